"""Thick strips between clamps at random poses: they converge, and a mesh twice as fine has the same shape."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fishbone as fb
from helpers import Json, rms_distance, spine_at, thick
from test_random_poses import LARGEST_CONE, LARGEST_ROTATION, WIDTH, pose_scenario


def scenario_of(seed: int, elements: int) -> Json:
    """The poses of the random tests of the other energies, of strips 0.002 to 0.02 as thick as wide."""
    rng = np.random.default_rng(seed)
    polar = math.acos(1.0 - rng.random() * (1.0 - math.cos(LARGEST_CONE)))
    azimuth = 2.0 * math.pi * rng.random()
    distance = rng.uniform(0.3, 0.9)
    axis = math.acos(2.0 * rng.random() - 1.0), 2.0 * math.pi * rng.random()
    angle = rng.uniform(-LARGEST_ROTATION, LARGEST_ROTATION)
    thickness = WIDTH * 10.0 ** rng.uniform(math.log10(0.002), math.log10(0.02))
    belt = pose_scenario("wunderlich", distance, polar, azimuth, *axis, angle)
    return thick(belt, thickness) | {"solver": {"elements": elements}}


@pytest.mark.parametrize("seed", range(1000, 1040))
def test_strip_is_that_of_a_mesh_twice_as_fine(seed: int) -> None:
    coarse, fine = (fb.solve(fb.Scenario.from_dict(scenario_of(seed, n))) for n in (80, 160))
    assert coarse.status == "converged", coarse.message
    assert fine.status == "converged", fine.message
    assert coarse.energy == pytest.approx(fine.energy, rel=1e-2)
    places = np.linspace(0.0, 1.0, 41)
    assert rms_distance(spine_at(coarse, places), spine_at(fine, places)) < 5e-3
