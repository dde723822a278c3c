"""Poses as robots write them, against SciPy's rotations."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fishbone as fb
from fishbone.pose import numbers_of

POSITION = [0.05, 0.5, 0.1]
ROTATIONS = [[0.0, 0.0, 0.0], [0.3, -0.2, 0.5], [1e-9, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, np.pi - 1e-7]]


def example1(supports=("end",)):
    return fb.Tracker(fb.load("scenarios/example1.toml"), supports=supports)


def homogeneous(rotation):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(rotation).as_matrix()
    matrix[:3, 3] = POSITION
    return matrix


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_quaternions_of_both_signs_and_orders_are_their_rotation_vector(rotation, sign):
    last = sign * Rotation.from_rotvec(rotation).as_quat()
    for order, quaternion in (("xyzw", last), ("wxyz", np.roll(last, 1))):
        pose = fb.Pose.from_quaternion(POSITION, quaternion, order)
        np.testing.assert_allclose(pose.rotation, rotation, atol=1e-8)
        np.testing.assert_array_equal(pose.position, POSITION)


def test_the_order_of_a_quaternion_is_that_of_scenarios_unless_it_is_named():
    quaternion = np.roll(Rotation.from_rotvec(ROTATIONS[1]).as_quat(), 1)
    assert repr(fb.Pose.from_quaternion(POSITION, quaternion)) == repr(
        fb.Pose.from_quaternion(POSITION, quaternion, "wxyz")
    )
    tables = fb.load("scenarios/example1.toml").to_dict()
    end = {key: value for key, value in tables["supports"][1].items() if key not in {"rotation", "euler"}}
    by_pose = fb.Pose.from_quaternion(POSITION, quaternion)
    held = [
        tables | {"supports": [tables["supports"][0], end | {"position": POSITION} | orientation]}
        for orientation in ({"quaternion": quaternion}, {"rotation": by_pose.rotation})
    ]
    first, second = (fb.solve(fb.Scenario.from_dict(one)) for one in held)
    np.testing.assert_allclose(first.energy, second.energy, rtol=1e-9)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_a_homogeneous_matrix_is_its_position_and_rotation_vector(rotation):
    pose = fb.Pose.from_matrix(homogeneous(rotation))
    np.testing.assert_allclose(pose.rotation, rotation, atol=1e-8)
    np.testing.assert_array_equal(pose.position, POSITION)


def test_a_tracker_takes_every_way_to_write_a_pose():
    rotation = ROTATIONS[1]
    quaternion = Rotation.from_rotvec(rotation).as_quat()
    ways = [
        (POSITION, rotation),
        (fb.Pose(POSITION, rotation),),
        ((POSITION, rotation),),
        (fb.Pose.from_quaternion(POSITION, quaternion, "xyzw"),),
        (homogeneous(rotation),),
    ]
    start = fb.Tracker(fb.load("scenarios/example1.toml"))
    for way in ways:
        tracker = start.copy()
        assert tracker.update(*way).status == "converged"
        np.testing.assert_allclose(tracker.position[-1], POSITION, atol=1e-8)
        frame = Rotation.from_rotvec(rotation).as_matrix()
        np.testing.assert_allclose(tracker.frame[-1], frame, atol=1e-7)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: fb.Pose.from_quaternion(POSITION, [2.0, 0.0, 0.0, 0.0]), "quaternion: found the norm 2, allowed 1"),
        (lambda: fb.Pose.from_quaternion(POSITION, [0.0] * 4), "quaternion: found the norm 0, allowed 1"),
        (lambda: fb.Pose.from_quaternion(POSITION, [1.0] * 3), r"quaternion: found shape \(3,\), allowed \(4,\)"),
        (lambda: fb.Pose.from_quaternion(POSITION, [1.0, 0, 0, 0], "zyxw"), "order: found 'zyxw', allowed"),
        (lambda: fb.Pose.from_matrix(np.eye(3)), r"matrix: found shape \(3, 3\), allowed \(4, 4\)"),
        (lambda: fb.Pose.from_matrix(np.diag([1.0, 1.0, -1.0, 1.0])), "matrix: found columns that are no right-handed"),
        (lambda: fb.Pose.from_matrix(2.0 * np.eye(4)), "matrix: found columns that are no right-handed"),
        (lambda: fb.Pose.from_matrix(homogeneous([0.0] * 3).T), r"matrix: found the last row \[0\.05"),
        (lambda: fb.Pose.from_matrix(np.full((4, 4), np.nan)), "matrix: found .*, allowed finite numbers"),
        (lambda: example1().update([*POSITION, 0.0]), r"pose: found shape \(4,\)"),
        (lambda: example1().update([[1.0], [2.0, 3.0]], None), r"position: found shape \(1,\)"),
        (lambda: example1().update({"end": POSITION}, POSITION), "rotation: found one beside poses by support"),
        (lambda: example1(["start", "end"]).update(POSITION, POSITION), "pose: found one for 2 moving supports"),
        (lambda: example1().update(POSITION, max_time=0.0), "max_time: found 0.0, allowed a finite positive number"),
        (lambda: example1().update(POSITION, max_time="3"), "max_time: found '3', allowed a number"),
        (lambda: example1().update(POSITION, max_time=np.ones(2)), r"max_time: found shape \(2,\)"),
        (lambda: example1().update(POSITION, max_iterations=0), "max_iterations: found 0, allowed a"),
        (lambda: example1().update(POSITION, max_iterations=1.5), "max_iterations: found 1.5, allowed a whole number"),
        (lambda: example1().update(POSITION, check_crossing=2), "check_crossing: found 2, allowed True or False"),
        (lambda: example1().update_many([POSITION], stop_on_snap=0), "stop_on_snap: found 0, allowed True or False"),
        (lambda: example1().update({"end": POSITION, 1: POSITION}), r"pose: found two of one support in \['end', 1\]"),
        (lambda: example1().update({"end": POSITION, 1.0: POSITION}), "pose: found two of one support"),
    ],
)
def test_what_is_no_pose_is_refused(make, error):
    with pytest.raises(fb.InvalidArgument, match=f"^{error}"):
        make()


@pytest.mark.parametrize(
    "position",
    [
        np.ma.array(POSITION, mask=[False, True, False]),
        [0.05, np.ma.masked, 0.1],
        np.array(POSITION, dtype=np.complex128),
        [0.05, 0.5 + 0.1j, 0.1],
        [str(number) for number in POSITION],
        [0.05, "0.5", 0.1],
        np.array([0.05, "0.5", 0.1], dtype=object),
        np.array([0, 1, 0], dtype="timedelta64[s]"),
        [0, 10**400, 0],
        np.array(["a letter"] * 100),
    ],
)
def test_what_is_no_real_number_is_refused_in_one_line(position):
    with pytest.raises(fb.InvalidArgument, match=r"^position: found .*, allowed numbers of shape \(3,\)$") as refused:
        example1().update(fb.Pose(position))
    with pytest.raises(fb.InvalidArgument, match=r"^pose: found .*, allowed numbers of shape \(\d, ?\d?\)$"):
        example1().update(position)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "position",
    [
        np.ma.array([0, 1, 2], mask=False),
        np.array([0, 1, 2], dtype=np.uint8),
        np.array([0.0, 1.0, 2.0], dtype=np.float32),
        [np.float64(0.0), np.int64(1), Fraction(2)],
    ],
)
def test_real_numbers_of_any_kind_are_taken(position):
    numbers = numbers_of("position", position, (3,))
    assert (numbers.dtype, numbers.tolist()) == (np.float64, [0.0, 1.0, 2.0])


@pytest.mark.parametrize("limit", [3, 3.0, np.float64(3.0), np.int8(3), np.array(3)])
def test_a_limit_of_iterations_is_a_whole_number_of_any_kind(limit):
    far = [0.04, 0.66, 0.08], [0.15, 0.3, 0.05]
    by_int, by_other = example1(), example1()
    assert repr(by_other.update(*far, max_iterations=limit)) == repr(by_int.update(*far, max_iterations=3))


def test_a_limit_of_iterations_beyond_all_is_none():
    limited, free = example1(), example1()
    assert repr(limited.update(POSITION, max_iterations=2**70)) == repr(free.update(POSITION))


def test_flags_of_numpy_are_taken():
    update = example1().update(POSITION, check_crossing=np.bool_(True))
    assert update.crosses_itself is False
    assert example1().update_many([POSITION], stop_on_snap=np.bool_(False)).valid == 1


@pytest.mark.parametrize("supports", [["end"], ["start"]])
def test_supports_beside_a_state_are_refused(supports):
    state = example1().state()
    for options in ({"supports": supports}, {"support": "start"}):
        with pytest.raises(fb.InvalidArgument, match="supports: found supports beside a state, allowed none"):
            fb.Tracker(state, **options)


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_a_state_may_be_any_kind_of_bytes(kind):
    tracker = example1()
    for other in (fb.Tracker(kind(tracker.state())), fb.Tracker.restore(kind(tracker.state()))):
        assert other.state() == tracker.state()


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (fb.Tracker.restore, fb.InvalidArgument, "state: found Scenario, allowed the bytes of"),
        (lambda sc: fb.Tracker(sc, supports="end"), fb.InvalidArgument, "supports: found 'end', allowed a list"),
        (lambda sc: fb.Tracker(sc, supports=1), fb.InvalidArgument, "supports: found 1, allowed a list of supports"),
        (lambda sc: fb.Tracker(sc, support=None), fb.NoSupport, "support None: found supports at"),
        (lambda sc: fb.Tracker(sc, support=("end",)), fb.NoSupport, r"support \('end',\): found supports at"),
        (lambda sc: fb.Tracker(sc).update({None: POSITION}), fb.NoSupport, "support None: found supports at"),
    ],
)
def test_what_names_no_support_or_state_is_refused(make, kind, words):
    with pytest.raises(kind, match=f"^{words}"):
        make(fb.load("scenarios/example1.toml"))


def test_derivatives_are_of_points_of_the_board():
    tracker = example1()
    across = 0.5 * tracker.equilibrium().scenario.to_dict()["belt"]["width"]
    for v in (across, -across, 0.0):
        assert tracker.jacobian(v=v).shape == (len(tracker.u), 3, 6)
    for other in (tracker, tracker.copy(), fb.Tracker.restore(tracker.state())):
        with pytest.raises(fb.InvalidArgument, match=r"^v: found 0\.051, allowed -0\.05 to 0\.05$"):
            other.jacobian(v=across + 1e-3)
