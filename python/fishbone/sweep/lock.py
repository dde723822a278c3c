"""Locks of folders: one process at a time works in a folder."""

from __future__ import annotations

import contextlib
import sys
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Locks a file, which is made if there is none, for the body; whether no other process, or thread, has locked it.

    The system ends the lock with the process, however it ends: a file that is left locks nothing. On a file system
    without locks nobody has locked it.

    Errors: `OSError`.
    """
    with path.open("ab") as file:
        try:
            _lock(file)
        except (BlockingIOError, PermissionError):  # the second is that of Windows
            yield False
            return
        except OSError:
            pass
        yield True
