"""Progress of a command, on standard error."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TYPE_CHECKING

from fishbone.terminal import write_line

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console

QUIET = 1.0
"""Time from which a terminal shows a bar [s]."""
QUIET_IN_LOGS = 10.0
"""Time from which lines are written where standard error is no terminal, each after twice the time of the one before
[s]."""
_REFRESH = 0.1
"""Time between two looks at the state of the work [s]."""


class Progress:
    """The state of some work, shown once the work has taken long."""

    def __init__(self, words: str) -> None:
        self.words = words
        """What is being done."""
        self.share: float | None = None
        """The share done, between 0 and 1; None where it is not known."""

    def show(self, words: str, share: float | None = None) -> None:
        """Sets words and share. The share of the same work never falls, also where more of it turns up."""
        if share is not None and self.share is not None and words == self.words:
            share = max(share, self.share)
        self.words, self.share = words, share


@contextlib.contextmanager
def progress(words: str) -> Iterator[Progress]:
    """Shows the progress of the work in its body: on a terminal a bar, else a line now and then."""
    state, done = Progress(words), threading.Event()
    console = _console()
    show = _bar if console.is_terminal else _lines
    # The core releases the interpreter, so that a thread of its own can show that the work goes on.
    watch = threading.Thread(target=show, args=(state, done, console), daemon=True)
    watch.start()
    try:
        yield state
    finally:
        done.set()
        watch.join()


def _console() -> Console:
    """The console of standard error. At a broken pipe it falls silent, where rich would close standard output."""
    from rich.console import Console  # noqa: PLC0415

    class ErrorConsole(Console):
        def on_broken_pipe(self) -> None:
            self.quiet = True

    return ErrorConsole(stderr=True)


def _bar(state: Progress, done: threading.Event, console: Console) -> None:
    if done.wait(QUIET):
        return
    from rich.progress import Progress as Bar  # noqa: PLC0415

    with Bar(console=console, transient=True) as bar:
        task = bar.add_task(state.words, total=None)
        while True:
            total = None if state.share is None else 1.0
            bar.update(task, description=state.words, completed=state.share or 0.0, total=total)
            if done.wait(_REFRESH):
                return


def _lines(state: Progress, done: threading.Event, _: Console) -> None:
    start, wait = time.monotonic(), QUIET_IN_LOGS
    while not done.wait(wait):
        wait = time.monotonic() - start
        share = "" if state.share is None else f", {state.share:.0%}"
        write_line(f"{state.words}{share}, after {wait:.0f} s{_left(state.share, wait)}")


def _left(share: float | None, elapsed: float) -> str:
    """The time left at the rate so far, in words; nothing where no share is done."""
    return f", about {elapsed * (1.0 - share) / share:.0f} s left" if share else ""
