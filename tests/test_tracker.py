"""Tracking of a minimum while a support moves: its shapes are those solved afresh, and snaps are reported."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from cases import on_one_mesh
from helpers import ENERGIES, Energy, rotation_vector

SCENARIOS = Path(__file__).parents[1] / "scenarios"
END = np.array([0.0, 0.5, 0.1])


def example(energy: Energy = "wunderlich", elements: int = 64, **tables: Any) -> fb.Scenario:
    """The belt of the source's first example."""
    ends = [
        {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},
        {"at": "end", "position": END.tolist(), "rotation": [0.0, 0.0, 0.0]},
    ]
    belt = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    given = {"energy": energy, "belt": belt, "supports": ends, "solver": {"elements": elements}} | tables
    return fb.Scenario.from_dict(given)


def way(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """A smooth closed path of poses around the example's, which it begins and ends with."""
    angles = np.linspace(0.0, 2.0 * np.pi, count + 1)
    shift = 0.03 * np.column_stack([np.sin(angles), 0.7 * np.sin(2.0 * angles), np.cos(angles) - 1.0])
    turn = 0.15 * np.column_stack([np.sin(angles), np.sin(3.0 * angles), 0.4 * (np.cos(angles) - 1.0)])
    return [(END + x, r) for x, r in zip(shift, turn, strict=True)]


@pytest.mark.parametrize("energy", ENERGIES)
def test_tracker_has_the_energy_of_the_equilibrium_solved_afresh(energy: Energy) -> None:
    """At every tenth pose; complementarity is half the tolerance in the tracker and a tenth in a solve."""
    tracker = fb.Tracker(example(energy))
    for k, (position, rotation) in enumerate(way(200)):
        update = tracker.update(position, rotation)
        assert (update.status, update.snapped) == ("converged", False)
        assert update.residual <= 1e-8
        if k % 10 == 0:
            fresh = example(energy).to_dict()
            fresh["supports"][1] |= {"position": position.tolist(), "rotation": rotation.tolist()}
            assert update.energy == pytest.approx(fb.solve(fb.Scenario.from_dict(fresh)).energy, rel=1e-6)


@pytest.mark.parametrize("energy", ENERGIES)
def test_tracker_keeps_to_the_branch_of_ten_times_finer_steps(energy: Energy) -> None:
    """No update is on a wrong branch, whatever the step."""
    coarse, fine = fb.Tracker(example(energy)), fb.Tracker(example(energy))
    poses = way(2000)
    for k, (position, rotation) in enumerate(poses):
        energy_now = fine.update(position, rotation).energy
        if k % 10 == 0:
            assert coarse.update(position, rotation).energy == pytest.approx(energy_now, rel=1e-6)


def test_update_takes_two_newton_steps_on_a_smooth_path() -> None:
    """A prediction and one correction."""
    tracker = fb.Tracker(example())
    iterations = [tracker.update(*pose).iterations for pose in way(2000)]
    assert np.percentile(iterations, 99) <= 2


def test_shape_and_reactions_are_those_of_the_equilibrium() -> None:
    """Reactions need no extra solve."""
    tracker = fb.Tracker(example())
    for pose in way(100)[:20]:
        tracker.update(*pose)
    equilibrium = tracker.equilibrium()
    assert equilibrium.status == "converged"
    np.testing.assert_allclose(tracker.u, equilibrium.u)
    np.testing.assert_allclose(tracker.position, equilibrium.position, atol=1e-6)
    np.testing.assert_allclose(tracker.frame, equilibrium.frame, atol=1e-5)
    np.testing.assert_allclose(tracker.bend, equilibrium.bend, atol=1e-3)
    np.testing.assert_allclose(tracker.rib_slope, equilibrium.rib_slope, atol=1e-3)
    for support in ("start", "end"):
        for followed, solved in zip(tracker.reaction(support), equilibrium.reaction(support), strict=True):
            np.testing.assert_allclose(followed, solved, rtol=1e-5, atol=1e-4)


def test_pose_of_the_support_is_met() -> None:
    """The last node is at the pose of the clamp, to rounding."""
    tracker = fb.Tracker(example())
    position, rotation = way(40)[7]
    tracker.update(position, rotation)
    np.testing.assert_allclose(tracker.position[-1], position, atol=1e-8)
    assert tracker.equilibrium().scenario.to_dict()["supports"][1]["position"] == pytest.approx(position.tolist())


def planar(elements: int = 80) -> fb.Scenario:
    """A planar arch, narrow so that it has no ribs to speak of."""
    return example(
        "sadowsky",
        elements,
        supports=[
            {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},
            {"at": "end", "position": [0.0, 0.9, 0.0], "rotation": [0.0, 0.0, 0.0]},
        ],
    )


def test_snap_is_reported_and_leads_to_less_energy() -> None:
    """The energy of an arch whose end is turned back falls at one snap only."""
    tracker = fb.Tracker(planar())
    energies, snaps = [tracker.energy], [False]
    for angle in np.linspace(0.0, -2.2, 221):
        update = tracker.update([0.0, 0.9, 0.0], [0.0, 0.0, angle])
        assert update.status == "converged"
        energies.append(update.energy)
        snaps.append(update.snapped)
    drops = np.diff(energies)
    assert np.flatnonzero(snaps[1:]).tolist() == np.flatnonzero(drops < -1.0).tolist()
    assert sum(snaps) == 1


def test_pose_out_of_reach_leaves_the_tracker_where_it_was() -> None:
    """The next update continues from the shape before the failure."""
    tracker = fb.Tracker(example())
    before = tracker.update(*way(40)[3])
    position = tracker.position
    failed = tracker.update([0.0, 2.0, 0.0], [0.0, 0.0, 0.0])
    assert failed.status == "infeasible"
    assert not failed.snapped
    assert failed.energy == pytest.approx(before.energy, rel=1e-12)
    np.testing.assert_allclose(tracker.position, position, atol=1e-12)
    after = tracker.update(*way(40)[4])
    assert (after.status, after.snapped) == ("converged", False)


def ends_past_each_other(y: float, **tables: Any) -> fb.Scenario:
    """The belt with its ends drawn past each other along the start's axis, without a turn."""
    scenario = example(**tables).to_dict()
    scenario["supports"][1] |= {"position": [0.0, y, 0.0]}
    return fb.Scenario.from_dict(scenario)


def test_mesh_of_a_tracker_follows_the_error() -> None:
    """Led to ever tighter bends, the belt keeps the energy and force of 1000 elements; its mesh changes on the way."""
    graded: dict[str, Any] = {"solver": {}}
    tracker = fb.Tracker(ends_past_each_other(-0.5, **graded))
    before = len(tracker.u)
    for y in np.linspace(-0.5, -0.95, 46):
        assert tracker.update([0.0, y, 0.0], np.zeros(3)).status == "converged"
    fine = fb.solve(ends_past_each_other(-0.95, elements=1000))
    assert len(tracker.u) > before
    assert tracker.energy == pytest.approx(fine.energy, rel=5e-3)
    assert tracker.reaction("end").force[1] == pytest.approx(fine.reaction("end").force[1], rel=1e-2)


def test_an_update_that_is_stopped_leaves_the_estimate_of_its_mesh_to_the_next_one() -> None:
    """Where the search on a finer mesh needs more iterations than the limit allows."""
    tracker = fb.Tracker(ends_past_each_other(-0.5, solver={}))
    before = len(tracker.u)
    for y in np.linspace(-0.5, -0.95, 46):
        for _ in range(30):
            if tracker.update([0.0, y, 0.0], np.zeros(3), max_iterations=10).status == "converged":
                break
    assert len(tracker.u) == before
    assert tracker.update([0.0, -0.95, 0.0], np.zeros(3)).status == "converged"
    assert len(tracker.u) > before


def test_the_mesh_of_a_slender_belt_does_not_grow_from_step_to_step() -> None:
    """Where ribs turn beside the clamp, graded anew at every update: there each mesh used to be finer than the last."""
    tables = example().to_dict()
    tables["belt"]["width"] = 0.01
    tables["solver"] = {}
    tables["supports"][1] |= {"position": [0.05, 0.7, 0.0]}
    tracker = fb.Tracker(fb.Scenario.from_dict(tables))
    for angle in np.linspace(2.86, 3.06, 26):
        shift = 0.016 * np.array([np.sin(angle), 0.7 * np.sin(2.0 * angle), np.cos(angle) - 1.0])
        turn = 0.016 * np.array([np.sin(angle), np.sin(2.0 * angle), 0.4 * (np.cos(angle) - 1.0)])
        assert tracker.update(np.array([0.05, 0.7, 0.0]) + shift, turn).status == "converged"
    again = fb.solve(tracker.equilibrium().scenario)
    assert len(tracker.u) < 1.5 * len(again.u)
    assert tracker.energy == pytest.approx(again.energy, rel=1e-4)


@pytest.mark.parametrize("energy", ENERGIES)
def test_a_belt_whose_ends_meet_is_followed_there_and_away(energy: Energy) -> None:
    """Its closed figure slides along itself at no cost: the minimum is no strict one."""
    tracker = fb.Tracker(example(energy))
    turn = np.zeros(3)
    update = tracker.update(np.zeros(3), turn)
    assert (update.status, update.snapped) == ("converged", False)
    here = tracker.equilibrium()
    assert (here.status, here.stable) == ("converged", None)
    assert update.energy == pytest.approx(fb.solve(here.scenario).energy, rel=1e-6)
    restored = fb.Tracker.restore(tracker.state())
    for y in (0.001, 0.01, 0.1, 0.01, 0.0, 0.2):
        update = tracker.update([0.0, y, 0.0], turn)
        assert (update.status, update.snapped) == ("converged", False)
        assert repr(restored.update([0.0, y, 0.0], turn)) == repr(update)
    fresh = example(energy).to_dict()
    fresh["supports"][1] |= {"position": [0.0, 0.2, 0.0]}
    assert update.energy == pytest.approx(fb.solve(fb.Scenario.from_dict(fresh)).energy, rel=1e-6)


def test_tracker_stops_where_elements_turn_too_far_for_a_belt() -> None:
    """On a fixed mesh, at a pose where a solve does not converge; it keeps its last pose, and goes on from there."""
    tracker = fb.Tracker(ends_past_each_other(-0.5, elements=40))
    for y in np.linspace(-0.5, -0.95, 46):
        last = tracker.energy
        status = tracker.update([0.0, y, 0.0], np.zeros(3)).status
        if status != "converged":
            break
    assert status == fb.solve(ends_past_each_other(y, elements=40)).status == "not_converged"
    assert tracker.energy == pytest.approx(last, rel=1e-9)
    assert tracker.position[-1] == pytest.approx([0.0, y + 0.01, 0.0], abs=1e-6)
    assert tracker.update([0.0, -0.6, 0.0], np.zeros(3)).status == "converged"
    assert tracker.energy == pytest.approx(fb.solve(ends_past_each_other(-0.6, elements=40)).energy, rel=1e-6)


def test_large_update_is_made_in_steps() -> None:
    """One update over a whole sixth of the path ends where many small ones do."""
    small, large = fb.Tracker(example()), fb.Tracker(example())
    poses = way(300)
    for pose in poses[:51]:
        update = small.update(*pose)
    assert large.update(*poses[50]).energy == pytest.approx(update.energy, rel=1e-6)


@pytest.mark.parametrize("name", ["curved", "bent", "hinge", "polystyrene"])
def test_boards_of_all_kinds_are_followed(name: str) -> None:
    """Arcs, corners, stiffeners, materials in SI units."""
    tables = on_one_mesh(fb.load(SCENARIOS / f"{name}.toml").to_dict())
    scenario, end = fb.Scenario.from_dict(tables), tables["supports"][-1]
    rotation = np.array(fb.solve(scenario).frame[-1])
    tracker = fb.Tracker(scenario, -1)
    length = float(tracker.u[-1])
    for k in range(1, 11):
        position = np.array(end["position"]) - 0.002 * k * length * np.array([0.0, 1.0, 0.3])
        update = tracker.update(position, rotation_vector(rotation))
        assert update.status == "converged"
    again = fb.solve(tracker.equilibrium().scenario)
    assert tracker.energy == pytest.approx(again.energy, rel=1e-5)


@pytest.mark.parametrize(
    ("position", "rotation", "words"),
    [
        ([0.0, 0.5], [0.0, 0.0, 0.0], r"position: found shape \(2,\), allowed \(3,\)"),
        ([0.0, 0.5, 0.0], np.eye(3), r"rotation: found shape \(3, 3\), allowed \(3,\)"),
        ([0.0, float("nan"), 0.0], [0.0, 0.0, 0.0], r"position: found .*nan.*, allowed finite numbers"),
    ],
)
def test_what_is_no_pose_is_refused(position: Any, rotation: Any, words: str) -> None:
    """The refusal is one line, and the tracker stays usable."""
    tracker = fb.Tracker(example())
    with pytest.raises(fb.InvalidArgument, match=words):
        tracker.update(position, rotation)
    assert tracker.update(END, [0.0, 0.0, 0.0]).status == "converged"


@pytest.mark.parametrize(
    ("position", "rotation"),
    [([0.0, 1e300, 0.0], [0.0, 0.0, 0.0]), ([0.0, 0.0, -1e7], [0.0, 0.0, 0.0]), (END, [0.0, 1e300, 0.0])],
)
def test_pose_that_no_scenario_may_hold_is_refused_in_the_same_words(
    position: list[float], rotation: list[float]
) -> None:
    tracker = fb.Tracker(example())
    tables = example().to_dict()
    tables["supports"][1] |= {"position": position, "rotation": rotation}
    with pytest.raises(fb.InvalidScenario) as scenario:
        fb.Scenario.from_dict(tables)
    with pytest.raises(fb.InvalidScenario) as refused:
        tracker.update(position, rotation)
    assert str(refused.value) == str(scenario.value)
    assert (refused.value.field, refused.value.allowed) == (scenario.value.field, scenario.value.allowed)
    assert tracker.update(END, [0.0, 0.0, 0.0]).status == "converged"


def test_what_cannot_be_followed_is_refused() -> None:
    """No equilibrium, no whole position, no multipliers, no such support, none at all, one twice."""
    with pytest.raises(fb.NoTracker, match="nothing to follow"):
        fb.Tracker(
            example(
                supports=[
                    {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},
                    {"at": "end", "position": [0.0, 1.5, 0.0], "rotation": [0.0, 0.0, 0.0]},
                ]
            )
        )
    sliding = [
        {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},
        {"at": "end", "position": [0.0, 0.8, "free"]},
    ]
    with pytest.raises(fb.NoTracker, match=r"supports\[1\] does not hold"):
        fb.Tracker(example(supports=sliding))
    with pytest.raises(fb.NoTracker, match="source's method"):
        fb.Tracker(example("fishbone", solver={"method": "ritz"}))
    with pytest.raises(fb.NoSupport):
        fb.Tracker(example(), 5)
    for supports in ([], ["end", 1]):
        with pytest.raises(
            fb.InvalidArgument, match=r"^supports: found .*, allowed one support or several, each once$"
        ):
            fb.Tracker(example(), supports=supports)


def test_many_poses_of_more_nodes_than_memory_may_hold_are_refused() -> None:
    tracker = fb.Tracker(example(elements=2000))
    with pytest.raises(
        fb.InvalidArgument, match=r"^positions: found 30000 of 2001 nodes each, allowed up to 5 million"
    ):
        tracker.update_many(np.tile(END, (30_000, 1)))


def test_steps_too_small_to_follow_add_up() -> None:
    tracker = fb.Tracker(example())
    for k in range(1, 2001):
        assert tracker.update(END + np.array([5e-13 * k, 0.0, 0.0])).status == "converged"
    assert tracker.position[-1][0] == pytest.approx(1e-9, abs=1e-11)


def test_an_update_without_a_motion_needs_no_time() -> None:
    tracker = fb.Tracker(example())
    tracker.update([0.0, 0.52, 0.1])
    update = tracker.update([0.0, 0.52, 0.1], max_time=1e-9)
    assert (update.status, update.fraction, update.iterations) == ("converged", 1.0, 0)


def test_an_update_has_the_reason_why_a_pose_was_not_reached() -> None:
    """A pose out of reach is proved to be; of another it is known only that nothing was found."""
    tracker = fb.Tracker(example("fishbone", elements=40))
    reached = tracker.update(*way(40)[3])
    assert (reached.message, reached.solved_afresh) == ("", False)
    far = tracker.update([0.0, 2.0, 0.0], [0.0, 0.0, 0.0])
    assert far.status == "infeasible"
    assert re.search(r"^supports\[0\] and supports\[1\].* apart, .* more than the belt between them", far.message)
    hard = tracker.update([0.2, 0.86, -0.16], [0.8, -0.1, -0.3])
    assert hard.status == "not_converged"
    assert hard.message == "no minimum was found farther on the way, nor at its end: move there in smaller steps"


def test_an_update_reports_that_the_pose_was_solved_afresh() -> None:
    """The way to the pose is too long to be followed; small steps lead elsewhere, or to the same minimum."""
    tracker = fb.Tracker(example("fishbone", elements=40))
    update = tracker.update([-0.25, 0.63, 0.0], [0.6, 1.2, 0.5])
    assert (update.status, update.solved_afresh, update.snapped) == ("converged", True, True)
    assert tracker.equilibrium().status == "converged"


def test_the_residual_of_an_update_is_the_distance_of_the_support_from_its_pose() -> None:
    tracker = fb.Tracker(example())
    for position, rotation in way(40)[:5]:
        update = tracker.update(position, rotation)
        off = np.linalg.norm(tracker.position[-1] - position) / tracker.u[-1]
        assert off <= 2.0 * update.residual + 1e-15
        assert update.residual < 1e-8


def test_a_tracker_at_each_of_the_branches_stays_on_it() -> None:
    """Around a small closed path of poses; no two of the minima have one shape."""
    minima = [found for found in fb.branches(example("wunderlich", elements=64)) if found.stable]
    assert len(minima) >= 3
    for found in minima:
        tracker = fb.Tracker(found)
        for position, rotation in way(60):
            update = tracker.update(END + 0.2 * (position - END), 0.2 * rotation)
            assert (update.status, update.snapped, update.solved_afresh) == ("converged", False, False)
        assert tracker.energy == pytest.approx(found.energy, rel=1e-6)
        np.testing.assert_allclose(tracker.position, found.position, atol=1e-5)
