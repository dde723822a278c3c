"""Many updates of a tracker in one call are those of as many calls."""

import numpy as np
import pytest

import fishbone as fb


def tracker(name="example1", **changes):
    return fb.Tracker(fb.Scenario.from_dict(fb.load(f"scenarios/{name}.toml").to_dict() | changes))


def smooth(steps=20):
    """Poses on a smooth way from that of example 1."""
    share = np.linspace(0.0, 1.0, steps)[:, None]
    start = np.array(fb.load("scenarios/example1.toml").to_dict()["supports"][1]["position"])
    return start + share * [0.05, -0.05, 0.05], share * [0.1, 0.2, -0.1]


def snapping():
    """A tracker, and poses by which its belt snaps: an arch that a turn of its end throws over."""
    angles = np.linspace(0.0, -3.0, 101)[:, None]
    return tracker("planar"), np.tile([0.0, 0.6, 0.0], (101, 1)), angles * [0.0, 0.0, 1.0]


def test_many_updates_are_those_of_as_many_calls():
    many, single = tracker(), tracker()
    positions, rotations = smooth()
    found = many.update_many(positions, rotations)
    assert found.valid == len(found.updates) == len(positions)
    np.testing.assert_array_equal(found.u, single.u)
    for row, pose in enumerate(zip(positions, rotations, strict=True)):
        assert repr(found.updates[row]) == repr(single.update(*pose))
        force, moment = single.reaction("end")
        np.testing.assert_array_equal(found.force[row], force)
        np.testing.assert_array_equal(found.moment[row], moment)
        if len(single.u) == len(found.u) and np.array_equal(single.u, found.u):
            np.testing.assert_array_equal(found.position[row], single.position)
    np.testing.assert_array_equal(many.position, single.position)


def test_shapes_on_a_mesh_that_changes_are_those_at_the_nodes_of_the_first():
    tables = fb.load("scenarios/example1.toml").to_dict()
    slender = tables["belt"] | {"width": 1.0 / 300.0}
    one = tracker(energy="wunderlich", belt=slender, solver={})
    positions, rotations = smooth(3)
    found = one.update_many(positions, rotations)
    assert found.valid == 3
    assert not np.array_equal(found.u, one.u)
    assert found.position.shape == (3, len(found.u), 3)
    expected = np.array([np.interp(found.u, one.u, one.position[:, axis]) for axis in range(3)]).T
    np.testing.assert_allclose(found.position[-1], expected, atol=1e-3)
    np.testing.assert_allclose(found.position[-1][[0, -1]], one.position[[0, -1]], atol=1e-12)


def test_many_updates_end_at_a_snap_unless_they_may_go_on():
    one, positions, rotations = snapping()
    going = one.copy()
    stopped = one.update_many(positions, rotations)
    assert stopped.updates[-1].snapped
    assert not any(update.snapped for update in stopped.updates[:-1])
    assert stopped.valid == len(stopped.updates) < len(positions)
    through = going.update_many(positions, rotations, stop_on_snap=False)
    assert len(through.updates) > len(stopped.updates)
    assert repr(through.updates[: stopped.valid]) == repr(stopped.updates)


def test_many_updates_end_where_a_pose_is_out_of_reach():
    one = tracker()
    positions, rotations = smooth(4)
    positions[2] = [0.0, 3.0, 0.0]
    found = one.update_many(positions, rotations)
    assert [update.status for update in found.updates] == ["converged", "converged", "infeasible"]
    assert found.valid == 2
    np.testing.assert_array_equal(found.position[2], found.position[1])
    np.testing.assert_array_equal(one.position, found.position[1])


def test_no_poses_change_nothing():
    one = tracker()
    before = one.state()
    found = one.update_many(np.empty((0, 3)), np.empty((0, 3)))
    assert (found.updates, found.valid, found.position.shape) == ([], 0, (0, len(one.u), 3))
    assert (found.force.shape, found.moment.shape) == ((0, 3), (0, 3))
    assert one.state() == before


@pytest.mark.parametrize(
    ("positions", "rotations", "error"),
    [
        ([[0.0, 0.5, 0.0]], [[0.0, 0.0, 0.0]] * 2, "rotations: found 2, allowed 1, one a position"),
        ([0.0, 0.5, 0.0], [[0.0, 0.0, 0.0]], r"positions: found shape \(3,\), allowed \(m, 3\)"),
        ([[0.0, 0.5, 0.0]], [[0.0, float("nan"), 0.0]], "rotations: found nan, allowed finite numbers"),
        (None, [[0.0, 0.0, 0.0]], r"positions: found shape \(\), allowed"),
        ("here", [[0.0, 0.0, 0.0]], r"positions: found 'here', allowed numbers of shape \(m, 3\)"),
    ],
)
def test_what_are_no_poses_is_refused(positions, rotations, error):
    with pytest.raises(fb.InvalidArgument, match=f"^{error}"):
        tracker().update_many(positions, rotations)


def test_a_pose_that_no_scenario_may_hold_is_refused_before_the_first_update():
    one = tracker()
    before = one.state()
    with pytest.raises(fb.InvalidScenario, match=r"^supports\[1\]\.position\[1\]: found"):
        one.update_many([[0.0, 0.55, 0.0], [0.0, 1e9, 0.0]], np.zeros((2, 3)))
    assert one.state() == before
