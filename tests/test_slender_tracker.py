"""Slender belts are tracked on meshes that go with the places where ribs turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fishbone as fb

SCENARIOS = Path(__file__).parents[1] / "scenarios"


def slender(position: list[float], rotation: list[float]) -> fb.Scenario:
    """Example 1 at U/V = 300 with its end at another pose."""
    tables = fb.load(SCENARIOS / "example1.toml").to_dict() | {"energy": "wunderlich"}
    tables["belt"]["width"] = 1.0 / 300.0
    tables["supports"][1] |= {"position": position, "rotation": rotation}
    tables.pop("solver", None)
    return fb.Scenario.from_dict(tables)


def test_no_update_of_a_slender_belt_on_a_smooth_loop_is_a_snap() -> None:
    """Each update takes few iterations, and ends in the equilibrium of a cold solve, within the stated error."""
    tracker = fb.Tracker(slender([0.0, 0.8, 0.05], [0.0, 0.0, 0.0]))
    iterations = []
    for k in range(1, 21):
        s = 2.0 * np.pi * k / 120.0
        move = 0.05 * np.sin(s)
        position = [move, 0.8 + move, 0.05 + move]
        rotation = [0.2 * np.sin(s), 0.2 * (1.0 - np.cos(s)), 0.3 * np.sin(s)]
        update = tracker.update(position, rotation)
        assert update.status == "converged"
        assert not update.snapped
        iterations.append(update.iterations)
        assert len(tracker.u) == len(tracker.position)
        if k % 5 == 0:
            cold = fb.solve(slender(position, rotation))
            assert cold.error is not None
            assert abs(tracker.energy / cold.energy - 1.0) < 1e-3
            along = [np.interp(cold.u, tracker.u, tracker.position[:, i]) for i in range(3)]
            # Between nodes a chord is off its arc by h²|κ|/8.
            chord = np.diff(tracker.u).max() ** 2 * np.abs(tracker.bend).max() / 8.0
            assert np.abs(np.transpose(along) - cold.position).max() < 2e-3 + chord
    assert np.median(iterations) <= 40
    assert max(iterations) <= 150


def test_small_steps_of_a_slender_belt_are_followed_on_one_mesh() -> None:
    """It is graded anew on the way, so that its error stays that of a cold solve, or little more."""
    tracker = fb.Tracker(slender([0.0, 0.8, 0.05], [0.0, 0.0, 0.0]))
    iterations, meshes = [], set()
    for k in range(1, 121):
        move = 1e-4 * k
        update = tracker.update([move, 0.8, 0.05 + move], [0.0, 0.0, 0.3 * move])
        assert (update.status, update.snapped) == ("converged", False)
        iterations.append(update.iterations)
        meshes.add(tracker.u.tobytes())
    assert np.median(iterations) <= 5
    assert 5 < len(meshes) < 30
    error = tracker.equilibrium().error
    assert error is not None
    assert max(error) < 3e-3
    assert tracker.energy == pytest.approx(fb.solve(tracker.equilibrium().scenario).energy, rel=1e-4)
