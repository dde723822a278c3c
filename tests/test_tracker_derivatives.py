"""Derivatives of a tracker, against those of the equilibrium and against differences of updates."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import fishbone as fb

STEP = 1e-5


def led(name="example1", energy="fishbone", elements=64):
    """A tracker that has been moved, and the pose of its end."""
    tables = fb.load(f"scenarios/{name}.toml").to_dict() | {"energy": energy}
    tables["solver"] = tables.get("solver", {}) | {"elements": elements}
    tracker = fb.Tracker(fb.Scenario.from_dict(tables), -1)
    turn = Rotation.from_matrix(tracker.frame[-1])
    position = tracker.position[-1] + 0.02 * tracker.u[-1] * np.array([0.5, -1.0, 0.5])
    turn = Rotation.from_rotvec([0.05, 0.02, -0.03]) * turn
    assert tracker.update(position, turn.as_rotvec()).status == "converged"
    return tracker, position, turn


def nudged(tracker, position, turn, column, step):
    """A copy whose end is moved by a small step of one of the six motions."""
    other, by = tracker.copy(), step * np.eye(6)[column]
    goal = position + by[:3], (Rotation.from_rotvec(by[3:]) * turn).as_rotvec()
    assert other.update(*goal).status == "converged"
    return other


def material(tracker, v):
    frame, slope = tracker.frame, tracker.rib_slope[:, None]
    return tracker.position + v * (frame[:, :, 2] - slope * frame[:, :, 1])


@pytest.mark.parametrize("name", ["example1", "curved", "bent", "polystyrene"])
@pytest.mark.parametrize("support", ["start", -1])
def test_derivatives_of_a_tracker_are_those_of_its_equilibrium(name, support):
    energy = "shell" if name == "polystyrene" else "fishbone"
    tracker, *_ = led(name, energy)
    found = tracker.equilibrium()
    np.testing.assert_allclose(tracker.jacobian(support), found.jacobian(support), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("energy", ["fishbone", "wunderlich"])
def test_jacobian_is_the_ratio_of_differences(energy):
    tracker, position, turn = led(energy=energy)
    jacobian = tracker.jacobian()
    for column in range(6):
        ends = [nudged(tracker, position, turn, column, sign * STEP).position for sign in (1.0, -1.0)]
        np.testing.assert_allclose(jacobian[:, :, column], (ends[0] - ends[1]) / (2.0 * STEP), atol=2e-5)


def test_stiffness_is_the_ratio_of_differences_of_the_reaction():
    tracker, position, turn = led()
    stiffness = tracker.stiffness("end")
    scale = np.abs(stiffness).max()
    for column in range(6):
        ends = [nudged(tracker, position, turn, column, sign * STEP).reaction("end") for sign in (1.0, -1.0)]
        difference = (np.concatenate(ends[0]) - np.concatenate(ends[1])) / (2.0 * STEP)
        np.testing.assert_allclose(stiffness[:, column], difference, rtol=1e-3, atol=1e-5 * scale)


def test_edges_move_as_the_material_that_is_there():
    """Where ribs turn, that of a node passes over other material: the edge's own points are found on the flat board."""
    tracker, position, turn = led(energy="wunderlich", elements=256)
    v = 0.05
    assert np.abs(tracker.rib_slope).max() > 0.05
    flat = tracker.u - v * tracker.rib_slope
    jacobian = tracker.jacobian(v=v)
    inside = slice(3, -3)
    for column in range(6):
        ends = []
        for sign in (1.0, -1.0):
            other = nudged(tracker, position, turn, column, sign * 1e-4)
            points, places = material(other, v), other.u - v * other.rib_slope
            ends.append(CubicSpline(places, points)(flat))
        difference = (ends[0] - ends[1]) / 2e-4
        np.testing.assert_allclose(jacobian[inside, :, column], difference[inside], atol=3e-3)
    assert np.abs(jacobian - tracker.jacobian())[inside].max() > 0.04


@pytest.mark.parametrize("board", ["curved", "bent"])
@pytest.mark.parametrize("side", ["minus", "plus"])
def test_edges_of_arcs_and_beside_corners_move_with_their_ribs(board, side):
    """Of the material at the end of each rib: a step moves it, and the rib of the node to other material."""
    tracker, position, turn = led(board, "wunderlich", 256)
    found = tracker.equilibrium()
    edge, spine = getattr(found.edges, side), found.position
    jacobian, of_spine = tracker.jacobian(v=side), tracker.jacobian()
    width = found.scenario.to_dict()["belt"]["width"]
    assert np.abs(np.linalg.norm(edge - spine, axis=1) - 0.5 * width).max() > 1e-4
    for column in range(6):
        # The line from the spine turns with the frame.
        ends = [nudged(tracker, position, turn, column, sign * STEP).frame for sign in (1.0, -1.0)]
        turns = np.einsum("nij,nkj->nik", (ends[0] - ends[1]) / (2.0 * STEP), tracker.frame)
        moved = of_spine[:, :, column] + np.einsum("nij,nj->ni", turns, edge - spine)
        np.testing.assert_allclose(jacobian[:, :, column], moved, atol=1e-3)


def test_other_supports_have_derivatives_and_pins_none_by_rotation():
    tables = fb.load("scenarios/example1.toml").to_dict()
    tables["supports"].insert(1, {"at": 0.5, "position": [0.0, 0.25, 0.3]})
    tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"solver": {"elements": 64}}), supports=[0.5, "end"])
    np.testing.assert_array_equal(tracker.jacobian(), tracker.jacobian(0.5))
    assert np.abs(tracker.jacobian(0.5)[:, :, 3:]).max() == 0.0
    np.testing.assert_allclose(tracker.jacobian(0.5)[32, :, :3], np.eye(3), atol=1e-7)
    assert np.abs(tracker.stiffness(0.5)[:, 3:]).max() == 0.0
    force = tracker.stiffness(0.5)[:3, :3]
    np.testing.assert_allclose(force, force.T, rtol=1e-6, atol=1e-6 * np.abs(force).max())


def test_derivatives_leave_the_tracker_as_it_is():
    tracker, position, turn = led()
    other, state = tracker.copy(), tracker.state()
    tracker.jacobian(), tracker.stiffness("start")
    assert tracker.state() == state
    goal = position + np.array([0.01, 0.0, 0.0]), turn.as_rotvec()
    assert repr(tracker.update(*goal)) == repr(other.update(*goal))
    np.testing.assert_array_equal(tracker.position, other.position)


def lowest(tracker):
    return tracker.equilibrium().modes(1)[0].eigenvalue


@pytest.mark.parametrize(
    ("name", "energy"), [("example1", "wunderlich"), ("curved", "fishbone"), ("polystyrene", "shell")]
)
def test_gradient_of_the_lowest_eigenvalue_is_the_ratio_of_differences(name, energy):
    tracker, position, turn = led(name, energy)
    found = tracker.lowest_eigenvalue()
    assert found.value == pytest.approx(lowest(tracker), rel=1e-7)
    units = np.array([*3 * [tracker.u[-1]], 1.0, 1.0, 1.0])
    tolerance = 1e-3 * np.abs(found.gradient * units).max() / units
    for column in range(6):
        # Of steps of another size than the tracker's own.
        step = 1e-4 * units[column]
        sides = [lowest(nudged(tracker, position, turn, column, sign * step)) for sign in (1.0, -1.0)]
        difference = (sides[0] - sides[1]) / (2.0 * step)
        assert found.gradient[column] == pytest.approx(difference, abs=tolerance[column])


def test_the_lowest_eigenvalue_does_not_change_where_all_supports_move_as_one():
    tracker = fb.Tracker(fb.load("scenarios/example2.toml"), supports=["start", "end"])
    start, end = (tracker.lowest_eigenvalue(place).gradient for place in ("start", "end"))
    largest = np.abs(end).max()
    np.testing.assert_allclose(start[:3] + end[:3], 0.0, atol=1e-6 * largest)
    arm = tracker.position[-1] - tracker.position[0]
    about_start = start[3:] + end[3:] + np.cross(arm, end[:3])
    np.testing.assert_allclose(about_start, 0.0, atol=1e-6 * largest)


def test_the_lowest_eigenvalue_and_its_gradient_lead_to_the_snap():
    """Near a fold the eigenvalue is the root of the way that is left: an arch whose end is turned back snaps there."""
    tables = fb.load("scenarios/example1.toml").to_dict() | {"energy": "sadowsky", "solver": {"elements": 80}}
    tables["supports"][1] |= {"position": [0.0, 0.9, 0.0]}
    tracker = fb.Tracker(fb.Scenario.from_dict(tables))
    ahead, last = tracker.copy(), 0.0
    for angle in np.arange(-0.01, -1.0, -0.01):
        if ahead.update([0.0, 0.9, 0.0], [0.0, 0.0, angle]).snapped:
            break
        tracker, last = ahead.copy(), angle
    found = tracker.lowest_eigenvalue()
    left = found.value / (2.0 * found.gradient[5])
    assert 0.0 < left < 0.012
    assert tracker.copy().update([0.0, 0.9, 0.0], [0.0, 0.0, last - 0.9 * left]).snapped is False
    assert tracker.copy().update([0.0, 0.9, 0.0], [0.0, 0.0, last - 1.1 * left]).snapped is True


def test_a_taut_belt_has_no_derivatives():
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
    tracker.update([0.0, 1.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(fb.NoSensitivity, match="has no slack"):
        tracker.jacobian()


@pytest.mark.parametrize(
    ("ask", "kind", "words"),
    [
        (lambda tracker: tracker.jacobian(0.3), fb.NoSupport, "support 0.3: found supports at"),
        (lambda tracker: tracker.lowest_eigenvalue(0.3), fb.NoSupport, "support 0.3: found supports at"),
        (
            lambda tracker: tracker.lowest_eigenvalue("start"),
            fb.InvalidArgument,
            "support: found 'start', which does not move",
        ),
        (lambda tracker: tracker.jacobian(v=float("nan")), fb.InvalidArgument, "v: found nan, allowed finite numbers"),
        (lambda tracker: tracker.jacobian(v="left"), fb.InvalidArgument, 'v: found "left", allowed "minus", "plus" or'),
        (lambda tracker: tracker.jacobian(v=[1.0]), fb.InvalidArgument, r"v: found shape \(1,\), allowed \(\)"),
    ],
)
def test_derivatives_of_nothing_are_refused(ask, kind, words):
    with pytest.raises(kind, match=f"^{words}"):
        ask(led()[0])


def test_points_off_the_spine_of_a_thick_strip_are_refused():
    tracker, *_ = led("polystyrene", "shell")
    with pytest.raises(fb.InvalidArgument, match=r'^v: found points off the spine with energy = "shell", allowed 0'):
        tracker.jacobian(v=1e-3)
