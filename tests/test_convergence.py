"""Observed orders of convergence as the mesh is refined.

Errors are differences of successive solutions, so that nothing but the package itself is compared; what it converges
to is the
business of the other files. Positions are compared at the nodes of the coarsest mesh.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from helpers import (
    ENERGIES,
    Array,
    Energy,
    Json,
    clamped,
    constant_twist_pose,
    example1,
    observed_orders,
    rotation_matrix,
    rotation_vector,
    solve,
)

REFINEMENT = (40, 80, 160, 320, 640)

# Smooth fields: two Gauss points and fourth-order Magnus give h⁴.
# Finer still, the term of second order of `wunderlich` shows, which has one s an element.
SMOOTH_REFINEMENT = (10, 20, 40, 80)
ORDER_WHERE_THE_BOUND_IS_INACTIVE = (3.4, 4.6)

# Where ribs sit on the bound, β' jumps at places that move with the mesh: about h², unevenly, so that the mean over
# 80, 160, 320, 640 elements counts. 40 elements are h = V/4, above the facet scale (MODEL §3): not yet asymptotic.
ENERGY_ORDER_WHERE_THE_BOUND_IS_ACTIVE = (1.6, 3.2)
POSITION_ORDER_WHERE_THE_BOUND_IS_ACTIVE = (1.0, 3.2)

# Below these differences the tolerance of the solver dominates, not the mesh.
LEAST_ENERGY_DIFFERENCE = 1e-7
LEAST_POSITION_DIFFERENCE = 5e-8


def gentle_arc(energy: Energy, elements: int) -> Json:
    """A helix's end pose, disturbed, ribs free: the bend keeps its sign, so no rib comes near the bound."""
    position, frame = constant_twist_pose(-1.5, 0.25, 1.0)
    return clamped(
        position + np.array([0.03, 0.02, 0.01]),
        rotation_vector(rotation_matrix([0.05, 0.05, -0.1]) @ frame),
        square_rib=False,
        energy=energy,
        elements=elements,
    )


def fishbone_example1(energy: Energy, elements: int) -> Json:
    return example1(energy, elements=elements)


def differences(
    build: Callable[[Energy, int], Json], energy: Energy, refinement: tuple[int, ...]
) -> tuple[Array, Array]:
    """Of energy and of position (largest over the nodes), between successive meshes.

    Shapes: (k - 1,), (k - 1,)
    """
    solutions = [solve(build(energy, n)) for n in refinement]
    energies = np.array([s.energy for s in solutions])
    positions = np.array([s.position[:: n // refinement[0]] for s, n in zip(solutions, refinement, strict=True)])
    return np.abs(np.diff(energies)), np.max(np.abs(np.diff(positions, axis=0)), axis=(1, 2))


def within(orders: Array, band: tuple[float, float]) -> bool:
    return bool(np.all((orders > band[0]) & (orders < band[1])))


@pytest.mark.parametrize("energy", ENERGIES)
def test_gentle_arc_keeps_away_from_the_bound(energy: Energy) -> None:
    """The premise of the next two tests: |β'| below half of 2/V."""
    equilibrium = solve(gentle_arc(energy, 80))
    slope_rate = np.diff(equilibrium.rib_slope) / np.diff(equilibrium.u)
    assert np.max(np.abs(slope_rate)) < 10.0


@pytest.mark.parametrize("energy", ENERGIES)
def test_energy_converges_with_the_fourth_order_where_the_bound_is_inactive(energy: Energy) -> None:
    """MODEL §3."""
    errors, _ = differences(gentle_arc, energy, SMOOTH_REFINEMENT)
    orders = observed_orders(errors[errors > LEAST_ENERGY_DIFFERENCE])
    assert len(orders) >= 1, errors
    assert within(orders, ORDER_WHERE_THE_BOUND_IS_INACTIVE), orders


@pytest.mark.parametrize("energy", ENERGIES)
def test_spine_converges_with_the_fourth_order_where_the_bound_is_inactive(energy: Energy) -> None:
    """MODEL §3."""
    _, errors = differences(gentle_arc, energy, SMOOTH_REFINEMENT)
    orders = observed_orders(errors[errors > LEAST_POSITION_DIFFERENCE])
    assert len(orders) >= 1, errors
    assert within(orders, ORDER_WHERE_THE_BOUND_IS_INACTIVE), orders


def test_ribs_of_example_1_sit_on_the_bound() -> None:
    """The premise of the next tests; MODEL §3: 12-21 % of the elements for `fishbone`."""
    equilibrium = solve(fishbone_example1("fishbone", 160))
    slope_rate = np.abs(np.diff(equilibrium.rib_slope) / np.diff(equilibrium.u))
    share = float(np.mean(slope_rate > 20.0 * (1.0 - 1e-4)))
    assert 0.1 < share < 0.22


@pytest.mark.parametrize("energy", ENERGIES)
def test_energy_of_example_1_converges_with_the_second_order(energy: Energy) -> None:
    """Mean order over the three finest doublings."""
    errors, _ = differences(fishbone_example1, energy, REFINEMENT[1:])
    order = np.mean(observed_orders(errors), keepdims=True)
    assert within(order, ENERGY_ORDER_WHERE_THE_BOUND_IS_ACTIVE), errors


@pytest.mark.parametrize("energy", ENERGIES)
def test_spine_of_example_1_converges(energy: Energy) -> None:
    """Mean order over the three finest doublings."""
    _, errors = differences(fishbone_example1, energy, REFINEMENT[1:])
    order = np.mean(observed_orders(errors), keepdims=True)
    assert within(order, POSITION_ORDER_WHERE_THE_BOUND_IS_ACTIVE), errors


@pytest.mark.parametrize("energy", ENERGIES)
def test_coarse_mesh_is_within_its_error_of_the_fine_one(energy: Energy) -> None:
    """Example 1 with 40 elements is off by less than 1 %, with 80 by less than 0.1 %, of the energy with 640."""
    coarse, default, fine = (solve(fishbone_example1(energy, elements)).energy for elements in (40, 80, 640))
    assert coarse == pytest.approx(fine, rel=1e-2)
    assert default == pytest.approx(fine, rel=1e-3)
