"""Mixes threads, signals, forks and pickles on one tracker and on solves, and looks for what does not come back.

    python benchmarks/stress.py --seconds 600

Threads call; a handler of signals reads the tracker while they do; children that are forked meanwhile call, too. A
line a minute has the counts and the resident memory. The exit code is 1 where a thread or a child hangs or fails.
"""

from __future__ import annotations

import argparse
import copy
import faulthandler
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import psutil

import fishbone as fb

if TYPE_CHECKING:
    from collections.abc import Callable

PATIENCE = 60.0
"""Time after which a call or a child counts as hanging [s]."""
SIGNALS = 0.003
"""Time between signals [s]."""
PAUSE = 60.0
"""Time between reports [s]."""
THREADS = 3
SCENARIO = fb.Scenario.from_dict(fb.load("scenarios/example1.toml").to_dict() | {"solver": {"elements": 40}})


def pose(random: np.random.Generator) -> fb.Pose:
    """A pose of the end near that of the example."""
    return fb.Pose(np.array([0.0, 0.5, 0.1]) + random.uniform(-0.1, 0.1, 3), random.uniform(-0.3, 0.3, 3))


def pickled(tracker: fb.Tracker, random: np.random.Generator) -> None:
    """Moves a pickle and a copy of one copy, which end alike."""
    one = tracker.copy()
    other = pickle.loads(pickle.dumps(one))  # noqa: S301 - of this process
    goal = pose(random)
    assert repr(one.update(goal)) == repr(other.update(goal))


def solved(*_: object) -> None:
    """Solves many scenarios, and copies and pickles a result."""
    found = fb.solve_many([SCENARIO] * 4)
    again = pickle.loads(pickle.dumps(copy.deepcopy(found[0])))  # noqa: S301 - of this process
    assert again.energy == found[-1].energy


def read(tracker: fb.Tracker, *_: object) -> None:
    """Reads the tracker, which other threads move."""
    assert np.isfinite(tracker.position).all()
    assert tracker.equilibrium().status == "converged"
    assert np.isfinite(tracker.jacobian()).all()


def moved(tracker: fb.Tracker, random: np.random.Generator) -> None:
    """Moves the tracker that all share."""
    assert 0.0 <= tracker.update(pose(random), max_time=0.05).fraction <= 1.0


CALLS: list[Callable[[fb.Tracker, np.random.Generator], None]] = [pickled, solved, read, moved]


def call_in_child(shared: fb.Tracker, random: np.random.Generator) -> None:
    """Calls with the tracker of the parent, which a thread of the parent may be at work on, then with another one."""
    assert np.isfinite(shared.position).all()
    try:
        moved(shared, random)
    except RuntimeError as lost:
        assert str(lost).startswith("lost: ")  # noqa: PT017 - no test of pytest
    tracker = fb.Tracker(SCENARIO)
    for call in CALLS:
        call(tracker, random)


class Stress:
    """The threads, and what they have done."""

    def __init__(self) -> None:
        self.tracker = fb.Tracker(SCENARIO)
        self.counts: Counter[str] = Counter()
        self.began = [time.monotonic()] * THREADS
        self.failed: list[str] = []
        self.ends = False

    def work(self, number: int) -> None:
        """Calls at random until the end."""
        random = np.random.default_rng(number)
        try:
            while not self.ends:
                self.began[number] = time.monotonic()
                call = CALLS[random.integers(len(CALLS))]
                call(self.tracker, random)
                self.counts[call.__name__] += 1
        except BaseException:  # the main thread reports it
            self.failed.append(traceback.format_exc())

    def interrupted(self, *_: object) -> None:
        """Reads the tracker in the middle of whatever the main thread does."""
        assert np.isfinite(self.tracker.energy)
        self.counts["signals"] += 1

    def fork(self, random: np.random.Generator) -> None:
        """Lets a child call, and waits for it."""
        child = os.fork()
        if child == 0:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            try:
                call_in_child(self.tracker, random)
                os._exit(0)
            finally:
                traceback.print_exc()
                os._exit(1)
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                if status:
                    self.failed.append(f"a child has ended with {status}")
                self.counts["forks"] += 1
                return
            time.sleep(0.01)
        os.kill(child, signal.SIGKILL)
        self.failed.append("a child hangs")

    def hangs(self) -> bool:
        """Whether a thread has not come back from its call."""
        return any(time.monotonic() - began > PATIENCE for began in self.began)


def report(stress: Stress, start: float) -> None:
    """One line of counts and memory."""
    memory = psutil.Process().memory_info().rss / 2**20
    counts = ", ".join(f"{count} {name}" for name, count in sorted(stress.counts.items()))
    print(f"{time.monotonic() - start:6.0f} s, {memory:.0f} MiB: {counts}", flush=True)


def main() -> int:
    """Runs for the time that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="how long to go on (600)")
    seconds = parser.parse_args().seconds
    stress, random = Stress(), np.random.default_rng(THREADS)
    threads = [threading.Thread(target=stress.work, args=[number], daemon=True) for number in range(THREADS)]
    signal.signal(signal.SIGALRM, stress.interrupted)
    signal.setitimer(signal.ITIMER_REAL, SIGNALS, SIGNALS)
    for thread in threads:
        thread.start()
    start = last = time.monotonic()
    while time.monotonic() - start < seconds and not stress.failed and not stress.hangs():
        stress.fork(random)
        if time.monotonic() - last > PAUSE:
            last = time.monotonic()
            report(stress, start)
    stress.ends = True
    for thread in threads:
        thread.join(PATIENCE)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    report(stress, start)
    if stress.hangs() or any(thread.is_alive() for thread in threads):
        faulthandler.dump_traceback(all_threads=True)
        stress.failed.append("a thread hangs")
    print(*stress.failed or ["nothing hangs, nothing fails"], sep="\n")
    return 1 if stress.failed else 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)
