"""The planar clamped belt against the elastica in closed form.

With x(U) = (0, d, 0) and R(U) = I the belt stays in a plane: β = 0, all three energies are (R_f/2) ∫ ω_ζ² du, and the
shape
is Euler's elastica. The closed form is derived in `helpers.Elastica`; the first tests here check that derivation
itself,
against SciPy's boundary value solver and against a finite-element shell.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from helpers import (
    ENERGIES,
    Array,
    Elastica,
    Energy,
    Json,
    clamped,
    end_wrench,
    highest_point,
    observed_orders,
    result,
    rms_distance,
    shell,
    solve,
)

DISTANCES = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.9999)

# Discretisation errors at 80 elements, in units of U and R_f: 4e-7 (energy, relative), 1e-7 (position), 4e-7 (force,
# relative) in an independent transcription; the rest is room for the solver's tolerance.
ENERGY_ERROR = 2e-6
POSITION_ERROR = 2e-6
REACTION_ERROR = 1e-5

# Two Gauss points and fourth-order Magnus: energy and nodes converge with h⁴, the piecewise-linear bend with h².
ORDER_OF_ENERGY_AND_POSITION = (3.7, 4.3)
ORDER_OF_BEND = (1.8, 2.2)


def planar(distance: float, energy: Energy = "wunderlich", elements: int = 80) -> Json:
    """x(U) = (0, d, 0), R(U) = I, bulging towards +x."""
    return clamped((0.0, distance, 0.0), energy=energy, elements=elements, bulge=(1.0, 0.0, 0.0))


# ------------------------------------------------------------------------------------ the reference itself


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.95])
def test_closed_form_solves_the_boundary_value_problem(distance: float) -> None:
    """ϑ'' = −P sin ϑ, x' = sin ϑ, y' = cos ϑ with P unknown, by collocation (scipy.integrate.solve_bvp)."""
    elastica = Elastica(distance)

    def rate(_: Array, state: Array, parameters: Array) -> Array:
        angle, curvature = state[0], state[1]
        return np.vstack([curvature, -parameters[0] * np.sin(angle), np.sin(angle), np.cos(angle), curvature**2])

    def conditions(start: Array, end: Array, _: Array) -> Array:
        return np.array([start[0], start[2], start[3], start[4], end[0], end[3] - distance])

    u = np.linspace(0.0, 1.0, 201)
    amplitude = 2.0 * np.sqrt(1.0 - distance)
    guess = np.vstack(
        [
            amplitude * np.sin(2.0 * np.pi * u),
            2.0 * np.pi * amplitude * np.cos(2.0 * np.pi * u),
            0.3 * np.sin(np.pi * u) ** 2,
            distance * u,
            20.0 * u,
        ]
    )
    solution = solve_bvp(rate, conditions, u, guess, p=[40.0], tol=1e-9, max_nodes=100_000)

    assert solution.success
    state = solution.sol(u)
    assert solution.p is not None
    assert solution.p[0] == pytest.approx(elastica.thrust, rel=1e-6)
    assert 0.5 * state[4, -1] == pytest.approx(elastica.energy, rel=1e-6)
    assert np.max(np.abs(state[2:4].T - elastica.position(u)[:, :2])) < 1e-6
    assert np.max(np.abs(state[1] + elastica.bend(u))) < 1e-5


@pytest.mark.parametrize("distance", DISTANCES)
def test_closed_form_ends_at_the_clamps(distance: float) -> None:
    """x(0) = 0, x(U/2) is the height, x(U) = (0, d, 0): u = U/4, U/2, 3U/4 are where SciPy's am(u) may jump."""
    length = 5.0 / 3.0
    scaled = Elastica(distance * length, length=length)
    u = np.linspace(0.0, scaled.length, 161)
    position = scaled.position(u)
    assert position[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert position[80] == pytest.approx([scaled.height, scaled.distance / 2.0, 0.0], abs=1e-9)
    assert position[-1] == pytest.approx([0.0, scaled.distance, 0.0], abs=1e-9)
    lengths = np.linalg.norm(np.diff(position, axis=0), axis=1)
    assert float(np.sum(lengths)) == pytest.approx(scaled.length, rel=1e-3)


def test_closed_form_agrees_with_the_shell() -> None:
    """`data/shell/planar.json`: a sheet of finite thickness, so to about 1e-4 U only."""
    data = shell("planar")
    elastica = Elastica(data["end_position"][1])
    assert rms_distance(elastica.position(np.array(data["u"])), np.array(data["position"])) < 2e-4


def test_closed_form_tends_to_euler_buckling_as_the_slack_vanishes() -> None:
    """Euler: a clamped strut buckles at P = 4π² R_f/U²."""
    assert Elastica(1.0 - 1e-9).thrust == pytest.approx(4.0 * np.pi**2, rel=1e-8)


# ---------------------------------------------------------------------------------------------- the package


@pytest.mark.parametrize("distance", DISTANCES)
def test_energy_is_that_of_the_elastica(distance: float) -> None:
    """(32 R_f/U) K (E − (1−k²) K), see `helpers.Elastica`."""
    equilibrium = solve(planar(distance))
    expected = Elastica(distance).energy
    assert equilibrium.energy == pytest.approx(expected, rel=ENERGY_ERROR, abs=1e-7)


@pytest.mark.parametrize("distance", DISTANCES)
def test_spine_is_the_elastica(distance: float) -> None:
    """Every node on the closed form."""
    equilibrium = solve(planar(distance))
    expected = Elastica(distance).position(equilibrium.u)
    assert np.max(np.abs(equilibrium.position - expected)) < POSITION_ERROR


@pytest.mark.parametrize("distance", DISTANCES)
def test_height_is_that_of_the_elastica(distance: float) -> None:
    """kU/K, at the middle."""
    peak = highest_point(solve(planar(distance)))
    expected = [Elastica(distance).height, distance / 2.0, 0.0]
    assert peak == pytest.approx(expected, abs=5e-6)


@pytest.mark.parametrize("distance", DISTANCES)
def test_clamps_push_with_the_thrust_of_the_elastica(distance: float) -> None:
    """Force (0, ∓P, 0) and moment (0, 0, ∓2kλR_f), opposite at the two ends."""
    elastica = Elastica(distance)
    equilibrium = solve(planar(distance))
    expected = np.array([0.0, -elastica.thrust, 0.0, 0.0, 0.0, elastica.end_moment])
    scale = elastica.thrust
    assert np.max(np.abs(end_wrench(equilibrium, "end") - expected)) < REACTION_ERROR * scale
    assert np.max(np.abs(end_wrench(equilibrium, "start") + expected)) < REACTION_ERROR * scale


@pytest.mark.parametrize("distance", DISTANCES)
def test_ribs_of_a_planar_belt_are_square(distance: float) -> None:
    """No torsion: β = 0, and nothing leaves the plane z = 0."""
    equilibrium = solve(planar(distance))
    assert np.max(np.abs(equilibrium.rib_slope)) < 1e-6
    assert np.max(np.abs(equilibrium.torsion)) < 1e-5
    assert np.max(np.abs(equilibrium.position[:, 2])) < 1e-7


def test_energies_agree_on_a_planar_belt() -> None:
    """sqrt(1+β²) = g(0) = 1 where β = 0 (MODEL §2)."""
    energies = [solve(planar(0.6, energy)).energy for energy in ENERGIES]
    assert energies == pytest.approx([energies[0]] * 3, rel=1e-8)


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.9])
def test_energy_converges_with_the_fourth_order(distance: float) -> None:
    """MODEL §3: energy and pose share the two Gauss points of fourth order."""
    exact = Elastica(distance).energy
    errors = np.array([abs(solve(planar(distance, elements=n)).energy - exact) for n in (20, 40, 80)])
    low, high = ORDER_OF_ENERGY_AND_POSITION
    orders = observed_orders(errors)
    assert np.all((orders > low) & (orders < high)), orders


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.9])
def test_spine_converges_with_the_fourth_order(distance: float) -> None:
    """The nodes against the closed form; 80 elements are left out, where the tolerance of the solver dominates."""
    elastica = Elastica(distance)
    errors = []
    for elements in (10, 20, 40):
        equilibrium = solve(planar(distance, elements=elements))
        errors.append(np.max(np.abs(equilibrium.position - elastica.position(equilibrium.u))))
    low, high = ORDER_OF_ENERGY_AND_POSITION
    orders = observed_orders(np.array(errors))
    assert np.all((orders > low) & (orders < high)), orders


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.9])
def test_bend_converges_with_the_second_order(distance: float) -> None:
    """ω_ζ = −2kλ cn(λu) against the piecewise-linear field."""
    elastica = Elastica(distance)
    errors = []
    for elements in (20, 40, 80):
        equilibrium = solve(planar(distance, elements=elements))
        errors.append(np.max(np.abs(equilibrium.bend - elastica.bend(equilibrium.u))))
    low, high = ORDER_OF_BEND
    orders = observed_orders(np.array(errors))
    assert np.all((orders > low) & (orders < high)), orders


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.9])
def test_tightest_bend_is_at_a_clamp_or_the_middle(distance: float) -> None:
    """With s = 0 the local radius is 1/|κ₁| = 1/|ω_ζ|, least where |ω_ζ| = 2kλ; 2 % for where it is sampled."""
    elastica = Elastica(distance)
    least = result(solve(planar(distance)))["least_bend_radius"]
    assert least["value"] == pytest.approx(1.0 / (2.0 * elastica.k * elastica.rate), rel=0.02)
    assert min(abs(least["u"] - u) for u in (0.0, 0.5, 1.0)) < 0.02


def test_belt_clamped_in_its_natural_state_stores_nothing() -> None:
    """d = U: the only shape that fits is the flat belt."""
    equilibrium = solve(planar(1.0))
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-8)
    flat = np.column_stack([np.zeros(81), equilibrium.u, np.zeros(81)])
    assert np.max(np.abs(equilibrium.position - flat)) < 1e-4
