"""Supports inside the span, hinges, slides and links, and supports that contradict one another.

CONTRACT: a support acts on the belt with `force` and `moment`. A link holds x(to) − x(from) = offset, Eq. (35); it acts
with its `force` at `to` and against it at `from`: the gradient of the least energy by its offset, as for supports.
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
    Cantilever,
    Energy,
    Json,
    board,
    clamped,
    internal,
    node_at,
    result,
    rigid,
    rotation_matrix,
    rotation_vector,
    solve,
    solve_any,
    straight,
    support,
)

END_POSITION, END_ROTATION = np.array([0.06, 0.62, 0.08]), np.array([0.3, 0.2, -0.25])
AXES = {"xi": 0, "eta": 1, "zeta": 2}
ELEMENTS = 80

energy_model = pytest.mark.parametrize("energy", ENERGIES)


def held(inner: list[Json], *, energy: Energy = "wunderlich", links: list[Json] | None = None, **options: Any) -> Json:
    """A straight belt clamped at both ends, and held in between."""
    ends = support("start", ORIGIN, ORIGIN), support("end", END_POSITION, END_ROTATION)
    return board(
        options.pop("segments", [straight(1.0)]),
        [ends[0], *inner, ends[1]],
        energy=energy,
        elements=ELEMENTS,
        bulge=(1.0, 0.0, 0.0),
        links=links,
        **options,
    )


def hinged(axis: str, energy: Energy = "wunderlich") -> Json:
    """The far end free to turn about one of its own axes."""
    scenario = held([], energy=energy)
    scenario["supports"][-1].update(hinge=axis, square_rib=False)
    return scenario


def linked(offset: Any, energy: Energy = "wunderlich", *, start: float = 0.3, end: float = 0.7) -> Json:
    return held([], energy=energy, links=[{"from": start, "to": end, "offset": [float(v) for v in offset]}])


def reactions(equilibrium: fb.Equilibrium) -> list[tuple[Array, Array]]:
    """Force and moment of every support, in the scenario's order."""
    return [(np.array(entry["force"]), np.array(entry["moment"])) for entry in result(equilibrium)["supports"]]


def scale_of(equilibrium: fb.Equilibrium) -> float:
    return max(float(np.max(np.abs(field))) for pair in reactions(equilibrium) for field in pair)


def natural_offset(energy: Energy = "wunderlich") -> Array:
    """x(0.7) − x(0.3) without a link."""
    free = solve(held([], energy=energy))
    return np.asarray(free.position[node_at(free, 0.7)] - free.position[node_at(free, 0.3)], dtype=np.float64)


# ---------------------------------------------------------------------------------------------------- inner supports


@energy_model
def test_pin_holds_the_place_of_a_point_and_nothing_else(energy: Energy) -> None:
    """Position only, in the middle: met to 1e-8, no moment; the internal force jumps by its reaction."""
    pin = (0.25, 0.3, 0.0)
    equilibrium = solve(held([{"at": 0.5, "position": list(pin)}], energy=energy))
    force, moment = reactions(equilibrium)[1]
    assert equilibrium.position[node_at(equilibrium, 0.5)] == pytest.approx(pin, abs=1e-8)
    assert np.max(np.abs(moment)) < 1e-7 * scale_of(equilibrium)
    assert np.linalg.norm(force) > 1.0
    inside, _ = internal(equilibrium)
    before, after = inside[equilibrium.u < 0.49][-1], inside[equilibrium.u > 0.51][0]
    assert np.max(np.abs(before - after - force)) < 1e-6 * scale_of(equilibrium)


def test_pin_where_the_belt_is_anyway_changes_nothing() -> None:
    """A point of the unpinned shape: the same energy, no reaction."""
    free = solve(held([]))
    place = free.position[node_at(free, 0.4)]
    pinned = solve(held([{"at": 0.4, "position": [float(v) for v in place]}]))
    assert pinned.energy == pytest.approx(free.energy, rel=1e-8)
    assert np.max(np.abs(reactions(pinned)[1][0])) < 1e-3 * scale_of(free)


@energy_model
def test_several_inner_supports_hold_together(energy: Energy) -> None:
    """Two pins and a clamp inside the span, given in the order of `at`."""
    inner: list[Json] = [
        {"at": 0.25, "position": [0.12, 0.2, 0.0]},
        {"at": 0.5, "position": [0.25, 0.33, 0.02], "rotation": [0.05, 0.1, 0.2]},
        {"at": 0.75, "position": [0.15, 0.5, 0.05]},
    ]
    equilibrium = solve(held(inner, energy=energy))
    for table in inner:
        assert equilibrium.position[node_at(equilibrium, table["at"])] == pytest.approx(table["position"], abs=1e-8)
    frame = equilibrium.frame[node_at(equilibrium, 0.5)]
    assert np.max(np.abs(frame - rotation_matrix(inner[1]["rotation"]))) < 1e-7
    assert [entry["at"] for entry in result(equilibrium)["supports"]][1:-1] == [0.25, 0.5, 0.75]


def test_support_anywhere_is_met_between_the_usual_nodes() -> None:
    """`at` need not be a multiple of the element length."""
    at = 1.0 / math.pi
    equilibrium = solve(held([{"at": at, "position": [0.2, 0.2, 0.0]}]))
    assert equilibrium.position[node_at(equilibrium, at)] == pytest.approx([0.2, 0.2, 0.0], abs=1e-8)


@energy_model
def test_orientation_alone_takes_a_moment_and_no_force(energy: Energy) -> None:
    """Rotation only, in the middle."""
    turned = rotation_vector(rotation_matrix([0.1, 0.3, 0.1]))
    equilibrium = solve(held([{"at": 0.5, "rotation": turned.tolist()}], energy=energy))
    force, moment = reactions(equilibrium)[1]
    assert np.max(np.abs(equilibrium.frame[node_at(equilibrium, 0.5)] - rotation_matrix(turned))) < 1e-7
    assert np.max(np.abs(force)) < 1e-7 * scale_of(equilibrium)
    assert np.linalg.norm(moment) > 1e-2


def test_rib_inside_the_span_is_free_unless_asked_for() -> None:
    """CONTRACT: `square_rib` is false by default but at ends that are clamped."""
    clamp = {"at": 0.5, "position": [0.25, 0.33, 0.05], "rotation": [0.3, 0.3, 0.1]}
    free, square = solve(held([clamp])), solve(held([{**clamp, "square_rib": True}]))
    assert abs(float(free.rib_slope[node_at(free, 0.5)])) > 1e-3
    assert abs(float(square.rib_slope[node_at(square, 0.5)])) < 1e-8
    assert square.energy > free.energy


def test_cantilever_held_in_the_middle_hangs_from_there() -> None:
    """Clamped at u = 0.4 alone: both sides are cantilevers of their own.

    The moment jumps there; a bend that is continuous inside a segment follows it to O(h) only: 2e-4 at 200 elements.
    """
    clamp = {"at": 0.4, "position": [0.0, 0.4, 0.0], "rotation": [0.0, 0.0, 0.0]}
    scenario = board([straight(1.0)], [clamp], elements=200, density=5.0, gravity=(-1.0, 0.0, 0.0))
    equilibrium = solve(scenario)
    right = Cantilever(weight=5.0, length=0.6).position(0.6)[0]
    left = Cantilever(weight=5.0, length=0.4).position(0.4)[0]
    assert equilibrium.position[-1] == pytest.approx([right[0], 0.4 + right[1], 0.0], abs=1e-3)
    assert equilibrium.position[0] == pytest.approx([left[0], 0.4 - left[1], 0.0], abs=1e-3)
    force, _ = reactions(equilibrium)[0]
    assert force == pytest.approx([5.0, 0.0, 0.0], abs=1e-6)


def test_end_alone_may_hold_the_belt_at_two_points() -> None:
    """Two pins inside, both ends free: between them half a wave of the elastica, straight beyond them."""
    inner: list[Json] = [{"at": 0.2, "position": [0.0, 0.0, 0.0]}, {"at": 0.8, "position": [0.0, 0.5, 0.0]}]
    equilibrium = solve(board([straight(1.0)], inner, elements=100, bulge=(1.0, 0.0, 0.0)))
    outside = (equilibrium.u < 0.15) | (equilibrium.u > 0.85)
    assert np.max(np.abs(equilibrium.bend[outside])) < 1e-3
    (first, _), (second, _) = reactions(equilibrium)
    assert first == pytest.approx(-second, abs=1e-6 * scale_of(equilibrium))


# ------------------------------------------------------------------------------------------------- hinges and slides


@energy_model
@pytest.mark.parametrize("axis", AXES)
def test_hinge_takes_no_moment_about_its_axis(energy: Energy, axis: str) -> None:
    """The body axis is held where the rotation has it; the belt turns about it, at less energy."""
    equilibrium = solve(hinged(axis, energy))
    held_axis = rotation_matrix(END_ROTATION)[:, AXES[axis]]
    _, moment = reactions(equilibrium)[-1]
    assert np.max(np.abs(equilibrium.frame[-1][:, AXES[axis]] - held_axis)) < 1e-7
    assert abs(float(moment @ held_axis)) < 1e-7 * scale_of(equilibrium)
    clamp = held([], energy=energy)
    clamp["supports"][-1]["square_rib"] = False
    assert equilibrium.energy < solve(clamp).energy * (1.0 - 1e-4)


def test_hinge_about_zeta_turns_in_the_plane() -> None:
    """In a planar belt such a hinge is a pin: no moment, no bend at the end."""
    scenario = clamped((0.0, 0.7, 0.0), elements=ELEMENTS, bulge=(1.0, 0.0, 0.0))
    scenario["supports"][1].update(hinge="zeta")
    equilibrium = solve(scenario)
    assert abs(float(equilibrium.bend[-1])) < 1e-2
    assert np.max(np.abs(equilibrium.frame[-1][:, 2] - [0.0, 0.0, 1.0])) < 1e-7
    assert abs(float(equilibrium.frame[-1][0, 1])) > 0.1


def test_hinge_inside_the_span_holds_its_axis() -> None:
    equilibrium = solve(held([{"at": 0.5, "rotation": [0.0, 0.2, 0.1], "hinge": "eta"}]))
    tangent = rotation_matrix([0.0, 0.2, 0.1])[:, 1]
    _, moment = reactions(equilibrium)[1]
    assert np.max(np.abs(equilibrium.frame[node_at(equilibrium, 0.5)][:, 1] - tangent)) < 1e-7
    assert abs(float(moment @ tangent)) < 1e-7 * scale_of(equilibrium)


@energy_model
@pytest.mark.parametrize("free", [0, 1, 2])
def test_slide_inside_the_span_takes_no_force_along_itself(energy: Energy, free: int) -> None:
    """One component of a position "free": the others are held."""
    place: list[Any] = [0.3, 0.28, 0.05]
    place[free] = "free"
    equilibrium = solve(held([{"at": 0.5, "position": place}], energy=energy))
    force, moment = reactions(equilibrium)[1]
    k = node_at(equilibrium, 0.5)
    for axis in {0, 1, 2} - {free}:
        assert equilibrium.position[k, axis] == pytest.approx(place[axis], abs=1e-8)
    assert abs(float(force[free])) < 1e-7 * scale_of(equilibrium)
    assert np.max(np.abs(moment)) < 1e-7 * scale_of(equilibrium)


# ------------------------------------------------------------------------------------------------------------- links


@energy_model
def test_link_holds_its_offset(energy: Energy) -> None:
    """Eq. (35), world axes: met to 1e-8."""
    offset = 0.8 * natural_offset(energy) + [0.02, 0.0, -0.01]
    equilibrium = solve(linked(offset, energy))
    actual = equilibrium.position[node_at(equilibrium, 0.7)] - equilibrium.position[node_at(equilibrium, 0.3)]
    assert actual == pytest.approx(offset, abs=1e-8)


@energy_model
def test_link_force_is_what_the_belt_between_its_ends_carries_more(energy: Energy) -> None:
    """The internal force jumps by the link's force at one end and back at the other."""
    equilibrium = solve(linked(0.8 * natural_offset(energy), energy))
    force = np.array(result(equilibrium)["links"][0]["force"])
    inside, _ = internal(equilibrium)
    u = equilibrium.u
    outer = inside[(u < 0.29) | (u > 0.71)]
    between = inside[(u > 0.31) & (u < 0.69)]
    assert np.linalg.norm(force) > 1e-2
    assert np.max(np.abs(outer - outer[0])) < 1e-6 * scale_of(equilibrium)
    assert np.max(np.abs(between - outer[0] - force)) < 1e-6 * scale_of(equilibrium)


@energy_model
def test_supports_balance_the_couple_of_a_link(energy: Energy) -> None:
    """A link keeps its direction as well as its length, so it may turn the belt: moment offset × force in all."""
    offset = 0.8 * natural_offset(energy) + [0.02, 0.0, -0.01]
    equilibrium = solve(linked(offset, energy))
    force = np.array(result(equilibrium)["links"][0]["force"])
    (first, first_moment), (last, last_moment) = reactions(equilibrium)
    moment = first_moment + last_moment + np.cross(equilibrium.position[-1], last) + np.cross(offset, force)
    assert np.max(np.abs(first + last)) < 1e-7 * scale_of(equilibrium)
    assert np.max(np.abs(moment)) < 1e-7 * scale_of(equilibrium)


def test_link_force_is_the_gradient_of_the_energy_by_its_offset() -> None:
    """As for supports: + the gradient of the least energy."""
    offset, step = 0.8 * natural_offset(), 3e-4
    force = np.array(result(solve(linked(offset)))["links"][0]["force"])
    gradient = [
        (solve(linked(offset + step * axis)).energy - solve(linked(offset - step * axis)).energy) / (2.0 * step)
        for axis in np.eye(3)
    ]
    assert np.max(np.abs(gradient - force)) < 1e-3 * np.max(np.abs(force))


def test_link_at_its_natural_offset_does_nothing() -> None:
    free = solve(held([]))
    equilibrium = solve(linked(natural_offset()))
    assert equilibrium.energy == pytest.approx(free.energy, rel=1e-8)
    assert np.max(np.abs(result(equilibrium)["links"][0]["force"])) < 1e-3 * scale_of(free)


def test_link_joins_points_in_either_order() -> None:
    """`from` and `to` swapped, the offset turned round: the same shape, the opposite force."""
    offset = 0.8 * natural_offset()
    one, other = solve(linked(offset)), solve(linked(-offset, start=0.7, end=0.3))
    assert other.energy == pytest.approx(one.energy, rel=1e-8)
    forces = [np.array(result(equilibrium)["links"][0]["force"]) for equilibrium in (one, other)]
    assert forces[1] == pytest.approx(-forces[0], abs=1e-6 * np.max(np.abs(forces[0])))


def test_link_makes_a_loop_of_a_belt_that_nothing_else_holds() -> None:
    """Offset 0 from start to end and one clamp: the drop-shaped loop of a sheet with its ends joined."""
    link = {"from": "start", "to": "end", "offset": [0.0, 0.0, 0.0]}
    equilibrium = solve(board([straight(1.0)], [support("start", ORIGIN, ORIGIN)], elements=160, links=[link]))
    assert equilibrium.position[-1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-8)
    force = np.array(result(equilibrium)["links"][0]["force"])
    reaction, _ = reactions(equilibrium)[0]
    assert np.max(np.abs(reaction)) < 1e-6 * np.linalg.norm(force)
    assert abs(float(equilibrium.bend[-1])) < 1e-2


# ---------------------------------------------------------------------------------------- contradiction, redundancy


def outcome(scenario: Json) -> tuple[str, str]:
    """The status and all text of the result; "invalid" where the scenario is refused."""
    try:
        equilibrium = solve_any(scenario)
    except fb.InvalidScenario as error:
        return "invalid", str(error)
    fields = {key: value for key, value in result(equilibrium).items() if key != "scenario"}
    return equilibrium.status, f"{fields} {getattr(equilibrium, 'message', '')}"


def assert_supports_named(message: str, places: tuple[float, float]) -> None:
    """The message names a support by its index, or both by their places."""
    by_index = "supports[1]" in message or "supports[2]" in message
    assert by_index or all(f"u = {at}" in message for at in places), message


def test_link_longer_than_the_belt_between_its_ends_is_named() -> None:
    """0.5 across 0.4 of belt: never "converged"."""
    status, message = outcome(linked((0.0, 0.5, 0.0)))
    assert status in {"infeasible", "not_converged", "invalid"}
    assert "links[0]" in message


def test_only_the_impossible_link_is_named() -> None:
    good = {"from": 0.1, "to": 0.2, "offset": [0.02, 0.08, 0.0]}
    scenario = held([], links=[good, {"from": 0.3, "to": 0.7, "offset": [0.3, 0.3, 0.0]}])
    status, message = outcome(scenario)
    assert status in {"infeasible", "not_converged", "invalid"}
    assert "links[1]" in message
    assert "links[0]" not in message


def test_supports_too_far_apart_inside_the_span_are_named() -> None:
    """0.4 of belt cannot reach over 0.5."""
    inner: list[Json] = [{"at": 0.3, "position": [0.0, 0.1, 0.0]}, {"at": 0.7, "position": [0.0, 0.6, 0.0]}]
    status, message = outcome(held(inner))
    assert status in {"infeasible", "not_converged", "invalid"}
    assert_supports_named(message, (0.3, 0.7))


@pytest.mark.parametrize("distance", [0.15, 0.25])
def test_supports_in_one_stiffener_at_a_wrong_distance_are_named(distance: float) -> None:
    """A stiffener holds its points at their distance of 0.2: nearer is as impossible as farther."""
    inner: list[Json] = [
        {"at": 0.4, "position": [0.1, 0.3, 0.0]},
        {"at": 0.6, "position": [0.1, 0.3 + distance, 0.0]},
    ]
    status, message = outcome(held(inner, segments=[straight(0.4), rigid(0.2), straight(0.4)]))
    assert status in {"infeasible", "not_converged", "invalid"}
    assert_supports_named(message, (0.4, 0.6))


def test_supports_in_one_stiffener_at_its_distance_hold() -> None:
    """Supports that repeat the constraint of a stiffener are redundant, not contradictory: solved, or refused."""
    inner: list[Json] = [{"at": 0.4, "position": [0.1, 0.3, 0.0]}, {"at": 0.6, "position": [0.1, 0.5, 0.0]}]
    scenario = held(inner, segments=[straight(0.4), rigid(0.2), straight(0.4)])
    scenario["supports"][-1]["position"] = [0.0, 0.8, 0.05]
    status, message = outcome(scenario)
    assert status in {"converged", "invalid"}, message
    if status == "invalid":
        assert_supports_named(message, (0.4, 0.6))


def redundant(offset: Any) -> Json:
    return held([], links=[{"from": "start", "to": "end", "offset": [float(v) for v in offset]}])


def test_link_that_the_supports_imply_is_named() -> None:
    """Solved, with a warning that names the link."""
    status, message = outcome(redundant(END_POSITION))
    assert status == "converged"
    assert "links[0]" in message


def test_link_that_the_supports_imply_does_not_change_the_shape() -> None:
    free, equilibrium = solve(held([])), solve(redundant(END_POSITION))
    assert equilibrium.energy == pytest.approx(free.energy, rel=1e-8)
    assert np.max(np.abs(equilibrium.position - free.position)) < 1e-6


def test_link_that_the_supports_contradict_is_named() -> None:
    """Both ends held, the link asks for another offset between them."""
    status, message = outcome(redundant(np.add(END_POSITION, (0.1, 0.0, 0.0))))
    assert status in {"infeasible", "not_converged", "invalid"}
    assert "links[0]" in message


def test_reaction_of_a_support_is_found_by_its_place() -> None:
    belt = solve(held([{"at": 0.4, "position": [0.1, 0.3, 0.0]}]))
    assert belt.reaction(0.4).force == pytest.approx(belt.reaction(1).force)
    with pytest.raises(fb.NoSupport, match="allowed one of them"):
        belt.reaction(0.41)
    assert belt.links.shape == (0, 3)
    assert belt.half_turns is None
