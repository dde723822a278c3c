"""Many solves at once: the same results as one by one, in their order, and a failed solve among them is a value."""

from __future__ import annotations

import json
import os
import signal
import threading
import time

import numpy as np
import pytest

import fishbone as fb
from helpers import Json, clamped, example1, example2


def scenario_of(tables: Json) -> fb.Scenario:
    return fb.Scenario.from_dict(json.loads(json.dumps(tables)))


def several() -> list[fb.Scenario]:
    heights = np.linspace(0.3, 0.7, 9)
    return [scenario_of(clamped((0.05, float(height), 0.1), (0.0, 0.2, 0.0), elements=80)) for height in heights]


def test_results_are_those_of_single_solves_in_their_order() -> None:
    scenarios = several()
    for scenario, found in zip(scenarios, fb.solve_many(scenarios), strict=True):
        alone = fb.solve(scenario)
        assert found.scenario is scenario
        assert found.energy == alone.energy
        assert np.array_equal(found.position, alone.position)


def test_failure_spoils_no_other() -> None:
    out_of_reach = scenario_of(clamped((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), elements=80))
    found = fb.solve_many(iter([scenario_of(example1()), out_of_reach, scenario_of(example2())]))
    assert [belt.status for belt in found] == ["converged", "infeasible", "converged"]


def test_nothing_gives_nothing() -> None:
    assert fb.solve_many([]) == []


def test_progress_rises_to_all() -> None:
    calls: list[tuple[int, int]] = []
    scenarios = several()
    fb.solve_many(scenarios, progress=lambda solved, total: calls.append((solved, total)))
    assert calls == sorted(calls)
    assert calls[-1] == (len(scenarios), len(scenarios))


def test_error_in_progress_ends_the_solves() -> None:
    def refuse(solved: int, total: int) -> None:
        raise RuntimeError(f"{solved} of {total}")

    with pytest.raises(RuntimeError, match="of 9"):
        fb.solve_many(several(), progress=refuse)


def test_what_is_no_scenario_is_refused() -> None:
    with pytest.raises(fb.InvalidArgument, match="found dict"):
        fb.solve_many([{}])  # type: ignore[list-item]


def test_interrupt_ends_the_solves() -> None:
    """A solve of this size takes seconds, and there are twenty of them."""
    scenarios = [scenario_of(example1(elements=20_000))] * 20
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        fb.solve_many(scenarios)
    assert time.perf_counter() - start < 30.0
