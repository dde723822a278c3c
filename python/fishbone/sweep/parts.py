"""The table of a sweep as a Parquet file, and its parts until it is finished."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from typing import IO, TYPE_CHECKING, Any

from fishbone.errors import FishboneError, InvalidArgument
from fishbone.files import DRAFTS, check_suffix, check_writable, is_file, whole, write_whole
from fishbone.sweep.extra import extra
from fishbone.sweep.lock import locked
from fishbone.sweep.rows import ORIGIN, POINT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

SUFFIX = ".parquet"
MANIFEST = "manifest.json"
LOCK = "lock"
FOLDER = ".parts"
"""What the name of the folder of the parts has beyond that of the table."""
LONGEST_NAME = 255
"""Greatest length of the name of a file on most systems [bytes]."""
KEY = b"fishbone.sweep"
"""Name of the manifest in the metadata of the table."""
GROUP = 64_000_000
"""Size of a row group of the table [bytes]: parts are collected in memory up to this size."""

Manifest = dict[str, Any]


class Parts:
    """The parts of a table, in a folder beside it, and the manifest of their sweep.

    The manifest is all that determines the rows: the scenario, the points and the version of fishbone. Each part has
    its digest as `origin`, so that no part of another sweep is taken for one of this.
    """

    def __init__(self, path: Path, manifest: Manifest, lengths: Mapping[int, int]) -> None:
        """`lengths` are the numbers of points of all parts by the number of their first point, in order.

        Errors: `InvalidArgument` where the table belongs to another sweep; `OSError`.
        """
        self._path = path
        self._folder = path.with_name(_folder_name(path.name))
        self._manifest = manifest
        self._text = json.dumps(manifest, indent=2, ensure_ascii=False).encode()
        self._lengths = lengths
        self.origin = hashlib.sha256(self._text).hexdigest()
        """The digest of the manifest, for `solve_part`."""
        if self.is_finished:
            _check(path, _manifest_of(path), manifest)

    @property
    def is_finished(self) -> bool:
        """Whether there is the whole table."""
        return self._path.exists()

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Makes the folder of the parts, and keeps other processes out of it, for the body.

        Errors: `InvalidArgument` where another process is at work in it, or it belongs to another sweep; `OSError`.
        """
        self._folder.mkdir(exist_ok=True)
        with locked(self._folder / LOCK) as is_free:
            if not is_free:
                raise InvalidArgument(f"{self._path}: found another sweep at work on it, allowed one at a time")
            self._claim()
            yield

    def missing(self) -> dict[int, int]:
        """The lengths of the parts that are still to be solved; a part that is not whole is none."""
        if self.is_finished:
            return {}
        return {first: length for first, length in self._lengths.items() if self._part(first) is None}

    def add(self, first: int, content: bytes) -> None:
        """Writes a part.

        Errors: `OSError`.
        """
        write_whole(self._file(first), content)

    def finish(self) -> None:
        """Writes the table, in the order of the points, unless there is one.

        Errors: `FishboneError` where a part has been lost meanwhile; `OSError`.
        """
        if self.is_finished:
            return
        arrow, parquet = extra("pyarrow"), extra("pyarrow.parquet")
        schema = _unified([part.schema for part in self._all()]).with_metadata({KEY: self._text})
        with whole(self._path) as draft, parquet.ParquetWriter(draft, schema, write_page_checksum=True) as writer:
            for tables in _groups(_complete(part, schema) for part in self._all()):
                writer.write_table(arrow.concat_tables(tables).combine_chunks())

    def clear(self) -> None:
        """Removes the parts, as far as that is allowed, and their folder, unless it has other files."""
        if not self._folder.is_dir():
            return
        with contextlib.suppress(OSError):
            for file in (*map(self._file, self._lengths), self._folder / MANIFEST, self._folder / LOCK):
                file.unlink(missing_ok=True)
            for draft in self._folder.glob(DRAFTS):
                shutil.rmtree(draft)
            self._folder.rmdir()

    def _claim(self) -> None:
        """Writes the manifest where there is none, but not beside parts of another sweep."""
        file = self._folder / MANIFEST
        found = _parsed(file.read_bytes()) if file.exists() else None
        if found is not None:
            _check(self._folder, found, self._manifest)
            return
        schemas = (read_parquet(part, extra("pyarrow.parquet").read_schema) for part in self._folder.glob(f"*{SUFFIX}"))
        if any(schema is not None and not self._is_origin_of(schema) for schema in schemas):
            raise InvalidArgument(
                f"{self._folder}: found parts of an unknown sweep, without {MANIFEST}, allowed those of this sweep: "
                "remove the folder, or take a new file"
            )
        write_whole(file, self._text)

    def _file(self, first: int) -> Path:
        return self._folder / f"{first:08d}{SUFFIX}"

    def _part(self, first: int) -> Any | None:  # noqa: ANN401 - a table of pyarrow
        """The part that begins with a point; None where there is none that is whole and of this sweep."""

        def read(file: IO[bytes]) -> Any | None:  # noqa: ANN401 - a table of pyarrow
            table = rows_in(file)
            points = list(range(first, first + self._lengths[first]))
            return table if self._is_origin_of(table.schema) and table[POINT].to_pylist() == points else None

        file = self._file(first)
        return read_parquet(file, read) if file.exists() else None

    def _all(self) -> Iterator[Any]:
        """All parts, in order."""
        for first in self._lengths:
            table = self._part(first)
            if table is None:
                raise FishboneError(f"{self._file(first)}: found no whole part any more; repeat the sweep to go on")
            yield table

    def _is_origin_of(self, schema: Any) -> bool:  # noqa: ANN401 - a schema of pyarrow
        return (schema.metadata or {}).get(ORIGIN) == self.origin.encode()


def check_table(path: Path) -> str | None:
    """The reason why there can be no table at a path, "found …, allowed …"; None where there is none.

    A file that exists is a finished table, or is refused, and need not be writable.
    """
    return check_suffix(path, (SUFFIX,)) if is_file(path) else check_writable(path, (SUFFIX,))


def _folder_name(name: str) -> str:
    """The name of the folder of the parts of a table; where it would be too long, with a digest of the table's."""
    if len(os.fsencode(name)) + len(FOLDER) <= LONGEST_NAME:
        return f"{name}{FOLDER}"
    encoded = os.fsencode(name)
    end = f".{hashlib.sha256(encoded).hexdigest()[:16]}{FOLDER}"
    return encoded[: LONGEST_NAME - len(end)].decode(errors="ignore") + end


def read_parquet(path: Path, read: Callable[[IO[bytes]], Any]) -> Any | None:  # noqa: ANN401 - of pyarrow
    """What `read` finds in a Parquet file; None of a file that it cannot read.

    Errors: `OSError` where the file cannot be opened.
    """
    with path.open("rb") as file:
        try:
            return read(file)
        except (extra("pyarrow").ArrowException, OSError, LookupError, ValueError):
            return None


def rows_in(file: IO[bytes], columns: list[str] | None = None) -> Any:  # noqa: ANN401 - a table of pyarrow
    """Columns of a Parquet file, or all, for `read_parquet`; content that is not as it was written cannot be read."""
    return extra("pyarrow.parquet").ParquetFile(file, page_checksum_verification=True).read(columns=columns)


def _manifest_of(path: Path) -> Manifest | None:
    """The manifest of a table; None of a file that is no table of a sweep."""
    schema = read_parquet(path, extra("pyarrow.parquet").read_schema)
    return None if schema is None else _parsed((schema.metadata or {}).get(KEY, b""))


def _parsed(text: bytes) -> Manifest | None:
    """A manifest; None of other text."""
    try:
        found = json.loads(text)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _check(path: Path, found: Manifest | None, manifest: Manifest) -> None:
    if found is None:
        raise InvalidArgument(f"{path}: found a file that is no table of a sweep, allowed a new file")
    for name, value in manifest.items():
        if found.get(name) != value:
            raise InvalidArgument(
                f"{path}: found a sweep that differs in its {name}, allowed the same sweep or a new file"
            )


def _unified(schemas: list[Any]) -> Any:  # noqa: ANN401 - a schema of pyarrow
    """The schema of all parts.

    A table of a result may be null as a whole, as the error of a failed solve is: such a name is no column where other
    rows have the table.
    """
    arrow = extra("pyarrow")
    schema = arrow.unify_schemas(schemas, promote_options="permissive")
    names = schema.names
    tables = {name for name in names if any(other.startswith((f"{name}.", f"{name}[")) for other in names)}
    return arrow.schema([field for field in schema if field.name not in tables])


def _complete(table: Any, schema: Any) -> Any:  # noqa: ANN401 - a table and a schema of pyarrow
    """A part with all columns of a schema, null where it has none."""
    arrow = extra("pyarrow")
    names = set(table.column_names)
    columns = [
        table[field.name].cast(field.type) if field.name in names else arrow.nulls(table.num_rows, field.type)
        for field in schema
    ]
    return arrow.table(columns, schema=schema)


def _groups(tables: Iterator[Any]) -> Iterator[list[Any]]:
    """Tables in lists of at least `GROUP` bytes, the last of what is left."""
    group: list[Any] = []
    size = 0
    for table in tables:
        group.append(table)
        size += table.nbytes
        if size >= GROUP:
            yield group
            group, size = [], 0
    if group:
        yield group
