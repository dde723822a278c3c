"""Poses as robots write them, against SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fishbone as fb

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
        (lambda: example1().update(POSITION, max_iterations=0), "max_iterations: found 0, allowed a"),
    ],
)
def test_what_is_no_pose_is_refused(make, error):
    with pytest.raises(fb.InvalidArgument, match=f"^{error}"):
        make()
