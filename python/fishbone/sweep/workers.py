"""The processes that solve the points of a sweep, as a Dask cluster: here, or wherever its scheduler is."""

from __future__ import annotations

import contextlib
import gc
import itertools
import logging
import signal
from typing import TYPE_CHECKING, Any

from fishbone.errors import FishboneError, InvalidArgument
from fishbone.sweep.extra import extra

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

AHEAD = 500
"""Greatest number of tasks that wait or run at a time."""
PATIENCE = "10s"
"""Time after which a scheduler that does not answer is given up."""


def results(
    scheduler: str | None,
    task: Callable[..., Any],
    arguments: Iterable[tuple[Any, ...]],
    count: int,
    common: dict[str, object],
) -> Generator[Any, None, None]:
    """The results of a task for `count` arguments, each with the keywords `common`, as they are done.

    A task whose worker is lost is done anew by another one. `scheduler` is the address of a Dask scheduler; None is a
    cluster of processes on this machine, one for each core.

    Errors: `MissingPackage`; `InvalidArgument` where there is no such scheduler, or its workers cannot do the task;
    `FishboneError` where the scheduler is lost, or worker after worker with a task; those of the task.
    """
    if count == 0:
        return
    distributed = extra("distributed")
    try:
        with _client(scheduler, count) as client:
            yield from _collected(client, task, arguments, common)
    except ImportError as error:
        raise InvalidArgument(f"scheduler: found workers without a package ({error}), allowed those with all") from None
    except distributed.scheduler.KilledWorker as error:
        raise FishboneError(f"workers: found {error.allowed_failures + 1} lost in a row with the same points") from None


def _collected(
    client: Any,  # noqa: ANN401 - of dask
    task: Callable[..., Any],
    arguments: Iterable[tuple[Any, ...]],
    common: dict[str, object],
) -> Iterator[Any]:
    waiting = iter(arguments)

    def submitted(count: int) -> list[Any]:
        return [client.submit(task, *some, pure=False, **common) for some in itertools.islice(waiting, count)]

    running = extra("distributed").as_completed(submitted(AHEAD), loop=client.loop, with_results=True)
    for future, result in running:
        if future.cancelled():
            raise FishboneError("scheduler: found the connection lost; repeat the sweep to go on")
        yield result
        running.update(submitted(1))


@contextlib.contextmanager
def _client(scheduler: str | None, tasks: int) -> Iterator[Any]:
    """The client of a scheduler, or of processes of its own, no more than there are tasks."""
    distributed = extra("distributed")
    if scheduler is not None:
        with _connected(scheduler) as client:
            yield client
        return
    with _without_interrupts():
        cluster = distributed.LocalCluster(
            n_workers=min(extra("dask.system").CPU_COUNT, tasks),
            threads_per_worker=1,
            processes=True,
            # A server at any free port, for this machine alone; without a page.
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
        )
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Holds Ctrl-C back until after the body.

    Processes that the body starts, or later its threads, never get it: it is for this one, which then ends them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    from multiprocessing import resource_tracker  # noqa: PLC0415 - not on Windows

    # Where it is started later, it lets the signals of that thread through again.
    resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _connected(scheduler: str) -> Any:  # noqa: ANN401 - of dask
    try:
        return extra("distributed").Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        text = " ".join(str(error).split())
    # Dask's client that has not connected waits for ever for a lock if it is collected while another one starts.
    gc.collect()
    raise InvalidArgument(
        f"scheduler: found {scheduler!r} ({text}), allowed the address of a Dask scheduler, as in tcp://host:8786"
    )
