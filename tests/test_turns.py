"""Whole turns: rotations beyond half a turn, and moments about the axis of a hinge, which roll a belt up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import ORIGIN, Json, arc, belt, board, clamped, rotation_matrix, rotation_vector, solve, straight, support

TAU = 2.0 * math.pi


def turned(angle: float, **options: Any) -> Json:
    """A belt of rigidity 1 and length 1 whose end is turned about the width, and free to move."""
    return belt([support("start", ORIGIN, ORIGIN), support("end", None, (0.0, 0.0, angle))], **options)


def rolled(moment: float, **options: Any) -> Json:
    """A belt whose end bears a moment about the width, and is free to move."""
    tables = turned(0.0, **options)
    tables["supports"][1] |= {"hinge": "zeta", "moment": moment}
    return tables


@pytest.mark.parametrize("angle", [4.0, TAU, -TAU, 2.5 * TAU])
@pytest.mark.parametrize("elements", [None, 120])
def test_belt_turned_at_its_end_is_a_circle(angle: float, elements: int | None) -> None:
    """Closed form: bend and moment are the angle over the length, the energy half its square."""
    found = solve(turned(angle, elements=elements))
    assert found.stable
    assert found.energy == pytest.approx(0.5 * angle**2, rel=1e-9)
    assert found.bend == pytest.approx(np.full_like(found.u, angle), rel=1e-6)
    assert found.reaction("end").moment == pytest.approx([0.0, 0.0, angle], abs=1e-6 * abs(angle))
    assert found.to_dict()["scenario"]["supports"][1]["rotation"] == [0.0, 0.0, angle]
    assert len(found.warnings) == (abs(angle) > TAU + 1e-6)


def test_loop_between_clamps_is_the_one_to_which_a_path_leads() -> None:
    """The independent way there is `follow`."""
    end = [0.0, 0.5, 0.0]
    found = solve(clamped(end, (0.0, 0.0, TAU), elements=120))
    start = solve(clamped(end, (0.0, 0.0, 1.5), elements=120))
    poses = [(end, [0.0, 0.0, angle]) for angle in np.linspace(1.5, TAU, 8)[1:]]
    loop = fb.follow(start, fb.Poses(poses), branches=1).branches[0].equilibrium(-1)
    assert found.energy == pytest.approx(loop.energy, rel=1e-6)
    assert np.abs(found.position - loop.position).max() < 1e-4


def test_half_a_turn_of_few_decimals_is_no_more_than_half_a_turn() -> None:
    """The belt between them may turn either way round, as with an exact half turn."""
    ends = [solve(clamped((-0.4, 0.0, 0.0), (0.0, 0.0, angle), elements=80)) for angle in (math.pi, 3.1416)]
    assert ends[0].energy == pytest.approx(ends[1].energy, rel=1e-4)


def test_supports_that_turn_alike_do_not_wind_the_belt() -> None:
    turn = (0.0, 0.0, 3.5)
    plain = solve(clamped((0.0, 0.6, 0.0), elements=80))
    moved = solve(
        clamped(
            rotation_matrix(turn) @ [0.0, 0.6, 0.0],
            turn,
            start_rotation=turn,
            elements=80,
            bulge=rotation_matrix(turn)[:, 0],
        )
    )
    assert moved.energy == pytest.approx(plain.energy, rel=1e-8)


def test_rotation_that_cannot_be_followed_is_taken_the_shorter_way_with_a_warning() -> None:
    """A coil of four turns is not stable, so that no minimum leads there."""
    found = solve(turned(4.0 * TAU))
    assert found.energy == pytest.approx(0.0, abs=1e-9)
    assert any("turned the shorter way round" in warning for warning in found.warnings)


@pytest.mark.parametrize("moment", [1.0, TAU, -TAU, 2.5 * TAU])
def test_cantilever_under_an_end_moment_is_a_circle(moment: float) -> None:
    """Closed form: curvature M/R_f, potential −M² U/(2 R_f), beyond a whole turn too."""
    length, rigidity = 2.0, 0.5
    tables = rolled(moment * rigidity / length, length=length, width=0.2, rigidity=rigidity)
    found = solve(tables)
    moment = moment * rigidity / length
    assert found.stable
    assert found.bend == pytest.approx(np.full_like(found.u, moment / rigidity), rel=1e-6)
    assert found.energy == pytest.approx(-(moment**2) * length / (2.0 * rigidity), rel=1e-9)
    assert found.elastic_energy == pytest.approx(-found.energy, rel=1e-9)
    assert found.reaction("end").moment == pytest.approx([0.0, 0.0, moment], abs=1e-8)
    assert found.reaction("start").moment == pytest.approx([0.0, 0.0, -moment], abs=1e-6)


TILT = (0.3, -0.5, 0.2)


def hinged(moment: float, rotation: Any = TILT, axis: str = "zeta") -> Json:
    """A belt clamped at its start, bent and twisted in space, whose end bears a moment about the axis of its hinge."""
    tables = clamped((0.1, 0.6, 0.15), rotation, elements=80)
    tables["supports"][1] |= {"hinge": axis, "moment": moment}
    return tables


@pytest.mark.parametrize("axis", ["xi", "zeta"])
def test_clamp_at_the_angle_of_a_hinge_bears_the_moment_of_the_hinge(axis: str) -> None:
    """The same shape, held by a frame in place of the moment."""
    moment = 3.0
    loaded = solve(hinged(moment, axis=axis))
    frame = loaded.frame[-1]
    held = solve(clamped((0.1, 0.6, 0.15), rotation_vector(frame), elements=80))
    assert held.elastic_energy == pytest.approx(loaded.elastic_energy, rel=1e-7)
    assert np.abs(held.position - loaded.position).max() < 1e-6
    assert held.reaction("end").moment == pytest.approx(loaded.reaction("end").moment, rel=1e-4, abs=1e-4)
    column = {"xi": 0, "zeta": 2}[axis]
    assert held.reaction("end").moment @ frame[:, column] == pytest.approx(moment, rel=1e-5)


def test_reaction_of_a_hinge_with_a_moment_is_the_gradient_of_the_energy() -> None:
    moment, h = 3.0, 1e-4
    gradient = []
    for axis in np.eye(3):
        turns = [rotation_vector(rotation_matrix(sign * h * axis) @ rotation_matrix(TILT)) for sign in (1.0, -1.0)]
        energies = [solve(hinged(moment, turn)).energy for turn in turns]
        gradient.append((energies[0] - energies[1]) / (2.0 * h))
    assert solve(hinged(moment)).reaction("end").moment == pytest.approx(gradient, rel=1e-4, abs=1e-4)


def test_derivative_by_a_hinge_with_a_moment_agrees_with_differences() -> None:
    h = 1e-4
    jacobian = solve(hinged(3.0)).jacobian("end")
    for i, axis in enumerate(np.eye(3)):
        turns = [rotation_vector(rotation_matrix(sign * h * axis) @ rotation_matrix(TILT)) for sign in (1.0, -1.0)]
        shapes = [solve(hinged(3.0, turn)).position for turn in turns]
        assert np.abs((shapes[0] - shapes[1]) / (2.0 * h) - jacobian[:, :, 3 + i]).max() < 1e-4


def test_moment_needs_a_hinge() -> None:
    tables = turned(0.0)
    tables["supports"][1]["moment"] = 1.0
    with pytest.raises(fb.InvalidScenario, match=r"supports\[1\]\.moment: found a moment without a hinge"):
        fb.Scenario.from_dict(tables)


def test_opposite_moments_at_two_hinges_roll_up_a_belt_between_pins() -> None:
    """Planar: a circular arc whose chord is the distance of the pins needs no force; M = 2 a, sin(a)/a = distance."""
    angle = 1.2
    ends = [support("start", ORIGIN, ORIGIN), support("end", (0.0, math.sin(angle) / angle, 0.0), ORIGIN)]
    for end, sign in zip(ends, (-1.0, 1.0), strict=True):
        end |= {"hinge": "zeta", "moment": sign * 2.0 * angle}
    found = solve(board([straight(1.0)], ends, elements=80))
    assert found.bend == pytest.approx(np.full_like(found.u, 2.0 * angle), rel=1e-5)
    assert found.reaction("end").force == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("angle", [TAU, -TAU])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_whole_turn_about_any_axis_rolls_up_a_free_end(axis: int, angle: float) -> None:
    """The least energy of a belt that has kept an odd number of whole turns is that of a circle."""
    rotation = [0.0, 0.0, 0.0]
    rotation[axis] = angle
    found = solve(belt([support("start", ORIGIN, ORIGIN), support("end", None, rotation)]))
    assert found.stable
    assert found.energy == pytest.approx(0.5 * TAU**2, rel=1e-4)


def pulled(turns: float, **options: Any) -> Json:
    """A narrow strip under tension whose end slides along its line and is turned about it by half turns."""
    end: Json = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, turns * math.pi, 0.0]}
    tables = belt([support("start", ORIGIN, ORIGIN), end], width=0.02, **options)
    tables["loads"] = {"points": [{"at": "end", "force": [0.0, 50.0, 0.0]}]}
    return tables


def twist(found: fb.Equilibrium) -> float:
    """Total twist of the strip, in half turns."""
    return float(np.trapezoid(found.torsion, found.u)) / math.pi


@pytest.mark.parametrize("bulge", [None, (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize(("turns", "elements"), [(1.9, None), (2.0, None), (-2.0, None), (2.0, 160), (-2.0, 160)])
def test_strip_is_twisted_by_the_turn_asked_for(turns: float, elements: int | None, bulge: Any) -> None:
    """Near two half turns the strip snaps, and its mirror image, twisted the other way, ends at the same frame."""
    found = solve(pulled(turns, elements=elements, bulge=bulge))
    assert twist(found) == pytest.approx(turns, rel=0.1)
    assert found.stable


@pytest.mark.parametrize("turns", [2.05, 3.0, -3.5, 4.0])
def test_strip_that_has_lost_its_turn_says_so(turns: float) -> None:
    found = solve(pulled(turns))
    has_lost = abs(twist(found) - turns) > 0.1 * abs(turns)
    words = ("has snapped on the way", "the other way round", "the shorter way round")
    assert not has_lost or any(word in warning for word in words for warning in found.warnings)


@pytest.mark.parametrize(("distance", "lean"), [(0.36, 0.15), (0.32, -0.1)])
def test_turn_of_a_board_in_its_own_plane_is_no_winding(distance: float, lean: float) -> None:
    """The board turns by half a turn as it lies flat; the vectors are one frame, a whole turn apart."""
    segments = [straight(0.15), arc(0.2 * math.pi, 5.0), straight(0.15)]
    energies = []
    for side in (1.0, -1.0):
        for angle in (math.pi + lean, lean - math.pi):
            ends = [support("start", ORIGIN, ORIGIN), support("end", (0.0, 0.0, distance), (angle, 0.0, 0.0))]
            found = solve(board(segments, ends, width=0.06, rigidity=1.0, bulge=(side, 0.0, 0.0)))
            assert found.side == 1
            assert found.stable
            assert not found.warnings
            energies.append(found.energy)
    assert energies == pytest.approx([energies[0]] * 4, rel=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_loop_lies_on_the_side_of_the_bulge_where_a_mirror_keeps_its_turn(axis: int) -> None:
    """The mirror x → −x takes a turn about x to itself, and so does a half turn about y a turn about y."""
    rotation = [0.0, 0.0, 0.0]
    rotation[axis] = TAU
    bulges = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]
    end = (0.0, 0.4, 0.0)
    loops = [solve(clamped(end, rotation, width=0.05, elements=100, bulge=bulge)) for bulge in bulges]
    assert [loop.side for loop in loops] == [1, 1]
    assert loops[0].energy == pytest.approx(loops[1].energy, rel=1e-6)
