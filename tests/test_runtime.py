"""No call hangs a process: readers, signals, threads and forks while the core is at work.

Each script runs in a process of its own, which is ended where it hangs.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap

import pytest

from conftest import ROOT

PATIENCE = 100.0
"""Time after which a process is taken to hang, many times what it takes [s]."""


def output(script: str) -> str:
    """What a script prints that ends by itself."""
    begin = "import os, signal, threading, time\nimport fishbone as fb\n"
    words = [sys.executable, "-c", begin + textwrap.dedent(script)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


needs_timers = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there are no timers on Windows")

FINE = """
tables = fb.load("scenarios/example1.toml").to_dict()
tables["solver"]["elements"] = 20000
tracker = fb.Tracker(fb.Scenario.from_dict(tables))
"""

READ = """
def read():
    shape = [tracker.u, tracker.position, tracker.frame, tracker.bend, tracker.rib_slope]
    assert {len(values) for values in shape} == {len(tracker.u)}
    return tracker.energy
"""


def test_a_thread_reads_a_tracker_that_another_one_moves() -> None:
    seen = output(
        """
tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
"""
        + READ
        + """
def robot():
    for _ in range(60):
        tracker.update([0.0, 5.0, 0.0], [0.0, 0.0, 0.0])
        tracker.update([0.0, 0.5, 0.1], [0.0, 0.0, 0.0])

thread = threading.Thread(target=robot, daemon=True)
thread.start()
count = 0
while thread.is_alive():
    energy = read()
    assert tracker.reaction("end").force.any()
    assert abs(tracker.equilibrium().energy / energy - 1.0) < 1e-6
    count += 1
    time.sleep(0.001)
print(count)
"""
    )
    assert int(seen) > 0


@needs_timers
def test_a_signal_handler_reads_the_tracker_that_it_interrupts() -> None:
    seen = output(
        FINE
        + READ
        + """
seen, start = [], tracker.energy
signal.signal(signal.SIGALRM, lambda *_: seen.append(read()))
signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
for k in range(1, 6):
    tracker.update([0.0, 0.5 + 0.01 * k, 0.1], [0.0, 0.0, 0.0])
signal.setitimer(signal.ITIMER_REAL, 0.0)
assert start in seen  # of the shape before
print(len(seen))
"""
    )
    assert int(seen) > 0


@needs_timers
@pytest.mark.parametrize("call", ["update([0.0, 0.6, 0.1], [0.0, 0.0, 0.0])", "equilibrium()", "reaction('end')"])
def test_a_signal_handler_that_moves_the_tracker_it_interrupts_gets_an_error(call: str) -> None:
    words = output(
        FINE
        + f"""
seen = []

at_work = []

def move(*_):
    # Between two updates the call is allowed, and may last until the next signal.
    if not at_work:
        at_work.append(True)
        try:
            tracker.{call}
        except RuntimeError as error:
            seen.append(error)
        at_work.clear()

signal.signal(signal.SIGALRM, move)
signal.setitimer(signal.ITIMER_REAL, 0.01, 0.1)
while not seen:
    for position in ([0.0, 0.55, 0.1], [0.0, 0.50, 0.1]):
        assert tracker.update(position, [0.0, 0.0, 0.0]).status == "converged"
signal.setitimer(signal.ITIMER_REAL, 0.0)
print(seen[0])
"""
    )
    assert words.startswith("in use: ")


def test_control_c_ends_the_wait_for_a_tracker_that_another_thread_moves() -> None:
    seconds = output(
        """
tracker = fb.Tracker(fb.load("scenarios/example1.toml"))

def robot():
    while not over:
        tracker.update([0.0, 5.0, 0.0], [0.0, 0.0, 0.0])

over = []
thread = threading.Thread(target=robot)
thread.start()
threading.Timer(0.3, signal.raise_signal, [signal.SIGINT]).start()
start = time.monotonic()
try:
    while True:
        tracker.equilibrium()
except KeyboardInterrupt:
    print(time.monotonic() - start)
over.append(True)
thread.join()
"""
    )
    assert float(seconds) < 0.3 + 0.5


def test_threads_share_one_sensitivity() -> None:
    seen = output(
        """
belt = fb.solve(fb.load("scenarios/example1.toml"))
sensitivity = belt.sensitivity()
alone = sensitivity.jacobian(1)
seen = []
threads = [threading.Thread(target=lambda: seen.append(sensitivity.jacobian(1))) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert all((one == alone).all() for one in seen)
print(len(seen))
"""
    )
    assert int(seen) == 8


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on Windows")
@pytest.mark.parametrize("call", ["tracker.copy()", "tracker.update([0.0, 0.5, 0.1])", "tracker.state()"])
def test_a_child_made_by_fork_while_a_thread_moves_the_tracker_gets_an_error(call: str) -> None:
    """Or the tracker, if no update was at work in the moment of the fork; it can read the shape before in any case."""
    words = output(
        f"""
tracker = fb.Tracker(fb.load("scenarios/example1.toml"))

def robot():
    k = 0
    while True:
        k += 1
        tracker.update([0.0, 0.5 + 0.02 * (k % 2), 0.1], [0.0, 0.0, 0.0])

threading.Thread(target=robot, daemon=True).start()
codes = []
for _ in range(20):
    child = os.fork()
    if child == 0:
        code = 3
        try:
            assert tracker.position.shape == tracker.bend.shape + (3,)
            {call}
            code = 0
        except RuntimeError as error:
            code = 1 if str(error).startswith("lost: another thread was at work") else 2
        os._exit(code)
    _, status = os.waitpid(child, 0)
    codes.append(os.waitstatus_to_exitcode(status))
print(sorted(set(codes)))
os._exit(0)
"""
    )
    assert set(json.loads(words)) <= {0, 1}
    assert 1 in json.loads(words)


def test_control_c_ends_the_first_call_that_makes_an_array() -> None:
    """Nothing of NumPy is left to be found then, which would run the handler in the midst of the core."""
    seen = output(
        """
tables = fb.load("scenarios/example1.toml").to_dict() | {"solver": {"elements": 2000}}
belt = fb.solve(fb.Scenario.from_dict(tables))
points = [[k / 20000, 0.01] for k in range(20000)]
threading.Timer(0.2, signal.raise_signal, [signal.SIGINT]).start()
start = time.monotonic()
try:
    while True:
        belt.material_points(points)
except KeyboardInterrupt:
    print(time.monotonic() - start)
"""
    )
    assert float(seen) < 0.2 + 0.5


CALLS = {
    "solve_many": "fb.solve_many([scenario] * 8)",
    "branches": "fb.branches(scenario)",
    "solve": "fb.solve(scenario)",
    "tracker": "tracker.update([0.0, 0.62, 0.0], [0.0, 0.0, 0.0])",
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on Windows")
@pytest.mark.parametrize("first", CALLS)
@pytest.mark.parametrize("then", ["solve_many", "branches"])
def test_a_child_made_by_fork_goes_on(first: str, then: str) -> None:
    words = output(
        f"""
scenario = fb.load("scenarios/planar.toml")
tracker = fb.Tracker(scenario)
{CALLS[first]}
child = os.fork()
if child == 0:
    {CALLS[then]}
    {CALLS["tracker"]}
    os._exit(0)
_, status = os.waitpid(child, 0)
print(status)
"""
    )
    assert words == "0"
