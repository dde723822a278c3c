"""Files written whole or not at all."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def check_writable(path: Path, suffixes: tuple[str, ...]) -> str | None:
    """The reason why a file cannot be written at a path, "found …, allowed …"; None where it can be written."""
    if path.suffix.lower() not in suffixes:
        return f"found {path.suffix or 'no suffix'}, allowed {', '.join(suffixes)}"
    try:
        # A symbolic link stays a link: its target is replaced.
        target = path.resolve()
        exists = target.exists()
    except (OSError, RuntimeError) as error:
        return f"found a name that leads nowhere ({error}), allowed a file that can be written"
    folder = target.parent
    if not folder.is_dir():
        return f"found no folder {folder}, allowed an existing one"
    if exists and not target.is_file():
        return f"found {path}, which is no plain file, allowed a file"
    if not os.access(folder, os.W_OK | os.X_OK):
        return f"found the folder {folder} read-only, allowed one to write in"
    return None


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A draft beside the file, which the body writes; it is moved to its place after the body.

    No reader sees a part of the file. Errors: `OSError` and those of the body; the file is then as it was before.
    """
    # A symbolic link stays a link: its target is replaced.
    target = path.resolve()
    draft = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield draft
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file, so that no reader sees a part of it.

    Errors: `OSError`; the file is then as it was before.
    """
    with whole(path) as draft:
        draft.write_bytes(content)
