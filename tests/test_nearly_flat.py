"""Boards with arcs that lie flat, or nearly so: their energy off the plane, and paths that begin and end in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import fishbone as fb
from fishbone.names import EnergyModel
from helpers import ENERGIES, clamped

RADIUS = 2.0 / math.pi
START = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
# The quarter arc ends here, where it lies flat.
END = [0.0, RADIUS, RADIUS]


def _arc(end: dict[str, Any], *, width: float = 0.03, energy: str = "wunderlich") -> fb.Scenario:
    arc = {"kind": "arc", "length": 1.0, "curvature": 1.0 / RADIUS}
    belt = {"width": width, "rigidity": 1.0, "segments": [arc]}
    supports = [START, {"at": "end", **end}]
    # The arc bulges to the other side than it is lifted to.
    tables = {"belt": belt, "energy": energy, "supports": supports, "solver": {"bulge": [-1.0, 0.0, 0.0]}}
    return fb.Scenario.from_dict(tables)


def _lifted(lift: float, **belt: Any) -> fb.Equilibrium:
    return fb.solve(_arc({"position": [lift, "free", "free"]}, **belt))


def _clamped(lift: float) -> fb.Scenario:
    return _arc({"position": [lift, *END[1:]], "rotation": [math.pi / 2, 0.0, 0.0]})


def _of_narrow_arc() -> float:
    """Energy over the square of the lift of a narrow quarter arc, by Castigliano's theorem.

    A force at the end bends the arc with the moment M and twists it with T. The ribs that give way most have the
    complementary energy ((|M| + hypot(M, T))/2)²/2.
    """

    def compliance(angle: float) -> float:
        bending, twisting = RADIUS * math.sin(angle), RADIUS * (1.0 - math.cos(angle))
        return (0.5 * (bending + math.hypot(bending, twisting))) ** 2 * RADIUS

    return 0.5 / quad(compliance, 0.0, math.pi / 2)[0]


@pytest.mark.parametrize("lift", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_energy_of_a_narrow_arc_is_the_square_of_its_lift_times_castigliano_s_constant(lift: float) -> None:
    belt = _lifted(lift, width=1e-3, energy="sadowsky")
    assert belt.status == "converged"
    assert belt.stable
    # The width and the lift itself count in the fourth digit.
    assert belt.energy / lift**2 == pytest.approx(_of_narrow_arc(), rel=3e-4)
    assert belt.reaction("end").force[0] / lift == pytest.approx(2.0 * _of_narrow_arc(), rel=3e-4)


def test_energy_over_the_square_of_the_lift_is_a_constant_and_half_the_force() -> None:
    lifts = [1e-3, 1e-4, 1e-5, 1e-6]
    belts = [_lifted(lift) for lift in lifts]
    energies = [belt.energy / lift**2 for belt, lift in zip(belts, lifts, strict=True)]
    forces = [belt.reaction("end").force[0] / lift for belt, lift in zip(belts, lifts, strict=True)]
    assert np.allclose(energies, energies[-1], rtol=2e-6)
    assert np.allclose(forces, 2.0 * np.array(energies), rtol=1e-5)
    assert all(belt.iterations <= 100 for belt in belts)
    # A board as flat as that is no more accurate than another.
    assert np.allclose([belt.error.energy for belt in belts], belts[0].error.energy, rtol=1e-3)
    assert belts[0].error.energy > 1e-5


def test_error_of_next_to_nothing_is_not_known_and_that_of_a_flat_board_nought() -> None:
    belt = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    tip = {"points": [{"at": "end", "force": [1e-8, 0.0, 0.0]}]}
    bent = fb.solve(fb.Scenario.from_dict({"belt": belt, "supports": [START], "loads": tip}))
    assert bent.status == "converged"
    assert bent.energy == pytest.approx(-(1e-8**2) / 6.0, rel=1e-6)
    assert math.isnan(bent.error.energy)
    assert bent.to_dict()["error"]["energy"] is None
    assert len(bent.u) < 200
    flat = _lifted(0.0)
    assert flat.error.energy == flat.error.force == flat.error.radius == 0.0
    assert len(flat.u) < 300


@pytest.mark.parametrize("lift", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("held", ["pose", "position", "height and rotation"])
def test_arc_held_in_its_plane_has_the_energy_and_force_of_a_larger_lift_in_proportion(held: str, lift: float) -> None:
    """The plane shortens it by the square of the lift, which at 1e-7 is 50 roundings of a position."""

    def solved(height: float) -> fb.Equilibrium:
        position = [height, "free", "free"] if held == "height and rotation" else [height, *END[1:]]
        turn = {} if held == "position" else {"rotation": [math.pi / 2, 0.0, 0.0]}
        return fb.solve(_arc({"position": position} | turn))

    near, far = solved(lift), solved(5e-3)
    assert near.status == far.status == "converged"
    assert near.stable
    assert near.energy / lift**2 == pytest.approx(far.energy / 5e-3**2, rel=1e-3)
    if lift >= 1e-6:
        assert near.reaction("end").force[0] == pytest.approx(2.0 * near.energy / lift, rel=2e-3)


def test_energy_of_a_wide_arc_is_the_square_of_its_lift() -> None:
    """Such an arc is found off its plane by a tenth, and brought back."""
    energies = []
    for lift in (1e-5, 1e-3, 5e-3):
        lifted = fb.solve(_arc({"position": [lift, *END[1:]]}, width=0.1), strict=True)
        assert lifted.stable
        energies.append(lifted.energy / lift**2)
    assert energies == pytest.approx([energies[0]] * 3, rel=1e-3)


@pytest.mark.parametrize("slack", [1e-6, 1e-8])
def test_strip_with_hardly_any_slack_has_eulers_energy_and_force(slack: float) -> None:
    strip = fb.solve(fb.Scenario.from_dict(clamped((0.0, 1.0 - slack, 0.0))))
    assert strip.status == "converged"
    euler = 4.0 * math.pi**2
    assert strip.energy / slack == pytest.approx(euler, rel=1e-5)
    assert -strip.reaction("end").force[1] == pytest.approx(euler, rel=1e-5)


def test_tracker_leads_an_arc_off_the_plane_and_back() -> None:
    tracker = fb.Tracker(_clamped(0.0), "end")
    heights = [0.02, 0.05, 0.1, 0.05, 0.02, 0.0]
    turn = [math.pi / 2, 0.0, 0.0]
    updates = [tracker.update([height, *END[1:]], turn) for height in heights]
    assert all(update.status == "converged" and not update.snapped for update in updates)
    energies = [update.energy for update in updates]
    assert energies[3:5] == pytest.approx(energies[1::-1], rel=1e-4)
    assert energies[-1] == pytest.approx(0.0, abs=1e-12)


def test_path_leads_an_arc_off_the_plane() -> None:
    diagram = fb.follow(_clamped(0.0), {"supports[1].position[0]": 0.1})
    branch = diagram.branches[0]
    assert branch.end == "range"
    assert branch.energy[0] == pytest.approx(0.0, abs=1e-12)
    near = fb.solve(_clamped(float(branch.parameter[2])))
    assert branch.energy[2] == pytest.approx(near.energy, rel=2e-3)


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize(
    ("curvature", "width"), [(2.0, 0.3), (2.0, 0.2), (4.0, 0.05), (4.0, 0.1), (6.0, 0.03), (6.0, 0.1), (2.0, 0.5)]
)
def test_unloaded_flat_arc_is_stable(energy: EnergyModel, curvature: float, width: float) -> None:
    """Its energy is 0, and none is negative."""
    belt = {"width": width, "rigidity": 1.0, "segments": [{"kind": "arc", "length": 1.0, "curvature": curvature}]}
    held = [{"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}]
    found = fb.solve(fb.Scenario.from_dict({"energy": energy, "belt": belt, "supports": held}), strict=True)
    assert found.energy == pytest.approx(0.0, abs=1e-20)
    assert found.stable
