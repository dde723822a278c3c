"""Own weight and dead forces: cantilevers against SciPy's boundary value solver, and buckling under own weight.

MODEL §2: the potential of the loads is −∫ ρ g·x du − Σ F·(x + Rℓ), the mass lumped on the spine.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    ORIGIN,
    Cantilever,
    Energy,
    Json,
    board,
    internal,
    load_potential,
    solve,
    spine_integrals,
    straight,
    support,
)

LEVELS = (1.0, 5.0, 20.0, 50.0)
TIP_ERROR = 1e-5
ENERGY_ERROR = 1e-5
# Sadowsky ribbon, clamped at one end, gravity along its width (MODEL §6).
BUCKLING_WEIGHT = 21.491

energy_model = pytest.mark.parametrize("energy", ENERGIES)


def cantilever(
    energy: Energy = "wunderlich", *, elements: int = 160, square_rib: bool | None = None, **options: Any
) -> Json:
    """Clamped at u = 0 in the natural pose, free at u = 1."""
    clamp = support("start", ORIGIN, ORIGIN, square_rib)
    return board([straight(1.0)], [clamp], energy=energy, elements=elements, **options)


def heavy(weight: float, energy: Energy = "wunderlich") -> Json:
    """Flat and level at the clamp, gravity along −x: across the belt's face."""
    return cantilever(energy, density=weight / 9.81, gravity=(-9.81, 0.0, 0.0))


def pulled(force: tuple[float, float], lever: tuple[float, float] = (0.0, 0.0)) -> Json:
    load: Json = {"at": "end", "force": [*force, 0.0]}
    if any(lever):
        load["lever"] = [*lever, 0.0]
    return cantilever(points=[load])


# -------------------------------------------------------------------------------------------- the reference itself


def test_light_reference_cantilever_sags_by_an_eighth_of_its_weight() -> None:
    """Linear beam: tip deflection q U⁴/8 R_f under own weight, F U³/3 R_f under a tip force, M U²/2 R_f by a couple."""
    assert Cantilever(weight=1e-3).tip[0] == pytest.approx(-1e-3 / 8.0, rel=1e-5)
    assert Cantilever(force=(1e-3, 0.0)).tip[0] == pytest.approx(1e-3 / 3.0, rel=1e-5)
    turned = Cantilever(force=(0.0, 1e-4), lever=(1.0, 0.0)).tip[0]
    assert turned == pytest.approx(-1e-4 / 2.0, rel=1e-3)


# --------------------------------------------------------------------------------------------------- heavy elastica


@pytest.mark.parametrize("weight", LEVELS)
def test_heavy_cantilever_follows_the_elastica(weight: float) -> None:
    """q U³/R_f from 1 to 50: every node, the tip among them."""
    equilibrium = solve(heavy(weight))
    expected = Cantilever(weight=weight).position(equilibrium.u)
    assert float(np.max(np.abs(equilibrium.position - expected))) < TIP_ERROR


@pytest.mark.parametrize("weight", LEVELS)
def test_heavy_cantilever_stores_the_energy_of_the_elastica(weight: float) -> None:
    """`elastic_energy` leaves out the potential of the weight."""
    expected = Cantilever(weight=weight).elastic_energy
    assert solve(heavy(weight)).elastic_energy == pytest.approx(expected, rel=ENERGY_ERROR)


@energy_model
def test_energies_agree_on_a_heavy_cantilever(energy: Energy) -> None:
    """β = 0 in the plane."""
    equilibrium = solve(heavy(5.0, energy))
    assert equilibrium.position[-1] == pytest.approx(Cantilever(weight=5.0).tip, abs=TIP_ERROR)


@pytest.mark.parametrize("weight", LEVELS)
def test_clamp_carries_the_whole_weight(weight: float) -> None:
    """Force (q U, 0, 0); moment about the clamp −∫ x × ρ g du."""
    equilibrium = solve(heavy(weight))
    force, moment = equilibrium.reaction("start")
    centre = np.sum(spine_integrals(equilibrium), axis=0)
    assert force == pytest.approx([weight, 0.0, 0.0], abs=1e-6 * weight)
    assert moment == pytest.approx(np.cross(centre, [weight, 0.0, 0.0]), abs=1e-6 * weight)


def test_internal_force_falls_to_nothing_at_the_free_end() -> None:
    """f(u) = ρ g (U − u): the weight of what lies beyond."""
    equilibrium = solve(heavy(5.0))
    force, moment = internal(equilibrium)
    assert force[:, 0] == pytest.approx(-5.0 * (1.0 - equilibrium.u), abs=1e-6)
    assert np.max(np.abs(moment[-1])) < 1e-6


@pytest.mark.parametrize("weight", [5.0, 50.0])
def test_energy_holds_the_potential_of_the_weight(weight: float) -> None:
    """Energy − elastic energy = −∫ ρ g·x du, negative where the belt hangs."""
    scenario = heavy(weight)
    equilibrium = solve(scenario)
    potential = equilibrium.energy - equilibrium.elastic_energy
    assert potential == pytest.approx(load_potential(equilibrium, scenario), rel=1e-7)
    assert potential < 0.0


def test_weight_in_another_unit_is_no_energy_without_a_least_value() -> None:
    """A clamped belt falls no farther than its length: the units are named instead."""
    equilibrium = fb.solve(fb.Scenario.from_dict(heavy(1e12)))
    assert equilibrium.status == "not_converged"
    assert "the loads are 1e12 R_f/U² together; check their units" in equilibrium.message


def test_weight_without_gravity_does_nothing() -> None:
    equilibrium = solve(cantilever(density=3.0))
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(equilibrium.position[:, [0, 2]])) < 1e-7


# ------------------------------------------------------------------------------------------------------ dead forces


@pytest.mark.parametrize("force", [(-3.0, 0.0), (-8.0, 2.0), (2.0, -2.0)])
def test_tip_force_bends_the_cantilever_as_the_elastica(force: tuple[float, float]) -> None:
    """In the plane, at the free end: across, across and along, pushing."""
    equilibrium = solve(pulled(force))
    expected = Cantilever(force=force)
    assert float(np.max(np.abs(equilibrium.position - expected.position(equilibrium.u)))) < TIP_ERROR
    assert equilibrium.elastic_energy == pytest.approx(expected.elastic_energy, rel=ENERGY_ERROR)


@pytest.mark.parametrize("force", [(-3.0, 0.0), (-8.0, 2.0)])
def test_lever_turns_with_the_tip(force: tuple[float, float]) -> None:
    """A lever in body axes: the moment at the tip is (Rℓ) × F."""
    lever = (0.1, 0.05)
    equilibrium = solve(pulled(force, lever))
    expected = Cantilever(force=force, lever=lever)
    assert float(np.max(np.abs(equilibrium.position - expected.position(equilibrium.u)))) < TIP_ERROR


SPATIAL = {"at": 0.7, "force": [-1.0, 0.3, 0.4], "lever": [0.05, -0.02, 0.04]}


@pytest.mark.parametrize("gravity", [None, (-1.0, 0.2, 0.1)])
@energy_model
def test_energy_holds_the_potential_of_a_force_on_a_lever(energy: Energy, gravity: Any) -> None:
    """Energy − elastic energy = −F·(x + Rℓ) − ∫ ρ g·x du, in space and inside the span."""
    scenario = cantilever(energy, elements=100, points=[SPATIAL], gravity=gravity, density=1.0)
    equilibrium = solve(scenario)
    potential = equilibrium.energy - equilibrium.elastic_energy
    assert potential == pytest.approx(load_potential(equilibrium, scenario), rel=1e-7)


@energy_model
def test_clamp_balances_a_force_on_a_lever(energy: Energy) -> None:
    """Force −F, moment −(x + Rℓ) × F about the clamp at the origin."""
    equilibrium = solve(cantilever(energy, elements=100, points=[SPATIAL]))
    k = int(np.argmin(np.abs(equilibrium.u - 0.7)))
    applied = np.array(SPATIAL["force"])
    acts_at = equilibrium.position[k] + equilibrium.frame[k] @ np.array(SPATIAL["lever"])
    force, moment = equilibrium.reaction("start")
    assert force == pytest.approx(-applied, abs=1e-7)
    assert moment == pytest.approx(-np.cross(acts_at, applied), abs=1e-7)


@energy_model
def test_belt_beyond_the_last_load_is_not_bent(energy: Energy) -> None:
    """Nothing acts there: no internal force, no bend, but for what the mesh smears over a few elements."""
    equilibrium = solve(cantilever(energy, elements=100, points=[{"at": 0.7, "force": [-1.0, 0.3, 0.4]}]))
    beyond = equilibrium.u > 0.7 + 1e-9
    force, moment = internal(equilibrium)
    assert np.max(np.abs(force[beyond])) < 1e-7
    assert np.max(np.abs(moment[beyond])) < 1e-7
    assert np.max(np.abs(equilibrium.bend[equilibrium.u > 0.8])) < 1e-5


def test_two_loads_at_one_point_are_their_sum() -> None:
    halves = [{"at": "end", "force": [-1.5, 0.0, 0.0]}] * 2
    twice = solve(cantilever(points=halves))
    once = solve(pulled((-3.0, 0.0)))
    assert twice.energy == pytest.approx(once.energy, rel=1e-9)
    assert np.max(np.abs(twice.position - once.position)) < 1e-8


# -------------------------------------------------------------------------------------------- buckling by own weight


PUSH = 0.002
NEAR = (22.0, 22.5, 23.0, 24.0, 25.0)


def on_edge(weight: float, energy: Energy, width: float, *, square_rib: bool, push: float) -> Json:
    """Gravity along −z, the belt standing on edge, its tip pushed towards +x."""
    return cantilever(
        energy,
        elements=100,
        square_rib=square_rib,
        width=width,
        density=1.0,
        gravity=(0.0, 0.0, -weight),
        points=[{"at": "end", "force": [push, 0.0, 0.0]}] if push else None,
        bulge=(1.0, 0.0, 0.0),
    )


def buckled(
    weight: float, energy: Energy = "sadowsky", width: float = 0.02, *, square_rib: bool = False
) -> fb.Equilibrium:
    """The state above the threshold that has left the plane.

    The flat belt is in equilibrium too, and with square ribs it takes a finite change of them to see that it is not
    stable; a push of 1e-4 of the weight decides.
    """
    equilibrium = solve(on_edge(weight, energy, width, square_rib=square_rib, push=PUSH))
    assert equilibrium.stable is not False
    assert float(equilibrium.position[-1, 0]) > 0.1, "the belt has not buckled towards the push"
    return equilibrium


def threshold(energy: Energy, width: float, weights: tuple[float, ...] = NEAR, *, square_rib: bool = False) -> float:
    """Weight at which the buckled state has no amplitude, the elastic energy being its square: by a parabola."""
    squares = [buckled(q, energy, width, square_rib=square_rib).elastic_energy for q in weights]
    return float(np.polynomial.Polynomial.fit(squares, weights, 2)(0.0))


def test_narrow_ribbon_buckles_under_its_weight_at_the_published_threshold() -> None:
    """q U³/R_f = 21.491 for the Sadowsky ribbon, its rib at the clamp free; 21.455 in an independent transcription."""
    assert threshold("sadowsky", 0.02) == pytest.approx(BUCKLING_WEIGHT, rel=0.01)


def test_light_ribbon_stands_on_edge() -> None:
    """Below the threshold nothing is gained by leaving the plane."""
    equilibrium = solve(on_edge(20.0, "sadowsky", 0.02, square_rib=False, push=0.0))
    assert np.max(np.abs(equilibrium.position[:, [0, 2]])) < 1e-4
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-6)


def test_flat_ribbon_above_the_threshold_is_not_called_stable() -> None:
    """Without a disturbing force the result of `solve` has either left the plane or is not a minimum."""
    equilibrium = solve(on_edge(25.0, "sadowsky", 0.02, square_rib=False, push=0.0))
    assert abs(float(equilibrium.position[-1, 0])) > 0.1 or equilibrium.stable is not True


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_ribbon_falls_to_the_side_of_the_bulge(side: float) -> None:
    """CONTRACT: `bulge` chooses between mirror images, here x → −x, which differ in nothing else."""
    scenario = on_edge(25.0, "sadowsky", 0.02, square_rib=False, push=0.0)
    scenario["solver"]["bulge"] = [side, 0.0, 0.0]
    equilibrium = solve(scenario)
    tip = float(equilibrium.position[-1, 0])
    assert abs(tip) < 1e-4 or tip * side > 0.0


def test_rib_at_the_clamp_leans_by_45_degrees_as_a_narrow_ribbon_buckles() -> None:
    """MODEL §6: rib slope 1.00; its sign says to which side the belt falls."""
    for weight in (22.0, 25.0):
        assert abs(float(buckled(weight).rib_slope[0])) == pytest.approx(1.0, rel=0.02)


def test_buckled_ribbon_sinks() -> None:
    """The potential falls by more than the bending costs."""
    equilibrium = buckled(25.0)
    assert equilibrium.energy < 0.0 < equilibrium.elastic_energy
    assert equilibrium.position[-1, 2] < -0.05


def test_wider_ribbon_buckles_a_little_later() -> None:
    """`wunderlich` is above `sadowsky`: by 0.3 % in an independent transcription, where ribs are free."""
    assert threshold("sadowsky", 0.02) < threshold("wunderlich", 0.1) < 1.25 * BUCKLING_WEIGHT


def test_square_rib_at_the_clamp_holds_a_wide_ribbon_up_longer() -> None:
    """By 9 %: a belt of width U/10 must turn its ribs within the first tenth of its length."""
    square = threshold("wunderlich", 0.1, (25.0, 26.0, 27.0, 28.0), square_rib=True)
    assert 1.02 * threshold("wunderlich", 0.1) < square < 1.25 * BUCKLING_WEIGHT


def test_strip_pressed_in_its_plane_between_clamps_buckles() -> None:
    """Pressed on edge at its middle by 200 R_f/U², far above what it bears flat."""
    slide: Json = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, 0.0, 0.0]}
    press: Json = {"at": 0.5, "force": [0.0, 0.0, -200.0]}
    scenario = board([straight(1.0)], [support("start", ORIGIN, ORIGIN), slide], points=[press], elements=80)
    belt = solve(scenario)
    assert belt.energy < -0.4
    assert belt.stable is True


def test_part_of_a_belt_may_buckle_under_its_weight() -> None:
    """A clamp in the middle: what is beyond it is a cantilever on edge above its threshold."""
    clamp: Json = {"at": 1.0, "position": [0.0, 0.8, 0.0], "rotation": [0.0, 0.0, 0.0], "square_rib": True}
    supports = [support("start", ORIGIN, ORIGIN), clamp]
    belt = solve(board([straight(2.0)], supports, density=1.0, gravity=(0.0, 0.0, -24.0)))
    beyond = belt.u > 1.0
    assert np.max(np.abs(belt.bend[beyond])) > 0.1
    assert not any("flat" in warning for warning in belt.warnings)
