"""Iterations of the shipped scenarios, so that no change raises them unnoticed."""

from __future__ import annotations

from pathlib import Path

import pytest

import fishbone as fb

SCENARIOS = Path(__file__).parents[1] / "scenarios"
ITERATIONS = {
    "bent": 19,
    "cantilever": 38,
    "curl": 18,
    "curved": 24,
    "example1": 19,
    "example2": 31,
    "hinge": 131,
    "mobius": 92,
    "planar": 10,
    "polystyrene": 69,
    "twist": 65,
}
"""Iterations over all attempts, as of the last intended change of the solver."""
PLAY = 2


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENARIOS.glob("*.toml")))
def test_scenario_takes_as_many_iterations_as_ever(name: str) -> None:
    """The iterations, plus or minus two for rounding on other machines."""
    assert abs(fb.solve(fb.load(SCENARIOS / f"{name}.toml")).iterations - ITERATIONS[name]) <= PLAY
