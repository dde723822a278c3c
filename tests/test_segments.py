"""Boards of several segments: joints, arcs, corners, stiffeners, and rigidity that changes along the belt."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from cases import on_one_mesh
from helpers import (
    ENERGIES,
    GAUSS_POINTS,
    ORIGIN,
    Array,
    Cantilever,
    Energy,
    Json,
    Nodes,
    arc,
    board,
    corner,
    elements_of,
    end_wrench,
    joints,
    node_at,
    observed_orders,
    rigid,
    rms_distance,
    rotation_matrix,
    rotation_vector,
    solve,
    solve_any,
    spine_at,
    straight,
    support,
)

WIDTH = 0.1
TURN = math.pi / 3.0
MIRROR = np.diag([1.0, 1.0, -1.0])
PLACES = np.linspace(0.0, 1.0, 41)
# A pose without any symmetry of its own, for belts that turn little in their plane, and one for a bend of 60°.
POSITION, ROTATION = np.array([0.06, 0.62, 0.08]), np.array([0.3, 0.2, -0.25])
BENT_POSITION, BENT_ROTATION = np.array([0.15, 0.55, 0.37]), np.array([TURN, 0.1, 0.0])

energy_model = pytest.mark.parametrize("energy", ENERGIES)
plate_energy = pytest.mark.parametrize("energy", ["sadowsky", "wunderlich"])


def held(segments: list[Json], position: Any = POSITION, rotation: Any = ROTATION, **options: Any) -> Json:
    """Clamped at both ends, the start in the natural pose."""
    supports = [support("start", ORIGIN, ORIGIN), support("end", position, rotation)]
    options.setdefault("bulge", (1.0, 0.0, 0.0))
    return board(segments, supports, **options)


def bent(segments: list[Json], **options: Any) -> fb.Equilibrium:
    """A board that turns by 60° in its plane; of its two stable states that towards +x."""
    sides = ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    found = [solve(held(segments, BENT_POSITION, BENT_ROTATION, bulge=side, **options)) for side in sides]
    return max(found, key=lambda equilibrium: float(np.max(equilibrium.position[:, 0])))


def ell(energy: Energy = "wunderlich", elements: int = 120) -> fb.Equilibrium:
    return bent([straight(0.5), corner(TURN), straight(0.5)], energy=energy, elements=elements)


def stiffened(energy: Energy = "wunderlich", middle: Json | None = None, **options: Any) -> Json:
    return held([straight(0.4), middle or rigid(0.1), straight(0.5)], energy=energy, elements=80, **options)


def between(equilibrium: fb.Equilibrium, low: float, high: float) -> Nodes:
    """Nodes of a segment, the joints' own side included: elements decide, not places."""
    first = elements_of(equilibrium)
    middle = 0.5 * (equilibrium.u[first] + equilibrium.u[first + 1])
    inside = first[(middle > low) & (middle < high)]
    return np.unique(np.concatenate([inside, inside + 1]))


# ---------------------------------------------------------------------------------------------------------- joints


@energy_model
def test_belt_of_two_strips_is_one_belt(energy: Energy) -> None:
    """Cut in half on the same mesh: the same numbers, the joint's node there twice."""
    whole = solve(held([straight(1.0)], energy=energy, elements=80))
    halves = solve(held([straight(0.5), straight(0.5)], energy=energy, elements=80))
    once = np.delete(np.arange(halves.u.size), joints(halves))
    assert halves.u[once] == pytest.approx(whole.u, abs=1e-12)
    assert halves.energy == pytest.approx(whole.energy, rel=1e-9)
    assert np.max(np.abs(halves.position[once] - whole.position)) < 1e-9


def test_fields_go_through_a_joint_of_equal_strips() -> None:
    """κ_g, R_f and k agree on both sides: ω_ζ and β are continuous."""
    halves = solve(held([straight(0.3), straight(0.7)], elements=80))
    for k in joints(halves):
        assert halves.bend[k + 1] == pytest.approx(halves.bend[k], abs=1e-9)
        assert halves.rib_slope[k + 1] == pytest.approx(halves.rib_slope[k], abs=1e-9)
        assert np.max(np.abs(halves.frame[k + 1] - halves.frame[k])) < 1e-9


@energy_model
def test_arc_of_no_curvature_is_straight(energy: Energy) -> None:
    straight_belt = solve(held([straight(1.0)], energy=energy, elements=80))
    arc_belt = solve(held([arc(1.0, 0.0)], energy=energy, elements=80))
    assert arc_belt.energy == pytest.approx(straight_belt.energy, rel=1e-9)
    assert np.max(np.abs(arc_belt.position - straight_belt.position)) < 1e-8


@energy_model
def test_corner_of_no_angle_is_no_corner(energy: Energy) -> None:
    plain = solve(held([straight(0.5), straight(0.5)], energy=energy, elements=80))
    cornered = solve(held([straight(0.5), corner(0.0), straight(0.5)], energy=energy, elements=80))
    assert cornered.energy == pytest.approx(plain.energy, rel=1e-6)
    assert np.max(np.abs(spine_at(cornered, PLACES) - spine_at(plain, PLACES))) < 1e-4


# ------------------------------------------------------------------------------------------------------------ arcs


@energy_model
@pytest.mark.parametrize("curvature", [1.4, -2.0])
def test_free_arc_lies_flat(energy: Energy, curvature: float) -> None:
    """A circle of radius 1/κ_g in the plane x = 0, towards +z for κ_g > 0; the frame turns with it."""
    scenario = board([arc(1.0, curvature)], [support("start", ORIGIN, ORIGIN)], energy=energy, elements=80)
    equilibrium = solve(scenario)
    angle = curvature * equilibrium.u
    expected = np.column_stack([0.0 * angle, np.sin(angle), 1.0 - np.cos(angle)]) / curvature
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(equilibrium.position - expected)) < 1e-7
    assert np.max(np.abs(equilibrium.frame[-1] - rotation_matrix([curvature, 0.0, 0.0]))) < 1e-7


@plate_energy
def test_many_small_corners_tend_to_an_arc(energy: Energy) -> None:
    """MODEL §2: a corner is κ_g → χ δ(u). RMS distances 2e-3, 6e-4, 9e-5 in an independent transcription."""
    smooth = bent([straight(0.4), arc(0.2, TURN / 0.2), straight(0.4)], energy=energy, elements=200)
    gaps, errors = [], []
    for n in (2, 4, 8):
        half = straight(0.1 / n)
        chain = [half, corner(TURN / n), half] * n
        equilibrium = bent([straight(0.4), *chain, straight(0.4)], energy=energy, elements=200)
        gaps.append(abs(equilibrium.energy - smooth.energy))
        errors.append(rms_distance(spine_at(equilibrium, PLACES), spine_at(smooth, PLACES)))
    assert np.all(observed_orders(np.array(gaps)) > 1.0), gaps
    assert np.all(observed_orders(np.array(errors)) > 1.0), errors
    assert errors[-1] < 1e-3


@plate_energy
def test_tight_arc_tends_to_a_corner(energy: Energy) -> None:
    """The same turning in less and less length, the strips longer to make up for it: the gap falls with the radius."""
    cornered = ell(energy, elements=200)
    errors = []
    for length in (0.16, 0.08, 0.04):
        strip = straight(0.5 - length / 2.0)
        equilibrium = bent([strip, arc(length, TURN / length), strip], energy=energy, elements=400)
        errors.append(rms_distance(spine_at(equilibrium, PLACES), spine_at(cornered, PLACES)))
    assert np.all(observed_orders(np.array(errors)) > 0.5), errors
    assert errors[-1] < 3e-3


# --------------------------------------------------------------------------------------------------------- corners


@energy_model
@pytest.mark.parametrize("angle", [TURN, -0.5, math.pi / 2.0])
def test_free_belt_with_a_corner_lies_flat(energy: Energy, angle: float) -> None:
    """Two straight lines, the second turned by χ towards ζ."""
    segments = [straight(0.6), corner(angle), straight(0.4)]
    equilibrium = solve(board(segments, [support("start", ORIGIN, ORIGIN)], energy=energy, elements=80))
    tip = np.array([0.0, 0.6 + 0.4 * math.cos(angle), 0.4 * math.sin(angle)])
    assert equilibrium.energy == pytest.approx(0.0, abs=1e-12)
    assert equilibrium.position[-1] == pytest.approx(tip, abs=1e-7)


@energy_model
def test_rib_at_a_corner_is_one_material_line(energy: Energy) -> None:
    """β⁺ = (β⁻ cos χ − sin χ)/(cos χ + β⁻ sin χ), that is α⁺ = α⁻ − χ, at the node that is there twice."""
    equilibrium = ell(energy)
    (k,) = joints(equilibrium)
    before, after = equilibrium.rib_slope[k], equilibrium.rib_slope[k + 1]
    scale = math.cos(TURN) + before * math.sin(TURN)
    assert scale > 0.0
    assert after == pytest.approx((before * math.cos(TURN) - math.sin(TURN)) / scale, abs=1e-7)
    assert math.atan(after) == pytest.approx(math.atan(before) - TURN, abs=1e-7)


@energy_model
def test_rib_at_a_corner_points_one_way_in_space(energy: Energy) -> None:
    """ζ − βη before and after are parallel, though the frames are not."""
    equilibrium = ell(energy)
    (k,) = joints(equilibrium)
    ribs = [equilibrium.frame[i, :, 2] - equilibrium.rib_slope[i] * equilibrium.frame[i, :, 1] for i in (k, k + 1)]
    before, after = (rib / np.linalg.norm(rib) for rib in ribs)
    assert np.max(np.abs(after - before)) < 1e-7


@energy_model
def test_frame_turns_at_a_corner(energy: Energy) -> None:
    """R⁺ = R⁻ Rot_ξ(χ), at one and the same point."""
    equilibrium = ell(energy)
    (k,) = joints(equilibrium)
    turned = equilibrium.frame[k] @ rotation_matrix([TURN, 0.0, 0.0])
    assert equilibrium.u[k] == pytest.approx(0.5, abs=1e-12)
    assert np.max(np.abs(equilibrium.frame[k + 1] - turned)) < 1e-9
    assert np.max(np.abs(equilibrium.position[k + 1] - equilibrium.position[k])) < 1e-9


def test_support_at_a_corner_holds_the_frame_before_it() -> None:
    """CONTRACT, conventions."""
    inner = {"at": 0.5, "position": [0.1, 0.4, 0.05], "rotation": [0.1, 0.2, -0.3]}
    scenario = held([straight(0.5), corner(TURN), straight(0.5)], BENT_POSITION, BENT_ROTATION, elements=80)
    scenario["supports"].insert(1, inner)
    equilibrium = solve(scenario)
    (k,) = joints(equilibrium)
    assert equilibrium.position[k] == pytest.approx(inner["position"], abs=1e-8)
    assert np.max(np.abs(equilibrium.frame[k] - rotation_matrix(inner["rotation"]))) < 1e-7


# -------------------------------------------------------------------------------------------------- where ribs meet


def rib_margins(equilibrium: fb.Equilibrium, curvature: float, width: float, share: float) -> Array:
    """How far s = β' + κ_g (1+β²) stays from where two ribs meet inside the strip, at `share` of every element.

    Ribs of an arc end on the edges at v ≠ ±V/2 (MODEL §2): v − κ_g v² (1+β²)/2 = ±V/2 − κ_g V²/8, and the bound is
    1/v₋ ≤ s ≤ 1/v₊. The simpler |s| ≤ 2/V is also good.
    """
    k = elements_of(equilibrium)
    rate = (equilibrium.rib_slope[k + 1] - equilibrium.rib_slope[k]) / (equilibrium.u[k + 1] - equilibrium.u[k])
    slope = (1.0 - share) * equilibrium.rib_slope[k] + share * equilibrium.rib_slope[k + 1]
    turning = curvature * (1.0 + slope**2)
    s = rate + turning
    edge = np.copysign(width / 2.0, s) - curvature * width**2 / 8.0
    root = (1.0 - np.sqrt(1.0 - 2.0 * turning * edge)) / turning if curvature else edge
    return np.asarray(1.0 - np.abs(s) * np.minimum(width / 2.0, np.abs(root)), dtype=np.float64)


@energy_model
@pytest.mark.parametrize("curvature", [1.4, -3.0])
def test_ribs_of_an_arc_do_not_meet_inside_it(energy: Energy, curvature: float) -> None:
    """|β' + κ_g (1+β²)| ≤ 2/V in the middle of every element, and to O(h) at its Gauss points."""
    position, rotation = (0.05, 0.5, 0.45 * math.copysign(1.0, curvature)), (0.7 * curvature, 0.1, 0.0)
    equilibrium = solve(held([arc(1.0, curvature)], position, rotation, energy=energy, elements=120))
    assert float(np.min(rib_margins(equilibrium, curvature, WIDTH, 0.5))) > -1e-6
    for share in GAUSS_POINTS:
        assert float(np.min(rib_margins(equilibrium, curvature, WIDTH, share))) > -5e-3


@energy_model
def test_ribs_do_not_meet_next_to_a_corner(energy: Energy) -> None:
    assert float(np.min(rib_margins(ell(energy), 0.0, WIDTH, 0.5))) > -1e-6


# ------------------------------------------------------------------------------------------------------- stiffeners


@energy_model
def test_stiffener_stays_straight_with_square_ribs_at_its_ends(energy: Energy) -> None:
    """ω = 0 inside, β = 0 at both ends, one frame, positions on a line at their distances."""
    equilibrium = solve(stiffened(energy))
    nodes = between(equilibrium, 0.4, 0.5)
    first = nodes[0]
    assert equilibrium.u[nodes[[0, -1]]] == pytest.approx([0.4, 0.5], abs=1e-12)
    assert np.max(np.abs(equilibrium.bend[nodes])) < 1e-9
    assert np.max(np.abs(equilibrium.torsion[nodes])) < 1e-9
    assert np.max(np.abs(equilibrium.rib_slope[nodes[[0, -1]]])) < 1e-9
    assert np.max(np.abs(equilibrium.frame[nodes] - equilibrium.frame[first])) < 1e-8
    ahead = (equilibrium.u[nodes] - 0.4)[:, None] * equilibrium.frame[first, :, 1]
    assert np.max(np.abs(equilibrium.position[nodes] - equilibrium.position[first] - ahead)) < 1e-9
    outside = np.setdiff1d(joints(equilibrium), nodes), np.setdiff1d(joints(equilibrium) + 1, nodes)
    for k in np.concatenate(outside):
        assert abs(float(equilibrium.rib_slope[k])) < 1e-8


@plate_energy
def test_stiffener_is_the_limit_of_a_stiff_strip(energy: Energy) -> None:
    """Rigidity 1e2, 1e3, 1e4 times the belt's, ribs made square at its ends: distances fall as one over it."""
    square = [{"at": at, "square_rib": True} for at in (0.4, 0.5)]
    exact = solve(stiffened(energy))
    errors = []
    for ratio in (1e2, 1e3, 1e4):
        scenario = stiffened(energy, straight(0.1, rigidity=ratio))
        scenario["supports"][1:1] = square
        equilibrium = solve(scenario)
        assert equilibrium.energy < exact.energy
        errors.append(rms_distance(spine_at(equilibrium, PLACES), spine_at(exact, PLACES)))
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.5)
    assert errors[2] < 1e-5


def test_stiffener_takes_the_weight_but_not_the_bend() -> None:
    """A heavy cantilever that is rigid all but for its first half."""
    clamp = [support("start", ORIGIN, ORIGIN)]
    heavy: Json = {"elements": 160, "density": 4.0, "gravity": (-1.0, 0.0, 0.0)}
    hanging = solve(board([straight(0.5), rigid(0.5)], clamp, **heavy))
    force, _ = hanging.reaction("start")
    assert force == pytest.approx([4.0, 0.0, 0.0], abs=1e-6)
    # The rigid half hangs at the tip of the soft one: its weight, half its length out.
    beam = board([straight(0.5)], clamp, **{**heavy, "elements": 80})
    beam["loads"]["points"] = [{"at": "end", "force": [-2.0, 0.0, 0.0], "lever": [0.0, 0.25, 0.0]}]
    k = node_at(hanging, 0.5)
    assert hanging.position[k] == pytest.approx(solve(beam).position[-1], abs=1e-6)


# --------------------------------------------------------------------------------------------------------- rigidity


@pytest.mark.parametrize("ends", [(1.0, 3.0), (2.0, 0.5)])
def test_rigidity_table_follows_the_elastica_of_varying_stiffness(ends: tuple[float, float]) -> None:
    """Linear R_f(u), a cantilever pulled at its tip, against SciPy."""
    load = {"at": "end", "force": [-3.0, 0.5, 0.0]}
    strip = straight(1.0, rigidity={"u": [0.0, 1.0], "value": list(ends)})
    equilibrium = solve(board([strip], [support("start", ORIGIN, ORIGIN)], elements=160, points=[load]))
    expected = Cantilever(force=(-3.0, 0.5), rigidity=ends)
    assert np.max(np.abs(equilibrium.position - expected.position(equilibrium.u))) < 1e-5
    assert equilibrium.elastic_energy == pytest.approx(expected.elastic_energy, rel=1e-5)


@energy_model
def test_rigidity_is_that_of_the_place_however_it_is_written(energy: Energy) -> None:
    """One table, the same table in two segments, and one with a point more: the same belt."""
    tables = (
        [straight(1.0, rigidity={"u": [0.0, 1.0], "value": [1.0, 3.0]})],
        [
            straight(0.5, rigidity={"u": [0.0, 0.5], "value": [1.0, 2.0]}),
            straight(0.5, rigidity={"u": [0.0, 0.5], "value": [2.0, 3.0]}),
        ],
        [straight(1.0, rigidity={"u": [0.0, 0.5, 1.0], "value": [1.0, 2.0, 3.0]})],
    )
    one, *others = [solve(held(segments, energy=energy, elements=80)) for segments in tables]
    for other in others:
        assert other.energy == pytest.approx(one.energy, rel=1e-7)
        assert np.max(np.abs(spine_at(other, PLACES) - spine_at(one, PLACES))) < 1e-6


def test_segment_rigidity_wins_over_that_of_the_belt() -> None:
    """The belt's rigidity has no effect where every segment has its own; twice the rigidity, twice the energy."""
    one = solve(held([straight(1.0)], elements=80))
    two = solve(held([straight(1.0, rigidity=2.0)], rigidity=5.0, elements=80))
    assert two.energy == pytest.approx(2.0 * one.energy, rel=1e-8)
    assert np.max(np.abs(two.position - one.position)) < 1e-7


def test_bend_jumps_with_the_rigidity_and_the_moment_does_not() -> None:
    """Planar cantilever, tip force: R_f ω_ζ is continuous where R_f jumps by 3."""
    load = {"at": "end", "force": [-2.0, 0.0, 0.0]}
    segments = [straight(0.5), straight(0.5, rigidity=3.0)]
    equilibrium = solve(board(segments, [support("start", ORIGIN, ORIGIN)], elements=160, points=[load]))
    (k,) = joints(equilibrium)
    assert equilibrium.rib_slope[k + 1] == pytest.approx(equilibrium.rib_slope[k], abs=1e-9)
    assert 3.0 * equilibrium.bend[k + 1] == pytest.approx(equilibrium.bend[k], rel=1e-3)


# ------------------------------------------------------------------------------------------------------ invariances


def varied(sign: float = 1.0, scale: float = 1.0) -> list[Json]:
    """An arc, a strip, a corner and an arc the other way."""
    return [
        arc(0.35 * scale, 1.5 * sign / scale),
        straight(0.2 * scale),
        corner(0.3 * sign),
        straight(0.15 * scale, rigidity=2.0 * scale),
        arc(0.3 * scale, -1.0 * sign / scale),
    ]


VARIED_POSITION, VARIED_ROTATION = np.array([0.06, 0.6, 0.3]), np.array([0.5, 0.2, -0.15])


@energy_model
def test_mirrored_board_takes_the_mirrored_shape(energy: Energy) -> None:
    """κ_g → −κ_g and χ → −χ with z → −z: β changes sign, the energy does not."""
    mirrored_rotation = rotation_vector(MIRROR @ rotation_matrix(VARIED_ROTATION) @ MIRROR)
    one = solve(held(varied(), VARIED_POSITION, VARIED_ROTATION, energy=energy, elements=80))
    other = solve(held(varied(-1.0), MIRROR @ VARIED_POSITION, mirrored_rotation, energy=energy, elements=80))
    assert other.energy == pytest.approx(one.energy, rel=1e-6)
    assert np.max(np.abs(other.position @ MIRROR - one.position)) < 1e-5
    assert np.max(np.abs(other.rib_slope + one.rib_slope)) < 1e-2


@energy_model
@pytest.mark.parametrize("scale", [1e-2, 50.0])
def test_board_of_another_size_takes_the_same_shape(energy: Energy, scale: float) -> None:
    """Lengths times s, curvatures over s, R_f times s, as if s times as wide: the energy is the same, forces over s."""
    one = solve(held(varied(), VARIED_POSITION, VARIED_ROTATION, energy=energy, elements=80))
    large = solve(
        held(
            varied(scale=scale),
            VARIED_POSITION * scale,
            VARIED_ROTATION,
            energy=energy,
            width=WIDTH * scale,
            rigidity=scale,
            elements=80,
        )
    )
    assert large.energy == pytest.approx(one.energy, rel=1e-6)
    assert np.max(np.abs(large.position / scale - one.position)) < 1e-5
    assert np.max(np.abs(large.rib_slope - one.rib_slope)) < 1e-2
    expected = end_wrench(one, "end")
    actual = end_wrench(large, "end") * np.repeat([scale, 1.0], 3)
    assert np.max(np.abs(actual - expected)) < 1e-4 * np.max(np.abs(expected))


@energy_model
def test_moved_board_takes_the_moved_shape(energy: Energy) -> None:
    """Both clamps and the bulge direction moved together."""
    turn, shift = rotation_matrix([0.7, -1.1, 0.4]), np.array([0.3, -2.0, 0.9])
    one = solve(held(varied(), VARIED_POSITION, VARIED_ROTATION, energy=energy, elements=80))
    supports = [
        support("start", shift, rotation_vector(turn)),
        support("end", turn @ VARIED_POSITION + shift, rotation_vector(turn @ rotation_matrix(VARIED_ROTATION))),
    ]
    moved = solve(board(varied(), supports, energy=energy, elements=80, bulge=turn[:, 0]))
    assert moved.energy == pytest.approx(one.energy, rel=1e-6)
    assert np.max(np.abs((moved.position - shift) @ turn - one.position)) < 1e-5


@energy_model
def test_board_run_backwards_takes_the_same_shape(energy: Energy) -> None:
    """A half-turn about ξ swaps the ends: what turned η towards ζ now turns it away."""
    half_turn = np.diag([1.0, -1.0, -1.0])
    one = solve(held(varied(), VARIED_POSITION, VARIED_ROTATION, energy=energy, elements=80))
    backwards = varied(-1.0)[::-1]
    supports = [
        support("start", VARIED_POSITION, rotation_vector(rotation_matrix(VARIED_ROTATION) @ half_turn)),
        support("end", ORIGIN, rotation_vector(half_turn)),
    ]
    other = solve(board(backwards, supports, energy=energy, elements=80, bulge=(1.0, 0.0, 0.0)))
    assert other.energy == pytest.approx(one.energy, rel=1e-6)
    assert np.max(np.abs(other.position[::-1] - one.position)) < 1e-5


def zed() -> list[Json]:
    legs = [straight(0.2), corner(math.pi / 2.0), straight(0.4), corner(-math.pi / 2.0), straight(0.2)]
    return [rigid(0.1), *legs, rigid(0.1)]


@energy_model
@pytest.mark.parametrize(
    ("segments", "position", "rotation"),
    [
        (zed(), (0.26, 0.15, 0.36), (0.0, 0.0, -2.0944)),
        (zed(), (0.1, 0.5, 0.3), (0.4, 0.3, 0.0)),
        ([straight(0.5), corner(1.2), straight(0.5)], (0.2, 0.45, 0.25), (1.2, 0.5, -0.6)),
        ([straight(0.4), arc(0.2, 6.0), straight(0.4)], (0.2, 0.45, 0.2), (1.2, 0.5, -0.8)),
        ([arc(1.0, -4.0)], (0.2, 0.1, -0.35), (-4.0, 0.0, 0.0)),
    ],
)
def test_ribs_do_not_cross_on_the_board_beside_bends(
    energy: Energy, segments: list[Json], position: Any, rotation: Any
) -> None:
    """Steep ribs reach past the inner side of a bend; where two cross the flat mesh has folded triangles."""
    found = solve(on_one_mesh(held(segments, position, rotation, energy=energy, width=0.06)))
    vertices, triangles = found.flat_mesh(n_across=9)
    (y1, z1), (y2, z2), (y3, z3) = (vertices[triangles[:, i]].T for i in range(3))
    areas = 0.5 * ((y2 - y1) * (z3 - z1) - (z2 - z1) * (y3 - y1))
    assert np.min(areas) > -1e-6 * np.sum(areas)


@pytest.mark.parametrize("energy", ["fishbone", "sadowsky"])
def test_reactions_are_the_gradient_of_the_energy_where_ribs_touch_beside_a_bend(energy: Energy) -> None:
    step = 1e-4

    def at(shift: float) -> fb.Equilibrium:
        pose = (0.1 + shift, 0.5, 0.3), (0.4, 0.3, 0.0)
        return solve(on_one_mesh(held(zed(), *pose, energy=energy, width=0.06)))

    force = at(0.0).reaction("end").force
    assert force[0] == pytest.approx((at(step).energy - at(-step).energy) / (2.0 * step), rel=1e-5)


FACING_BACK: list[Json] = [
    {"rotation": [0.0, 0.0, math.pi]},
    {"rotation": [0.0, 0.0, -math.pi]},
    {"rotation": [0.0, 0.0, 3.14159265]},
    {"euler": [math.pi, 0.0, 0.0]},
    {"quaternion": [0.0, 0.0, 0.0, 1.0]},
    {"quaternion": [0.0, 0.0, 0.0, -1.0]},
]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("above", [0.2, -0.2])
def test_end_facing_back_is_reached_the_short_way_round_however_it_is_written(above: float, side: float) -> None:
    """A hairpin turns by half a turn; the other way round it would take three, or a loop."""
    for frame in FACING_BACK:
        supports = [support("start", ORIGIN, ORIGIN), {"at": "end", "position": [above, 0.0, 0.0], **frame}]
        hairpin = solve(board([straight(1.0)], supports, bulge=(side, 0.0, 0.0), elements=80))
        turned = float(np.trapezoid(hairpin.bend, hairpin.u))
        assert turned == pytest.approx(-math.copysign(math.pi, above), abs=1e-6)
        assert hairpin.energy == pytest.approx(11.643, rel=1e-3)


def test_half_a_turn_of_twist_is_one_shape_however_it_is_written() -> None:
    frames = [{"rotation": [0.0, turn, 0.0]} for turn in (math.pi, -math.pi)]
    frames += [{"quaternion": [0.0, 0.0, turn, 0.0]} for turn in (1.0, -1.0)]
    ends = [{"at": "end", "position": [0.0, 0.7, 0.0], **frame} for frame in frames]
    found = [solve(board([straight(1.0)], [support("start", ORIGIN, ORIGIN), end])) for end in ends]
    for belt in found[1:]:
        assert np.max(np.abs(belt.position - found[0].position)) < 1e-6


def test_s_board_with_a_pin_in_the_middle_is_solved_on_every_mesh() -> None:
    pieces = [straight(0.02), arc(0.0314159265, 50.0), straight(0.02), arc(0.0314159265, -50.0), straight(0.02)]
    supports = [
        support("start", ORIGIN, ORIGIN),
        {"at": 0.0614159265, "position": [0.01, 0.035, 0.025]},
        support("end", (0.0, 0.05, 0.06), ORIGIN),
    ]
    energies = [
        solve(board(pieces, supports, width=0.006, elements=count)).energy for count in (80, 120, 164, 160, 320)
    ]
    assert energies == pytest.approx([energies[-1]] * 5, rel=1e-2)


def test_narrow_weak_stretch_of_a_table_is_seen_on_every_mesh() -> None:
    table = {"u": [0.5015, 0.502, 0.504, 0.5045], "value": [1.0, 0.01, 0.01, 1.0]}
    piece = straight(1.0, rigidity=table)
    energies = [solve(held([piece], (0.0, 0.6, 0.0), ORIGIN, elements=count)).energy for count in (80, 320)]
    cut = solve(held([straight(0.502), straight(0.002, rigidity=0.01), straight(0.496)], (0.0, 0.6, 0.0), ORIGIN))
    assert energies[0] == pytest.approx(energies[1], rel=1e-5)
    assert energies[0] == pytest.approx(cut.energy, rel=1e-2)


def test_square_rib_that_would_leave_through_a_bend_is_no_crash() -> None:
    supports: list[Json] = [{"at": 0.4, "position": [0.0, 0.0, 0.0], "square_rib": True}]
    belt = solve_any(board([straight(0.4), corner(1.6), straight(0.6)], supports))
    assert belt.status == "not_converged"
    assert "ribs" in belt.message
