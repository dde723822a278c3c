"""Scenarios: what is to be solved."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fishbone import _core
from fishbone.errors import InvalidScenario

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    Table = Mapping[str, Any]

MAX_BYTES = 16_000_000
"""A scenario file larger than this is not one: refused unread."""

_PARSERS = {".toml": _core.Scenario.from_toml, ".json": _core.Scenario.from_json}


class Scenario:
    """A checked scenario: a belt, its supports, its loads.

    The keywords are the tables of a scenario file; the same tables as one dict go through `from_dict`. NumPy arrays and
    numbers are welcome anywhere a number or a list is.

    Errors: `InvalidScenario`, one line "field: found …, allowed …".
    """

    __slots__ = ("_inner",)
    _inner: _core.Scenario

    def __init__(  # noqa: PLR0913 - one keyword for each table of the file
        self,
        *,
        belt: Table,
        supports: Sequence[Table] = (),
        links: Sequence[Table] = (),
        loads: Table | None = None,
        solver: Table | None = None,
        name: str | None = None,
        energy: str | None = None,
    ) -> None:
        tables = {
            "name": name,
            "energy": energy,
            "belt": belt,
            "supports": list(supports),
            "links": list(links),
            "loads": loads,
            "solver": solver,
        }
        # What is left out is the core's to default.
        self._inner = _from_dict({key: value for key, value in tables.items() if value not in (None, [])})

    @classmethod
    def from_dict(cls, tables: Table) -> Scenario:
        """The scenario of a dict with the structure of a scenario file.

        Errors: `InvalidScenario`.
        """
        return cls._wrap(_from_dict(tables))

    @classmethod
    def _wrap(cls, core: _core.Scenario) -> Scenario:
        scenario = cls.__new__(cls)
        scenario._inner = core  # noqa: SLF001 - its own class
        return scenario

    def to_dict(self) -> dict[str, Any]:
        """The scenario, normalised, with the structure of a scenario file."""
        tables: dict[str, Any] = json.loads(self._inner.to_json())
        return tables

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        return self._inner.to_json() == other._inner.to_json()

    def __hash__(self) -> int:
        return hash(self._inner.to_json())

    def __reduce__(self) -> tuple[Any, ...]:
        return Scenario.from_dict, (self.to_dict(),)

    def __repr__(self) -> str:
        arguments = ", ".join(f"{key}={value!r}" for key, value in self.to_dict().items())
        return f"Scenario({arguments})"


def load(path: str | os.PathLike[str]) -> Scenario:
    """Reads a scenario file, TOML or JSON.

    Errors: `InvalidScenario`, one line that starts with the file.
    """
    path = Path(path)
    try:
        return Scenario._wrap(_parser(path)(_read(path)))  # noqa: SLF001 - its own module
    except (OSError, ValueError) as error:
        raise InvalidScenario(f"{path}: {_one_line(error)}") from None


def _parser(path: Path) -> Any:  # noqa: ANN401 - text to core scenario
    try:
        return _PARSERS[path.suffix.lower()]
    except KeyError:
        raise InvalidScenario(f"file name: found {path.suffix or 'no suffix'}, allowed .toml or .json") from None


def _read(path: Path) -> str:
    # A pipe would keep us waiting for whoever may never write into it.
    if path.exists() and not path.is_file():
        raise InvalidScenario("file: found a folder, pipe or device, allowed a file")
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise InvalidScenario(
            f"file size: found over {MAX_BYTES // 1_000_000} MB, allowed up to {MAX_BYTES // 1_000_000} MB"
        )
    if not content.strip():
        raise InvalidScenario("file: found nothing in it, allowed a scenario")
    return content.decode("utf-8-sig")


def _one_line(error: Exception) -> str:
    if isinstance(error, UnicodeDecodeError):
        return f"encoding: found a byte at {error.start} that is not UTF-8, allowed UTF-8"
    if isinstance(error, OSError):
        return f"file: found {(error.strerror or 'an error').lower()}, allowed a readable file"
    return " ".join(str(error).split())


def _from_dict(tables: Table) -> _core.Scenario:
    try:
        return _core.Scenario.from_json(_to_json(tables))
    except ValueError as error:
        raise InvalidScenario(_one_line(error)) from None


def _to_json(tables: Table) -> str:
    try:
        return json.dumps(_plain(tables, ""))
    except RecursionError:
        raise InvalidScenario("scenario: found tables nested too deep, allowed those of a scenario file") from None


def _plain(value: Any, field: str) -> Any:  # noqa: ANN401 - whatever a caller may bring
    """What JSON can hold, or a refusal that names the field, which json's own would not."""
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), field)
    if isinstance(value, Mapping):
        return {key: _plain(item, f"{field}.{key}".lstrip(".")) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{field}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidScenario(f"{field}: found {value}, allowed a finite number")
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise InvalidScenario(
        f"{field or 'scenario'}: found a {type(value).__name__}, allowed what a scenario file can hold"
    )
