"""The command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import fishbone
from fishbone import examples as shipped
from fishbone.errors import FishboneError
from fishbone.files import check_writable, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fishbone.equilibrium import Equilibrium


class Failure(click.ClickException):
    """An end other than success: one line, and an exit code by its class."""

    exit_code = 1


class Invalid(Failure):
    """The input, the use of the command line, or the place to write to is not valid."""

    exit_code = 2


class NoEquilibrium(Failure):
    """The solve ended without an equilibrium."""

    exit_code = 3


class Interrupted(Failure):
    """Ctrl-C; the exit code is the shell's own for it."""

    exit_code = 130


def _output(*suffixes: str) -> Callable[[click.Context, click.Parameter, Path | None], Path | None]:
    """A check of a file to write, so that it is refused before the solve rather than after it."""

    def check(ctx: click.Context, param: click.Parameter, path: Path | None) -> Path | None:
        obstacle = None if path is None else check_writable(path, suffixes)
        if obstacle is not None:
            raise click.BadParameter(f"{path}: {obstacle}", ctx, param)
        return path

    return check


_PATH = click.Path(path_type=Path)


class Commands(click.Group):
    """Turns every end of a command into an exit code and one line."""

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - as in click
        """Runs the command."""
        try:
            return super().invoke(ctx)
        except FishboneError as error:
            raise Invalid(str(error)) from error
        except KeyboardInterrupt:
            raise Interrupted("interrupted") from None


@click.group(cls=Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(fishbone.__version__, prog_name="fishbone")
@click.pass_context
def command(context: click.Context) -> None:
    """Equilibrium shapes of thin, inextensible belts."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@command.command()
@click.argument("file", type=_PATH)
@click.option("--out", type=_PATH, callback=_output(".json"), help="Write the result: .json.")
@click.option(
    "--figure",
    type=_PATH,
    callback=_output(".png", ".pdf", ".svg"),
    help="Draw top, front and side view: .png, .pdf or .svg.",
)
@click.option(
    "--mesh",
    type=_PATH,
    callback=_output(".stl", ".ply", ".obj", ".glb"),
    help="Write the surface: .stl, .ply, .obj or .glb.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON instead of a table.")
def solve(file: Path, *, out: Path | None, figure: Path | None, mesh: Path | None, as_json: bool) -> None:
    """Solve a scenario.

    FILE is .toml or .json; what came out is printed as a table.

    Exit code: 0 converged, 2 invalid input, 3 infeasible or not converged.
    """
    pictures = _pictures(figure, mesh)
    if out is not None and out.resolve() == file.resolve():
        raise Invalid(f"{out}: found the scenario itself, allowed another file")
    equilibrium = fishbone.solve(fishbone.load(file))
    # All is made before anything is written, so that a failure leaves nothing behind.
    contents = {}
    if out is not None:
        contents[out] = encode(equilibrium.to_dict()).encode()
    if equilibrium.status == "converged":
        contents |= {path: encode_picture(equilibrium, path.suffix) for path, encode_picture in pictures}
    for path, content in contents.items():
        _write(path, content)
    _print(equilibrium, file, as_json=as_json)


def _pictures(figure: Path | None, mesh: Path | None) -> list[tuple[Path, Callable[[Equilibrium, str], bytes]]]:
    """What is to be drawn, and how; asked before the solve, so that a package that is missing is missed then."""
    pictures: list[tuple[Path, Callable[[Equilibrium, str], bytes]]] = []
    # Whoever wants no picture does not wait for these imports.
    if figure is not None:
        from fishbone import plot  # noqa: PLC0415

        pictures.append((figure, plot.encode))
    if mesh is not None:
        from fishbone import export  # noqa: PLC0415

        pictures.append((mesh, export.encode))
    return pictures


def encode(result: dict[str, Any]) -> str:
    """A result as JSON, one line for each field: short to read, quick to compare."""
    fields = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in result.items())
    return "{\n" + ",\n".join(fields) + "\n}\n"


def _write(path: Path, content: bytes) -> None:
    try:
        write_whole(path, content)
    except OSError as error:
        raise Invalid(f"{path}: not written: {error.strerror}") from error


def _print(equilibrium: Equilibrium, file: Path, *, as_json: bool) -> None:
    if as_json:
        click.echo(encode(equilibrium.to_dict()), nl=False)
    if equilibrium.status != "converged":
        status = equilibrium.status.replace("_", " ")
        raise NoEquilibrium(f"{file}: {status}: {' '.join(equilibrium.message.split())}")
    if not as_json:
        from rich.console import Console  # noqa: PLC0415

        from fishbone.report import report  # noqa: PLC0415

        Console(highlight=False).print(report(equilibrium))
    for warning in equilibrium.warnings:
        click.echo(f"fishbone: {file}: warning: {warning}", err=True)


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
    _write(path, content.encode())
    click.echo(f"{path} written; next: fishbone solve {path}")


def _list_examples() -> None:
    names = shipped.names()
    width = max(map(len, names), default=0)
    for name in names:
        click.echo(f"{name:<{width}}  {shipped.summary(name)}".rstrip())


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns the exit code; never a traceback."""
    try:
        code = command.main(arguments, "fishbone", standalone_mode=False)
    except click.ClickException as error:
        return _fail(error.exit_code, error.format_message())
    except (click.Abort, KeyboardInterrupt):
        return _fail(Interrupted.exit_code, "interrupted")
    except OSError as error:
        return _fail(Failure.exit_code, str(error))
    except SystemExit:
        raise
    except BaseException as error:  # a panic of the core is no Exception
        return _fail(Failure.exit_code, f"internal error, please report it: {type(error).__name__}: {error}")
    return code if isinstance(code, int) else 0


def _fail(exit_code: int, message: str) -> int:
    click.echo(f"fishbone: {' '.join(message.split())}", err=True)
    return exit_code
