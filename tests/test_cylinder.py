"""A belt wound on a cylinder, in closed form (MODEL §6).

Winding angle a on radius R: |ω_ζ| = cos²a/R, |ω_η| = sin a cos a/R, so β = ∓tan a and κ₁ = ±1/R are constant, the ribs
lie along the cylinder's axis, and the end pose is the exponential of a constant twist. A uniform belt held at those
poses, its ribs free
at the ends, is in equilibrium for every energy that depends on ω_ζ and β alike at each u: with the internal force f
along
ω and the moment cη + μω both balance equations f' + ω×f = 0 and m' + ω×m + η×f = 0 hold.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers import (
    ENERGIES,
    Energy,
    Json,
    clamped,
    constant_twist_pose,
    energy_by_quadrature,
    integrate_pose,
    rotation_vector,
    solve,
)

WINDING_ANGLES = (-0.4, 0.0, 0.2, 0.5)
RADII = (0.5, 1.0)

# The discrete programme holds the helix exactly: what remains is the solver's tolerance.
FIELD_ERROR = 1e-5
POSITION_ERROR = 1e-6
ENERGY_ERROR = 1e-7

winding_angle = pytest.mark.parametrize("angle", WINDING_ANGLES)
radius = pytest.mark.parametrize("radius", RADII)
energy_model = pytest.mark.parametrize("energy", ENERGIES)


def helix_fields(angle: float, radius: float) -> tuple[float, float]:
    """Bend and rib slope; the belt curls towards +ξ, so that ω_ζ < 0 and κ₁ = 1/R."""
    return -(math.cos(angle) ** 2) / radius, math.tan(angle)


def wound(angle: float, radius: float, energy: Energy, rigidity: float = 1.0) -> Json:
    bend, slope = helix_fields(angle, radius)
    position, frame = constant_twist_pose(bend, slope, 1.0)
    return clamped(position, rotation_vector(frame), square_rib=False, energy=energy, rigidity=rigidity)


@winding_angle
@radius
def test_reference_pose_lies_on_the_cylinder(angle: float, radius: float) -> None:
    """The constant-twist path is a helix: the rib direction is its axis, and every point is R from that axis."""
    bend, slope = helix_fields(angle, radius)
    axis = np.array([0.0, -slope, 1.0]) / math.hypot(1.0, slope)
    centre = np.array([radius, 0.0, 0.0])
    for length in (0.1, 0.5, 1.0):
        position, frame = constant_twist_pose(bend, slope, length)
        from_axis = (position - centre) - ((position - centre) @ axis) * axis
        assert np.linalg.norm(from_axis) == pytest.approx(radius, rel=1e-12)
        assert frame[:, 2] - slope * frame[:, 1] == pytest.approx(axis * math.hypot(1.0, slope))
        assert frame[:, 0] == pytest.approx(-from_axis / radius)


def test_reference_pose_agrees_with_adaptive_integration() -> None:
    """The matrix exponential against DOP853."""
    bend, slope = helix_fields(0.5, 0.5)
    u = np.linspace(0.0, 1.0, 11)
    positions, frames = integrate_pose(u, np.full(11, bend), np.full(11, slope))
    position, frame = constant_twist_pose(bend, slope, 1.0)
    assert positions[-1] == pytest.approx(position, abs=1e-9)
    assert frames[-1] == pytest.approx(frame, abs=1e-9)


@winding_angle
@radius
@energy_model
def test_bend_and_rib_slope_of_a_wound_belt_are_constant(angle: float, radius: float, energy: Energy) -> None:
    """ω_ζ = −cos²a/R, β = tan a, ω_η = −βω_ζ = sin a cos a/R."""
    equilibrium = solve(wound(angle, radius, energy))
    bend, slope = helix_fields(angle, radius)
    torsion = math.sin(angle) * math.cos(angle) / radius
    assert np.max(np.abs(equilibrium.bend - bend)) < FIELD_ERROR
    assert np.max(np.abs(equilibrium.rib_slope - slope)) < FIELD_ERROR
    assert np.max(np.abs(equilibrium.rib_angle - angle)) < FIELD_ERROR
    assert np.max(np.abs(equilibrium.torsion - torsion)) < FIELD_ERROR


@winding_angle
@radius
@pytest.mark.parametrize("energy", ["sadowsky", "wunderlich"])
def test_energy_of_a_wound_belt_does_not_depend_on_the_winding_angle(
    angle: float, radius: float, energy: Energy
) -> None:
    """D U V/(2R²) = R_f U/(2R²): plate theory on a cylinder (MODEL §5)."""
    equilibrium = solve(wound(angle, radius, energy, rigidity=2.0))
    assert equilibrium.energy == pytest.approx(2.0 / (2.0 * radius**2), rel=ENERGY_ERROR)


@winding_angle
@radius
def test_fishbone_energy_of_a_wound_belt_grows_with_the_longer_rib(angle: float, radius: float) -> None:
    """Eq. (34): R_f U/(2R² cos a)."""
    equilibrium = solve(wound(angle, radius, "fishbone", rigidity=2.0))
    expected = 2.0 / (2.0 * radius**2) / math.cos(angle)
    assert equilibrium.energy == pytest.approx(expected, rel=ENERGY_ERROR)


@winding_angle
@radius
def test_spine_of_a_wound_belt_is_a_helix(angle: float, radius: float) -> None:
    """Each node at the exponential of the constant twist up to there."""
    equilibrium = solve(wound(angle, radius, "wunderlich"))
    bend, slope = helix_fields(angle, radius)
    for u, position, frame in zip(equilibrium.u, equilibrium.position, equilibrium.frame, strict=True):
        expected_position, expected_frame = constant_twist_pose(bend, slope, float(u))
        assert np.max(np.abs(position - expected_position)) < POSITION_ERROR
        assert np.max(np.abs(frame - expected_frame)) < FIELD_ERROR


@energy_model
def test_square_ribs_at_the_ends_cost_energy(energy: Energy) -> None:
    """Connectors (β = 0) are further constraints on the same end poses."""
    bend, slope = helix_fields(0.5, 0.5)
    position, frame = constant_twist_pose(bend, slope, 1.0)
    free = solve(wound(0.5, 0.5, energy))
    squared = solve(clamped(position, rotation_vector(frame), energy=energy))
    assert squared.energy > free.energy * (1.0 + 1e-3)


@energy_model
def test_reference_quadrature_gives_the_energy_of_the_cylinder(energy: Energy) -> None:
    """`helpers.energy_by_quadrature` itself, on constant fields: R_f U/(2R²), over cos a for `fishbone`."""
    bend, slope = helix_fields(0.5, 0.5)
    u = np.linspace(0.0, 1.0, 5)
    energy_value = energy_by_quadrature(energy, u, np.full(5, bend), np.full(5, slope), width=0.1, rigidity=3.0)
    expected = 3.0 / (2.0 * 0.25) / (math.cos(0.5) if energy == "fishbone" else 1.0)
    assert energy_value == pytest.approx(expected, rel=1e-13)
