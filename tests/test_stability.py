"""Counts of stability, modes, and the margin to the loss of stability.

Expected values are closed forms of the vibrating and the buckled beam, or come from `planar`, which is independent of
the package. The scale of modes is the mean squared displacement of the board, all of it weighing alike: with one unit
of mass in all, eigenvalues are squared natural frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fishbone as fb
from helpers import ENERGIES, Energy, Json, arc, belt, board, clamped, example1, example2, solve, straight, support

CLAMPED_CLAMPED = (4.730040744862704, 7.853204624095838, 10.995607838001671)
"""Roots of cos k cosh k = 1."""
CLAMPED_FREE = (1.875104068711961, 4.694091132974175, 7.854757438237613)
"""Roots of cos k cosh k = −1."""


def strut(force: float, width: float = 0.1) -> Json:
    """A straight belt clamped at its start, its end square and free to slide along y under a dead force along y."""
    scenario = belt([support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))], width=width)
    end = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, 0.0, 0.0]}
    scenario["supports"].append(end)
    scenario["loads"] = {"points": [{"at": "end", "force": [0.0, force, 0.0]}]}
    return scenario


def flat(scenario: Json) -> fb.Equilibrium:
    """The flat state, stable or not."""
    zeros = np.zeros(9)
    return fb.solve(fb.Scenario.from_dict(scenario), start=(zeros, zeros))


# ------------------------------------------------------------------------------------------------------- the modes


def test_modes_of_a_straight_belt_are_those_of_a_clamped_beam() -> None:
    """Without stress ω² = k⁴ R_f/(ρ U⁴); the rotary inertia of the board about its spine takes no part in bending."""
    scenario = belt([support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))])
    modes = flat(scenario).modes(3)
    expected = [k**4 for k in CLAMPED_FREE]
    assert [mode.eigenvalue for mode in modes] == pytest.approx(expected, rel=1e-3)
    ends = clamped((0.0, 1.0, 0.0))
    ends["supports"][1]["position"] = [0.0, "free", 0.0]
    modes = flat(ends).modes(3)
    assert [mode.eigenvalue for mode in modes] == pytest.approx([k**4 for k in CLAMPED_CLAMPED], rel=1e-3)


@pytest.mark.parametrize("length", [1.0, 2.5])
def test_mode_scales_with_the_belt(length: float) -> None:
    """Energy per squared length: R_f/U³ for a mean squared displacement of 1."""
    scenario = belt(
        [support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))], length=length, width=0.1 * length, rigidity=3.0
    )
    (mode,) = flat(scenario).modes(1)
    assert mode.eigenvalue == pytest.approx(3.0 * CLAMPED_FREE[0] ** 4 / length**3, rel=1e-3)
    mean_square = np.trapezoid(np.sum(mode.translation**2, axis=1), np.linspace(0.0, 1.0, len(mode.translation)))
    assert mean_square == pytest.approx(1.0, rel=1e-2)


def second_difference(scenario: fb.Scenario, equilibrium: fb.Equilibrium, mode: fb.Mode) -> float:
    """Second derivative of the energy along a mode, from the dead force that holds the belt there.

    The belt is loaded by dead forces along the mode's own displacement, the same per length all along: to first order
    it moves by the force over the eigenvalue along the mode, and along no other.
    """
    nodes = np.arange(2, len(equilibrium.u) - 2)
    pull = 1e-4
    lengths = np.gradient(equilibrium.u)
    tables = scenario.to_dict()
    tables["loads"] = {
        "points": [
            {"at": float(equilibrium.u[k]), "force": (pull * lengths[k] * mode.translation[k]).tolist()} for k in nodes
        ]
    }
    moved = fb.solve(fb.Scenario.from_dict(tables)).position - equilibrium.position
    along = np.sum(lengths[:, None] * moved * mode.translation)
    return pull / float(along)


@pytest.mark.parametrize("end", [(0.0, 0.6, 0.0), (0.05, 0.55, 0.1)])
def test_eigenvalue_is_the_stiffness_against_forces_along_the_mode(end: tuple[float, float, float]) -> None:
    """A clamped arch under small dead forces in the shape of its lowest mode, against the solver without them."""
    scenario = fb.Scenario.from_dict(clamped(end, width=0.02, elements=80))
    equilibrium = fb.solve(scenario)
    mode = equilibrium.modes(1)[0]
    assert second_difference(scenario, equilibrium, mode) == pytest.approx(mode.eigenvalue, rel=0.02)


@pytest.mark.parametrize("elements", [160, 320, 640, 1280, pytest.param(3000, marks=pytest.mark.full)])
@pytest.mark.parametrize(
    ("scenario", "expected"),
    [(example1, (1372.8, 2427.0)), (example2, (1911.2, 2907.4))],
    ids=["example 1", "example 2"],
)
def test_modes_are_the_same_on_coarse_and_on_fine_meshes(
    scenario: Callable[..., Json], expected: tuple[float, float], elements: int
) -> None:
    """Those of example 2 are expected by a sparse factorisation with pivots, SciPy's, at 3000 elements."""
    equilibrium = solve(scenario("wunderlich", elements=elements))
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (True, 0, 0)
    assert [mode.eigenvalue for mode in equilibrium.modes(2)] == pytest.approx(expected, rel=1e-2)


def test_equilibrium_on_a_fine_mesh_is_followed_and_has_its_margin() -> None:
    """On 1280 elements; the expected margin is that on 160 elements."""
    up = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    coarse, fine = (solve(example2("wunderlich", elements=elements)) for elements in (160, 1280))
    branch = fb.follow(fine, {"supports[1].position[2]": 0.05}).branches[0]
    assert branch.parameter[-1] == pytest.approx(0.05)
    assert all(branch.stable)
    margins = [equilibrium.snap_margin("end", up) for equilibrium in (coarse, fine)]
    assert margins[0] is not None
    assert margins[1] is not None
    assert margins[1].distance == pytest.approx(margins[0].distance, rel=2e-3)


def test_modes_are_square_to_each_other_and_rise() -> None:
    equilibrium = solve(example1())
    modes = equilibrium.modes(5)
    values = [mode.eigenvalue for mode in modes]
    assert values == sorted(values)
    assert values[0] > 0.0
    lengths = np.gradient(equilibrium.u)[:, None]
    across = equilibrium.frame[:, :, 2]
    moves = [(mode.translation, np.cross(mode.rotation, across)) for mode in modes]
    products = [[np.sum(lengths * (a[0] * b[0] + 0.1**2 / 12.0 * a[1] * b[1])) for b in moves] for a in moves]
    assert np.array(products) == pytest.approx(np.eye(5), abs=1e-9)


@pytest.mark.parametrize("count", [0, 101])
def test_number_of_modes_is_checked(count: int) -> None:
    with pytest.raises(fb.InvalidArgument, match="count: found"):
        solve(example1()).modes(count)


def test_the_sources_method_has_no_modes() -> None:
    scenario = example1()
    scenario.setdefault("solver", {})["method"] = "ritz"
    equilibrium = fb.solve(fb.Scenario.from_dict(scenario))
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (None, None, None)
    with pytest.raises(fb.NoModes, match="multipliers"):
        equilibrium.modes(1)


# ------------------------------------------------------------------------------------------------------ the counts


@pytest.mark.parametrize(("force", "negative"), [(-45.0, 1), (-75.0, 1), (-90.0, 2), (-170.0, 3)])
def test_flat_strut_has_as_many_negative_modes_as_loads_are_passed(force: float, negative: int) -> None:
    """Euler's loads, clamped and sliding: 39.478, 80.763, 157.91 R_f/U²."""
    scenario = strut(force)
    scenario["solver"] = {"tolerance": 1e-2}
    equilibrium = flat(scenario)
    assert np.abs(equilibrium.bend).max() < 1e-12
    assert (equilibrium.stable, equilibrium.negative_modes) == (False, negative)


@pytest.mark.parametrize("force", [-39.4, -30.0, 30.0, 1e4])
@pytest.mark.parametrize("width", [0.1, 0.02])
def test_flat_strut_under_less_is_stable(force: float, width: float) -> None:
    """Below Euler's load, and pulled: no slope of the ribs makes the belt buckle sooner."""
    scenario = strut(force, width)
    scenario["solver"] = {"tolerance": 1e-2}
    equilibrium = flat(scenario)
    assert np.abs(equilibrium.bend).max() < 1e-12
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (True, 0, 0)


def column(weight: float, energy: Energy = "sadowsky", axis: int = 2, width: float = 0.1) -> Json:
    """A flat belt along y, clamped at its start with its rib free there, of this weight in the direction of an axis."""
    gravity = [0.0, 0.0, 0.0]
    gravity[axis] = weight
    clamp = support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), square_rib=False)
    scenario = belt([clamp], energy=energy, width=width)
    scenario["belt"]["density"] = 1.0
    return scenario | {"loads": {"gravity": gravity}, "solver": {"elements": 80, "tolerance": 1e-2}}


@pytest.mark.parametrize(("weight", "stable"), [(50.0, True), (-7.8, True), (-7.9, False)])
def test_standing_belt_carries_the_weight_of_greenhill(weight: float, stable: bool) -> None:
    """It buckles under its own weight of 7.8373 R_f/U² (Greenhill 1881); hanging it is stable under any."""
    equilibrium = flat(column(weight, axis=1))
    assert np.abs(equilibrium.bend).max() < 1e-12
    assert equilibrium.stable is stable


@pytest.mark.parametrize(
    ("energy", "weight", "stable"),
    [
        ("sadowsky", 21.3, True),
        ("sadowsky", 22.0, False),
        ("wunderlich", 21.3, True),
        ("wunderlich", 25.0, False),
        ("fishbone", 20.2, True),
    ],
)
def test_belt_on_edge_buckles_along_slanted_ribs(energy: Energy, weight: float, stable: bool) -> None:
    """The narrow limit stands on edge up to 21.491 R_f/U² (MODEL); the other energies are no lower.

    With square ribs nothing shows the instability. A bar that twists with a stiffness p beside its bending stiffness 1
    would buckle at 12.85 √p (Michell 1899): 18.17 at p = 2, 20.32 at the 5/2 of `fishbone`.
    """
    equilibrium = flat(column(-weight, energy))
    assert np.abs(equilibrium.bend).max() < 1e-12
    assert equilibrium.stable is stable


def test_strip_that_leans_and_is_pulled_straight_is_stable() -> None:
    """Elastica under tension: it bends by its clamp alone, and is flat beyond."""
    tables = strut(1600.0)
    tables["supports"] = [support("start", (0.0, 0.0, 0.0), (0.0, 0.0, -np.pi / 3.0))]
    equilibrium = solve(tables)
    assert equilibrium.bend_radius.spine is not None
    assert equilibrium.bend_radius.spine.value == pytest.approx(1.0 / 40.0, rel=1e-3)
    assert np.abs(equilibrium.bend[equilibrium.u > 0.6]).max() < 1e-8
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.warnings) == (True, 0, [])


def test_flat_belt_that_nothing_stresses_is_stable() -> None:
    equilibrium = flat(strut(0.0))
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (True, 0, 0)


def test_belt_that_may_turn_freely_has_a_zero_mode() -> None:
    """An arch between two balls turns about the line through them at no cost; it is a minimum but for this turn."""
    scenario = belt([support("start", (0.0, 0.0, 0.0)), support("end", (0.0, 0.7, 0.0))])
    equilibrium = solve(scenario)
    assert equilibrium.status == "converged"
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (True, 0, 1)


def test_cantilever_is_known_to_be_stable_up_to_its_free_end() -> None:
    scenario = fb.load("scenarios/cantilever.toml")
    equilibrium = fb.solve(scenario)
    assert (equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes) == (True, 0, 0)


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize("pull", [1e4, 2e4, 4e4, 1e5])
def test_belt_drawn_out_straight_from_a_twisted_clamp_is_not_unstable(energy: Energy, pull: float) -> None:
    """Its tail bends by 1e-9 and less: ribs laid across it at will are out of balance, and prove nothing."""
    tables = belt([support("start", (0, 0, 0), (0.3, 0.0, 0.5))], width=0.025, energy=energy)
    equilibrium = solve(tables | {"loads": {"points": [{"at": "end", "force": [0.0, pull, 0.0]}]}})
    assert equilibrium.stable is not False
    assert equilibrium.stable or pull > 2e4


# ----------------------------------------------------------------------------------------------------- the margins


def test_margin_to_a_fold_is_that_of_the_elastica() -> None:
    """The planar arch whose end is turned back folds at −1.1230897421, by `planar.folds`."""
    margin = solve(clamped((0.0, 0.6, 0.0))).snap_margin(direction=(0.0, 0.0, 0.0, 0.0, 0.0, -1.0), reach=1.5)
    assert margin is not None
    assert margin.snaps
    assert margin.confirmed
    assert margin.distance == pytest.approx(1.1230897421, abs=1e-5)
    assert margin.rotation == pytest.approx([0.0, 0.0, -1.1230897421], abs=1e-5)


def test_margin_to_a_pitchfork_is_that_of_the_elastica() -> None:
    """Pushed sideways the arch merges with the S at 0.6020976231, by `planar.pitchfork`."""
    margin = solve(clamped((0.0, 0.6, 0.0))).snap_margin(direction=(2.0, 0.0, 0.0, 0.0, 0.0, 0.0), reach=0.7)
    assert margin is not None
    assert not margin.snaps
    assert margin.distance == pytest.approx(0.6020976231, abs=1e-5)


def test_loss_of_stability_of_the_mesh_alone_is_unconfirmed() -> None:
    """Ribs of a twisted board turn over from element to element: led three times as far, the belt does not snap."""
    segments = [straight(0.4), arc(0.1 * math.pi, 5.0), straight(0.4)]
    end = {"at": "end", "position": [0.1, 0.5, 0.5], "euler": [0.0, 0.6, 0.5 * math.pi]}
    equilibrium = solve(board(segments, [support("start", (0, 0, 0), (0, 0, 0)), end], width=0.08))
    margin = equilibrium.snap_margin()
    assert margin is not None
    assert not margin.confirmed
    tracker = fb.Tracker(equilibrium.scenario)
    length, frame = equilibrium.u[-1], Rotation.from_matrix(equilibrium.frame[-1])
    for share in np.linspace(0.0, 3.0, 31):
        way = share * margin.distance * margin.direction
        turned = Rotation.from_rotvec(way[3:]) * frame
        update = tracker.update(equilibrium.position[-1] + length * way[:3], turned.as_rotvec())
        assert (update.status, update.snapped) == ("converged", False)


def test_nearest_margin_is_no_farther_than_along_any_axis() -> None:
    equilibrium = solve(clamped((0.02, 0.6, 0.01), (0.1, 0.05, -0.3)))
    nearest = equilibrium.snap_margin()
    assert nearest is not None
    assert np.linalg.norm(nearest.direction) == pytest.approx(1.0)
    for axis in range(6):
        for sign in (1.0, -1.0):
            along = equilibrium.snap_margin(direction=sign * np.eye(6)[axis])
            assert along is None or nearest.distance <= along.distance * (1.0 + 1e-6)


def test_margin_is_refused_where_there_is_none() -> None:
    equilibrium = solve(example1())
    with pytest.raises(fb.InvalidArgument, match="direction"):
        equilibrium.snap_margin(direction=(0.0,) * 6)
    with pytest.raises(fb.InvalidArgument, match="reach"):
        equilibrium.snap_margin(reach=0.0)
    with pytest.raises(fb.NoMargin, match="not stable"):
        flat(strut(-90.0)).snap_margin()


@pytest.mark.parametrize("reach", [1.5, 3.5, 5.0])
def test_margin_does_not_depend_on_how_far_it_looks(reach):
    """Beyond half a turn the way is not the shorter turn."""
    margin = solve(clamped((0.0, 0.6, 0.0))).snap_margin(direction=(0.0, 0.0, 0.0, 0.0, 0.0, -1.0), reach=reach)
    assert margin.distance == pytest.approx(1.1230897421, abs=1e-4)


def test_belt_that_is_drawn_straight_has_no_margin():
    assert solve(clamped((0.0, 0.6, 0.0))).snap_margin(direction=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0), reach=0.6) is None


def test_nearest_margin_is_below_that_along_many_directions():
    """Of the planar arch, where branching off lies along z, and of a belt that leans."""
    rng = np.random.default_rng(0)
    for equilibrium in (solve(clamped((0.0, 0.6, 0.0))), solve(clamped((0.0, 0.5, 1.0 / 6.0), (0.0, 1.2, 0.0)))):
        nearest = equilibrium.snap_margin()
        again = equilibrium.snap_margin(direction=nearest.direction)
        assert again.distance == pytest.approx(nearest.distance, rel=1e-6)
        for direction in rng.normal(size=(10, 6)):
            found = equilibrium.snap_margin(direction=direction, reach=nearest.distance)
            assert found is None or found.distance > 0.95 * nearest.distance


# ------------------------------------------------------------- slopes of ribs that hardly any bend holds are no modes

CLAMP = support("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("energy", ["fishbone", "sadowsky", "wunderlich"])
@pytest.mark.parametrize("weight", [1e-4, 1e-2, 1.0])
def test_flat_arc_under_a_small_load_in_its_plane_is_stable(energy: Energy, weight: float) -> None:
    """Straight cantilevers on edge buckle at 21.5; these loads are far below."""
    for curvature, width in [(0.3, 0.02), (1.5, 0.15), (2.9, 0.15), (4.0, 0.25)]:
        for direction in ([0.0, 0.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]):
            segments = [arc(1.0, curvature)]
            gravity = weight * np.array(direction)
            found = solve(board(segments, [CLAMP], energy=energy, width=width, density=1.0, gravity=gravity))
            assert found.stable is True
            assert np.max(np.abs(found.bend)) == 0.0


@pytest.mark.parametrize("elements", [None, 100, 400])
def test_overhang_that_bears_nothing_leaves_an_arch_stable(elements: int | None) -> None:
    arch = support(0.5, (0.0, 0.35, 0.0), (0.0, 0.0, 0.0))
    found = solve(board([straight(0.5), arc(0.5, 2.0)], [CLAMP, arch], elements=elements))
    alone = solve(board([straight(0.5)], [CLAMP, arch | {"at": "end"}], elements=elements))
    assert found.energy == pytest.approx(alone.energy, rel=1e-5)
    assert found.stable is alone.stable is True


@pytest.mark.parametrize("height", [0.0, 0.05])
def test_span_without_slack_does_not_make_a_belt_unstable(height: float) -> None:
    """Its bend is what rounding of its length leaves; the slack span bends as it does alone."""
    middle = support(0.5, (0.0, 0.5, 0.0), (0.0, 0.0, 0.0))
    end = support("end", (0.0, 0.8, height), (0.0, 0.0, 0.0))
    found = solve(belt([CLAMP, middle, end]))
    assert found.stable is not False


@pytest.mark.parametrize("elements", [160, 320, 1000, 2000])
def test_bent_cantilever_is_stable_on_every_mesh(elements: int) -> None:
    """Towards its free end the bend tends to 0, and the slopes of the ribs there cost less and less."""
    weight = np.array([-1.0, 0.0, 0.0])
    found = solve(board([arc(1.0, 1.5)], [CLAMP], density=1.0, gravity=weight, elements=elements))
    assert found.stable is True
    (mode,) = found.modes(1)
    assert mode.eigenvalue == pytest.approx(15.55, rel=1e-2)
