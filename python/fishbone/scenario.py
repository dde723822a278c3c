"""Scenarios: the input of a solve."""

from __future__ import annotations

import json
import math
import sys
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
"""Largest scenario file [bytes]: a larger file is refused unread."""

_PARSERS = {".toml": _core.Scenario.from_toml, ".json": _core.Scenario.from_json}


class Scenario:
    """A checked scenario: a belt, its supports, its loads.

    The keywords are the tables of a scenario file; `from_dict` takes the same tables as one dict. NumPy numbers and
    arrays may stand for numbers and lists.

    Errors: `InvalidScenario`, one line that names the field, the value found and the values allowed.
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
        # The core has the defaults of the tables left out.
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
        return _restored, (self.to_dict(), _core.__version__)

    def __repr__(self) -> str:
        arguments = ", ".join(f"{key}={value!r}" for key, value in self.to_dict().items())
        return f"Scenario({arguments})"


def _restored(tables: Table, version: str) -> Scenario:
    """The scenario that a version has pickled.

    Errors: `InvalidScenario`, which names the version where it is another.
    """
    try:
        return Scenario.from_dict(tables)
    except InvalidScenario as error:
        if version != _core.__version__:
            error.args = (f"pickled by version {version} of fishbone: {error}",)
        raise


def load(path: str | os.PathLike[str]) -> Scenario:
    """Reads a scenario file, TOML or JSON.

    Errors: `InvalidScenario`, one line that starts with the file.
    """
    path = Path(path)
    parse = _PARSERS.get(path.suffix.lower())
    if parse is None:
        raise _invalid("file name", path.suffix or "no suffix", ".toml or .json", path)
    return Scenario._wrap(parse(_read(path), str(path)))  # noqa: SLF001 - its own module


def _read(path: Path) -> str:
    try:
        # Reading a pipe could block for ever.
        is_other = path.exists() and not path.is_file()
        content = b"" if is_other else _content(path)
    except OSError as error:
        raise _invalid("file", (error.strerror or "an error").lower(), "a readable file", path) from None
    except ValueError:
        raise _invalid("file", "a name that no file can have", "a readable file", path) from None
    if is_other:
        raise _invalid("file", "a folder, pipe or device", "a file", path)
    if len(content) > MAX_BYTES:
        most = f"{MAX_BYTES // 1_000_000} MB"
        raise _invalid("file size", f"over {most}", f"up to {most}", path)
    if not content.strip():
        raise _invalid("file", "nothing in it", "a scenario", path)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _invalid("encoding", f"a byte at {error.start} that is not UTF-8", "UTF-8", path) from None


def _content(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(MAX_BYTES + 1)


def _invalid(field: str, found: str, allowed: str, file: Path | None = None) -> InvalidScenario:
    """The error of a scenario that does not reach the core, in the form of the core's errors."""
    text = " ".join(f"{field}: found {found}, allowed {allowed}".split())
    error = InvalidScenario(text if file is None else f"{file}: {text}")
    error.reason = "invalid"
    error.field, error.found, error.allowed = field, found, allowed
    error.file = None if file is None else str(file)
    return error


def _from_dict(tables: Table) -> _core.Scenario:
    return _core.Scenario.from_json(_to_json(tables))


def _to_json(tables: Table) -> str:
    try:
        return json.dumps(_plain(tables, ""))
    except RecursionError:
        raise _invalid("scenario", "tables nested too deep", "those of a scenario file") from None


def _plain(value: Any, field: str) -> Any:  # noqa: ANN401 - whatever a caller may bring
    """The value in types of JSON; unlike the errors of json, the error names the field."""
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), field)
    if isinstance(value, Mapping):
        return {key: _plain(item, f"{field}.{key}".lstrip(".")) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{field}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise _invalid(field, str(value), "a finite number")
    if isinstance(value, int) and value.bit_length() > sys.float_info.max_exp:
        raise _invalid(field, "an integer larger than all finite numbers", "a finite number")
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise _invalid(field or "scenario", f"a {type(value).__name__}", "what a scenario file can hold")
