"""Changes of a scenario that must not change its equilibrium, or must change it in a known way."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    Array,
    Energy,
    Json,
    belt,
    clamped,
    end_wrench,
    example1,
    example2,
    numbers,
    result,
    rotation_matrix,
    rotation_vector,
    solve,
    support,
)

# Two solves of the same problem in other coordinates agree to the solver's tolerance, not to rounding.
ENERGY_ERROR = 1e-6
POSITION_ERROR = 1e-5
REACTION_ERROR = 1e-4

# A pose without any symmetry of its own.
POSITION = np.array([0.06, 0.62, 0.08])
ROTATION = np.array([0.3, 0.2, -0.25])

# A rigid motion without any special direction.
TURN = rotation_matrix([0.7, -1.1, 0.4])
SHIFT = np.array([0.3, -2.0, 0.9])

HALF_TURN_ABOUT_NORMAL = np.diag([1.0, -1.0, -1.0])

energy_model = pytest.mark.parametrize("energy", ENERGIES)


def generic(energy: Energy, **options: Any) -> Json:
    return clamped(POSITION, ROTATION, energy=energy, elements=80, **options)


def assert_same_shape(actual: Array, expected: Array, scale: float = 1.0) -> None:
    assert np.max(np.abs(actual - expected)) < POSITION_ERROR * scale


def assert_same_wrench(actual: Array, expected: Array) -> None:
    assert np.max(np.abs(actual - expected)) < REACTION_ERROR * np.max(np.abs(expected))


# ------------------------------------------------------------------------------------------- rigid motion


def moved(energy: Energy) -> Json:
    return clamped(
        TURN @ POSITION + SHIFT,
        rotation_vector(TURN @ rotation_matrix(ROTATION)),
        start_position=SHIFT,
        start_rotation=rotation_vector(TURN),
        energy=energy,
        elements=80,
        bulge=TURN[:, 0],
    )


@energy_model
def test_energy_does_not_depend_on_rigid_motion(energy: Energy) -> None:
    """Both supports and the bulge direction moved together."""
    assert solve(moved(energy)).energy == pytest.approx(solve(generic(energy)).energy, rel=ENERGY_ERROR)


@energy_model
def test_shape_moves_with_the_supports(energy: Energy) -> None:
    """x → Q x + c, R → Q R; bend and rib slope, being body quantities, stay."""
    before, after = solve(generic(energy)), solve(moved(energy))
    assert_same_shape(after.position, before.position @ TURN.T + SHIFT)
    assert np.max(np.abs(after.frame - TURN @ before.frame)) < 1e-4


@energy_model
@pytest.mark.parametrize("at", ["start", "end"])
def test_reactions_turn_with_the_supports(energy: Energy, at: Any) -> None:
    """World axes, moments about the support point: the shift has no effect."""
    before, after = end_wrench(solve(generic(energy)), at), end_wrench(solve(moved(energy)), at)
    assert_same_wrench(after, np.concatenate([TURN @ before[:3], TURN @ before[3:]]))


# -------------------------------------------------------------------------------------------------- mirror


def mirrored(energy: Energy, mirror: Array) -> Json:
    """Reflected world S; body axis ξ or ζ flipped along with it, so that the frame stays right-handed: R → S R S."""
    return clamped(
        mirror @ POSITION,
        rotation_vector(mirror @ rotation_matrix(ROTATION) @ mirror),
        energy=energy,
        elements=80,
        bulge=mirror[:, 0],
    )


mirrors = pytest.mark.parametrize("mirror", [np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, 1.0, -1.0])], ids=["x", "z"])


@energy_model
@mirrors
def test_mirrored_supports_give_the_mirrored_shape(energy: Energy, mirror: Array) -> None:
    """Same energy, x → S x."""
    before, after = solve(generic(energy)), solve(mirrored(energy, mirror))
    assert after.energy == pytest.approx(before.energy, rel=ENERGY_ERROR)
    assert_same_shape(after.position, before.position @ mirror)


@energy_model
@mirrors
def test_mirrored_reactions_are_a_vector_and_an_axial_vector(energy: Energy, mirror: Array) -> None:
    """Force → S f, moment → −S m."""
    before = end_wrench(solve(generic(energy)), "end")
    after = end_wrench(solve(mirrored(energy, mirror)), "end")
    assert_same_wrench(after, np.concatenate([mirror @ before[:3], -mirror @ before[3:]]))


# --------------------------------------------------------------------------------------------------- scale


def scaled(energy: Energy, length: float, rigidity: float) -> Json:
    return clamped(
        length * POSITION,
        ROTATION,
        energy=energy,
        length=length,
        width=0.1 * length,
        rigidity=rigidity,
        elements=80,
    )


SCALES = ((1.0, 1.0), (0.2, 1.0), (0.2, 2.3e-5), (1.0, 1e-7), (1.0, 1e7), (350.0, 40.0))
scales = pytest.mark.parametrize(("length", "rigidity"), SCALES[1:])


@energy_model
@scales
def test_energy_scales_with_rigidity_over_length(energy: Energy, length: float, rigidity: float) -> None:
    """∫ R_f κ² du: R_f/U."""
    reference = solve(scaled(energy, *SCALES[0]))
    assert solve(scaled(energy, length, rigidity)).energy == pytest.approx(
        reference.energy * rigidity / length, rel=ENERGY_ERROR
    )


@energy_model
@scales
def test_shape_scales_with_length_and_does_not_depend_on_rigidity(
    energy: Energy, length: float, rigidity: float
) -> None:
    """MODEL §6; the source's Sec. IV: "the deformed shape is independent of it when it is constant"."""
    reference = solve(scaled(energy, *SCALES[0]))
    equilibrium = solve(scaled(energy, length, rigidity))
    assert_same_shape(equilibrium.position, length * reference.position, length)
    assert_same_shape(equilibrium.u, length * reference.u, length)


@energy_model
@scales
def test_reactions_scale_with_rigidity_over_length(energy: Energy, length: float, rigidity: float) -> None:
    """Force R_f/U², moment R_f/U."""
    reference = end_wrench(solve(scaled(energy, *SCALES[0])), "end")
    wrench = end_wrench(solve(scaled(energy, length, rigidity)), "end")
    factors = np.repeat([rigidity / length**2, rigidity / length], 3)
    assert_same_wrench(wrench / factors, reference)


# ------------------------------------------------------------------------------------------------- reversal


@energy_model
def test_belt_may_be_read_from_either_end(energy: Energy) -> None:
    """Read backwards, η → −η and, keeping ξ, ζ → −ζ: R → R diag(1, −1, −1).

    Then ω → (−ω_ξ, ω_η, ω_ζ) at U − u: bend, torsion and rib slope are the same numbers in reverse order.
    """
    forth = solve(generic(energy))
    back = solve(
        clamped(
            (0.0, 0.0, 0.0),
            rotation_vector(HALF_TURN_ABOUT_NORMAL),
            start_position=POSITION,
            start_rotation=rotation_vector(rotation_matrix(ROTATION) @ HALF_TURN_ABOUT_NORMAL),
            energy=energy,
            elements=80,
        )
    )
    assert back.energy == pytest.approx(forth.energy, rel=ENERGY_ERROR)
    assert_same_shape(back.position[::-1], forth.position)
    assert np.max(np.abs(back.frame[::-1] - forth.frame @ HALF_TURN_ABOUT_NORMAL)) < 1e-4
    assert np.sqrt(np.mean((back.bend[::-1] - forth.bend) ** 2)) < 1e-2
    assert np.sqrt(np.mean((back.torsion[::-1] - forth.torsion) ** 2)) < 1e-2
    assert_same_wrench(end_wrench(back, "start"), end_wrench(forth, "end"))
    assert_same_wrench(end_wrench(back, "end"), end_wrench(forth, "start"))


# ---------------------------------------------------------------------------------- other ways to say the same


def test_material_gives_the_rigidity_of_a_plate_strip() -> None:
    """R_f = D V = E t³ V/(12 (1 − ν²)): rigidity of the whole width (MODEL §1, CONTRACT)."""
    young, poisson, thickness, width = 3.2e9, 0.34, 140e-6, 0.02
    by_material = clamped((0.0, 0.1, 0.02), length=0.2, width=width, rigidity=None, elements=80)
    by_material["energy"] = "wunderlich"
    by_material["belt"]["material"] = {"young": young, "poisson": poisson, "thickness": thickness}
    rigidity = young * thickness**3 * width / (12.0 * (1.0 - poisson**2))
    by_number = clamped((0.0, 0.1, 0.02), length=0.2, width=width, rigidity=rigidity, elements=80)
    assert solve(by_material).energy == pytest.approx(solve(by_number).energy, rel=1e-9)
    assert solve(by_material).position == pytest.approx(solve(by_number).position, abs=1e-9)


def eulerian_frame(phi: float, theta: float, psi: float) -> Array:
    """Eq. (1), written out."""
    cf, sf = math.cos(phi), math.sin(phi)
    ct, st = math.cos(theta), math.sin(theta)
    cp, sp = math.cos(psi), math.sin(psi)
    return np.array(
        [
            [ct * cf * cp - sf * sp, -ct * cf * sp - sf * cp, st * cf],
            [ct * sf * cp + cf * sp, -ct * sf * sp + cf * cp, st * sf],
            [-st * cp, st * sp, ct],
        ]
    )


EULER = (0.35, 0.4, -0.2)


def oriented(field: str, values: list[float]) -> Json:
    scenario = belt(
        [support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), support("end", POSITION)],
        energy="sadowsky",
        elements=80,
    )
    scenario["supports"][1][field] = values
    return scenario


def quaternion_of(vector: Array) -> list[float]:
    """[w, x, y, z] of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle
    return numbers([math.cos(angle / 2.0), *(math.sin(angle / 2.0) * axis)])


def test_euler_angles_are_those_of_the_source() -> None:
    """The frame at the end is Eq. (1)'s matrix."""
    equilibrium = solve(oriented("euler", list(EULER)))
    assert equilibrium.frame[-1] == pytest.approx(eulerian_frame(*EULER), abs=1e-7)


def test_euler_angles_quaternion_and_rotation_vector_are_the_same_orientation() -> None:
    """CONTRACT: rotation, euler (Eq. (1)), quaternion [w, x, y, z]."""
    vector = rotation_vector(eulerian_frame(*EULER))
    by_vector = solve(oriented("rotation", numbers(vector)))
    by_euler = solve(oriented("euler", list(EULER)))
    by_quaternion = solve(oriented("quaternion", quaternion_of(vector)))
    for other in (by_euler, by_quaternion):
        assert other.energy == pytest.approx(by_vector.energy, rel=1e-9)
        assert other.position == pytest.approx(by_vector.position, abs=1e-8)


def test_quaternion_and_its_negative_are_the_same_orientation() -> None:
    """q and −q."""
    quaternion = quaternion_of(ROTATION)
    plus = solve(oriented("quaternion", quaternion))
    minus = solve(oriented("quaternion", [-q for q in quaternion]))
    assert minus.energy == pytest.approx(plus.energy, rel=1e-9)
    assert minus.position == pytest.approx(plus.position, abs=1e-8)


def test_quaternion_within_a_millionth_of_unit_length_is_normalised() -> None:
    """Rounded input is accepted: the orientation is that of the unit quaternion."""
    quaternion = quaternion_of(ROTATION)
    rounded = [q * (1.0 + 5e-7) for q in quaternion]
    exact, near = (
        solve(oriented("quaternion", quaternion)),
        solve(oriented("quaternion", rounded)),
    )
    assert near.energy == pytest.approx(exact.energy, rel=1e-9)
    frame = near.frame[-1]
    assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-10)


def test_rotation_is_the_frame_itself() -> None:
    """CONTRACT: R = exp([rotation]×), columns ξ, η, ζ, world axes, at both ends."""
    start = np.array([0.2, -0.3, 0.5])
    equilibrium = solve(clamped(POSITION, ROTATION, start_rotation=start, energy="sadowsky", elements=80))
    assert equilibrium.frame[0] == pytest.approx(rotation_matrix(start), abs=1e-7)
    assert equilibrium.frame[-1] == pytest.approx(rotation_matrix(ROTATION), abs=1e-7)


def test_segments_of_one_straight_belt_are_the_belt() -> None:
    """Two straight segments in a row are one straight belt."""
    whole = example1("wunderlich", elements=80)
    divided = example1("wunderlich", elements=80)
    divided["belt"]["segments"] = [
        {"kind": "straight", "length": 0.25},
        {"kind": "straight", "length": 0.75},
    ]
    assert solve(divided).energy == pytest.approx(solve(whole).energy, rel=1e-8)
    assert solve(divided).position == pytest.approx(solve(whole).position, abs=1e-6)


# --------------------------------------------------------------------------------------------- determinism


@energy_model
@pytest.mark.parametrize("build", [example1, example2], ids=["example1", "example2"])
def test_repeated_solves_are_identical_bit_for_bit(energy: Energy, build: Any) -> None:
    """CONTRACT: `solve_time` alone is outside any claim of identical output."""
    texts = []
    for _ in range(2):
        output = result(fb.solve(fb.Scenario.from_dict(build(energy))))
        del output["solve_time"]
        texts.append(json.dumps(output, sort_keys=True))
    assert texts[0] == texts[1]
