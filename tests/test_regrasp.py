"""A tracker takes hold of its belt elsewhere and lets go: what is still held keeps its shape."""

import numpy as np
import pytest

import fishbone as fb

POSITION = np.array([0.0, 0.5, 0.1])
TURN = np.array([0.2, -0.1, 0.3])


def example1(energy="fishbone", elements=64):
    tables = fb.load("scenarios/example1.toml").to_dict()
    tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"energy": energy, "solver": {"elements": elements}}))
    assert tracker.update(POSITION + np.array([0.05, -0.03, 0.02]), TURN).status == "converged"
    return tracker


def shape_at(tracker, u):
    return np.array([np.interp(u, tracker.u, tracker.position[:, axis]) for axis in range(3)]).T


def places(tracker):
    return [support["at"] for support in tracker.equilibrium().scenario.to_dict()["supports"]]


@pytest.mark.parametrize("seed", range(30))
def test_the_part_that_is_still_held_keeps_its_shape_in_random_regrasps(seed):
    random = np.random.default_rng(seed)
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
    pose = POSITION + random.uniform(-0.1, 0.1, 3), random.uniform(-0.4, 0.4, 3)
    assert tracker.update(*pose).status == "converged"
    before, hold = tracker.copy(), float(random.uniform(0.3, 0.7))
    update = tracker.regrasp(hold=hold, release="end")
    assert (update.status, update.snapped) == ("converged", False)
    held = tracker.u[tracker.u <= hold]
    np.testing.assert_allclose(shape_at(tracker, held), shape_at(before, held), atol=1e-3)
    assert update.energy == pytest.approx(before.energy - update.released)
    assert update.released > 0.0
    there = shape_at(tracker, [hold])[0]
    assert tracker.update(there + np.array([0.005, 0.0, 0.0])).status == "converged"
    np.testing.assert_allclose(shape_at(tracker, [hold])[0], there + np.array([0.005, 0.0, 0.0]), atol=1e-8)


@pytest.mark.parametrize("energy", ["fishbone", "wunderlich"])
def test_a_hold_near_the_end_that_is_let_go_is_no_snap(energy):
    """Ribs beside it turn, which moves what is still held by less than a fifth of the width."""
    for seed in range(10):
        random = np.random.default_rng(seed)
        tracker = example1(energy)
        tracker.update(POSITION + random.uniform(-0.1, 0.1, 3), random.uniform(-0.4, 0.4, 3))
        update = tracker.regrasp(hold=float(random.uniform(0.7, 0.98)), release="end")
        assert (update.status, update.snapped) == ("converged", False)
        assert update.jump < 0.02


def test_a_hold_in_place_of_another_one_changes_nothing():
    tracker = example1("wunderlich")
    before = tracker.copy()
    update = tracker.regrasp(hold="end", release="end")
    assert (update.status, update.snapped) == ("converged", False)
    assert update.jump < 1e-6
    assert tracker.energy == pytest.approx(before.energy, rel=1e-9)


@pytest.mark.parametrize("energy", ["fishbone", "wunderlich"])
def test_a_hold_alone_changes_no_energy_and_bears_no_load(energy):
    tracker = example1(energy)
    energy, nodes, end = tracker.energy, len(np.unique(tracker.u)), tracker.reaction("end")
    update = tracker.regrasp(hold=0.44)
    assert update.status == "converged"
    assert update.jump < 1e-3
    assert (places(tracker), len(np.unique(tracker.u))) == (["start", 0.44, "end"], nodes)
    assert tracker.energy == pytest.approx(energy, rel=2e-3)
    np.testing.assert_allclose(tracker.reaction("end").force, end.force, rtol=0.03, atol=0.3)
    assert np.linalg.norm(tracker.reaction(0.44).force) < 0.05 * np.linalg.norm(end.force)
    there = shape_at(tracker, [0.44])[0]
    assert tracker.update({0.44: there + np.array([0.0, 0.0, 0.01])}).status == "converged"


def test_the_start_is_let_go_and_the_end_carries_the_belt():
    tracker = example1()
    before = tracker.copy()
    update = tracker.regrasp(hold=0.5, release="start")
    assert update.status == "converged"
    assert places(tracker) == [0.5, "end"]
    held = tracker.u[tracker.u >= 0.5]
    np.testing.assert_allclose(shape_at(tracker, held), shape_at(before, held), atol=1e-3)
    moved = tracker.update({"end": fb.Pose(POSITION + np.array([0.05, -0.02, 0.02]), TURN)})
    assert moved.status == "converged"


def test_a_belt_is_handed_over_from_hold_to_hold():
    tracker = example1()
    energies = [tracker.energy]
    for hold, release in [(0.6, "end"), (0.8, 0.6), ("end", 0.8)]:
        assert tracker.regrasp(hold=hold, release=release).status == "converged"
        energies.append(tracker.energy)
    assert places(tracker)[1] in {"end", 1.0}
    assert energies == sorted(energies, reverse=True)
    end = tracker.position[-1] + np.array([0.0, -0.05, 0.05])
    assert tracker.update(end).status == "converged"
    np.testing.assert_allclose(tracker.position[-1], end, atol=1e-8)


def test_a_regrasp_on_a_state_and_a_copy_is_the_same():
    tracker = example1()
    others = [tracker.copy(), fb.Tracker.restore(tracker.state())]
    update = tracker.regrasp(hold=0.5, release="end")
    for other in others:
        assert repr(other.regrasp(hold=0.5, release="end")) == repr(update)
        np.testing.assert_array_equal(other.position, tracker.position)


@pytest.mark.parametrize(
    ("regrasp", "kind", "words"),
    [
        ({}, fb.InvalidArgument, "regrasp: found neither a hold nor a release"),
        ({"hold": 1.5}, fb.InvalidScenario, r"supports\[2\]\.at: found 1\.5"),
        ({"hold": float("nan")}, fb.InvalidArgument, "hold: found nan, allowed finite numbers"),
        ({"hold": "middle"}, fb.InvalidArgument, 'hold: found \'middle\', allowed "start", "end" or an arc length'),
        ({"hold": (0.3, 0.5)}, fb.InvalidArgument, r"hold: found shape \(2,\)"),
        ({"hold": b"0.5"}, fb.InvalidArgument, "hold: found b'0.5', allowed a number"),
        (
            {"release": "end"},
            fb.InvalidArgument,
            "release: found 'end', the only support that moves, allowed with a hold",
        ),
        ({"hold": "end"}, fb.InvalidScenario, r"supports\[\d\]\.at: found"),
        ({"release": 0.3}, fb.NoSupport, "support 0.3: found supports at"),
    ],
)
def test_a_regrasp_that_cannot_be_is_refused_and_changes_nothing(regrasp, kind, words):
    tracker = example1()
    state = tracker.state()
    with pytest.raises(kind, match=words):
        tracker.regrasp(**regrasp)
    assert tracker.state() == state


def test_a_support_is_let_go_without_a_hold_where_another_one_moves():
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"), supports=["start", "end"])
    assert tracker.regrasp(release="end").status == "converged"
    assert tracker.stiffness().shape == (6, 6)
    with pytest.raises(fb.InvalidArgument, match="release: found 0, the only support that moves"):
        tracker.regrasp(release=0)
