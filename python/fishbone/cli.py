"""The command line."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

import fishbone
from fishbone import examples as shipped
from fishbone.command import PICTURE, Commands, Failure, Input, Interrupted, Invalid, NoEquilibrium, Output
from fishbone.errors import NoBranch
from fishbone.files import write_all
from fishbone.follow import out_of_reach
from fishbone.names import EnergyModel
from fishbone.progress import progress
from fishbone.sweep_command import sweep
from fishbone.terminal import settle, write_line, write_out
from fishbone.text import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rich.console import Group

    from fishbone.equilibrium import Equilibrium
    from fishbone.follow import Columns, Diagram
    from fishbone.names import Motion, Place

_WIDE = 160
"""Columns of tables where standard output is no terminal."""


@click.group(cls=Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(fishbone.__version__, prog_name="fishbone")
@click.pass_context
def command(context: click.Context) -> None:
    """Equilibrium shapes of thin belts."""
    if context.invoked_subcommand is None:
        write_out(f"{context.get_help()}\n")


command.add_command(sweep)


@command.command()
@click.argument("file", type=Input())
@click.option("--out", type=Output(".json"), help="Write the result: .json.")
@click.option(
    "--figure",
    type=PICTURE,
    help="Draw top, front and side view: .png, .pdf or .svg.",
)
@click.option(
    "--mesh",
    type=Output(".stl", ".ply", ".obj", ".glb"),
    help="Write the surface: .stl, .ply, .obj or .glb.",
)
@click.option("--energy", type=click.Choice(get_args(EnergyModel)), help="The elastic energy, in place of the file's.")
@click.option(
    "--all",
    "is_all",
    is_flag=True,
    help="Search for all equilibria, saddles included, not for one minimum; with the energy shell for minima alone.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON instead of a table.")
def solve(  # noqa: PLR0913 - one for each option
    file: Path,
    *,
    out: Path | None,
    figure: Path | None,
    mesh: Path | None,
    energy: EnergyModel | None,
    is_all: bool,
    as_json: bool,
) -> None:
    """Solve a scenario.

    FILE is .toml or .json; the result is printed as a table. With --all the table has a row for each equilibrium, the
    result is a list of equilibria, and the figure shows them side by side. With the energy shell these are the minima
    next to those of wunderlich, without saddles.

    Exit code: 0 converged, 2 invalid input, 3 infeasible or not converged.
    """
    if is_all and mesh is not None:
        raise Invalid("--mesh: found with --all, allowed without it: a mesh is that of one shape")
    pictures = _pictures(figure, mesh)
    scenario = fishbone.load(file)
    if energy is not None:
        scenario = fishbone.Scenario.from_dict(scenario.to_dict() | {"energy": energy})
    found = _all(scenario) if is_all else [_solved(scenario)]
    converged = [equilibrium for equilibrium in found if equilibrium.status == "converged"]
    # All contents are made before a file is written, so that a failure leaves no file behind.
    contents = {}
    with progress("writing"):
        text = _encode_found(found, is_all=is_all) if as_json or out is not None else ""
        if out is not None:
            contents[out] = text.encode()
        if converged:
            subject = converged if is_all else converged[0]
            contents |= {path: encode_picture(subject, path.suffix) for path, encode_picture in pictures}
        write_all(contents)
    if as_json:
        write_out(text)
    if not converged:
        raise NoEquilibrium(f"{file}: {_reason(found[0])}")
    if not as_json:
        _print(converged, is_all=is_all)
    _warn(file, converged)


def _solved(scenario: fishbone.Scenario) -> Equilibrium:
    with progress("solving"):
        return fishbone.solve(scenario)


def _all(scenario: fishbone.Scenario) -> list[Equilibrium]:
    with progress("searching") as state:
        # What has been found leads to further starts: no share of the whole is known.
        return fishbone.branches(
            scenario, progress=lambda done, planned: state.show(f"searching, {done} of {planned} starts so far")
        )


def _pictures(figure: Path | None, mesh: Path | None) -> list[tuple[Path, Callable[[Any, str], bytes]]]:
    """The files to draw, with their encoders; called before the solve, so that a missing package is reported then."""
    pictures: list[tuple[Path, Callable[[Any, str], bytes]]] = []
    # These imports take long, and are needed for pictures only.
    if figure is not None:
        from fishbone import plot  # noqa: PLC0415

        pictures.append((figure, plot.encode))
    if mesh is not None:
        from fishbone import export  # noqa: PLC0415

        pictures.append((mesh, export.encode))
    return pictures


def encode(result: dict[str, Any]) -> str:
    """A result as JSON, one line for each field, so that results can be read and compared line by line."""
    fields = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in result.items())
    return "{\n" + ",\n".join(fields) + "\n}\n"


def encode_list(results: Iterable[dict[str, Any]]) -> str:
    """Results as one JSON array."""
    return "[\n" + ",\n".join(encode(result).rstrip() for result in results) + "\n]\n"


def _encode_found(found: list[Equilibrium], *, is_all: bool) -> str:
    results = [equilibrium.to_dict() for equilibrium in found]
    return encode_list(results) if is_all else encode(results[0])


def _reason(equilibrium: Equilibrium) -> str:
    """The status and the message of a failed solve in one line."""
    return f"{equilibrium.status.replace('_', ' ')}: {' '.join(equilibrium.message.split())}"


def _print(equilibria: list[Equilibrium], *, is_all: bool) -> None:
    from fishbone.report import report, report_all  # noqa: PLC0415

    _show(report_all(equilibria) if is_all else report(equilibria[0]))


def _show(tables: Group) -> None:
    """Prints tables, of a fixed width where standard output is no terminal."""
    from rich.console import Console  # noqa: PLC0415

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=_WIDE)
    # rich would end the program at a broken pipe, and at a character that the encoding lacks, in its own way.
    with console.capture() as text:
        console.print(tables)
    write_out(text.get())


def _warn(file: Path, equilibria: list[Equilibrium]) -> None:
    """Prints warnings, each once.

    Of several equilibria the saddles and those that cross themselves are left out: the table marks them.
    """
    is_sound = [one.stable is not False and one.crosses_itself is None for one in equilibria]
    shown = equilibria if len(equilibria) == 1 else list(compress(equilibria, is_sound))
    for warning in dict.fromkeys(warning for equilibrium in shown for warning in equilibrium.warnings):
        write_line(f"{file}: warning: {warning}")


@command.command()
@click.argument("file", type=Input())
@click.option(
    "--to",
    "numbers",
    multiple=True,
    metavar="FIELD=VALUE",
    help='A number of the scenario and its last value, "supports[1].position[2]=0.4", or a list of numbers, '
    '"supports[1].position=[0, 0.7, 0.4]". May be repeated: all change together.',
)
@click.option(
    "--pose",
    "poses",
    multiple=True,
    metavar='"X Y Z RX RY RZ"',
    help="A pose of the support: position and rotation vector. May be repeated: one pose after the other.",
)
@click.option("--support", metavar="PLACE", help='The support of --pose: "start", "end", index or arc length.  [end]')
@click.option("--screw", is_flag=True, help="Move the support from pose to pose along a screw, not straight.")
@click.option("--step", type=float, default=0.05, show_default=True, help="Greatest step length along a branch.")
@click.option("--states", type=int, default=1000, show_default=True, help="Greatest number of states of a branch.")
@click.option("--branches", type=int, default=10, show_default=True, help="Greatest number of branches.")
@click.option("--snaps", is_flag=True, help="Lead the belt along its minima, from snap to snap.")
@click.option("--out", type=Output(".json"), help="Write all states: .json.")
@click.option("--table", type=Output(".csv"), help="Write a report on all states: .csv.")
@click.option(
    "--figure",
    type=PICTURE,
    help="Draw energy, height and force along the path: .png, .pdf or .svg.",
)
@click.option(
    "--radius-limit",
    type=float,
    metavar="R",
    help="Say where the bend on the spine is tighter than this radius, and draw a line into --figure.",
)
@click.option("--json", "as_json", is_flag=True, help="Print all states as JSON instead of tables.")
def follow(  # noqa: PLR0913 - one for each option
    file: Path,
    *,
    numbers: tuple[str, ...],
    poses: tuple[str, ...],
    support: str | None,
    screw: bool,
    step: float,
    states: int,
    branches: int,
    snaps: bool,
    out: Path | None,
    table: Path | None,
    figure: Path | None,
    radius_limit: float | None,
    as_json: bool,
) -> None:
    """Follow an equilibrium along a path.

    FILE is .toml or .json. The path changes numbers of the scenario (--to), or leads a support through poses (--pose).
    Branches are followed through folds and instabilities; tables of branches and events are printed.

    Exit code: 0 followed, 2 invalid input, 3 no equilibrium to begin with, or the path is not followed to its end.
    """
    path = _path_of(numbers, poses, support, screw=screw)
    if radius_limit is not None and not 0.0 < radius_limit < math.inf:
        raise Invalid(f"--radius-limit: found {radius_limit:g}, allowed a positive finite number")
    pictures = _pictures(figure, None)
    scenario = fishbone.load(file)
    _warn_of_degrees(file, path)
    diagram = _followed(file, scenario, path, {"step": step, "states": states, "branches": branches, "snaps": snaps})
    # All contents are made before a file is written, so that a failure leaves no file behind.
    contents = {}
    with progress("writing"):
        text = encode(diagram.to_dict()) if as_json or out is not None else ""
        if out is not None:
            contents[out] = text.encode()
        if table is not None:
            contents[table] = encode_table(diagram.table())
        limit = {} if radius_limit is None else {"radius_limit": radius_limit}
        contents |= {path: encode_picture(diagram, path.suffix, **limit) for path, encode_picture in pictures}
        write_all(contents)
    if as_json:
        write_out(text)
    else:
        _print_diagram(diagram)
    _warn_of_coarse_mesh(file, diagram)
    if radius_limit is not None:
        _compare_radius(file, diagram, radius_limit)
    if not diagram.is_complete:
        raise NoEquilibrium(f"{file}: {_shortfall(diagram)}")


def _followed(
    file: Path, scenario: fishbone.Scenario, path: dict[str, Any] | fishbone.Poses, settings: dict[str, Any]
) -> Diagram:
    """The diagram of a path, with the quantities of its states."""
    try:
        with progress("solving") as state:
            # Of numbers, an invalid path is refused before a long solve.
            start = fishbone.solve(scenario) if isinstance(path, fishbone.Poses) else scenario
            obstacle = out_of_reach(start, path)
            if obstacle is not None:
                raise NoEquilibrium(f"{file}: infeasible: {obstacle}")

            def show(branch: int, share: float) -> None:
                state.show(f"following branch {branch}", share)

            diagram = fishbone.follow(start, path, **settings, progress=show)
    except NoBranch as error:
        raise NoEquilibrium(f"{file}: {' '.join(str(error).split())}") from error
    with progress("reporting") as state:
        for index, branch in enumerate(diagram.branches):
            state.show("reporting", index / len(diagram.branches))
            # The branch computes and keeps its quantities at the first access.
            _ = branch.energy
    return diagram


def _warn_of_degrees(file: Path, path: dict[str, Any] | fishbone.Poses) -> None:
    """Prints that a path turns a support by more than a turn, as one in degrees would, if it does."""
    if isinstance(path, fishbone.Poses):
        turns = [rotation for _, rotation in path.poses]
    else:
        turns = [value for field, value in path.items() if ".rotation" in field or ".euler" in field]
    largest = max((math.hypot(*(turn if isinstance(turn, list) else [turn])) for turn in turns), default=0.0)
    if largest > math.tau * (1.0 + 1e-9):
        write_line(
            f"{file}: warning: the path turns a support to {largest:g} rad, which is more than a turn: "
            "angles are in radians"
        )


def _warn_of_coarse_mesh(file: Path, diagram: Diagram) -> None:
    """Prints where the mesh makes a large error on a path, if anywhere."""
    from fishbone.report import coarse_mesh  # noqa: PLC0415

    warning = coarse_mesh(diagram)
    if warning is not None:
        write_line(f"{file}: {warning}")


def _compare_radius(file: Path, diagram: Diagram, limit: float) -> None:
    """Prints where the belt is bent to less than a radius on its spine, or that it is nowhere."""
    from fishbone.report import below_limit  # noqa: PLC0415

    write_line(f"{file}: {below_limit(diagram, limit)}")


def _shortfall(diagram: Diagram) -> str:
    """Where and why a path is not followed to its end."""
    from fishbone.report import shortfall  # noqa: PLC0415

    return shortfall(diagram)


def _path_of(
    numbers: tuple[str, ...], poses: tuple[str, ...], support: str | None, *, screw: bool
) -> dict[str, Any] | fishbone.Poses:
    if bool(numbers) == bool(poses):
        found = "--to and --pose" if numbers else "neither --to nor --pose"
        raise Invalid(f"path: found {found}, allowed one of them")
    if poses:
        motion: Motion = "screw" if screw else "straight"
        return fishbone.Poses([_pose(pose) for pose in poses], _place(support or "end"), motion)
    if screw or support is not None:
        raise Invalid("path: found --support or --screw with --to, allowed with --pose")
    path: dict[str, Any] = {}
    for number in numbers:
        field, sign, value = (part.strip() for part in number.partition("="))
        if not (field and sign):
            raise Invalid(f"--to: found {number!r}, allowed FIELD=VALUE, as in supports[1].position[2]=0.4")
        if field in path:
            raise Invalid(f"--to: found {field} twice, allowed once")
        # The core takes UTF-8 alone.
        path[shown(field)] = _value(field, value)
    return path


def _value(field: str, text: str) -> float | list[float]:
    is_list = text.startswith("[") and text.endswith("]")
    try:
        numbers = [float(part) for part in (text[1:-1] if is_list else text).split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 1 or (is_list and numbers):
        return numbers if is_list else numbers[0]
    raise Invalid(f"{field}: found {text!r}, allowed a number or a list such as [0, 0.7, 0.4]")


def _pose(text: str) -> tuple[list[float], list[float]]:
    try:
        x, y, z, rx, ry, rz = map(float, text.replace(",", " ").split())
    except ValueError:
        raise Invalid(f"--pose: found {text!r}, allowed six numbers: position and rotation vector") from None
    return [x, y, z], [rx, ry, rz]


def _place(text: str) -> Place:
    """A support as the package names it: an end, an index, an arc length."""
    ends: dict[str, Place] = {"start": "start", "end": "end"}
    if text in ends:
        return ends[text]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    raise Invalid(f'--support: found {text!r}, allowed "start", "end", an index or an arc length')


def encode_table(columns: Columns) -> bytes:
    """Columns as CSV, with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return text.getvalue().encode()


def _print_diagram(diagram: Diagram) -> None:
    from fishbone.report import report_diagram  # noqa: PLC0415

    _show(report_diagram(diagram))


@command.command()
@click.argument("name", required=False)
@click.option("--force", is_flag=True, help="Overwrite NAME.toml where it exists.")
def examples(name: str | None, *, force: bool) -> None:
    """List the shipped scenarios, or copy one.

    With NAME, that scenario is written to ./NAME.toml.
    """
    if name is None:
        _list_examples()
        return
    content = shipped.text(name)
    path = Path(f"{name}.toml")
    if path.exists() and not force:
        raise Invalid(f"{path}: found it here already, allowed to be overwritten with --force")
    write_all({path: content.encode()})
    write_out(f"{path} written; next: fishbone solve {path}\n")


def _list_examples() -> None:
    names = shipped.names()
    width = max(map(len, names), default=0)
    for name in names:
        write_out(f"{name:<{width}}  {shipped.summary(name)}".rstrip() + "\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns the exit code; never a traceback."""
    try:
        return _run(arguments)
    finally:
        settle()


def _run(arguments: Sequence[str] | None) -> int:
    try:
        code = command.main(arguments, "fishbone", standalone_mode=False)
    except click.ClickException as error:
        return _fail(error.exit_code, error.format_message())
    except (click.Abort, KeyboardInterrupt):
        return _fail(Interrupted.exit_code, "interrupted")
    except SystemExit:
        raise
    except BaseException as error:  # a panic of the core is not an Exception
        return _fail(Failure.exit_code, f"internal error, please report it: {type(error).__name__}: {error}")
    return code if isinstance(code, int) else 0


def _fail(exit_code: int, message: str) -> int:
    write_line(message)
    return exit_code
