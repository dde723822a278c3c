"""Sweeps: the results of a scenario with other numbers, as one table; needs `pip install "fishbone[sweep]"`."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fishbone import _core
from fishbone.errors import InvalidArgument
from fishbone.sweep.extra import extra
from fishbone.sweep.limit import check_column, limit_of, numbers_in
from fishbone.sweep.parts import Parts, check_table, read_parquet, rows_in
from fishbone.sweep.points import Grid, number_of, points_of
from fishbone.sweep.rows import solve_part
from fishbone.sweep.workers import results

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from fishbone.scenario import Scenario
    from fishbone.sweep.points import Points

SCHEMA = "fishbone.sweep/1"
PARTS = 64
"""Greatest number of parts of a sweep of few points: enough for all cores to have work to the end."""
LARGEST_PART = 256
"""Greatest number of points of a part: a sweep of more points has more parts."""


class Sweep:
    """The table of a sweep, in a Parquet file: a row for each point, in the order of their numbers.

    Units: those of the scenario.
    """

    def __init__(self, path: Path, scenario: Scenario, points: Points, solved: int) -> None:
        self.path = path
        """The file."""
        self.scenario = scenario
        """The scenario whose numbers are swept."""
        self.fields = points.fields
        """The fields that are swept, each a column of the same name."""
        self.is_grid = isinstance(points, Grid)
        """Whether the points are a grid, not a sample."""
        self.counts: tuple[int, ...] = points.counts
        """Number of values of each field of a grid; of a sample its number of points alone."""
        self.solved = solved
        """Number of points that `sweep` has solved for it; the others were in the file or in its parts."""
        self.names: tuple[str, ...] = tuple(extra("pyarrow.parquet").read_schema(path).names)
        """The names of all columns."""
        self.statuses: dict[str, int] = dict(Counter(self.column("status").tolist()))
        """Number of points of each status: "converged", "infeasible", "not_converged", "invalid"."""

    def __len__(self) -> int:
        return sum(self.statuses.values())

    def column(self, name: str) -> NDArray[Any]:
        """A column. Where a row has no number it is NaN in a column of numbers, else None.

        Shapes: (points,).
        Errors: `InvalidArgument` where there is no such column, and where the table cannot be read.
        """
        check_column(name, self.names)
        table = read_parquet(self.path, lambda file: rows_in(file, [name]))
        if table is None:
            raise InvalidArgument(f"{self.path}: found a table that is not whole, allowed a new file")
        values: NDArray[Any] = table[name].to_numpy()
        return values

    def passes(self, limit: str) -> NDArray[np.bool_]:
        """Whether each point has converged to an equilibrium within a limit; the mean of these is the yield.

        A limit is a column, `<` or `>`, and a number: "bend_radius.area.p99 > 0.002". It may have a unit, such as
        "2 mm", where the scenario is known to be in SI units: it gives a material.

        Shapes: (points,).
        Errors: `InvalidArgument` where the limit is none, or its column has no numbers.
        """
        checked = limit_of(self.scenario, limit)
        if "converged" not in self.statuses:  # there may be no figures at all
            return np.zeros(len(self), dtype=np.bool_)
        figures = numbers_in(checked.column, self.column(checked.column))
        passing: NDArray[np.bool_] = checked.passes(figures) & (self.column("status") == "converged")
        return passing

    def __repr__(self) -> str:
        return f"<Sweep: {len(self)} points over {', '.join(self.fields)}, {self.path}>"


def sweep(  # noqa: PLR0913 - keywords all but three
    scenario: Scenario,
    path: str | os.PathLike[str],
    ranges: Mapping[str, Sequence[float]],
    *,
    sample: int | None = None,
    seed: int = 0,
    tolerances: Mapping[str, float] | None = None,
    shapes: bool = False,
    scheduler: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Sweep:
    """Solves a scenario with other numbers, on all cores or on a Dask cluster, into one table.

    `ranges` names fields as `follow` does, with (first number, last number, count): `{"belt.width": (0.05, 0.15, 11)}`.
    The points are all combinations. With `sample`, a number of points, a range is (first number, last number), and the
    points are a Latin hypercube; `tolerances` are then further fields, each with the greatest distance from its number
    in the scenario, around which it is drawn uniformly and independently. `seed` determines what is drawn.

    The table is the Parquet file `path`. Its columns are the point's number, the fields, and the figures of
    `Equilibrium.to_dict` under dotted names, without `solve_time`; with `shapes` also the arrays along the belt, as
    lists. A point at which the scenario is invalid has the status "invalid" and the error as its message.

    Every point is solved by itself, as `solve` does, so that a row depends on nothing but its point. Until the table is
    finished its parts are in the folder `path.parts`. A call with the same arguments goes on from there, or solves
    nothing where the table is finished. Parts that are not whole are solved again.

    Processes are started for the cores of this machine, unless `scheduler` is the address of a Dask scheduler, such as
    "tcp://host:8786". As always with processes, a script calls this under `if __name__ == "__main__":`.
    `progress(solved, all)` is called from the calling thread, for the points that are solved by this call.

    Errors: `NoPath` where the scenario has no such number; `InvalidArgument` for other invalid arguments, where `path`
    holds another sweep, and where another process is at work on it; `MissingPackage`; `FishboneError` where the workers
    are lost, or a part; `OSError`; any error that `progress` raises.
    """
    target = Path(path)
    obstacle = check_table(target)
    if obstacle is not None:
        raise InvalidArgument(f"{target}: {obstacle}")
    points = points_of(scenario, ranges, tolerances or {}, sample, seed)
    tables = scenario.to_dict()
    size = min(LARGEST_PART, math.ceil(points.total / PARTS))
    lengths = {first: min(size, points.total - first) for first in range(0, points.total, size)}
    parts = Parts(target, _manifest(tables, points, shapes=shapes), lengths)
    numbers = {field: number_of(scenario, field) for field in points.fields}
    common = {"shapes": shapes, "version": _core.__version__, "origin": parts.origin}
    solved = 0
    if not parts.is_finished:
        with parts.held():
            missing = parts.missing()
            tasks = ((tables, numbers, first, points.values(first, first + size)) for first in missing)
            with contextlib.closing(results(scheduler, solve_part, tasks, len(missing), common)) as found:
                for first, content in found:
                    parts.add(first, content)
                    solved += missing[first]
                    if progress is not None:
                        progress(solved, sum(missing.values()))
            parts.finish()
    parts.clear()
    return Sweep(target, scenario, points, solved)


def _manifest(tables: dict[str, Any], points: Points, *, shapes: bool) -> dict[str, Any]:
    """All that determines the rows of a table."""
    return {
        "schema": SCHEMA,
        "version": _core.__version__,
        "scenario": tables,
        "points": points.design,
        "shapes": shapes,
    }
