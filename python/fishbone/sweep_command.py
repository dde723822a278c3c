"""The command `fishbone sweep`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click

import fishbone
from fishbone.command import PICTURE, Command, Input, Invalid, NoEquilibrium, Output
from fishbone.files import write_whole
from fishbone.progress import progress
from fishbone.sweep.limit import check_column, describe_yield, limit_of
from fishbone.sweep.parts import SUFFIX, check_table
from fishbone.sweep.rows import POINT, figures_of
from fishbone.terminal import write_out
from fishbone.text import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence
    from pathlib import Path

_PLUS_MINUS = re.compile(r"(?:±|\+-)\s*(.*)")


class Table(Output):
    """The table of a sweep, to write or finished."""

    def __init__(self) -> None:
        super().__init__(SUFFIX)

    def obstacle(self, path: Path) -> str | None:
        """The reason why there can be no table at a path; None where there is none."""
        return check_table(path)


@click.command(cls=Command)
@click.argument("file", type=Input())
@click.option(
    "--set",
    "ranges",
    multiple=True,
    metavar='"FIELD=START:STOP:N"',
    help='A number of the scenario and its values, N from START to STOP: "supports[1].position[2]=0.1:0.3:21". May be '
    "repeated: all combinations. With --sample FIELD=START:STOP.",
)
@click.option("--sample", type=int, metavar="N", help="Draw N points: a Latin hypercube of --set, and --tolerance.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the points drawn.")
@click.option(
    "--tolerance",
    "tolerances",
    multiple=True,
    metavar='"FIELD=±X"',
    help="A number of the scenario, drawn uniformly within X of its value; +-X too. With --sample. May be repeated.",
)
@click.option("-o", "--out", type=Table(), required=True, help="Write the table: .parquet.")
@click.option("--shapes", is_flag=True, help="Write the arrays along the belt too, as columns of lists.")
@click.option("--scheduler", metavar="ADDRESS", help="Solve on a Dask cluster: tcp://HOST:PORT of its scheduler.")
@click.option(
    "--figure",
    type=PICTURE,
    help="Draw the figures over one number, or a map over two: .png, .pdf or .svg.",
)
@click.option(
    "--limit",
    metavar='"FIELD>NUMBER"',
    help='Print the yield, the share of points within a limit to a column of numbers: "bend_radius.area.p99>0.002".',
)
def sweep(  # noqa: PLR0913 - one for each option
    file: Path,
    *,
    ranges: tuple[str, ...],
    sample: int | None,
    seed: int,
    tolerances: tuple[str, ...],
    out: Path,
    shapes: bool,
    scheduler: str | None,
    figure: Path | None,
    limit: str | None,
) -> None:
    """Solve a scenario with other numbers, into one table.

    FILE is .toml or .json. The points are a grid or a sample; each is a row of the table, whether it converges or not.
    An interrupted sweep goes on where it ended when the command is repeated.

    Exit code: 0 solved, 2 invalid input, 3 no point has converged.
    """
    spans = _fields("--set", ranges, _range)
    distances = _fields("--tolerance", tolerances, _tolerance)
    if figure is not None:
        # The import takes long, and reports a missing package before the solves.
        from fishbone import plot  # noqa: PLC0415
        from fishbone.sweep.picture import check_fields  # noqa: PLC0415

        check_fields(list(spans | distances))
    scenario = fishbone.load(file)
    if limit is not None:
        _check_limit(scenario, limit, spans | distances)
    with progress("sweeping") as state:
        found = fishbone.sweep(
            scenario,
            out,
            spans,
            sample=sample,
            seed=seed,
            tolerances=distances,
            shapes=shapes,
            scheduler=scheduler,
            progress=lambda solved, planned: state.show("sweeping", solved / planned),
        )
    if figure is not None:
        with progress("drawing"):
            write_whole(figure, plot.encode(found, figure.suffix, limit=limit))
    counts = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in found.statuses.items())
    write_out(f"{shown(str(out))}: {len(found)} points, {counts}; {found.solved} solved now\n")
    if limit is not None:
        write_out(f"{describe_yield(found.passes(limit), limit)}\n")
    if "converged" not in found.statuses:
        raise NoEquilibrium(f"{file}: found no point that converged; {out} has the message of each")


def _check_limit(scenario: fishbone.Scenario, limit: str, fields: Collection[str]) -> None:
    """Refuses a limit to a column that the table would not have, as far as the scenario's own result has all."""
    column = limit_of(scenario, limit).column
    with progress("solving"):
        figures = figures_of(scenario.to_dict(), shapes=False)
    if figures["status"] == "converged":
        check_column(column, [POINT, *figures, *fields])


def _fields(option: str, texts: Sequence[str], number: Callable[[str, str], Any]) -> dict[str, Any]:
    """Fields with what `number` makes of their texts, FIELD=TEXT each."""
    fields: dict[str, Any] = {}
    for text in texts:
        field, sign, value = (part.strip() for part in text.partition("="))
        if not (field and sign and value):
            raise Invalid(f"{option}: found {text!r}, allowed FIELD= and numbers, as in belt.width=0.05:0.15:11")
        if field in fields:
            raise Invalid(f"{option}: found {field} twice, allowed once")
        fields[field] = number(field, value)
    return fields


def _range(field: str, text: str) -> list[float]:
    """The numbers of start:stop:n or start:stop."""
    try:
        return [float(part) for part in text.split(":")]
    except ValueError:
        raise Invalid(
            f"--set: found {field}={text}, allowed numbers start:stop:n, or start:stop with --sample"
        ) from None


def _tolerance(field: str, text: str) -> float:
    """The number of ±x."""
    found = _PLUS_MINUS.fullmatch(text)
    try:
        return float(found[1] if found is not None else "")
    except ValueError:
        raise Invalid(f"--tolerance: found {field}={text}, allowed ± and a number, as in belt.width=±0.001") from None
