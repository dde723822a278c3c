"""Several supports of a tracker move at once: clamps, hinges and pins."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fishbone as fb

START = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
END = {"at": "end", "position": [0.0, 0.75, 0.1], "rotation": [0.0, 0.0, 0.0]}
MIDDLE = {"at": 0.5, "position": [0.0, 0.35, 0.25]}
HINGE = MIDDLE | {"rotation": [0.0, 0.0, 0.0], "hinge": "zeta"}
ELEMENTS = 64


def held(*supports):
    tables = fb.load("scenarios/example1.toml").to_dict()
    return fb.Scenario.from_dict(tables | {"supports": list(supports), "solver": {"elements": ELEMENTS}})


@pytest.mark.parametrize("middle", [MIDDLE, HINGE], ids=["pin", "hinge"])
def test_reactions_are_the_derivatives_of_the_energy_where_supports_have_moved_together(middle):
    tracker = fb.Tracker(held(START, middle, END), supports=["start", 0.5, "end"])
    goals = {
        "start": fb.Pose([0.01, -0.005, 0.005], [0.05, 0.0, 0.025]),
        0.5: np.array([0.01, 0.355, 0.245]),
        "end": fb.Pose([0.005, 0.745, 0.11], [0.0, 0.05, 0.0]),
    }
    update = tracker.update(goals)
    assert (update.status, update.fraction, update.message) == ("converged", 1.0, "")
    supports = tracker.equilibrium().scenario.to_dict()["supports"]
    assert supports[1]["position"] == pytest.approx(goals[0.5].tolist())
    assert supports[0]["rotation"] == pytest.approx([0.05, 0.0, 0.025])
    force = tracker.reaction(0.5).force
    for axis in range(3):
        step = 1e-4 * np.eye(3)[axis]
        energies = [tracker.copy().update({0.5: goals[0.5] + sign * step}).energy for sign in (1.0, -1.0)]
        assert (energies[0] - energies[1]) / 2e-4 == pytest.approx(
            force[axis], rel=1e-3, abs=1e-2 * np.linalg.norm(force)
        )


def test_a_belt_that_is_carried_by_all_of_its_supports_keeps_its_shape():
    tracker = fb.Tracker(held(START, MIDDLE, END), supports=["start", 0.5, "end"])
    energy, shape = tracker.energy, tracker.position
    for k in range(1, 21):
        turn = Rotation.from_rotvec(0.05 * k * np.array([1.0, -2.0, 0.5]))
        by = 0.01 * k * np.array([1.0, 1.0, -1.0])
        goals = {
            place: fb.Pose(turn.apply(support["position"]) + by, turn.as_rotvec())
            for place, support in {"start": START, 0.5: MIDDLE, "end": END}.items()
        }
        assert tracker.update(goals).status == "converged"
        np.testing.assert_allclose(tracker.position, turn.apply(shape) + by, atol=1e-6)
        assert tracker.energy == pytest.approx(energy, rel=1e-8)


def test_supports_that_are_not_named_stay():
    tracker = fb.Tracker(held(START, MIDDLE, END), supports=[0.5, "end"])
    tracker.update({"end": fb.Pose(END["position"], [0.0, 0.1, 0.0])})
    before = tracker.position[[0, -1]]
    tracker.update({0.5: [0.0, 0.36, 0.25]})
    np.testing.assert_allclose(tracker.position[[0, -1]], before, atol=1e-9)
    assert tracker.position[ELEMENTS // 2] == pytest.approx([0.0, 0.36, 0.25], abs=1e-9)
    with pytest.raises(fb.InvalidScenario, match=r"^supports\[0\]: found a support that does not move"):
        tracker.update({"start": START["position"]})
    with pytest.raises(fb.NoSupport):
        tracker.update({0.7: START["position"]})


def test_many_updates_of_several_supports_are_those_of_as_many_calls():
    one = fb.Tracker(held(START, MIDDLE, END), supports=["end", 0.5])
    other = one.copy()
    share = np.linspace(0.1, 1.0, 10)[:, None]
    ends, middles = END["position"] + share * [0.0, -0.02, 0.02], MIDDLE["position"] + share * [0.01, 0.0, -0.01]
    turns = share * [0.1, 0.0, 0.1]
    found = one.update_many(np.stack([ends, middles], axis=1), np.stack([turns, turns], axis=1))
    assert (found.valid, found.force.shape, found.moment.shape) == (10, (10, 2, 3), (10, 2, 3))
    for k in range(10):
        update = other.update({"end": fb.Pose(ends[k], turns[k]), 0.5: fb.Pose(middles[k])})
        assert repr(update) == repr(found.updates[k])
        np.testing.assert_array_equal(other.reaction(0.5).force, found.force[k, 1])
    np.testing.assert_array_equal(one.position, other.position)


def test_positions_alone_keep_the_rotations():
    one = fb.Tracker(held(START, END))
    found = one.update_many([[0.0, 0.74, 0.1], [0.0, 0.73, 0.1]])
    other = fb.Tracker(held(START, END))
    for k, y in enumerate([0.74, 0.73]):
        assert repr(other.update([0.0, y, 0.1])) == repr(found.updates[k])
    np.testing.assert_array_equal(one.position, other.position)


def test_moving_supports_are_kept_by_copies_and_states():
    tracker = fb.Tracker(held(START, MIDDLE, END), supports=["start", 0.5])
    for other in (tracker.copy(), fb.Tracker.restore(tracker.state())):
        assert other.update({0.5: [0.0, 0.36, 0.25]}).status == "converged"


FAR = ([0.04, 0.66, 0.08], [0.15, 0.3, 0.05])


def test_an_update_that_is_stopped_goes_on_from_the_last_valid_pose():
    tracker, at_once = fb.Tracker(held(START, END)), fb.Tracker(held(START, END))
    assert at_once.update(*FAR).status == "converged"
    fractions = []
    while not fractions or fractions[-1] < 1.0:
        before = tracker.position[-1]
        update = tracker.update(*FAR, max_iterations=20)
        assert update.iterations <= 21
        fractions.append(update.fraction)
        reached = before + update.fraction * (FAR[0] - before)
        np.testing.assert_allclose(tracker.position[-1], reached, atol=1e-9)
        assert tracker.equilibrium().status == "converged"
        assert len(fractions) < 200
    assert len(fractions) > 2
    assert update.status == "converged"
    assert tracker.energy == pytest.approx(at_once.energy, rel=1e-9)


def test_an_update_without_time_reaches_nothing_and_says_so():
    tracker = fb.Tracker(held(START, END))
    position = tracker.position
    update = tracker.update(*FAR, max_time=1e-9)
    assert (update.status, update.fraction) == ("not_converged", 0.0)
    assert update.message == "stopped before the next equilibrium on the way: allow more to go on"
    np.testing.assert_array_equal(tracker.position, position)
    assert tracker.update(*FAR, max_time=60.0).status == "converged"


def test_a_tracker_reports_that_its_belt_crosses_itself_when_it_is_asked():
    tracker = fb.Tracker(held(START, END))
    assert tracker.update(END["position"]).crosses_itself is None
    assert tracker.update(END["position"], check_crossing=True).crosses_itself is False


def test_a_loop_crosses_itself_until_its_end_is_more_than_the_width_aside():
    tables = fb.load("scenarios/planar.toml").to_dict() | {"solver": {"elements": ELEMENTS}}
    scenario = fb.Scenario.from_dict(tables)
    nodes = len(fb.solve(scenario).u)
    loop = fb.Tracker(fb.solve(scenario, start=(np.full(nodes, 2.0 * np.pi), np.zeros(nodes))))
    assert loop.update([0.0, 0.61, 0.0], check_crossing=True).crosses_itself is True
    first, second = loop.equilibrium().crosses_itself
    assert second - first > 0.3
    points = [[np.interp(u, loop.u, loop.position[:, axis]) for axis in range(3)] for u in (first, second)]
    np.testing.assert_allclose(*points, atol=1.0 / ELEMENTS)
    width = tables["belt"]["width"]
    for aside, crosses in [(0.2 * width, True), (2.0 * width, False), (0.2 * width, True)]:
        assert loop.update([0.0, 0.61, aside], check_crossing=True).crosses_itself is crosses
        assert (loop.equilibrium().crosses_itself is not None) is crosses


def test_a_belt_that_is_pulled_straight_is_taut_and_its_reactions_are_not_a_number():
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
    update = tracker.update([0.0, 1.0, 0.0], [0.0, 0.0, 0.0])
    assert (update.status, update.taut) == ("converged", True)
    assert np.isnan(tracker.reaction("end").force[1])
    assert not tracker.update([0.0, 0.9, 0.0], [0.0, 0.0, 0.0]).taut
    assert np.isfinite(tracker.reaction("end").force).all()
