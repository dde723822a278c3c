"""Thick strips between clamps at random poses: they converge, and a mesh twice as fine has the same strip."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fishbone as fb
from helpers import Json, thick
from test_random_poses import LARGEST_CONE, LARGEST_ROTATION, WIDTH, pose_scenario


def scenario_of(seed: int) -> Json:
    """The poses of the random tests of the other energies, of strips 0.002 to 0.02 as thick as wide."""
    rng = np.random.default_rng(seed)
    polar = math.acos(1.0 - rng.random() * (1.0 - math.cos(LARGEST_CONE)))
    azimuth = 2.0 * math.pi * rng.random()
    distance = rng.uniform(0.3, 0.9)
    axis = math.acos(2.0 * rng.random() - 1.0), 2.0 * math.pi * rng.random()
    angle = rng.uniform(-LARGEST_ROTATION, LARGEST_ROTATION)
    thickness = WIDTH * 10.0 ** rng.uniform(math.log10(0.002), math.log10(0.02))
    belt = pose_scenario("wunderlich", distance, polar, azimuth, *axis, angle)
    return thick(belt, thickness) | {"solver": {"elements": 80}}


@pytest.fixture(scope="module")
def found() -> list[fb.Equilibrium]:
    return [fb.solve(fb.Scenario.from_dict(scenario_of(seed))) for seed in range(1000, 1040)]


def test_nearly_all_converge(found: list[fb.Equilibrium]) -> None:
    assert sum(strip.status == "converged" for strip in found) >= 39


def test_mesh_twice_as_fine_has_the_same_strip_next_to_each(found: list[fb.Equilibrium]) -> None:
    """The energy of a false state falls as its mesh gets finer."""
    errors = [strip.error for strip in found if strip.status == "converged"]
    known = [error for error in errors if error is not None]
    assert len(known) >= len(errors) - 1
    for error in known:
        assert error.energy < 6e-3
        assert error.position < 6e-3


@pytest.mark.parametrize("seed", [2639, 2773, 2866])
def test_ribs_that_ran_to_their_bound_have_one_energy_on_every_mesh(seed: int) -> None:
    """Thick sheets whose ribs would come as close as they may over whole stretches: fine meshes had no minimum."""
    found = [fb.solve(fb.Scenario.from_dict(scenario_of(seed) | {"solver": {"elements": n}})) for n in (80, 160, 320)]
    assert [strip.status for strip in found] == ["converged"] * 3
    for strip in found:
        assert strip.stable
        assert strip.energy == pytest.approx(found[-1].energy, rel=2e-3)


def test_thick_strips_have_less_energy_than_inextensible_ones(found: list[fb.Equilibrium]) -> None:
    """They may do what the inextensible strip does, and more."""
    for strip in found[:10]:
        inextensible = fb.solve(fb.Scenario.from_dict(strip.scenario.to_dict() | {"energy": "wunderlich"}))
        if strip.status == inextensible.status == "converged":
            assert strip.energy < 1.001 * inextensible.energy


@pytest.mark.parametrize("seed", [2306, 2758])
def test_energy_that_hides_from_the_mesh_is_no_result(seed: int) -> None:
    """Minima of their meshes alone: neither a solve nor a tracker that is led there takes one."""
    tables = scenario_of(seed)
    found = fb.solve(fb.Scenario.from_dict(tables))
    assert found.status == "not_converged"
    assert "the ribs turn so fast within elements" in found.message
    end = tables["supports"][1]
    before = {**end, "position": [0.9 * x for x in end["position"]]}
    tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"supports": [tables["supports"][0], before]}))
    for share in np.linspace(0.9, 1.0, 11)[1:]:
        update = tracker.update([share * x for x in end["position"]], end["rotation"])
        assert tracker.equilibrium().status == "converged"
    assert update.status == "not_converged"
