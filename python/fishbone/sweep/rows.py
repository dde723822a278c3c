"""The rows of a sweep: the figures of the result at a point."""

from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING, Any

from fishbone import _core
from fishbone.equilibrium import solve
from fishbone.errors import InvalidArgument, InvalidScenario
from fishbone.scenario import Scenario
from fishbone.sweep.extra import extra

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fishbone.sweep.points import Floats, Number

    Row = dict[str, Any]

POINT = "point"
"""The column of the number of a point."""
ORIGIN = b"fishbone.sweep.origin"
"""Name of the digest of a sweep in the metadata of a part."""
ALONG = frozenset(
    ("u", "position", "frame", "bend", "torsion", "rib_slope", "rib_angle", "curvature", "edges", "internal")
)
"""Fields of a result that have a value for every node."""
WORDS = frozenset(("status", "message", "warnings", "energy_model", "stable", "crosses_itself"))
"""Columns of a table whose values, where it has any, are no numbers."""
LEFT_OUT = frozenset(("schema", "scenario", "solve_time"))
"""Fields of a result that a row repeats or knows better, and the time, which differs from run to run."""
UNBENT = frozenset(("bend_radius.spine.value", "least_spine_radius.value")) | {
    f"bend_radius.area.{quantile}" for quantile in ("p999", "p99", "p95")
}
"""Radii that are infinite where nothing bends, and null in a result."""


def solve_part(  # noqa: PLR0913 - keywords all but four
    tables: dict[str, Any],
    numbers: dict[str, Number],
    first: int,
    values: Floats,
    *,
    shapes: bool,
    version: str,
    origin: str,
) -> tuple[int, bytes]:
    """Solves the points from number `first` on, one after the other; returns `first` and a Parquet file of their rows.

    `numbers` are the fields that are swept, `origin` is the digest of the sweep. A point starts from nothing that
    another one has found.

    Shapes: values (points, fields).
    Errors: `InvalidArgument` where the fishbone of this process is not of `version`, that of the sweep.
    """
    if version != _core.__version__:
        raise InvalidArgument(f"scheduler: found a worker with fishbone {_core.__version__}, allowed {version}")
    tables = copy.deepcopy(tables)
    rows = []
    for point, row in enumerate(values.tolist(), start=first):
        swept = dict(zip(numbers, row, strict=True))
        for field, value in swept.items():
            numbers[field].put(tables, value)
        # The place of a support, which a result repeats, may be swept.
        rows.append({POINT: point, **swept} | figures_of(tables, shapes=shapes) | swept)
    return first, _encode(rows, origin)


def figures_of(tables: dict[str, Any], *, shapes: bool) -> Row:
    """The figures of the result of a scenario; of an invalid one its status and message."""
    try:
        scenario = Scenario.from_dict(tables)
    except InvalidScenario as error:
        return {"status": "invalid", "message": str(error)}
    result = solve(scenario).to_dict()
    unwanted = LEFT_OUT if shapes else LEFT_OUT | ALONG
    figures = dict(flatten("", {name: value for name, value in result.items() if name not in unwanted}))
    if result["status"] == "converged":
        figures |= {name: math.inf for name in UNBENT & figures.keys() if figures[name] is None}
    return figures


def flatten(name: str, value: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - plain data
    """Plain data under dotted names.

    Tables give `name.field`, lists of tables `name[0].field`, and vectors of three numbers `name.x`, `name.y` and
    `name.z`. Other lists are kept whole; an empty list is None.
    """
    if isinstance(value, dict):
        for field, item in value.items():
            yield from flatten(f"{name}.{field}".lstrip("."), item)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for index, item in enumerate(value):
            yield from flatten(f"{name}[{index}]", item)
    elif _is_vector(value):
        for axis, item in zip("xyz", value, strict=True):
            yield f"{name}.{axis}", item
    else:
        yield name, None if value == [] else value


def _is_vector(value: Any) -> bool:  # noqa: ANN401 - plain data
    return (
        isinstance(value, list) and len(value) == len("xyz") and all(x is None or isinstance(x, float) for x in value)
    )


def _encode(rows: list[Row], origin: str) -> bytes:
    """Rows as a Parquet file: a column for every name in the order of its first row, null where a row has none."""
    arrow, parquet = extra("pyarrow"), extra("pyarrow.parquet")
    names = dict.fromkeys(name for row in rows for name in row)
    table = arrow.table({name: [row.get(name) for row in rows] for name in names}, metadata={ORIGIN: origin})
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink, write_page_checksum=True)
    content: bytes = sink.getvalue().to_pybytes()
    return content
