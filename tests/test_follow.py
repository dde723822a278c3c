"""Equilibria along a path: events against independent references, changes of energy against the work of reactions."""

from __future__ import annotations

import json
import math
import signal

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

import fishbone as fb
import planar
from conftest import ROOT
from folds import FOLDS, Expected
from folds import turned as turned_arch
from helpers import spine_at

ANGLE = "supports[1].rotation[2]"
PUSH = "loads.points[0].force[1]"


def on_one_mesh(scenario: fb.Scenario) -> fb.Scenario:
    """The scenario on a fixed mesh: along a path it is one discrete belt, whose identities hold to rounding."""
    tables = scenario.to_dict()
    tables["solver"]["elements"] = 80
    return fb.Scenario.from_dict(tables)


def arch(distance: float = 0.6, angle: float = 0.0) -> fb.Scenario:
    """The planar belt between clamps in line, its end turned."""
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict()
    tables["supports"][1] |= {"position": [0.0, distance, 0.0], "rotation": [0.0, 0.0, angle]}
    return fb.Scenario.from_dict(tables)


def strut() -> fb.Scenario:
    """A straight belt under thrust, its end held square and free to slide along y."""
    tables = arch().to_dict()
    tables["supports"][1]["position"] = [0.0, "free", 0.0]
    tables["loads"] = {"points": [{"at": "end", "force": [0.0, -1.0, 0.0]}]}
    return fb.Scenario.from_dict(tables)


@pytest.fixture(scope="module")
def buckling() -> fb.Diagram:
    return fb.follow(strut(), {PUSH: -100.0})


@pytest.fixture(scope="module")
def sheared() -> fb.Diagram:
    """An arch whose end moves sideways: its ribs lean, and its branch has many folds."""
    return fb.follow(arch(), {"supports[1].position[2]": 0.25}, branches=1)


# ------------------------------------------------------------------------------------------------------ events


def towards(expected: Expected) -> tuple[fb.Scenario, dict[str, float]]:
    """A stable shape on the branch of a fold, and a path on which the fold lies."""
    field = ("supports[1].position[0]", "", ANGLE)[expected.component]
    if expected.mode == 2:
        # The S, drawn out so far to the other side that it is stable.
        tables = arch(expected.distance).to_dict()
        tables["supports"][1]["position"][0] = -1.02 * expected.parameter
        return fb.Scenario.from_dict(tables), {field: 1.1 * expected.parameter}
    if expected.nth == 1:
        return arch(expected.distance, 1.6), {field: -1.6}
    return arch(expected.distance, expected.turned), {field: expected.parameter + 0.1 * sum(expected.direction)}


@pytest.mark.parametrize("expected", FOLDS, ids=lambda expected: expected.name)
def test_fold_is_where_the_planar_reference_has_it(expected):
    [branch] = fb.follow(*towards(expected), states=100, branches=1).branches
    fold = next(event for event in branch.events if event.negative_modes == expected.modes)
    assert fold.kind == "fold"
    assert fold.parameter == pytest.approx(expected.parameter, abs=1e-4)
    assert branch.energy[fold.state] == pytest.approx(expected.energy, rel=1e-4)
    assert branch.height[fold.state] == pytest.approx(expected.height, abs=1e-4)
    # Before the fold the belt does not lose its stability out of its plane: all events are planar.
    earlier = branch.events[: branch.events.index(fold)]
    assert len(earlier) == expected.modes[0]
    for event in earlier:
        mode = branch.equilibrium(event.state).modes(event.negative_modes[0] + 1)[-1]
        across = np.abs(mode.translation[:, 2]).max()
        assert across < 1e-3 * np.abs(mode.translation).max()


def test_arch_turned_back_folds_at_a_number_that_anyone_can_check(turned):
    """Of the elastica: ϑ'' = X cos ϑ + Y sin ϑ from ϑ = 0 at the origin to ϑ = a at (0, 0.6)."""
    assert turned.branches[0].events[0].parameter == pytest.approx(-1.1230897421, abs=1e-4)


def test_flat_strut_buckles_at_eulers_loads(buckling):
    first, second = buckling.branches[0].events
    assert [first.kind, second.kind] == ["pitchfork", "pitchfork"]
    assert [first.negative_modes, second.negative_modes] == [(0, 1), (1, 2)]
    assert -first.parameter == pytest.approx(4.0 * math.pi**2, rel=1e-5)
    assert -second.parameter == pytest.approx(80.7629142257, rel=1e-5)


def test_flat_strut_is_stable_until_it_buckles(buckling):
    trunk = buckling.branches[0]
    load = trunk.events[0].parameter
    assert {stable for stable, push in zip(trunk.stable, trunk.parameter, strict=True) if push > load + 0.1} == {True}
    assert {stable for stable, push in zip(trunk.stable, trunk.parameter, strict=True) if push < load - 0.1} == {False}
    assert trunk.equilibrium(1).stable is True


def test_buckled_branches_begin_at_eulers_loads_and_bend(buckling):
    first = next(branch for branch in buckling.branches if branch.origin == fb.Origin(0, 0))
    assert first.stable[0] is True
    assert np.all(np.abs(buckling.branches[0].height) < 1e-9)
    assert 0.05 < first.height[0] < first.height[2]
    other = next(branch for branch in buckling.branches if branch.origin == fb.Origin(0, 1))
    assert other.negative_modes[0] == 1


def test_arch_pushed_aside_meets_the_s_where_the_planar_reference_has_it():
    expected = planar.pitchfork(0.6)
    event = fb.follow(arch(), {"supports[1].position[0]": 0.7}).branches[0].events[0]
    assert event.parameter == pytest.approx(expected.pose[0], abs=1e-4)


def test_events_lie_between_the_states_beside_them(turned, buckling):
    for branch in [*turned.branches, *buckling.branches]:
        states = [event.state for event in branch.events]
        assert states == sorted(set(states))
        for event in branch.events:
            before, after = branch.negative_modes[[event.state - 1, event.state + 1]]
            assert event.negative_modes == (before, after)
            assert branch.parameter[event.state] == pytest.approx(event.parameter, abs=1e-3 * abs(event.parameter))


def test_snapped_state_is_what_a_tracker_finds_past_the_fold(turned):
    [fold] = turned.branches[0].events
    tracker = fb.Tracker(arch())
    for angle in np.linspace(0.0, fold.snapped_parameter, 200):
        update = tracker.update([0.0, 0.6, 0.0], [0.0, 0.0, angle])
    assert update.snapped
    assert fold.snapped.status == "converged"
    assert fold.snapped.energy == pytest.approx(update.energy, rel=1e-6)
    np.testing.assert_allclose(fold.snapped.position, tracker.position, atol=1e-5)
    assert fold.snapped.scenario.to_dict()["supports"][1]["rotation"][2] == pytest.approx(fold.snapped_parameter)
    assert abs(fold.snapped_parameter) > abs(fold.parameter)


# ------------------------------------------------------------------------------------------------------ states


def rates_of(branch: fb.Branch, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rates along a branch, of its energy and of the work that `along` per unit of the parameter does; both by splines
    over the length of the branch, folds and all, and away from its ends."""
    keep = np.setdiff1d(np.arange(len(branch)), [event.state for event in branch.events])
    parameter, energy, work = branch.parameter[keep], branch.energy[keep], along[keep]
    way = np.linalg.norm(np.diff(branch.position[keep], axis=0), axis=2).max(axis=1) + np.abs(np.diff(parameter))
    length = np.concatenate([[0.0], np.cumsum(way)])
    rates = [CubicSpline(length, values)(length, 1) for values in (energy, parameter)]
    return rates[0][3:-3], (work * rates[1])[3:-3]


def test_energy_changes_by_the_moment_of_the_end_that_is_turned_through_the_fold():
    [branch] = fb.follow(arch(), {ANGLE: -1.5}, step=0.02).branches
    rate, work = rates_of(branch, branch.reaction("end").moment[:, 2])
    assert branch.events
    np.testing.assert_allclose(rate, work, atol=2e-3 * np.abs(rate).max())


def test_energy_changes_by_the_force_of_the_end_that_is_moved_aside():
    start = on_one_mesh(arch())
    [branch] = fb.follow(start, {"supports[1].position[2]": 0.25}, step=0.02, branches=1).branches
    rate, work = rates_of(branch, branch.reaction("end").force[:, 2])
    np.testing.assert_allclose(rate, work, atol=1e-5 * np.abs(rate).max())


def test_energy_changes_by_the_wrench_of_an_end_that_is_led_as_a_screw():
    turn, shift = np.array([0.1, 0.3, -0.4]), np.array([0.05, 0.02, 0.03])
    end = fb.Poses([(np.array([0.0, 0.6, 0.0]) + shift, turn)], motion="screw")
    [branch] = fb.follow(arch(), end, step=0.02, branches=1).branches
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), shift
    screw = np.real(logm(pose))
    velocity = np.array([(expm(place * screw) @ screw)[:3, 3] for place in branch.parameter])
    force, moment = branch.reaction("end")
    rate, work = rates_of(branch, np.sum(force * velocity, axis=1) + moment @ turn)
    np.testing.assert_allclose(rate, work, atol=1e-5 * np.abs(rate).max())


def test_branch_is_stable_up_to_its_fold_and_unstable_beyond(turned):
    [branch] = turned.branches
    [fold] = branch.events
    assert set(branch.stable[: fold.state]) == {True}
    assert set(branch.stable[fold.state + 1 :]) == {False}
    assert branch.equilibrium(5).stable is True
    assert branch.equilibrium(-5).stable is False
    assert branch.equilibrium(-5).negative_modes == branch.negative_modes[-5] == 1


def test_stable_states_are_those_of_a_solve(turned):
    [branch] = turned.branches
    for state in (0, 8, 16):
        one, other = branch.equilibrium(state), fb.solve(branch.equilibrium(state).scenario)
        assert one.energy == pytest.approx(other.energy, rel=1e-5)
        np.testing.assert_allclose(one.position, spine_at(other, one.u), atol=1e-5)


def test_every_state_is_an_equilibrium(turned, sheared):
    for branch in (*turned.branches, *sheared.branches):
        for state in range(0, len(branch), 5):
            equilibrium = branch.equilibrium(state)
            assert equilibrium.status == "converged"
            assert max(equilibrium.residuals) <= 1e-8


@pytest.mark.parametrize("energy", ["fishbone", "wunderlich"])
def test_a_band_is_followed_past_all_places_where_ribs_turn_over(energy):
    """Sheared by 0.4 it meets plenty, both ways along its parameter."""
    tables = arch(0.75).to_dict()
    tables["energy"], tables["belt"]["width"] = energy, 1.0 / 6.0
    diagram = fb.follow(fb.Scenario.from_dict(tables), {"supports[1].position[2]": 0.4}, branches=1)
    [branch] = diagram.branches
    assert branch.end == "range"
    assert branch.parameter[-1] == 0.4
    assert branch.events
    for state in range(0, len(branch), 50):
        equilibrium = branch.equilibrium(state)
        assert equilibrium.status == "converged"
        assert max(equilibrium.residuals) <= 1e-8


@pytest.mark.parametrize("name", ["bent", "hinge", "curved"])
@pytest.mark.parametrize("field", ["supports[1].position[2]", "belt.segments[0].length"])
def test_boards_with_bends_are_followed_from_where_they_were_solved(name, field):
    """With the edges that hold their ribs, and as many elements to every stretch; states are equilibria to the last."""
    start = fb.solve(fb.load(ROOT / "scenarios" / f"{name}.toml"), strict=True)
    tables = start.scenario.to_dict()
    length = tables["belt"]["segments"][0]["length"]
    last = {"supports[1].position[2]": tables["supports"][1]["position"][2] + 0.1 * length, field: 1.1 * length}
    [branch] = fb.follow(start, {field: last[field]}, branches=1, states=60).branches
    first = branch.equilibrium(0)
    assert start.error is not None
    assert first.energy == pytest.approx(start.energy, rel=2.0 * start.error.energy)
    assert len(branch) > 10
    for state in (0, len(branch) // 2, -1):
        assert branch.equilibrium(state).status == "converged"


def test_a_belt_that_is_drawn_straight_ends_there_and_branches_off_nowhere():
    [branch] = fb.follow(arch(), {"supports[1].position[1]": 1.3}).branches
    assert branch.end == "no_slack"
    assert branch.events == []
    assert branch.parameter.max() < 1.0 + 1e-6


def test_reports_are_those_of_the_equilibria(sheared):
    [branch] = sheared.branches
    meshes = [branch.equilibrium(state).u for state in range(len(branch))]
    places = max(meshes, key=len)
    assert len(meshes[0]) < len(places)
    for state in (0, len(branch) // 2, -1):
        shape = branch.equilibrium(state)
        assert branch.energy[state] == shape.energy
        assert branch.height[state] == pytest.approx(shape.highest_point.position[0], rel=1e-12)
        assert branch.least_bend_radius[state] == shape.least_bend_radius.value
        assert branch.least_spine_radius[state] == shape.least_spine_radius.value
        assert branch.rib_margin[state] == shape.rib_margin.value
        assert tuple(branch.area_radii[state]) == shape.bend_radius.area
        # On a mesh with fewer elements the shape is read off between its nodes.
        np.testing.assert_allclose(branch.position[state], spine_at(shape, places), atol=1e-6)
        assert branch.error[state] == max(shape.error)
        for support in ("start", "end"):
            for along, at in zip(branch.reaction(support), shape.reaction(support), strict=True):
                np.testing.assert_array_equal(along[state], at)
        assert shape.scenario.to_dict()["supports"][1]["position"][2] == branch.parameter[state]


def pulled(**solver: int) -> fb.Branch:
    """A strip clamped at an angle to the force that pulls its other end, which straightens it but for a layer."""
    belt = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    clamp = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.6]}
    loads = {"points": [{"at": "end", "force": [0.0, 10.0, 0.0]}]}
    tables = {"energy": "wunderlich", "belt": belt, "supports": [clamp], "loads": loads, "solver": solver}
    [branch] = fb.follow(fb.Scenario.from_dict(tables), {"loads.points[0].force[1]": 1e5}).branches
    return branch


def layer_radius(pull: np.ndarray) -> np.ndarray:
    """The tightest bend of a long strip pulled at 0.6 to its clamp, by the integral of its equation along the arc."""
    return 1.0 / (2.0 * np.sqrt(pull) * np.sin(0.3))


def test_the_mesh_is_graded_anew_along_a_path_where_the_bend_gets_too_sharp_for_it():
    branch = pulled()
    assert branch.end == "range"
    far = branch.parameter > 100.0
    np.testing.assert_allclose(branch.least_spine_radius[far], layer_radius(branch.parameter[far]), rtol=1e-2)
    assert branch.error.max() < 1e-2
    assert len(branch.equilibrium(-1).u) > len(branch.equilibrium(0).u)


def test_a_fixed_mesh_tells_what_it_makes_of_a_path():
    """The layer is thinner than an element: the radius is off by the error, to a factor of 3."""
    branch = pulled(elements=80)
    true = branch.least_spine_radius / layer_radius(branch.parameter) - 1.0
    assert true[-1] > 0.5
    coarse = true > 0.01
    ratio = branch.error[coarse] / true[coarse]
    assert ratio.min() > 1.0 / 3.0
    assert ratio.max() < 3.0
    assert {len(branch.equilibrium(state).u) for state in (0, -1)} == {81}


def test_states_whose_elements_turn_too_far_are_no_equilibria():
    """Of a path on a fixed mesh, as of a solve on it; a solve of the same scenario has the same verdict."""
    branch = pulled(elements=80)
    first = branch.status.index("not_converged")
    assert set(branch.status[:first]) == {"converged"}
    assert set(branch.status[first:]) == {"not_converged"}
    for state in (first - 1, first, -1):
        assert fb.solve(branch.equilibrium(state).scenario).status == branch.status[state]
    assert "elements turn by up to" in branch.equilibrium(-1).message
    assert set(pulled().status) == {"converged"}


def test_arrays_have_the_documented_shapes_and_belong_to_the_caller(turned):
    [branch] = turned.branches
    count, nodes = len(branch), len(turned.start.u)
    assert branch.position.shape == (count, nodes, 3)
    assert branch.reaction("end").force.shape == branch.reaction(0).moment.shape == (count, 3)
    assert isinstance(branch.stable, list)
    assert len(branch.stable) == count
    assert branch.negative_modes.dtype == np.int64
    for name in ("parameter", "energy", "height", "least_bend_radius", "least_spine_radius", "rib_margin"):
        array = getattr(branch, name)
        assert (array.shape, array.dtype) == ((count,), np.float64)
        array[:] = math.nan
        assert np.isfinite(getattr(branch, name)).all(), name
    branch.position[:] = branch.negative_modes[:] = 7
    branch.stable.clear()
    assert branch.stable[0] is True
    assert np.all(branch.negative_modes < 2)
    assert np.abs(branch.position).max() < 1.0


def test_where_nothing_bends_no_radius_is_a_number():
    # Not all flat belts are exactly flat: radii that are not NaN are very large.
    radii = fb.follow(strut(), {PUSH: -2.0}, branches=1).branches[0].least_spine_radius
    assert np.all(np.isnan(radii) | (radii > 1e9))


# ------------------------------------------------------------------------------------------------------- paths


def test_a_list_stands_for_its_numbers():
    last = np.array([0.02, 0.65, 0.1])
    one = fb.follow(arch(), {"supports[1].position": last}, branches=1)
    other = fb.follow(arch(), {f"supports[1].position[{i}]": x for i, x in enumerate(last)}, branches=1)
    assert one.parameter_name == other.parameter_name == "share of the path"
    np.testing.assert_array_equal(one.branches[0].energy, other.branches[0].energy)
    np.testing.assert_allclose(one.branches[0].equilibrium(-1).position[-1], last, atol=1e-7)


def test_poses_on_a_line_are_the_numbers_that_change_on_it():
    one = fb.follow(arch(), {"supports[1].position[2]": 0.2}, branches=1)
    other = fb.follow(arch(), fb.Poses([([0.0, 0.6, 0.2], [0.0, 0.0, 0.0])]), branches=1)
    assert (one.parameter_name, other.parameter_name) == ("supports[1].position[2]", "place on the path")
    np.testing.assert_allclose(one.branches[0].parameter, 0.2 * other.branches[0].parameter, atol=1e-9)
    np.testing.assert_allclose(one.branches[0].energy, other.branches[0].energy, rtol=1e-9)


def test_a_support_is_led_through_pose_after_pose():
    poses = [([0.0, 0.6, 0.1], [0.0, 0.2, 0.0]), ([0.0, 0.7, 0.1], [0.0, 0.0, 0.0])]
    diagram = fb.follow(arch(), fb.Poses(poses), branches=1)
    [branch] = diagram.branches
    assert (branch.parameter[0], branch.parameter[-1], branch.end) == (0.0, 2.0, "range")
    np.testing.assert_allclose(branch.position[-1, -1], poses[-1][0], atol=1e-7)
    assert diagram.support == 1


@pytest.mark.parametrize("snaps", [True, False])
def test_an_arch_is_led_there_and_back(snaps):
    """At the pose between, the way turns back at once. The arch leans over on the way there, and stands up again."""
    poses = [([0.0, 0.3, 0.0], [0.0, 1.5, 0.0]), ([0.0, 0.6, 0.0], [0.0, 0.0, 0.0])]
    diagram = fb.follow(on_one_mesh(arch()), fb.Poses(poses), snaps=snaps)
    trunk = diagram.branches[0]
    assert (diagram.is_complete, trunk.end, trunk.parameter[-1]) == (True, "range", 2.0)
    assert trunk.energy[-1] == pytest.approx(trunk.energy[0], rel=1e-8)
    assert trunk.stable[-1] is True
    there, back = (event.parameter for event in trunk.events)
    assert there == pytest.approx(2.0 - back, abs=1e-5)
    # The pose between is a state, once, and no event.
    assert np.count_nonzero(trunk.parameter == 1.0) == 1
    np.testing.assert_allclose(trunk.position[trunk.parameter == 1.0][0, -1], poses[0][0], atol=1e-7)


def random_way(seed: int) -> tuple[fb.Scenario, list[tuple[np.ndarray, np.ndarray]]]:
    """A strip of few elements, and three poses of its end: back to the first one for every other seed."""
    rng = np.random.default_rng(seed)

    def pose(reach: float, turn: float) -> np.ndarray:
        return np.concatenate((rng.uniform(-reach, reach, 3), rng.uniform(-turn, turn, 3)))

    first = pose(0.2, 0.8) + 0.5 * np.eye(6)[1]
    between, last = (first + pose(0.25, 1.6) for _ in range(2))
    poses = [first, between, first if seed % 2 else last]
    tables = arch().to_dict()
    tables |= {"energy": "wunderlich", "solver": {"elements": 40}}
    tables["supports"][1] |= {"position": first[:3].tolist(), "rotation": first[3:].tolist()}
    return fb.Scenario.from_dict(tables), [(pose[:3], pose[3:]) for pose in poses]


@pytest.mark.parametrize("seed", range(12))
def test_strips_are_led_past_the_pose_between_two_legs(seed):
    scenario, poses = random_way(seed)
    diagram = fb.follow(scenario, fb.Poses(poses[1:]), snaps=True)
    last = diagram.branches[-1]
    assert (last.end, last.parameter[-1]) == ("range", 2.0)
    np.testing.assert_allclose(last.position[-1, -1], poses[-1][0], atol=1e-7)
    events = [event for branch in diagram.branches for event in branch.events]
    assert all(event.parameter != 1.0 for event in events)
    if seed % 2 and not events:
        np.testing.assert_allclose(last.position[-1], last.position[0], atol=1e-6)


@pytest.mark.parametrize("past", [-1e-3, -1e-6, 1e-6, 1e-3])
@pytest.mark.parametrize("step", [0.02, 0.3])
def test_a_fold_next_to_a_pose_is_met_only_before_the_pose(step, past, turned):
    """A way that turns back just before a fold does not meet it, though the curve of the leg goes on to it."""
    [fold] = turned.branches[0].events
    angle = fold.parameter - past
    poses = [([0.0, 0.6, 0.0], [0.0, 0.0, angle]), ([0.0, 0.6, 0.0], [0.0, 0.0, 0.0])]
    [branch] = fb.follow(arch(), fb.Poses(poses), branches=1, step=step).branches
    assert branch.end == "range"
    if past < 0.0:
        assert (branch.events, branch.parameter[-1], set(branch.stable)) == ([], 2.0, {True})
    else:
        assert branch.events[0].kind == "fold"
        assert branch.events[0].parameter == pytest.approx(fold.parameter / angle, abs=1e-6)
        assert branch.parameter[-1] == 0.0


def test_a_screw_and_a_line_lead_to_one_end_by_different_ways():
    poses = [([0.0, 0.7, 0.1], [0.0, 0.8, 0.0])]
    start = on_one_mesh(arch())
    line, screw = (
        fb.follow(start, fb.Poses(poses, motion=motion), branches=1).branches[0] for motion in ("straight", "screw")
    )
    np.testing.assert_allclose(line.position[-1], screw.position[-1], atol=1e-5)
    middle = [np.argmin(np.abs(branch.parameter - 0.5)) for branch in (line, screw)]
    x = [branch.position[state, -1, 0] for branch, state in zip((line, screw), middle, strict=True)]
    assert abs(x[0]) < 1e-9
    assert abs(x[1]) > 1e-3


def test_the_start_may_be_led_too():
    diagram = fb.follow(arch(), fb.Poses([([0.0, 0.0, 0.1], [0.0, 0.0, 0.0])], support="start"), branches=1)
    assert diagram.support == 0
    np.testing.assert_allclose(diagram.branches[0].position[-1, 0], [0.0, 0.0, 0.1], atol=1e-7)


def test_an_equilibrium_is_followed_itself(turned):
    [branch] = fb.follow(turned.start, {ANGLE: -1.5}).branches
    np.testing.assert_array_equal(branch.energy, turned.branches[0].energy)


def test_a_saddle_is_followed_back_over_the_fold(turned):
    saddle = turned.branches[0].equilibrium(-8)
    branch = fb.follow(saddle, {ANGLE: -1.5}).branches[0]
    assert branch.events[0].parameter == pytest.approx(turned.branches[0].events[0].parameter, abs=1e-6)
    assert branch.events[0].negative_modes == (1, 0)
    assert branch.events[0].snapped is None


def test_a_belt_that_is_led_snaps_over_and_goes_on(turned):
    diagram = fb.follow(arch(), {ANGLE: -1.5}, snaps=True)
    before, after = diagram.branches
    [fold] = turned.branches[0].events
    [snap] = before.events
    assert (before.end, after.end, after.origin) == ("unstable", "range", (0, 0))
    assert snap.parameter == pytest.approx(fold.parameter, abs=1e-6)
    assert (snap.confirmed, snap.negative_modes) == (True, (0, 1))
    assert all(after.stable)
    assert after.energy[-1] == pytest.approx(fb.solve(after.equilibrium(-1).scenario).energy, rel=1e-6)


def test_a_belt_without_supports_is_followed():
    diagram = fb.follow(fb.load(ROOT / "scenarios" / "mobius.toml"), {"belt.width": 0.15}, branches=1)
    assert diagram.branches[0].end == "range"
    assert diagram.support is None
    assert not [name for name in diagram.table() if name.startswith("supports")]


def test_a_branch_has_the_reason_of_its_end():
    short = fb.follow(arch(), {ANGLE: -1.5}, states=10).branches[0]
    assert (len(short), short.end) == (10, "budget")
    assert fb.follow(arch(), {ANGLE: -0.5}).branches[0].end == "range"


def test_shorter_steps_are_more_states_of_one_branch(turned):
    fine = fb.follow(arch(), {ANGLE: -1.5}, step=0.01).branches[0]
    assert len(fine) > 2 * len(turned.branches[0])
    assert fine.events[0].parameter == pytest.approx(turned.branches[0].events[0].parameter, abs=1e-7)


def test_the_same_twice_is_the_same_bit_for_bit(buckling):
    again = fb.follow(strut(), {PUSH: -100.0})
    for one, other in zip(again.table().values(), buckling.table().values(), strict=True):
        assert one.tobytes() == other.tobytes()
    for one, other in zip(again.branches, buckling.branches, strict=True):
        assert one.position.tobytes() == other.position.tobytes()
        for event, same in zip(one.events, other.events, strict=True):
            assert event[:4] == same[:4]
            assert event.snapped_parameter == same.snapped_parameter
            assert snapped_energy(event) == snapped_energy(same)


def snapped_energy(event: fb.Event) -> float | None:
    return None if event.snapped is None else event.snapped.energy


# ------------------------------------------------------------------------------------------------ closed branches

AWAY = (-0.15, 0.25, -1.3)
"""Where the end of the arch turned by 1.5 is led to, as x, y and its angle; then back."""


def there_and_back(step: float = 0.05) -> fb.Diagram:
    """Led away, the arch folds and goes over to a shape that does not exist at either end of the path."""
    tables = arch(0.55, 1.5).to_dict()
    # So large a jump is passed over too.
    tables["solver"] |= {"elements": 32, "snap_size": 10.0}
    x, y, angle = AWAY
    poses = fb.Poses([([x, y, 0.0], [0.0, 0.0, angle]), ([0.0, 0.55, 0.0], [0.0, 0.0, 1.5])])
    return fb.follow(fb.Scenario.from_dict(tables), poses, states=400, step=step)


@pytest.fixture(scope="module")
def closed() -> fb.Branch:
    return next(branch for branch in there_and_back().branches if branch.end == "closed")


def test_a_branch_that_comes_back_to_its_start_is_closed_there(closed):
    assert closed.origin == fb.Origin(0, 0)
    assert closed.parameter[-1] == closed.parameter[0]
    assert closed.energy[-1] == closed.energy[0]
    np.testing.assert_array_equal(closed.position[-1], closed.position[0])
    assert set(closed.status) == {"converged"}


def test_a_closed_branch_goes_round_once(closed):
    """It is a stable shape and a saddle, which fold into each other on the way there and on the way back."""
    assert len(closed) < 200
    assert [(event.kind, event.negative_modes, event.confirmed) for event in closed.events] == [
        ("fold", (0, 1), True),
        ("fold", (1, 0), True),
    ]
    turning = np.sign(np.diff(closed.parameter))
    assert np.count_nonzero(np.diff(turning)) == len(closed.events)
    # It passes the pose between the legs twice, each time with a state.
    assert np.count_nonzero(closed.parameter == 1.0) == 2
    assert np.count_nonzero(np.diff(np.sign(closed.parameter[closed.parameter != 1.0] - 1.0))) == 2
    # No other state but the neighbours of the first is near to it.
    off = np.linalg.norm(closed.position - closed.position[0], axis=-1).max(axis=-1)
    off = np.hypot(off, closed.parameter - closed.parameter[0])
    assert np.all(off[5:-5] > 2.0 * off[[1, -2]].max())


def test_a_closed_branch_folds_where_the_planar_reference_has_it(closed):
    """The path goes back as it came, so that its folds lie alike on both legs. The reference is the mirror image."""
    x, y, angle = AWAY
    moved = planar.at_parameter(turned_arch(0.55, 1, -angle), np.array([-x, y - 0.55, 0.0]), 1.0)
    expected = next(planar.folds(moved, np.array([x, 0.55 - y, angle - 1.5])))
    place = 1.0 - (expected.pose[2] - moved.pose[2]) / (angle - 1.5)
    back, there = closed.events
    assert there.parameter == pytest.approx(place, abs=1e-4)
    assert back.parameter == pytest.approx(2.0 - place, abs=1e-4)
    for fold in (back, there):
        assert closed.energy[fold.state] == pytest.approx(expected.state.energy, rel=1e-4)


@pytest.mark.parametrize("step", [0.02, 0.15])
def test_a_branch_is_closed_at_the_same_place_for_steps_of_any_length(step, closed):
    [branch] = [branch for branch in there_and_back(step).branches if branch.end == "closed"]
    assert branch.parameter[0] == pytest.approx(closed.parameter[0], abs=1e-7)
    places = [event.parameter for event in closed.events]
    np.testing.assert_allclose([event.parameter for event in branch.events], places, atol=1e-7)


# ----------------------------------------------------------------------------------------------------- exports


def test_the_dict_has_the_numbers_of_the_branches(turned):
    tables = turned.to_dict()
    assert json.loads(json.dumps(tables, allow_nan=False)) == tables
    assert tables["schema"] == "fishbone.diagram/1"
    assert tables["parameter_name"] == ANGLE
    assert tables["scenario"] == arch().to_dict()
    [branch], [expected] = tables["branches"], turned.branches
    assert (branch["origin"], branch["end"]) == (None, "range")
    [event], [fold] = branch["events"], expected.events
    assert event["kind"] == "fold"
    assert event["negative_modes"] == [0, 1]
    assert event["parameter"] == fold.parameter
    assert event["snapped"]["parameter"] == fold.snapped_parameter
    assert event["snapped"]["result"]["energy"] == fold.snapped.energy
    assert [state["parameter"] for state in branch["states"]] == expected.parameter.tolist()
    assert [state["negative_modes"] for state in branch["states"]] == expected.negative_modes.tolist()
    assert [state["result"]["energy"] for state in branch["states"]] == expected.energy.tolist()
    assert {state["result"]["schema"] for state in branch["states"]} == {"fishbone.result/1"}


def test_the_dict_has_the_origins_of_branches(buckling):
    origins = [branch["origin"] for branch in buckling.to_dict()["branches"]]
    assert origins[:2] == [None, {"branch": 0, "event": 0}]


def test_the_table_has_a_row_for_each_state_of_all_branches(buckling):
    table = buckling.table()
    count = sum(map(len, buckling.branches))
    assert {column.shape for column in table.values()} == {(count,)}
    for index, branch in enumerate(buckling.branches):
        rows = table["branch"] == index
        np.testing.assert_array_equal(table["state"][rows], np.arange(len(branch)))
        np.testing.assert_array_equal(table["energy"][rows], branch.energy)
        np.testing.assert_array_equal(table["stable"][rows], branch.stable)
        np.testing.assert_array_equal(table["supports[1].force.x"][rows], branch.reaction(1).force[:, 0])
        np.testing.assert_array_equal(table["supports[0].moment.z"][rows], branch.reaction(0).moment[:, 2])
    assert np.count_nonzero(table["event"]) == sum(len(branch.events) for branch in buckling.branches)


def test_repr_is_one_short_line(turned):
    assert repr(turned) == f"<Diagram: {ANGLE}, 1 branches, {len(turned.branches[0])} states, 1 events>"
    assert repr(turned.branches[0]).startswith("<Branch: ")


# ------------------------------------------------------------------------------------------------------ errors


@pytest.mark.parametrize(
    ("path", "error", "words"),
    [
        ({}, fb.NoPath, "found nothing that changes"),
        ({"supports[1].position[1]": 0.6}, fb.NoPath, "found nothing that changes"),
        ({"supports[7].position[1]": 0.6}, fb.NoPath, r"supports\[7\].position\[1\]: found nothing"),
        ({"supports[1].position": 0.6}, fb.NoPath, r"supports\[1\].position: found \[0.0,0.6,0.0\]"),
        ({"supports[1].position": [0, 0.6, 0, 1]}, fb.NoPath, r"position\[3\]: found nothing"),
        ({"solver.method": 1.0}, fb.NoPath, 'solver.method: found "intrinsic"'),
        ({"energy": 1.0}, fb.NoPath, "energy: found nothing"),
        ({"belt.width": -1.0}, fb.NoPath, "at the end of the path, belt.width: found -1"),
        ({"belt.width": math.nan}, fb.InvalidArgument, "belt.width: found nan"),
        ({"belt.width": 10**400}, fb.InvalidArgument, "belt.width: found 1000"),
        ({"belt.width": True}, fb.InvalidArgument, "belt.width: found True"),
        ({"belt.width": "wide"}, fb.InvalidArgument, "belt.width: found 'wide'"),
        ({1: 2.0}, fb.InvalidArgument, "found the field 1"),
        ({"supports[1].position[1]": 0.7, "supports[1].position": [0, 0.7]}, fb.InvalidArgument, "found twice"),
        ([("belt.width", 0.2)], fb.InvalidArgument, "path: found list"),
        (fb.Poses([]), fb.NoPath, "found nothing that changes"),
        (fb.Poses([([0.0, 0.6, 0.0], [0.0, 0.0, 0.0])]), fb.NoPath, "found nothing that changes"),
        (fb.Poses([([0.0, 0.6], [0.0, 0.0, 0.0])]), fb.InvalidArgument, r"poses\[0\]\[0\]: found shape \(2,\)"),
        (fb.Poses([([0.0, 0.6, 0.0],)]), fb.InvalidArgument, r"poses\[0\]: found"),
        (fb.Poses(1.0), fb.InvalidArgument, "poses: found 1.0"),
        (fb.Poses([([0.0, 0.7, 0.0], [0.0, 0.0, 0.0])], motion="arc"), fb.InvalidArgument, "motion: found 'arc'"),
        (fb.Poses([([0.0, 0.7, 0.0], [0.0, 0.0, 0.0])], support=4), fb.NoSupport, "support 4"),
    ],
)
def test_what_is_no_path_is_refused_in_one_line(path, error, words):
    with pytest.raises(error, match=words) as refusal:
        fb.follow(arch(), path)
    assert "\n" not in str(refusal.value)
    assert isinstance(refusal.value, fb.FishboneError)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("step", [0.0, -0.1, 1.5, math.nan, "a", True]),
        ("states", [1, 100_001, 2.5, True]),
        ("branches", [0, 1001, "a"]),
    ],
)
def test_settings_are_within_their_limits(monkeypatch, name, values):
    monkeypatch.setitem(fb.follow.__globals__, "solve", lambda _: pytest.fail("solved"))
    for value in values:
        with pytest.raises(fb.InvalidArgument, match=f"^{name}: found .*, allowed"):
            fb.follow(arch(), {ANGLE: -1.5}, **{name: value})


def test_follow_names_the_type_that_it_needs():
    with pytest.raises(fb.InvalidArgument, match="found str, allowed a Scenario or an Equilibrium"):
        fb.follow("planar.toml", {ANGLE: -1.5})


def test_what_cannot_be_followed_is_refused(out_of_reach):
    with pytest.raises(fb.NoBranch, match="nothing to follow"):
        fb.follow(out_of_reach, {ANGLE: -1.5})
    ritz = fb.Scenario.from_dict(arch().to_dict() | {"energy": "fishbone", "solver": {"method": "ritz"}})
    with pytest.raises(fb.NoBranch, match="source's method"):
        fb.follow(ritz, {ANGLE: -1.5})
    pinned = arch().to_dict()
    del pinned["supports"][1]["rotation"]
    with pytest.raises(fb.NoPath, match=r"supports\[1\]: found a support that does not hold"):
        fb.follow(fb.Scenario.from_dict(pinned), fb.Poses([([0.0, 0.7, 0.0], [0.0, 0.0, 0.0])]))


def test_what_is_not_there_is_refused(turned):
    [branch] = turned.branches
    for state in (len(branch), -len(branch) - 1, 1.5, True):
        with pytest.raises(fb.InvalidArgument, match=f"state: found {state}, allowed"):
            branch.equilibrium(state)
    with pytest.raises(fb.NoSupport):
        branch.reaction(2)


def test_progress_is_called_and_may_end_the_continuation():
    calls = []
    fb.follow(strut(), {PUSH: -100.0}, progress=lambda branch, share: calls.append((branch, share)))
    assert {branch for branch, _ in calls} <= set(range(10))
    assert all(-0.1 <= share <= 1.1 for _, share in calls)
    assert calls

    for error in (ValueError("enough"), KeyboardInterrupt()):

        def stop(branch, share, error=error):
            raise error

        with pytest.raises(type(error)) as ended:
            fb.follow(strut(), {PUSH: -100.0}, progress=stop)
        assert ended.value is error


class _Alarm(Exception):  # noqa: N818
    pass


def test_a_signal_ends_the_continuation():
    def ring(*_):
        raise _Alarm

    start = fb.solve(fb.Scenario.from_dict(arch().to_dict() | {"solver": {"elements": 640}}))
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(_Alarm):
            fb.follow(start, {"supports[1].position[2]": 0.6})
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
