"""The table of a sweep as a Parquet file, and its parts until it is finished."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any

from fishbone.errors import InvalidArgument
from fishbone.files import whole, write_whole
from fishbone.sweep.extra import extra

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MANIFEST = "manifest.json"
KEY = b"fishbone.sweep"
"""Name of the manifest in the metadata of the table."""
GROUP = 64_000_000
"""Size of a row group of the table [bytes]: parts are collected in memory up to this size."""

Manifest = dict[str, Any]


class Parts:
    """The parts of a table, in a folder beside it, and the manifest of their sweep.

    The manifest is all that determines the rows: the scenario, the points and the version of fishbone.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        """Errors: `InvalidArgument` where the table or its parts belong to another sweep; `OSError`."""
        self._path = path
        self._folder = path.with_name(f"{path.name}.parts")
        self._manifest = json.dumps(manifest, indent=2, ensure_ascii=False)
        self.is_finished = path.exists()
        """Whether there is the whole table."""
        if self.is_finished:
            _check(path, _manifest_of(path), manifest)
            return
        self._folder.mkdir(exist_ok=True)
        file = self._folder / MANIFEST
        if file.exists():
            _check(self._folder, json.loads(file.read_text("utf-8")), manifest)
        else:
            write_whole(file, self._manifest.encode())

    def has(self, first: int) -> bool:
        """Whether there is the part that begins with point number `first`."""
        return self._file(first).exists()

    def add(self, first: int, content: bytes) -> None:
        """Writes a part.

        Errors: `OSError`.
        """
        write_whole(self._file(first), content)

    def finish(self) -> None:
        """Writes the table, in the order of the points, and removes the parts.

        Errors: `OSError`.
        """
        if not self.is_finished:
            self._merge()
            self.is_finished = True
        shutil.rmtree(self._folder, ignore_errors=True)

    def _file(self, first: int) -> Path:
        return self._folder / f"{first:08d}.parquet"

    def _merge(self) -> None:
        arrow, parquet = extra("pyarrow"), extra("pyarrow.parquet")
        files = sorted(self._folder.glob("*.parquet"))
        schema = _unified([parquet.read_schema(file) for file in files])
        schema = schema.with_metadata({KEY: self._manifest.encode()})
        with whole(self._path) as draft, parquet.ParquetWriter(draft, schema) as writer:
            for tables in _groups(_complete(parquet.ParquetFile(file).read(), schema) for file in files):
                writer.write_table(arrow.concat_tables(tables).combine_chunks())


def _manifest_of(path: Path) -> Manifest | None:
    """The manifest of a table; None of a file that is no table of a sweep."""
    arrow, parquet = extra("pyarrow"), extra("pyarrow.parquet")
    try:
        text = (parquet.read_schema(path).metadata or {}).get(KEY)
    except arrow.ArrowInvalid:
        return None
    manifest: Manifest | None = None if text is None else json.loads(text)
    return manifest


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
