"""The packages that sweeps need beyond those of fishbone, imported where they are used: their imports take long."""

from __future__ import annotations

import importlib
from typing import Any

from fishbone.errors import MissingPackage


def extra(module: str) -> Any:  # noqa: ANN401 - a module without types
    """A module of the extra `sweep`.

    Errors: `MissingPackage`.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingPackage(module.partition(".")[0], "sweep") from None
