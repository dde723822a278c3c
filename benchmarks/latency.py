"""Times of single updates of a tracker: boards of all kinds, wide to slender, in small steps and around a loop.

    python benchmarks/latency.py

It writes the table of docs/performance.md. Each case is led along its way several times by trackers in the same state,
and the least time of each update counts: the last percentiles show hard updates and not the load of the machine.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from rich.progress import track
from scipy.spatial.transform import Rotation

import fishbone as fb
from tables import ROOT, table, write

RATIOS = (10, 20, 50, 100, 300)
"""Length over width, U/V."""
PASSES, SLENDER = 3, 50
"""Passes along each way; a board of this ratio or more, whose updates take long, goes along it once."""
STEPS, LOOP = 1000, 120
"""Updates of each way."""
STEP = 1e-4
"""Length of a small step, in U and rad: a tenth of a metre a second at 1 kHz, on a board of a metre."""
SWING, TURN = 0.03, 0.15
"""Size of the loop, in U and rad."""
HALF = {"kind": "straight", "length": 0.5}
BOARDS: dict[str, dict[str, Any]] = {
    "straight": {"segments": [{"kind": "straight", "length": 1.0}]},
    "bent": {"segments": [HALF, {"kind": "corner", "angle": 0.3}, HALF]},
    "curved": {"segments": [{"kind": "arc", "length": 1.0, "curvature": 0.8}]},
    "linked": {"segments": [{"kind": "straight", "length": 1.0}]},
}
LINK = {"from": 0.3, "to": 0.7}


def tracker_of(board: str, ratio: int) -> fb.Tracker:
    """A tracker of a board between clamps; its end is drawn in from where the flat board has it."""
    belt = {"width": 1.0 / ratio, "rigidity": 1.0} | BOARDS[board]
    start = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
    flat = fb.solve(fb.Scenario.from_dict({"belt": belt, "supports": [start], "energy": "wunderlich"}))
    end = 0.7 * flat.position[-1] + np.array([0.05, 0.0, 0.0])
    turn = Rotation.from_matrix(flat.frame[-1]).as_rotvec()
    held = {"at": "end", "position": end.tolist(), "rotation": turn.tolist()}
    tables: dict[str, Any] = {"belt": belt, "supports": [start, held], "energy": "wunderlich"}
    if board == "linked":
        found = fb.solve(fb.Scenario.from_dict(tables))
        ends = [np.array([np.interp(LINK[key], found.u, row) for row in found.position.T]) for key in ("from", "to")]
        tables["links"] = [LINK | {"offset": (0.95 * (ends[1] - ends[0])).tolist()}]
    return fb.Tracker(fb.Scenario.from_dict(tables))


def ways(tracker: fb.Tracker) -> dict[str, list[fb.Pose]]:
    """Poses of the end, in small steps and around a loop."""
    start, turn = tracker.position[-1], Rotation.from_matrix(tracker.frame[-1])

    def at(angle: float, size: float, by: float) -> fb.Pose:
        shift = size * np.array([np.sin(angle), 0.7 * np.sin(2.0 * angle), np.cos(angle) - 1.0])
        twist = by * np.array([np.sin(angle), np.sin(2.0 * angle), 0.4 * (np.cos(angle) - 1.0)])
        return fb.Pose(start + shift, (Rotation.from_rotvec(twist) * turn).as_rotvec())

    radius = STEP * STEPS / (2.0 * np.pi)
    small = [at(2.0 * np.pi * k / STEPS, radius, radius) for k in range(1, STEPS + 1)]
    return {"small": small, "loop": [at(2.0 * np.pi * k / LOOP, SWING, TURN) for k in range(1, LOOP + 1)]}


def timed(tracker: fb.Tracker, poses: list[fb.Pose], passes: int) -> dict[str, Any]:
    """Least wall and CPU time of each update [ms], and how many failed or snapped."""
    best = np.full((2, len(poses)), np.inf)
    for _ in range(passes):
        mover = tracker.copy()
        failed = snapped = 0
        for k, pose in enumerate(poses):
            began = time.perf_counter(), time.process_time()
            update = mover.update(pose)
            took = time.perf_counter() - began[0], time.process_time() - began[1]
            best[:, k] = np.minimum(best[:, k], took)
            failed += update.status != "converged"
            snapped += update.snapped
    wall, used = 1e3 * best
    quantiles = dict(zip(("p50", "p99", "p99.9"), np.percentile(wall, [50.0, 99.0, 99.9]), strict=True))
    return {"updates": len(poses), "failed": failed, "snaps": snapped} | quantiles | {"CPU": used.mean()}


def main() -> None:
    """Measures all cases, and fills the table in."""
    rows = []
    cases = [(board, ratio) for board in BOARDS for ratio in RATIOS]
    for board, ratio in track(cases, "cases"):
        tracker = tracker_of(board, ratio)
        for name, poses in ways(tracker).items():
            found = timed(tracker, poses, 1 if ratio >= SLENDER else PASSES)
            times = [f"{found[key]:.3g}" for key in ("p50", "p99", "p99.9", "CPU")]
            counts = [str(found[key]) for key in ("updates", "failed", "snaps")]
            rows.append([board, str(ratio), name, str(len(tracker.u) - 1), *counts, *times])
    head = ["board", "U/V", "way", "elements", "updates", "failed", "snaps"]
    found = table([*head, "p50 [ms]", "p99", "p99.9", "mean CPU [ms]"], rows)
    write("latency", found, ROOT / "docs" / "performance.md")


if __name__ == "__main__":
    main()
