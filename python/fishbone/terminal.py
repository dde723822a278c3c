"""The standard streams: text in any encoding, and an end without noise where nobody reads it."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING

from fishbone.text import shown

if TYPE_CHECKING:
    from typing import TextIO


def write_out(text: str) -> None:
    """Writes text to standard output at once; "?" stands for characters that its encoding lacks, so that columns align.

    Errors: `OSError`.
    """
    _write(sys.stdout, text, "replace")


def write_line(message: str) -> None:
    """Writes one line to standard error: escapes stand for controls and for characters that its encoding lacks.

    A line that cannot be written is lost: there is no other place for it.
    """
    with contextlib.suppress(OSError):
        _write(sys.stderr, f"fishbone: {shown(' '.join(message.split()))}\n", "backslashreplace")


def _write(stream: TextIO | None, text: str, errors: str) -> None:
    # A stream that is closed from the start is None.
    if stream is None:
        return
    encoding = stream.encoding or "utf-8"
    stream.write(text.encode(encoding, errors).decode(encoding))
    stream.flush()


def settle() -> None:
    """Empties the standard streams; what a broken stream still holds is dropped.

    Else the interpreter would try again at its end, print a traceback, and change the exit code.
    """
    for stream in filter(None, (sys.stdout, sys.stderr)):
        _settle(stream)


def _settle(stream: TextIO) -> None:
    try:
        stream.flush()
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
