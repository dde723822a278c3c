"""Closed belts: the ring and the Möbius band.

Starostin & van der Heijden (2007): a band of length 2π and half-width w = π/30 has energy/(D w) = 18.63 (they print it
over π). With D = 1 the rigidity of the whole width is R_f = V = π/15.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    ORIGIN,
    Array,
    Energy,
    Json,
    arc,
    board,
    internal_wrenches,
    node_at,
    numbers,
    result,
    rigid,
    rotation_vector,
    solve,
    solve_any,
    straight,
    support,
)

LENGTH = 2.0 * math.pi
HALF_WIDTH = math.pi / 30.0
WUNDERLICH = 18.63
ELEMENTS = 400
HALF_TURN_ABOUT_TANGENT = np.diag([-1.0, 1.0, -1.0])
SEAM_ERROR = 1e-7

signs = pytest.mark.parametrize("sign", [1, -1])
energy_model = pytest.mark.parametrize("energy", ENERGIES)


def closed(
    half_turns: int | None,
    supports: list[Json] | None = None,
    *,
    energy: Energy = "wunderlich",
    elements: int = ELEMENTS,
    **fields: Any,
) -> Json:
    turns: Json = {} if half_turns is None else {"half_turns": half_turns}
    return board(
        [straight(LENGTH)],
        supports or [],
        energy=energy,
        width=2.0 * HALF_WIDTH,
        rigidity=2.0 * HALF_WIDTH,
        elements=elements,
        closed=True,
        **turns,
        **fields,
    )


def total_torsion(equilibrium: fb.Equilibrium) -> float:
    """∫ ω_η du."""
    torsion = equilibrium.torsion
    return float(np.sum(0.5 * np.diff(equilibrium.u) * (torsion[:-1] + torsion[1:])))


def distances(equilibrium: fb.Equilibrium) -> Array:
    """Every eighth node's distance from every other: the shape without its place."""
    x = equilibrium.position[::8]
    return np.asarray(np.linalg.norm(x[:, None] - x[None, :], axis=2), dtype=np.float64)


# ------------------------------------------------------------------------------------------------------------ ring


@energy_model
@pytest.mark.parametrize("half_turns", [0, None])
def test_closed_belt_without_a_twist_is_a_circle(energy: Energy, half_turns: int | None) -> None:
    """Energy R_f/2 (2π/L)² L; every node at L/2π from the centre."""
    equilibrium = solve(closed(half_turns, energy=energy, elements=100))
    assert equilibrium.energy == pytest.approx(HALF_WIDTH * LENGTH, rel=1e-9)
    assert np.abs(equilibrium.bend) == pytest.approx(1.0, abs=1e-6)
    centre = np.mean(equilibrium.position[:-1], axis=0)
    assert np.linalg.norm(equilibrium.position - centre, axis=1) == pytest.approx(1.0, abs=1e-6)


def test_ring_starts_in_the_natural_pose_where_nothing_holds_it() -> None:
    """CONTRACT: without any support the start is held where it is, and takes no force."""
    equilibrium = solve(closed(0, elements=100))
    assert equilibrium.position[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert np.max(np.abs(equilibrium.frame[0] - np.eye(3))) < 1e-9
    for reaction in result(equilibrium)["supports"]:
        assert np.max(np.abs([reaction["force"], reaction["moment"]])) < 1e-6


def test_ring_of_rolled_belt_costs_nothing() -> None:
    """Natural bend ±2π/L: one of the two closes as it is curled. The other may be inside out, which holds too."""
    rings = [solve(closed(0, elements=100, natural_bend=curl)) for curl in (1.0, -1.0)]
    curled = min(rings, key=lambda ring: ring.elastic_energy)
    assert curled.elastic_energy == pytest.approx(0.0, abs=1e-9)
    assert np.abs(curled.bend) == pytest.approx(1.0, abs=1e-5)


# ----------------------------------------------------------------------------------------------------- Möbius band


@signs
def test_moebius_band_has_the_published_energy(sign: int) -> None:
    """18.63 at 400 elements; 18.631 in an independent transcription."""
    energy = solve(closed(sign)).energy
    assert energy / HALF_WIDTH == pytest.approx(WUNDERLICH, abs=0.05)


@signs
def test_moebius_band_closes(sign: int) -> None:
    """x(U) = x(0); the frame comes back turned by π about η."""
    equilibrium = solve(closed(sign))
    assert np.max(np.abs(equilibrium.position[-1] - equilibrium.position[0])) < SEAM_ERROR
    turned = equilibrium.frame[0] @ HALF_TURN_ABOUT_TANGENT
    assert np.max(np.abs(equilibrium.frame[-1] - turned)) < SEAM_ERROR


@signs
def test_fields_of_a_moebius_band_change_sign_at_the_seam(sign: int) -> None:
    """ω_ζ and β are antiperiodic, so that ω_η = −βω_ζ is periodic."""
    equilibrium = solve(closed(sign))
    for field in (equilibrium.bend, equilibrium.rib_slope):
        assert abs(float(field[-1] + field[0])) < SEAM_ERROR
    assert abs(float(equilibrium.torsion[-1] - equilibrium.torsion[0])) < SEAM_ERROR


def test_left_and_right_handed_moebius_bands_are_mirror_images() -> None:
    """Mirror images: the same energy and distances between points, opposite torsion."""
    right, left = solve(closed(1)), solve(closed(-1))
    assert left.energy == pytest.approx(right.energy, rel=1e-6)
    assert total_torsion(left) == pytest.approx(-total_torsion(right), rel=1e-2)
    assert abs(total_torsion(right)) > 1.0
    # The seam may sit elsewhere along the band: the compared quantities do not depend on the place of the seam.
    assert float(np.mean(distances(left))) == pytest.approx(float(np.mean(distances(right))), rel=1e-4)


@pytest.mark.parametrize("half_turns", [0, 1, -1])
def test_result_has_the_half_turns_that_it_ended_with(half_turns: int) -> None:
    """The scenario has the half turns of the start, the result those of the end."""
    elements = 100 if half_turns == 0 else ELEMENTS
    assert result(solve(closed(half_turns, elements=elements)))["half_turns"] == half_turns


@pytest.mark.parametrize("hand", [1, -1])
@pytest.mark.parametrize(("width", "energy"), [(0.1, 135.103), (0.05, 132.88)])
def test_band_keeps_three_half_turns(width: float, energy: float, hand: int) -> None:
    """The energies are those of a boundary value solver of its own, at rigidity and length 1."""
    band = solve(board([straight(1.0)], [], closed=True, half_turns=3 * hand, width=width, energy="wunderlich"))
    assert band.half_turns == 3 * hand
    assert band.stable
    assert band.warnings == []
    assert band.energy == pytest.approx(energy, rel=2e-4)


@pytest.mark.parametrize("width", [0.03, 0.02, 0.01, 0.007])
def test_narrow_band_keeps_three_half_turns(width: float) -> None:
    """From 0.05 down the energy falls by 50 V: narrower bands tend to a limit of 130.5."""
    band = solve(board([straight(1.0)], [], closed=True, half_turns=3, width=width, energy="wunderlich"))
    assert (band.half_turns, band.stable) == (3, True)
    assert band.energy == pytest.approx(130.5 + 50.0 * width, rel=1e-3)


@pytest.mark.parametrize("width", [0.1, 0.3, 0.4, 0.5])
def test_wide_bands_converge_on_every_mesh(width: float) -> None:
    """The error of the energy falls with the square of the length of the elements."""

    def energy(elements: int) -> float:
        band = solve(board([straight(1.0)], [], closed=True, half_turns=1, width=width, elements=elements))
        assert band.stable
        assert band.half_turns == 1
        assert max(band.residuals) <= 1e-8
        return band.energy

    energies = [energy(elements) for elements in (160, 320, 480, 640, 1280)]
    steps = energies[0] - energies[1], energies[1] - energies[3], energies[3] - energies[4]
    assert steps[0] / steps[1] == pytest.approx(4.0, rel=0.2)
    assert steps[1] / steps[2] == pytest.approx(4.0, rel=0.2)
    assert energies[1] > energies[2] > energies[3]


def test_default_mesh_carries_the_widest_band() -> None:
    band = solve(board([straight(1.0)], [], closed=True, half_turns=1, width=0.5))
    error = band.error
    assert error is not None
    assert max(error.energy, error.force, error.radius) <= 1e-3
    assert [warning for warning in band.warnings if "solver.accuracy" in warning] == []


def test_band_that_keeps_no_half_turns_is_warned_of() -> None:
    band = solve(board([straight(1.0)], [], closed=True, half_turns=4, width=0.1, elements=80))
    assert band.half_turns == 0
    [warning] = band.warnings
    assert "it was given 4 half turns and ended with 0" in warning


def test_moebius_band_is_a_minimum() -> None:
    """MODEL §6: the flip-symmetric state; moving the seam along the band is free."""
    assert solve(closed(1)).stable is not False


def test_moebius_band_is_in_balance_with_itself() -> None:
    """The internal wrench is one and the same all along, through the seam."""
    wrenches = internal_wrenches(solve(closed(1)))
    assert np.max(np.abs(wrenches - wrenches[0])) < 1e-6 * np.max(np.abs(wrenches))


# ------------------------------------------------------------------------------------------------------- the seam


def test_seam_may_lie_anywhere() -> None:
    """Held by the pose that it has at 0.3 U, or made to lie where the rib is square: the energy is the same to 1e-6."""
    free = solve(closed(1))
    k = int(np.argmin(np.abs(free.u - 0.3 * LENGTH)))
    pose = support("start", free.position[k], rotation_vector(free.frame[k]), square_rib=False)
    square = support("start", numbers([0.0] * 3), numbers([0.0] * 3), square_rib=True)
    for held in (pose, square):
        equilibrium = solve(closed(1, [held]))
        assert equilibrium.energy == pytest.approx(free.energy, rel=1e-6)
        assert np.max(np.abs(equilibrium.position[-1] - equilibrium.position[0])) < SEAM_ERROR


@pytest.mark.parametrize("at", ["start", 0.3 * LENGTH])
def test_support_of_a_closed_belt_holds_nothing(at: str | float) -> None:
    """A single pose only places the band: no force, no moment, wherever along the band."""
    pose = ((0.2, -0.1, 0.3), (0.3, 0.1, -0.2))
    equilibrium = solve(closed(1, [{**support("start", *pose, square_rib=False), "at": at}]))
    reaction = result(equilibrium)["supports"][0]
    assert equilibrium.energy / HALF_WIDTH == pytest.approx(WUNDERLICH, abs=0.05)
    assert np.max(np.abs([reaction["force"], reaction["moment"]])) < 1e-5
    k = 0 if isinstance(at, str) else node_at(equilibrium, at)
    assert equilibrium.position[k] == pytest.approx(pose[0], abs=1e-8)


def test_ring_can_be_pulled_by_its_supports() -> None:
    """The point opposite to the start drawn away by a fifth: equal and opposite pulls, at more energy."""
    ring = solve(closed(0, elements=100))
    opposite = ring.position[50]
    pose = support("start", ring.position[0], rotation_vector(ring.frame[0]), square_rib=False)
    pin: Json = {"at": LENGTH / 2.0, "position": numbers(1.2 * opposite)}
    pulled = solve(closed(0, [pose, pin], elements=100))
    forces = [np.array(entry["force"]) for entry in result(pulled)["supports"]]
    assert pulled.energy > 1.05 * ring.energy
    assert float(forces[1] @ opposite) > 1e-3
    assert np.max(np.abs(forces[0] + forces[1])) < 1e-6


def test_links_of_a_closed_belt_may_reach_across_the_seam() -> None:
    """The belt between two points is the shorter way round: 0.2 U here, not 0.8 U; more is refused."""
    for share, status in [(0.15, "converged"), (0.21, "infeasible")]:
        link: Json = {"from": 0.1 * LENGTH, "to": 0.9 * LENGTH, "offset": [0.0, -share * LENGTH, 0.0]}
        scenario = closed(0, [support("start", ORIGIN, ORIGIN, square_rib=False)], elements=100)
        scenario["links"] = [link]
        assert solve_any(scenario).status == status


# ------------------------------------------------------------------------------------- what the seam must not change


def test_stiffener_may_begin_at_the_seam() -> None:
    """Its ribs are square at both its ends, wherever the belt is cut open."""
    rest = [straight(0.5), arc(0.4, 2.0)]
    for half_turns in (0, 1):
        one, other = (
            solve(board(pieces, [], closed=True, half_turns=half_turns, width=0.1, elements=160))
            for pieces in ([rigid(0.1), *rest], [rigid(0.05), *rest, rigid(0.05)])
        )
        assert np.abs(one.rib_slope[[0, -1]]) == pytest.approx([0.0, 0.0], abs=1e-12)
        assert one.energy == pytest.approx(other.energy, rel=1e-6)


def test_moment_may_act_at_the_seam() -> None:
    """Two clamps, one of them at the seam or both away from it: the bend jumps at a clamp."""
    energies = []
    for shift in (0.0, 0.1):
        held = [
            {"at": "start" if shift == 0.0 else shift, "position": numbers(ORIGIN), "rotation": numbers(ORIGIN)},
            {"at": 0.5 + shift, "position": [0.3, 0.1, 0.1], "rotation": [0.0, 0.4, math.pi]},
        ]
        energies.append(solve(board([straight(1.0)], held, closed=True, elements=160)).energy)
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)


def test_supports_on_a_ring_are_met_by_that_ring() -> None:
    """Whichever side the bulge is on."""
    places = (0.4, 0.5)
    supports = [support("start", ORIGIN, ORIGIN, square_rib=False)]
    for u in places:
        angle = math.tau * u
        position = ((math.cos(angle) - 1.0) / math.tau, math.sin(angle) / math.tau, 0.0)
        supports.append({**support("end", position, (0.0, 0.0, angle), square_rib=False), "at": u})
    for side in (1.0, -1.0):
        ring = solve(board([straight(1.0)], supports, closed=True, width=0.03, bulge=(side, 0.0, 0.0)))
        assert ring.energy == pytest.approx(2.0 * math.pi**2, rel=1e-6)
        assert not ring.warnings


@pytest.mark.parametrize("elements", [240, 241, 267])
def test_ring_that_lies_on_itself_keeps_the_half_turns_it_was_given(elements: int) -> None:
    ring = solve(board([straight(1.0)], [], closed=True, half_turns=2, width=0.1, elements=elements))
    assert ring.half_turns == 2
    assert not ring.warnings


def test_supports_too_far_apart_across_the_seam_are_named() -> None:
    held = [(0.05, [0.0, 0.0, 0.0]), (0.5, [0.1, 0.2, 0.0]), (0.95, [0.0, 0.12, 0.0])]
    supports: list[Json] = [{"at": u, "position": position} for u, position in held]
    belt = solve_any(board([straight(1.0)], supports, closed=True))
    assert belt.status == "infeasible"
    assert "supports[2] and supports[0]" in belt.message
    assert belt.half_turns is None
