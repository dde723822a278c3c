"""The side to which a belt bulges is the side asked for, wherever there is a minimum on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ORIGIN,
    Json,
    arc,
    belt,
    board,
    clamped,
    numbers,
    result,
    rotation_matrix,
    rotation_vector,
    solve,
    straight,
    support,
)

C_SHAPE = [straight(0.01), arc(0.02 * math.pi, 50.0), straight(0.01)]
HALF_TURN = (math.pi, 0.0, 0.0)


def c_shaped(distance: float, side: float, holds: str = "clamped") -> Json:
    """A board in the form of a C, its ends drawn apart or together along z from 0.04."""
    ends = [support("start", ORIGIN, ORIGIN), support("end", (0.0, 0.0, distance), HALF_TURN)]
    for end in ends:
        if holds == "hinged":
            end["hinge"] = "zeta"
        if holds == "pinned":
            del end["rotation"]
    return board(C_SHAPE, ends, width=0.006, rigidity=1e-5, bulge=(side, 0.0, 0.0))


def mirrored(belt: fb.Equilibrium) -> Any:
    return belt.position * [-1.0, 1.0, 1.0]


@pytest.mark.parametrize("holds", ["clamped", "hinged"])
def test_no_pose_of_a_sweep_flips_the_side(holds: str) -> None:
    """The mirror x → −x takes board and supports to themselves."""
    for distance in np.arange(0.026, 0.0385, 0.002):
        belts = [solve(c_shaped(float(distance), side, holds)) for side in (1.0, -1.0)]
        assert [belt.side for belt in belts] == [1, 1]
        peaks = [belt.highest_point.position[0] for belt in belts]
        assert peaks[0] > 0.005
        assert peaks[1] < -0.005
        assert belts[0].stable
        assert belts[1].stable
        assert belts[0].energy == pytest.approx(belts[1].energy, rel=1e-6)
        # Between hinges there are two such pairs: the ends may change places too.
        if holds == "clamped":
            assert np.allclose(belts[0].position, mirrored(belts[1]), atol=1e-5)


def test_a_twin_that_exchanges_the_ends_is_found() -> None:
    """Parallel clamps offset to the side: the point half way between them is a centre of symmetry."""
    offset = (0.15, 0.5, 0.0)
    belts = [solve(clamped(offset, elements=80, bulge=(side, 0.0, 0.0))) for side in (1.0, -1.0)]
    assert [belt.side for belt in belts] == [1, 1]
    assert np.allclose(belts[0].position, np.array(offset) - belts[1].position[::-1], atol=1e-6)


def test_side_is_that_of_the_area_under_the_spine() -> None:
    for side in (1.0, -1.0):
        arch = solve(clamped((0.0, 0.6, 0.0), bulge=(side, 0.0, 0.0)))
        area = np.trapezoid(arch.position[:, 0], arch.u)
        assert side * area > 0.1
        assert arch.side == 1
        assert result(arch)["side"] == 1
    tables = arch.scenario.to_dict()
    tables["solver"]["bulge"] = [0.0, 1.0, 0.0]
    along_the_chord = fb.solve(fb.Scenario.from_dict(tables))
    assert along_the_chord.side == 0
    [warning] = along_the_chord.warnings
    assert "solver.bulge chooses neither of two mirror images" in warning
    flat = solve(board([straight(1.0)], [support("start", ORIGIN, ORIGIN)]))
    assert flat.side == 0


def leaning(angle: float, side: float) -> Json:
    """Clamps that lean to the side of −x."""
    return clamped((0.0, 0.8, 0.0), (0.0, 0.0, -angle), start_rotation=(0.0, 0.0, angle), bulge=(side, 0.0, 0.0))


def test_other_minimum_is_taken_where_it_is_no_mirror_image() -> None:
    belts = [solve(leaning(0.1, side)) for side in (1.0, -1.0)]
    assert [belt.side for belt in belts] == [1, 1]
    assert belts[0].energy > 1.2 * belts[1].energy


def test_side_without_a_minimum_is_warned_of() -> None:
    belt = solve(leaning(1.2, 1.0))
    assert belt.side == -1
    [warning] = belt.warnings
    assert "no minimum was found on the side of solver.bulge" in warning
    assert solve(leaning(1.2, -1.0)).warnings == []


def test_loads_draw_a_belt_held_at_one_end_to_their_side_without_a_warning() -> None:
    tables = board([straight(1.0)], [support("start", ORIGIN, ORIGIN)])
    tables["loads"] = {"points": [{"at": "end", "force": numbers((-2.0, 0.0, 0.0))}]}
    belt = solve(tables)
    assert belt.side == -1
    assert belt.warnings == []


def turned(tables: Json, turn: Any) -> Json:
    """The same belt, supports and bulge turned in space."""
    frame = rotation_matrix(turn)
    for held in tables["supports"]:
        held["position"] = numbers(frame @ held["position"])
        held["rotation"] = numbers(rotation_vector(frame @ rotation_matrix(held["rotation"])))
    tables["solver"]["bulge"] = numbers(frame[:, 0])
    return tables


TURNS = [(0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.5, -1.1, 0.7)]


def twisted(width: float, offset: float, angle: float, distance: float = 0.8) -> Json:
    ends = [support("start", ORIGIN, ORIGIN), support("end", (offset, distance, 0.0), (0.0, angle, 0.0))]
    return belt(ends, width=width, bulge=(1.0, 0.0, 0.0))


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize(("width", "energy"), [(0.01, 19.203), (0.001, 19.066)])
def test_slender_belt_bulges_to_the_side_asked_for(turn: Any, width: float, energy: float) -> None:
    """A quarter twist with an offset of a tenth: the minimum on the other side has less energy, 18.0."""
    found = solve(turned(twisted(width, 0.1, math.pi / 2.0), turn))
    assert (found.side, found.warnings) == (1, [])
    assert found.energy == pytest.approx(energy, rel=1e-3)


@pytest.mark.parametrize(
    ("offset", "distance"), [(0.1, 0.05), (0.1, 0.8), (0.1, -0.3), (0.2, 0.4), (0.2, 0.8), (0.2, -0.3)]
)
def test_shape_after_a_half_twist_is_the_same_however_it_lies_in_space(offset: float, distance: float) -> None:
    belts = [solve(turned(twisted(0.1, offset, math.pi, distance), turn)) for turn in TURNS]
    assert len({belt.side for belt in belts}) == 1
    assert [belt.energy for belt in belts] == pytest.approx([belts[0].energy] * len(belts), rel=1e-6)


@pytest.mark.parametrize("angle", [math.pi / 2.0, -math.pi / 2.0])
def test_unclear_side_without_a_minimum_is_warned_of(angle: float) -> None:
    """Turned by a quarter turn about the normal, the belt bulges mostly along its width."""
    ends = [support("start", ORIGIN, ORIGIN), support("end", (0.2, 0.05, 0.0), (angle, 0.0, 0.0))]
    found = solve(belt(ends, elements=80))
    assert found.side == -1
    assert any("no minimum was found on the side of solver.bulge" in warning for warning in found.warnings)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_wound_belt_lies_on_the_side_of_the_bulge_by_a_twin_and_still_says_that_it_has_snapped(side: float) -> None:
    tables = twisted(0.1, 0.0, 8.0 * math.pi)
    tables["solver"]["bulge"] = [side, 0.0, 0.0]
    found = solve(tables)
    assert found.side == 1
    assert any("has snapped on the way" in warning for warning in found.warnings)


@pytest.mark.parametrize(("turn", "side"), [(2.0 * math.pi, -1), (-2.0 * math.pi, 1)])
def test_loop_whose_turn_leaves_no_choice_of_the_side_is_warned_of(turn: float, side: int) -> None:
    """Turned about the width, a loop lies to the left of its chord or to the right; its mirror image is turned back."""
    found = solve(clamped((0.0, 0.4, 0.0), (0.0, 0.0, turn), elements=120, bulge=(1.0, 0.0, 0.0)))
    assert found.side == side
    warned = any("lies on the other side than solver.bulge" in warning for warning in found.warnings)
    assert warned == (side == -1)
