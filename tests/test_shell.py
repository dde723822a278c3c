"""The spine against a thin elastic shell, an independent finite-element computation (data/README.md).

Solver settings are the defaults. Bounds are RMS distances over 101 points of the centre line, in U.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cases import on_one_mesh
from helpers import ENERGIES, Energy, distance_to_shell, shell, shell_scenario, solve

# Validation README, with room for the default 80 elements: example 1 1.3e-3, example 2 5.3e-3.
BOUNDS = {
    "example1": 1.5e-3,
    "example2": 6e-3,
    "offset05": 1.2e-3,
    "offset10_far": 1.5e-3,
    "planar": 2e-4,
}
FALLING_THICKNESS = (
    ("example1_2h", "example1", "example1_h2", "example1_h4"),
    ("example2_2h", "example2", "example2_h2", "example2_h4"),
)


@pytest.mark.parametrize(("name", "bound"), BOUNDS.items())
def test_centre_line_is_close_to_the_shell(name: str, bound: float) -> None:
    """RMS distance for the default energy."""
    assert distance_to_shell(name, "wunderlich") <= bound


@pytest.mark.parametrize("names", FALLING_THICKNESS, ids=["example1", "example2"])
def test_shell_tends_to_wunderlich_as_it_gets_thinner(names: tuple[str, ...]) -> None:
    """Validation README: RMS distance falls with thickness."""
    distances = [distance_to_shell(name, "wunderlich") for name in names]
    assert all(thick > thin for thick, thin in itertools.pairwise(distances)), distances


@pytest.mark.parametrize("names", FALLING_THICKNESS, ids=["example1", "example2"])
def test_shell_energy_rises_towards_wunderlich_as_it_gets_thinner(names: tuple[str, ...]) -> None:
    """An elastic sheet may stretch, so it stores less than the inextensible belt; the gap closes with thickness."""
    gaps = [solve(shell_scenario(name, "wunderlich")).energy - shell(name)["energy"] for name in names]
    assert all(thick > thin > 0.0 for thick, thin in itertools.pairwise(gaps)), gaps


@pytest.mark.parametrize("other", ["fishbone", "sadowsky"])
def test_other_energies_are_farther_from_the_thinnest_shell(other: Energy) -> None:
    """Validation README: both level off near 1e-2 U in example 2, `wunderlich` goes on falling."""
    assert distance_to_shell("example2_h4", other) > 2.0 * distance_to_shell("example2_h4", "wunderlich")


@pytest.mark.parametrize("energy", ENERGIES)
def test_shell_and_belt_are_on_the_same_side(energy: Energy) -> None:
    """Not the mirror image: the shell's peak is at x > 0, and the default bulge is +x."""
    for name in BOUNDS:
        height = float(np.max(np.array(shell(name)["position"])[:, 0]))
        equilibrium = solve(shell_scenario(name, energy))
        assert float(np.max(equilibrium.position[:, 0])) == pytest.approx(height, abs=0.02)


@pytest.mark.parametrize("name", ["example1", "example2"])
def test_surface_normal_is_close_to_that_of_the_shell(name: str) -> None:
    """ξ within 12° everywhere: the frame convention (ξ normal, η tangent), not its sign or order, is what this
    tests."""
    data = shell(name)
    frame = solve(on_one_mesh(shell_scenario(name, "wunderlich"))).frame[::4]
    normal = np.array(data["normal"])[::5]
    tangent = np.array(data["tangent"])[::5]
    assert np.min(np.sum(frame[:, :, 0] * normal, axis=1)) > np.cos(np.radians(12.0))
    assert np.min(np.sum(frame[:, :, 1] * tangent, axis=1)) > np.cos(np.radians(12.0))
