"""Belts that are curled when unloaded.

MODEL §2: R_f/2 · [κ₁² g − 2k(1+β²)ω_ζ + k² + 2(1−ν)kβ²ω_ζ], which is R_f/2 · (ω_ζ − k)² in a plane, and 0 only where
ω_ζ = k and β = 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from helpers import (
    ENERGIES,
    GAUSS_POINTS,
    ORIGIN,
    Array,
    Cantilever,
    Energy,
    Json,
    board,
    end_wrench,
    internal,
    node_at,
    solve,
    straight,
    support,
)

CURL = 2.5
GENTLE = 0.6
FAINT = 0.2
RIGIDITY = 2.0

energy_model = pytest.mark.parametrize("energy", ENERGIES)
width = pytest.mark.parametrize("width", [0.02, 0.3])


def held_at_the_start(energy: Energy, *, elements: int = 160, curl: float = CURL, **options: Any) -> Json:
    supports = [support("start", ORIGIN, ORIGIN)]
    return board([straight(1.0)], supports, energy=energy, elements=elements, natural_bend=curl, **options)


def arch(curl: float, turn: float = 0.0, energy: Energy = "wunderlich") -> Json:
    """Both ends clamped in the plane z = 0, the far one turned about z."""
    supports = [support("start", ORIGIN, ORIGIN), support("end", (0.0, 0.7, 0.0), (0.0, 0.0, turn))]
    return board(
        [straight(1.0)],
        supports,
        energy=energy,
        rigidity=RIGIDITY,
        elements=80,
        bulge=(1.0, 0.0, 0.0),
        natural_bend=curl,
        poisson=0.0,
    )


def flattened(energy: Energy, curl: float) -> Json:
    """Clamped with parallel ends in line, the far one free to slide along the belt."""
    end = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, 0.0, 0.0]}
    return board(
        [straight(1.0)],
        [support("start", ORIGIN, ORIGIN), end],
        energy=energy,
        rigidity=RIGIDITY,
        elements=80,
        natural_bend=curl,
        poisson=0.0,
    )


def roll(u: Array, curl: float) -> Array:
    """A circle of radius 1/k in the plane z = 0, towards −ξ for k > 0."""
    return np.column_stack([(np.cos(curl * u) - 1.0) / curl, np.sin(curl * u) / curl, np.zeros_like(u)])


# ----------------------------------------------------------------------------------------------------- free belts


@width
@energy_model
@pytest.mark.parametrize("curl", [CURL, -CURL])
def test_free_belt_rolls_to_its_natural_radius(energy: Energy, width: float, curl: float) -> None:
    """ω_ζ = k and β = 0 everywhere, at no cost, and round the right way."""
    equilibrium = solve(held_at_the_start(energy, width=width, curl=curl))
    assert equilibrium.elastic_energy == pytest.approx(0.0, abs=1e-10)
    assert equilibrium.bend == pytest.approx(curl, abs=1e-6)
    assert np.max(np.abs(equilibrium.rib_slope)) < 1e-4
    assert np.max(np.abs(equilibrium.position - roll(equilibrium.u, curl))) < 1e-6


@energy_model
@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.3, 0.49])
def test_free_roll_does_not_depend_on_poissons_ratio(energy: Energy, poisson: float) -> None:
    """ν matters only where β ≠ 0."""
    equilibrium = solve(held_at_the_start(energy, poisson=poisson))
    assert equilibrium.elastic_energy == pytest.approx(0.0, abs=1e-10)
    assert equilibrium.position[-1] == pytest.approx(roll(np.array([1.0]), CURL)[0], abs=1e-6)


@energy_model
def test_free_roll_has_no_reactions(energy: Energy) -> None:
    """The unloaded shape: no reaction, no internal moment."""
    equilibrium = solve(held_at_the_start(energy))
    force, moment = internal(equilibrium)
    for field in (force, moment, end_wrench(equilibrium, "start")):
        assert np.max(np.abs(field)) < 1e-6


def test_free_belt_rolls_in_space_from_wherever_it_is_held() -> None:
    """Held at its end, in another pose: the same circle, run backwards."""
    scenario = held_at_the_start("wunderlich")
    scenario["supports"] = [support("end", (0.3, -0.2, 0.5), (0.0, 0.0, 0.4))]
    equilibrium = solve(scenario)
    assert equilibrium.elastic_energy == pytest.approx(0.0, abs=1e-10)
    assert equilibrium.bend == pytest.approx(CURL, abs=1e-6)
    assert equilibrium.position[-1] == pytest.approx([0.3, -0.2, 0.5], abs=1e-8)
    assert float(np.linalg.norm(equilibrium.position[0] - equilibrium.position[-1])) == pytest.approx(
        2.0 / CURL * math.sin(CURL / 2.0), abs=1e-6
    )


def test_segments_have_natural_bends_of_their_own() -> None:
    """One curls up, the next is flat, the last keeps the belt's own: ω_ζ jumps where they meet, at no cost."""
    segments = [straight(0.4, natural_bend=-3.0), straight(0.3, natural_bend=0.0), straight(0.3)]
    scenario = board(segments, [support("start", ORIGIN, ORIGIN)], elements=100, natural_bend=2.0)
    equilibrium = solve(scenario)
    middles = 0.5 * (equilibrium.u[1:] + equilibrium.u[:-1])
    bend = 0.5 * (equilibrium.bend[1:] + equilibrium.bend[:-1])
    inside = np.diff(equilibrium.u) > 1e-9
    expected = np.select([middles < 0.4, middles < 0.7], [-3.0, 0.0], 2.0)
    assert equilibrium.elastic_energy == pytest.approx(0.0, abs=1e-10)
    assert bend[inside] == pytest.approx(expected[inside], abs=1e-6)
    k = node_at(equilibrium, 0.4)
    assert equilibrium.u[k - 1] == pytest.approx(0.4, abs=1e-9)
    assert equilibrium.bend[k - 1] - equilibrium.bend[k] == pytest.approx(-3.0, abs=1e-6)


def test_arc_with_natural_bend_stays_a_strip_of_its_own_curvature() -> None:
    """Rolled, an arc costs nothing only without in-plane curvature; with it the belt stays cheaper than flat."""
    supports = [support("start", ORIGIN, ORIGIN)]
    segments = [{"kind": "arc", "length": 1.0, "curvature": 1.0, "natural_bend": 1.0}]
    equilibrium = solve(board(segments, supports, elements=100))
    assert equilibrium.elastic_energy < 0.5 * 1.0**2 * 1.0
    assert float(np.mean(equilibrium.bend)) > 0.5


# ---------------------------------------------------------------------------------------------------- held in a plane


@energy_model
@pytest.mark.parametrize("curl", [FAINT, -FAINT])
def test_curled_belt_clamped_flat_stores_half_its_curvature_squared(energy: Energy, curl: float) -> None:
    """ω_ζ = 0: R_f k² U/2, no force along, and a moment −R_f k about ζ all along.

    A straight belt has no compliance in its plane and, with square ribs, to twist: the force along z and the moments
    about x and y are not determined, and hardly leaning ribs let them into the others. (A belt of more curl, k U = 0.6,
    can do with less by twisting out of the plane.)
    """
    equilibrium = solve(flattened(energy, curl))
    force, moment = internal(equilibrium)
    assert equilibrium.elastic_energy == pytest.approx(0.5 * RIGIDITY * curl**2, rel=1e-7)
    assert np.max(np.abs(equilibrium.position[:, [0, 2]])) < 1e-4
    assert np.max(np.abs(force[:, 1])) < 1e-5
    assert moment[:, 2] == pytest.approx(-RIGIDITY * curl, rel=0.05)


@pytest.mark.parametrize("turn", [0.0, 0.5, -0.4])
@pytest.mark.parametrize("curl", [GENTLE, -GENTLE])
def test_natural_bend_does_not_move_a_planar_clamped_belt(curl: float, turn: float) -> None:
    """R/2 ∫(ω − k)² differs from R/2 ∫ω² by what the end frames fix."""
    plain, curled = solve(arch(0.0, turn)), solve(arch(curl, turn))
    assert np.max(np.abs(curled.position - plain.position)) < 1e-6
    assert np.max(np.abs(curled.bend - plain.bend)) < 1e-4


@pytest.mark.parametrize("turn", [0.0, 0.5, -0.4])
@pytest.mark.parametrize("curl", [GENTLE, -GENTLE])
def test_natural_bend_shifts_the_energy_by_what_the_clamps_turn(curl: float, turn: float) -> None:
    """−k R_f (θ_end − θ_start) + R_f k² U/2."""
    plain, curled = solve(arch(0.0, turn)), solve(arch(curl, turn))
    shift = -curl * RIGIDITY * turn + 0.5 * RIGIDITY * curl**2
    assert curled.energy - plain.energy == pytest.approx(shift, abs=1e-6)


@energy_model
def test_natural_bend_shifts_the_moments_and_not_the_forces(energy: Energy) -> None:
    """m = R_f (ω_ζ − k) about ζ = +z."""
    plain, curled = internal(solve(arch(0.0, 0.5, energy))), internal(solve(arch(GENTLE, 0.5, energy)))
    assert curled[0] == pytest.approx(plain[0], abs=1e-4)
    shift = np.tile([0.0, 0.0, -RIGIDITY * GENTLE], (len(plain[1]), 1))
    assert curled[1] - plain[1] == pytest.approx(shift, abs=1e-4)


def test_curled_cantilever_under_a_tip_force_follows_the_elastica() -> None:
    """Against SciPy: (R (ω − k))' is the lever of the force."""
    load = {"at": "end", "force": [-3.0, 1.0, 0.0]}
    scenario = held_at_the_start("wunderlich", curl=1.2, points=[load], poisson=0.0)
    expected = Cantilever(force=(-3.0, 1.0), natural_bend=1.2)
    equilibrium = solve(scenario)
    assert np.max(np.abs(equilibrium.position - expected.position(equilibrium.u))) < 1e-5
    assert equilibrium.elastic_energy == pytest.approx(expected.elastic_energy, rel=1e-5)


# ------------------------------------------------------------------------------------------------------- in space


def twisted(energy: Energy, poisson: float) -> Json:
    """Curled, bent with its curl and twisted."""
    supports = [support("start", ORIGIN, ORIGIN), support("end", (-0.4, 0.7, 0.1), (0.4, 0.3, 1.2))]
    return board([straight(1.0)], supports, energy=energy, elements=80, natural_bend=2.0, poisson=poisson)


@energy_model
def test_energy_changes_with_poissons_ratio_by_the_twist(energy: Energy) -> None:
    """dE/dν = −R_f k ∫ β² ω_ζ du, times sqrt(1+β²) in `fishbone`: the change of the shape is of second order."""
    step = 1e-3
    less, more = (solve(twisted(energy, 0.3 + sign * step)).energy for sign in (-1.0, 1.0))
    equilibrium = solve(twisted(energy, 0.3))
    rate = 0.0
    for c in GAUSS_POINTS:
        bend = (1.0 - c) * equilibrium.bend[:-1] + c * equilibrium.bend[1:]
        slope = (1.0 - c) * equilibrium.rib_slope[:-1] + c * equilibrium.rib_slope[1:]
        longer = np.sqrt(1.0 + slope**2) if energy == "fishbone" else 1.0
        rate -= float(np.sum(0.5 * np.diff(equilibrium.u) * 2.0 * slope**2 * bend * longer))
    assert abs(rate) > 1e-2
    assert (more - less) / (2.0 * step) == pytest.approx(rate, rel=1e-3)


@energy_model
def test_turned_over_belt_curls_the_other_way(energy: Energy) -> None:
    """x → −x with k → −k: the same energy and the mirrored spine."""

    def bent(sign: float) -> Json:
        end = support("end", (0.1 * sign, 0.6, 0.1), (0.3, 0.2 * sign, -0.25 * sign))
        return board(
            [straight(1.0)],
            [support("start", ORIGIN, ORIGIN), end],
            energy=energy,
            elements=80,
            bulge=(sign, 0.0, 0.0),
            natural_bend=-1.5 * sign,
        )

    one, other = solve(bent(1.0)), solve(bent(-1.0))
    assert other.energy == pytest.approx(one.energy, rel=1e-6)
    assert np.max(np.abs(other.position * [-1.0, 1.0, 1.0] - one.position)) < 1e-5
    assert np.max(np.abs(other.bend + one.bend)) < 1e-3
