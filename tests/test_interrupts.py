"""Ctrl-C ends every long call soon, and what a call has begun can be done again."""

import signal
import time

import pytest

import fishbone as fb

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there are no timers on Windows")

BEFORE = 0.2
"""Time of the work before the interrupt [s]."""
PATIENCE = 10.0
"""Time from the interrupt to the end of the call after which the call counts as not interrupted [s]."""


def fine(elements, name="example1"):
    return fb.Scenario.from_dict(fb.load(f"scenarios/{name}.toml").to_dict() | {"solver": {"elements": elements}})


def segments(count):
    tables = fb.load("scenarios/example1.toml").to_dict()
    pieces = [{"kind": "arc", "length": 1.0 / count, "curvature": 0.5 * (-1.0) ** i} for i in range(count)]
    return fb.Scenario.from_dict(tables | {"belt": tables["belt"] | {"segments": pieces}, "solver": {}})


def interrupted(call):
    """Interrupts a call; the seconds from the interrupt to its end."""

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    start = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, BEFORE)
    try:
        with pytest.raises(KeyboardInterrupt):
            call()
        return time.monotonic() - start - BEFORE
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def found():
    return fb.solve(fine(10_000))


CALLS = {
    "solve": lambda found: fb.solve(fine(20_000)),
    "solve of 10 000 arcs": lambda found: fb.solve(segments(10_000)),
    "solve of a thick strip": lambda found: fb.solve(fine(2000, "polystyrene")),
    "modes": lambda found: found.modes(100),
    "error": lambda found: found.error,
    "to_dict": lambda found: found.to_dict(),
    "refined": lambda found: found.refined(100_000),
    "snap_margin": lambda found: fb.solve(fine(3000)).snap_margin(),
    "follow": lambda found: fb.follow(fine(3000), {"supports[1].position[1]": 0.2}),
    "update": lambda found: fb.Tracker(found).update([0.3, 0.3, 0.3], [1.0, 0.0, 0.0]),
    "branches": lambda found: fb.branches(fine(80)),
    "solve_many": lambda found: fb.solve_many([fine(5000)] * 100),
}


@pytest.mark.parametrize("name", CALLS)
def test_control_c_ends_a_long_call(name, found):
    assert interrupted(lambda: CALLS[name](found)) < PATIENCE


def test_what_was_interrupted_can_be_done_again(found):
    small = fb.solve(fine(6000))
    interrupted(lambda: [small.modes(100) for _ in range(100)])
    interrupted(lambda: [fb.solve(fine(6000)).error for _ in range(100)])
    assert small.error is not None
    assert len(small.modes(2)) == 2
