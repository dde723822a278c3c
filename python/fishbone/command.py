"""What commands of the command line share: exit codes, files to read and to write."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fishbone.errors import FishboneError
from fishbone.files import check_writable, identity

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator


class Failure(click.ClickException):
    """A command failed: one line of error, and an exit code for each class."""

    exit_code = 1


class Invalid(Failure):
    """The input, the use of the command line, or the place to write to is not valid."""

    exit_code = 2


class NoEquilibrium(Failure):
    """The solve ended without an equilibrium, or `follow` has no equilibrium to start from."""

    exit_code = 3


class NoRoom(Failure):
    """A file or standard output takes no more bytes, as on a full disk; the exit code is EX_IOERR of sysexits.h."""

    exit_code = 74


class Interrupted(Failure):
    """Ctrl-C was pressed; the exit code is that of shells."""

    exit_code = 130


class Unread(Failure):
    """Nobody reads standard output any more; the exit code is that of shells for a broken pipe."""

    exit_code = 141


_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Errors of a disk, a quota or a device that takes no more bytes."""


def _failure(error: OSError) -> Failure:
    """The failure of a file or, where the error names none, of standard output."""
    if isinstance(error, BrokenPipeError):
        kind: type[Failure] = Unread
    else:
        kind = NoRoom if error.errno in _NO_ROOM else Invalid
    return kind(f"{error.filename or 'standard output'}: {error.strerror}")


class Input(click.Path):
    """A file to read."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)


class Output(click.Path):
    """A file to write, of some suffixes; a path that cannot be written is refused before the solve."""

    def __init__(self, *suffixes: str) -> None:
        super().__init__(path_type=Path, readable=False)
        self.suffixes = suffixes

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - as in click
        """The path."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        obstacle = self.obstacle(path)
        if obstacle is not None:
            self.fail(f"{path}: {obstacle}", param, ctx)
        return path

    def obstacle(self, path: Path) -> str | None:
        """The reason why a path cannot be written; None where it can be."""
        return check_writable(path, self.suffixes)


PICTURE = Output(".png", ".pdf", ".svg")


class Command(click.Command):
    """A command none of whose outputs is one of its inputs, or another output."""

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - as in click
        """Runs the command."""
        known: dict[Hashable, click.Parameter] = {}
        for kind in (Input, Output):
            for param, path in self._files(ctx, kind):
                other = known.setdefault(identity(path), param)
                if kind is Output and other is not param:
                    found = f"found the file of {other.get_error_hint(ctx)} itself"
                    raise click.BadParameter(f"{path}: {found}, allowed another file", ctx, param)
        return super().invoke(ctx)

    def _files(self, ctx: click.Context, kind: type[click.Path]) -> Iterator[tuple[click.Parameter, Path]]:
        """The paths of a kind, with their parameters."""
        for param in self.params:
            path = ctx.params.get(param.name or "")
            if isinstance(param.type, kind) and path is not None:
                yield param, path


class Commands(click.Group):
    """Converts errors and interrupts of a command into an exit code and one line."""

    command_class = Command

    def make_context(self, *args: Any, **extra: Any) -> click.Context:  # noqa: ANN401 - as in click
        """Reads the arguments, and prints help and version."""
        with _converted():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - as in click
        """Runs the command."""
        with _converted():
            return super().invoke(ctx)


@contextlib.contextmanager
def _converted() -> Iterator[None]:
    """Converts errors into failures, before click ends the program at a broken pipe in its own way."""
    try:
        yield
    except FishboneError as error:
        raise Invalid(str(error)) from error
    except OSError as error:
        raise _failure(error) from error
    except KeyboardInterrupt:
        raise Interrupted("interrupted") from None
