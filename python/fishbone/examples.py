"""The scenarios that come with the package."""

from __future__ import annotations

from importlib import resources
from itertools import takewhile
from typing import TYPE_CHECKING

from fishbone.errors import InvalidArgument

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable


def names() -> list[str]:
    """Names of the scenarios, sorted."""
    files = (entry.name for entry in _folder().iterdir())
    return sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml"))


def text(name: str) -> str:
    """The content of a shipped scenario file.

    Errors: `InvalidArgument` where no scenario has this name.
    """
    if name not in names():
        raise InvalidArgument(f"example: found {name!r}, allowed {', '.join(names())}")
    return (_folder() / f"{name}.toml").read_text("utf-8")


def summary(name: str) -> str:
    """The first sentence of the comment at the start of a scenario file."""
    comment = takewhile(lambda line: line.startswith("#"), text(name).splitlines())
    sentence, stop, _ = " ".join(line.lstrip("# ") for line in comment).partition(". ")
    return sentence + stop.rstrip()


def _folder() -> Traversable:
    return resources.files("fishbone") / "scenarios"
