"""Forces and moments: balance along the belt, and the gradient of the least energy.

Internal force f(u) and moment m(u) are what the belt beyond u does to the part before it, about the spine point;
reactions
are what the support does to the belt, about the support point. Balance of the part between two points gives
f = const and m(u) + x(u) × f = const; balance of the two end sections gives reaction(end) = (f, m)(U) and
reaction(start) = −(f, m)(0).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest

from cases import on_one_mesh
from helpers import (
    ENERGIES,
    Array,
    Elastica,
    Energy,
    Json,
    belt,
    clamped,
    end_wrench,
    example1,
    example2,
    internal,
    result,
    rotation_matrix,
    rotation_vector,
    solve,
    support,
)

ORIGIN = (0.0, 0.0, 0.0)
POSITION = np.array([0.06, 0.62, 0.08])
ROTATION = np.array([0.3, 0.2, -0.25])

# Relative to the largest component of the wrench, U = 1.
BALANCE_ERROR = 1e-6
# Central differences of the energy with this step; where ribs reach or leave the bound the energy has no third
# derivative.
STEP = 3e-4
GRADIENT_ERROR = 3e-5

energy_model = pytest.mark.parametrize("energy", ENERGIES)


def generic(energy: Energy) -> Json:
    return clamped(POSITION, ROTATION, energy=energy, elements=80)


def pinned_end(energy: Energy, position: Any = (0.0, 0.6, 0.0)) -> Json:
    return belt([support("start", ORIGIN, ORIGIN), support("end", position)], energy=energy, elements=80)


def pinned_pinned(energy: Energy, distance: float) -> Json:
    return belt(
        [support("start", ORIGIN), support("end", (0.0, distance, 0.0))],
        energy=energy,
        elements=80,
        bulge=(1.0, 0.0, 0.0),
    )


CASES = {"generic": generic, "example1": example1, "example2": example2, "pinned": pinned_end}
cases = pytest.mark.parametrize("name", CASES)


def largest(*fields: Array) -> float:
    return max(float(np.max(np.abs(field))) for field in fields)


# ------------------------------------------------------------------------------------------------- balance


@energy_model
@cases
def test_internal_force_is_constant(energy: Energy, name: str) -> None:
    """No loads between the supports: f' = 0."""
    force, _ = internal(solve(CASES[name](energy)))
    assert largest(force - force[0]) < BALANCE_ERROR * largest(force)


@energy_model
@cases
def test_internal_moment_changes_by_the_lever_of_the_force(energy: Energy, name: str) -> None:
    """m(u) + x(u) × f = const."""
    equilibrium = solve(CASES[name](energy))
    force, moment = internal(equilibrium)
    total = moment + np.cross(equilibrium.position, force)
    assert largest(total - total[0]) < BALANCE_ERROR * largest(force, moment)


@energy_model
@cases
def test_support_at_the_end_is_what_lies_beyond_it(energy: Energy, name: str) -> None:
    """At u = U the part before u is the whole belt, and only the support is beyond u."""
    equilibrium = solve(CASES[name](energy))
    force, moment = internal(equilibrium)
    wrench = end_wrench(equilibrium, "end")
    error = largest(wrench - np.concatenate([force[-1], moment[-1]]))
    assert error < BALANCE_ERROR * largest(force, moment)


@energy_model
@cases
def test_support_at_the_start_holds_what_lies_beyond_it(energy: Energy, name: str) -> None:
    """At u = 0 the part before is empty but for the support: reaction + internal = 0."""
    equilibrium = solve(CASES[name](energy))
    force, moment = internal(equilibrium)
    wrench = end_wrench(equilibrium, "start")
    error = largest(wrench + np.concatenate([force[0], moment[0]]))
    assert error < BALANCE_ERROR * largest(force, moment)


@energy_model
@cases
def test_reactions_hold_the_belt_in_balance(energy: Energy, name: str) -> None:
    """Forces sum to 0; moments about the origin too."""
    equilibrium = solve(CASES[name](energy))
    start, end = end_wrench(equilibrium, "start"), end_wrench(equilibrium, "end")
    first, last = equilibrium.position[0], equilibrium.position[-1]
    force = start[:3] + end[:3]
    moment = start[3:] + end[3:] + np.cross(first, start[:3]) + np.cross(last, end[:3])
    assert largest(force, moment) < BALANCE_ERROR * largest(start, end)


@energy_model
def test_reactions_are_those_of_the_result(energy: Energy) -> None:
    """`reaction(at)` and `supports[]` agree, in the order of the scenario's supports."""
    equilibrium = solve(generic(energy))
    supports = result(equilibrium)["supports"]
    assert [s["at"] for s in supports] in (["start", "end"], [0.0, 1.0])
    for entry, at in zip(supports, ("start", "end"), strict=True):
        force, moment = equilibrium.reaction(at)
        assert entry["force"] == pytest.approx(force, rel=1e-12)
        assert entry["moment"] == pytest.approx(moment, rel=1e-12)


@energy_model
def test_internal_moment_does_the_work_of_bending_at_the_clamp(energy: Energy) -> None:
    """In a planar belt the moment is R_f ω_ζ about ζ = +z, f is the thrust: m = R_f ω_ζ(u) to discretisation error
    O(h²)."""
    equilibrium = solve(clamped((0.0, 0.6, 0.0), energy=energy, rigidity=2.0, elements=160))
    _, moment = internal(equilibrium)
    expected = 2.0 * Elastica(0.6).bend(equilibrium.u)
    assert largest(moment[:, :2]) < 1e-4
    assert largest(moment[:, 2] - expected) < 1e-4 * largest(expected)


# ------------------------------------------------------------------------------------------------ gradient


def displaced(scenario: Json, at: Literal["start", "end"], direction: int, step: float) -> Json:
    """The scenario with one support moved along a world axis (0-2) or turned about one through itself (3-5)."""
    poses: dict[str, tuple[Array, Array]] = {}
    for entry in scenario["supports"]:
        position = np.array(entry["position"])
        rotation = np.array(entry["rotation"])
        if entry["at"] == at:
            change = np.zeros(3)
            change[direction % 3] = step
            if direction < 3:
                position = position + change
            else:
                rotation = rotation_vector(rotation_matrix(change) @ rotation_matrix(rotation))
        poses[entry["at"]] = (position, rotation)
    return clamped(
        *poses["end"],
        start_position=poses["start"][0],
        start_rotation=poses["start"][1],
        energy=scenario["energy"],
        elements=80,
    )


@energy_model
@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("name", ["generic", "example2"])
def test_reaction_is_the_gradient_of_the_least_energy(energy: Energy, at: Literal["start", "end"], name: str) -> None:
    """CONTRACT: + the gradient by that support's translation and left, world-axes rotation about the support point."""
    scenario = on_one_mesh(CASES[name](energy))
    wrench = end_wrench(solve(scenario), at)
    gradient = np.array(
        [
            (
                solve(displaced(scenario, at, direction, STEP)).energy
                - solve(displaced(scenario, at, direction, -STEP)).energy
            )
            / (2.0 * STEP)
            for direction in range(6)
        ]
    )
    assert largest(gradient - wrench) < GRADIENT_ERROR * largest(wrench)


# -------------------------------------------------------------------------------------------- free and pinned


@energy_model
def test_pinned_end_takes_no_moment(energy: Energy) -> None:
    """Orientation free: reaction moment 0, force not 0."""
    wrench = end_wrench(solve(pinned_end(energy, (0.05, 0.6, 0.1))), "end")
    assert largest(wrench[3:]) < 1e-6 * largest(wrench[:3])
    assert largest(wrench[:3]) > 1.0


@energy_model
def test_pinned_end_costs_less_than_a_clamped_one(energy: Energy) -> None:
    """Every shape that fits the clamp fits the pin."""
    clamp = solve(clamped((0.05, 0.6, 0.1), energy=energy, elements=80))
    pin = solve(pinned_end(energy, (0.05, 0.6, 0.1)))
    assert pin.energy < clamp.energy * (1.0 - 1e-3)


@energy_model
@pytest.mark.parametrize("distance", [0.5, 0.8])
def test_belt_pinned_at_both_ends_takes_half_a_wave(energy: Energy, distance: float) -> None:
    """The first buckled elastica between pins: the clamped one's k at λ = 2K/U, a quarter of its energy and thrust.

    Only |force| is compared: the belt is free to swing about the line through its pins.
    """
    elastica = Elastica(distance)
    equilibrium = solve(pinned_pinned(energy, distance))
    assert equilibrium.energy == pytest.approx(elastica.energy / 4.0, rel=1e-5)
    for at in ("start", "end"):
        force, moment = equilibrium.reaction(at)
        assert np.linalg.norm(force) == pytest.approx(elastica.thrust / 4.0, rel=1e-4)
        assert largest(np.asarray(moment)) < 1e-5


def test_belt_pinned_at_both_ends_is_as_high_as_a_clamped_one() -> None:
    """Height 2k/λ, λ = 2K/U, like the clamped belt; from the line through the pins, which it may swing about."""
    equilibrium = solve(pinned_pinned("wunderlich", 0.8))
    off_line = np.hypot(equilibrium.position[:, 0], equilibrium.position[:, 2])
    assert float(np.max(off_line)) == pytest.approx(Elastica(0.8).height, abs=1e-4)


@energy_model
def test_belt_clamped_at_one_end_is_flat(energy: Energy) -> None:
    """Nothing holds the other end: natural state, no energy, no force, moved with the clamp."""
    position, rotation = np.array([0.3, -0.2, 0.7]), np.array([0.4, 0.9, -0.3])
    equilibrium = solve(belt([support("start", position, rotation)], energy=energy))
    frame = rotation_matrix(rotation)
    line = position + equilibrium.u[:, None] * frame[:, 1]
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(equilibrium.position - line)) < 1e-7
    assert np.max(np.abs(equilibrium.frame - frame)) < 1e-7
    assert np.max(np.abs(equilibrium.bend)) < 1e-7
    force, moment = internal(equilibrium)
    assert largest(force, moment) < 1e-7
    assert largest(end_wrench(equilibrium, "start")) < 1e-7


@energy_model
def test_belt_clamped_at_its_far_end_is_flat(energy: Energy) -> None:
    """The start is the free end: x(0) = c − U η."""
    position, rotation = np.array([0.3, -0.2, 0.7]), np.array([0.4, 0.9, -0.3])
    equilibrium = solve(belt([support("end", position, rotation)], energy=energy))
    frame = rotation_matrix(rotation)
    line = position + (equilibrium.u[:, None] - 1.0) * frame[:, 1]
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(equilibrium.position - line)) < 1e-7


def test_slide_takes_no_force_along_itself() -> None:
    """CONTRACT: a component of a position may be "free". The end slides along y: no reaction along y, and less
    energy."""
    scenario = clamped((0.2, 0.8, 0.05), energy="wunderlich", elements=80)
    held = solve(scenario)
    scenario["supports"][1]["position"] = [0.2, "free", 0.05]
    sliding = solve(scenario)
    force, _ = sliding.reaction("end")
    assert abs(float(force[1])) < 1e-5
    assert sliding.energy < held.energy * (1.0 - 1e-3)
    assert sliding.position[-1, [0, 2]] == pytest.approx([0.2, 0.05], abs=1e-7)


# --------------------------------------------------------------------------------------------- square ribs


@energy_model
@pytest.mark.parametrize("name", ["generic", "example1", "example2"])
def test_ribs_are_square_at_clamps(energy: Energy, name: str) -> None:
    """Eq. (45), (46), (50): β = 0 at an end with both position and rotation, by default."""
    slope = solve(CASES[name](energy)).rib_slope
    assert abs(slope[0]) < 1e-8
    assert abs(slope[-1]) < 1e-8


@energy_model
def test_rib_at_a_pinned_end_is_free(energy: Energy) -> None:
    """CONTRACT: `square_rib` is false by default where the orientation is free."""
    scenario = pinned_end(energy, (0.05, 0.6, 0.2))
    default = solve(scenario)
    scenario["supports"][1]["square_rib"] = False
    assert solve(scenario).energy == pytest.approx(default.energy, rel=1e-12)
    assert abs(default.rib_slope[0]) < 1e-8


def test_rib_at_a_pinned_end_leans_with_the_twist() -> None:
    """With the other energies the rib is not determined: no moment, so no bend, so its slope costs no energy."""
    assert abs(solve(pinned_end("wunderlich", (0.05, 0.6, 0.2))).rib_slope[-1]) > 1e-3


@energy_model
@pytest.mark.parametrize("end", ["start", "end"])
def test_square_rib_is_honoured_at_each_end_by_itself(energy: Energy, end: str) -> None:
    """`square_rib = false` at one end only: that rib leans, the other stays square, and the energy falls."""
    scenario = generic(energy)
    free = {"start": 0, "end": 1}[end]
    scenario["supports"][free]["square_rib"] = False
    equilibrium = solve(scenario)
    slopes = equilibrium.rib_slope[[0, -1]]
    assert abs(slopes[1 - free]) < 1e-8
    assert abs(slopes[free]) > 1e-3
    assert equilibrium.energy < solve(generic(energy)).energy
