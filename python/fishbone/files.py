"""Files written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping

DRAFTS = ".*.part"
"""Names of the folders in which drafts are written, which stay where a process is killed."""
_ANY_WRITES = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH
"""The mode bits of those who may write."""


def check_writable(path: Path, suffixes: tuple[str, ...]) -> str | None:
    """The reason why a file cannot be written at a path, "found …, allowed …"; None where it can be written."""
    obstacle = check_suffix(path, suffixes)
    if obstacle is not None:
        return obstacle
    try:
        target = _target(path)
        obstacle = _protection(target, _status(target))
    except OSError as error:
        return f"found a name that leads nowhere ({error.strerror}), allowed a file that can be written"
    folder = target.parent
    if not folder.is_dir():
        return f"found no folder {folder}, allowed an existing one"
    if obstacle is None and not os.access(folder, os.W_OK | os.X_OK):
        return f"found the folder {folder} read-only, allowed one to write in"
    return obstacle


def check_suffix(path: Path, suffixes: tuple[str, ...]) -> str | None:
    """The reason why a path has none of the suffixes, "found …, allowed …"; None where it has one."""
    if path.suffix.lower() in suffixes:
        return None
    return f"found {path.suffix or 'no suffix'}, allowed {', '.join(suffixes)}"


def is_file(path: Path) -> bool:
    """Whether a path leads to a plain file; False of a path that leads nowhere."""
    try:
        status = _status(_target(path))
    except OSError:
        return False
    return status is not None and stat.S_ISREG(status.st_mode)


def identity(path: Path) -> Hashable:
    """Equal for paths that lead to one file, by symbolic and hard links too; the file need not exist."""
    try:
        target = _target(path)
        status = _status(target)
    except OSError:
        # A path that leads nowhere is equal to itself alone.
        return path
    return target if status is None else (status.st_dev, status.st_ino)


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file so that no reader sees a part of it, also where several write at once.

    The content is on the disk before the file takes its place, so that a crash of the machine leaves no part of it. A
    file that exists keeps its mode; one that is read-only, or no plain file, stays as it is.

    Errors: `OSError` with the path; the file is then as it was before.
    """
    write_all({path: content})


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Writes files, each as `write_whole`, and none before there is room for all.

    Errors: `OSError` with the path.
    """
    with contextlib.ExitStack() as drafts:
        moves = []
        for path, content in contents.items():
            with _naming(path):
                target = _target(path)
                draft = drafts.enter_context(_draft(target))
                draft.write_bytes(content)
                _flush(draft)
                moves.append((path, draft, target))
        for path, draft, target in moves:
            with _naming(path):
                _move(draft, target)


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A draft for the body to write, which takes the place of a file after it, as `write_whole` does.

    Errors: `OSError` with the path, and those of the body; the file is then as it was before.
    """
    with _naming(path):
        target = _target(path)
        with _draft(target) as draft:
            yield draft
            _flush(draft)
            _move(draft, target)


@contextlib.contextmanager
def _draft(target: Path) -> Iterator[Path]:
    """A place for a draft beside the target, which must be writable."""
    obstacle = _protection(target, _status(target))
    if obstacle is not None:
        raise PermissionError(errno.EACCES, obstacle)
    # In a folder of its own the name is short and free, and the mode of a new file is that of any other.
    with tempfile.TemporaryDirectory(prefix=".", suffix=".part", dir=target.parent) as folder:
        yield Path(folder) / "draft"


def _flush(draft: Path) -> None:
    """Waits until a draft is on the disk."""
    with draft.open("r+b") as file:  # Windows flushes only what is open for writing.
        os.fsync(file.fileno())


def _move(draft: Path, target: Path) -> None:
    """Moves a draft to its target, whose mode it takes over."""
    status = _status(target)
    if status is not None:
        draft.chmod(stat.S_IMODE(status.st_mode))
    draft.replace(target)


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Puts the path of the caller into errors, in place of those of drafts."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def _target(path: Path) -> Path:
    """The file that a path leads to: a symbolic link stays a link."""
    return Path(os.path.realpath(path))


def _status(target: Path) -> os.stat_result | None:
    """The status of a file; None where there is no file."""
    try:
        return target.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def _protection(target: Path, status: os.stat_result | None) -> str | None:
    """What keeps a file from being replaced, "found …, allowed …"; None where nothing does."""
    if status is None:
        return None
    if not stat.S_ISREG(status.st_mode):
        return f"found {target}, which is no plain file, allowed a file"
    # The superuser may write to all files; a mode by which nobody writes is meant for all, too.
    if not (status.st_mode & _ANY_WRITES and os.access(target, os.W_OK)):
        return f"found {target} read-only, allowed a file that may be written"
    return None
