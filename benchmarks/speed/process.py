"""One measurement of fishbone in a process of its own, printed as JSON: its peak memory, its threads, its instructions.

python -m speed.process mesh ELEMENTS | batch COUNT | solve EXAMPLE TIMES | update EXAMPLE TIMES < POSES
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import fishbone as fb

if TYPE_CHECKING:
    from collections.abc import Callable

SCENARIOS = Path(__file__).parents[2] / "scenarios"
COARSE = 80
"""Elements of the mesh from whose solution finer meshes are solved."""
TRACKED = {"energy": "wunderlich", "solver": {"elements": 80}}
"""Density and mesh of a tracker, the same for boards of any outline."""
REPETITIONS = 5


def _example(name: str, **solver: int) -> fb.Scenario:
    tables = fb.load(SCENARIOS / f"{name}.toml").to_dict()
    tables["solver"] |= solver
    return fb.Scenario.from_dict(tables)


def _peak() -> float:
    """Largest memory of this process so far [MB]; getrusage would count that of the process which started it."""
    found = re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    assert found is not None
    return int(found[1]) / 1024.0


def mesh(elements: str) -> dict[str, Any]:
    """Time of an iteration on a mesh, without the iterations on the coarse mesh before; and memory."""
    fine, coarse = (_example("example1", elements=count) for count in (int(elements), COARSE))
    before = _peak()
    fb.solve(fine, strict=True)
    memory = _peak() - before
    iterations, seconds = [one - other for one, other in zip(_solved(fine), _solved(coarse), strict=True)]
    return {
        "elements": int(elements),
        "iterations": int(iterations),
        "per_iteration": seconds / iterations,
        "megabytes": memory,
    }


def _solved(scenario: fb.Scenario) -> tuple[int, float]:
    belts = [fb.solve(scenario, strict=True) for _ in range(REPETITIONS)]
    return belts[0].iterations, min(belt.solve_time for belt in belts)


def batch(count: str) -> dict[str, Any]:
    """Random poses at once, on the number of threads set by the environment."""
    import numpy as np  # noqa: PLC0415 - not for the count of instructions

    import random_poses  # noqa: PLC0415

    rng = np.random.default_rng(1)
    scenarios = [random_poses.scenario("wunderlich", *random_poses.pose(rng)) for _ in range(int(count))]
    start = perf_counter()
    belts = fb.solve_many(scenarios)
    return {
        "threads": int(os.environ["RAYON_NUM_THREADS"]),
        "scenarios": len(belts),
        "converged": sum(belt.status == "converged" for belt in belts),
        "seconds": perf_counter() - start,
    }


def solve(example: str, times: str) -> dict[str, Any]:
    """The same scenario so many times."""
    scenario = _example(example)
    return {"energy": [fb.solve(scenario).energy for _ in range(int(times))]}


def update(example: str, times: str) -> dict[str, Any]:
    """The first so many updates of a tracker, through poses that are read; all are read in any case."""
    poses = json.load(sys.stdin)
    tracker = fb.Tracker(fb.Scenario.from_dict(_example(example).to_dict() | TRACKED))
    return {"iterations": [tracker.update(*pose).iterations for pose in poses[: int(times)]]}


if __name__ == "__main__":
    tasks: dict[str, Callable[..., dict[str, Any]]] = {"mesh": mesh, "batch": batch, "solve": solve, "update": update}
    print(json.dumps(tasks[sys.argv[1]](*sys.argv[2:])))
