"""Poses of supports, as robots and planners write them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from fishbone import _core
from fishbone.errors import InvalidArgument

if TYPE_CHECKING:
    import numpy.typing as npt
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

Order: TypeAlias = Literal["wxyz", "xyzw"]
TOLERANCE = 1e-6
"""Tolerance of a quaternion's norm, and of the products of a matrix's columns, against those of a rotation."""


class Pose(NamedTuple):
    """Position and orientation of a support, world axes. Without a rotation the frame's axes are those of the world.

    Shapes: (3,) both.
    Units: those of the scenario; rad.
    """

    position: npt.ArrayLike
    rotation: npt.ArrayLike = (0.0, 0.0, 0.0)
    """Rotation vector: its direction is the axis, its length the angle."""

    @classmethod
    def from_quaternion(cls, position: npt.ArrayLike, quaternion: npt.ArrayLike, order: Order = "wxyz") -> Pose:
        """The pose of a position and a unit quaternion.

        The order is [w, x, y, z], as in scenarios, or with "xyzw" that of ROS, [x, y, z, w].

        Shapes: (3,), (4,).
        Errors: `InvalidArgument` where the norm of the quaternion is not 1, and for another order.
        """
        if order not in {"wxyz", "xyzw"}:
            raise InvalidArgument(f'order: found {order!r}, allowed "wxyz" or "xyzw"')
        numbers = numbers_of("quaternion", quaternion, (4,))
        norm = float(np.linalg.norm(numbers))
        if abs(norm - 1.0) > TOLERANCE:
            raise InvalidArgument(f"quaternion: found the norm {norm:g}, allowed 1")
        scalar_first = numbers if order == "wxyz" else np.roll(numbers, 1)
        return cls(position, np.array(_core.rotation_of_quaternion(scalar_first.tolist())))

    @classmethod
    def from_matrix(cls, matrix: npt.ArrayLike) -> Pose:
        """The pose of a homogeneous matrix: the rotation, and the position in the last column.

        Shapes: (4, 4).
        Errors: `InvalidArgument` for a matrix that is none of a rotation and a translation.
        """
        numbers = numbers_of("matrix", matrix, (4, 4))
        frame = numbers[:3, :3]
        is_rotation = np.allclose(frame.T @ frame, np.eye(3), rtol=0.0, atol=TOLERANCE) and np.linalg.det(frame) > 0.0
        if not is_rotation:
            raise InvalidArgument("matrix: found columns that are no right-handed frame, allowed a rotation")
        if not np.array_equal(numbers[3], [0.0, 0.0, 0.0, 1.0]):
            raise InvalidArgument(f"matrix: found the last row {numbers[3].tolist()}, allowed [0, 0, 0, 1]")
        return cls(numbers[:3, 3], np.array(_core.rotation_of_matrix(frame.tolist())))


def numbers_of(name: str, values: Any, shape: tuple[int | None, ...]) -> Floats:  # noqa: ANN401 - whatever a caller brings
    """Finite real numbers of a shape, of which lengths that are None may be any. Text is no number.

    Errors: `InvalidArgument`, whose message begins with `name`.
    """
    allowed = str(shape).replace("None", "m")
    numbers = _real(values)
    if numbers is None:
        found, kind = " ".join(repr(values).split()), f"numbers of shape {allowed}" if shape else "a number"
        raise InvalidArgument(f"{name}: found {found}, allowed {kind}")
    if len(numbers.shape) != len(shape) or any(
        length not in {None, found} for length, found in zip(shape, numbers.shape, strict=True)
    ):
        raise InvalidArgument(f"{name}: found shape {numbers.shape}, allowed {allowed}")
    # For the few numbers of a pose faster than numpy.isfinite.
    infinite = next((number for number in numbers.ravel().tolist() if not math.isfinite(number)), None)
    if infinite is not None:
        raise InvalidArgument(f"{name}: found {infinite}, allowed finite numbers")
    return numbers


def _real(values: Any) -> Floats | None:  # noqa: ANN401 - whatever a caller brings
    """Values as an array of floats; None where they are no real numbers, or some are masked."""
    parts = values if isinstance(values, list | tuple) else [values]
    # The package numpy.ma is imported at first use, which waits for ever in a child forked in the midst of it.
    if any(np.any(getattr(part, "mask", False)) for part in parts):
        return None
    try:
        array = np.asarray(values)
        kind = array.dtype.kind
        is_real = kind in "biuf" or (kind == "O" and not any(isinstance(x, str | bytes | complex) for x in array.flat))
        return array.astype(np.float64, copy=False) if is_real else None
    except (TypeError, ValueError, OverflowError):
        return None


def pose_of(name: str, pose: Any) -> Pose:  # noqa: ANN401 - whatever a caller brings
    """The pose of a `Pose`, a pair of position and rotation vector, or a homogeneous matrix.

    Errors: `InvalidArgument`, whose message begins with `name`.
    """
    if isinstance(pose, Pose):
        return pose
    if isinstance(pose, (tuple, list)) and len(pose) == 2:  # noqa: PLR2004 - position and rotation
        return Pose(*pose)
    return Pose.from_matrix(numbers_of(name, pose, (4, 4)))


def parts_of(name: str, pose: Any) -> tuple[list[float], list[float] | None]:  # noqa: ANN401 - whatever a caller brings
    """The position and the rotation vector of a pose, as `pose_of` takes it; of a position alone, with None.

    Errors: `InvalidArgument`, whose message begins with `name`.
    """
    if _is_position(pose):
        return numbers_of(name, pose, (3,)).tolist(), None
    pose = pose_of(name, pose)
    position = numbers_of("position", pose.position, (3,))
    return position.tolist(), numbers_of("rotation", pose.rotation, (3,)).tolist()


def _is_position(pose: Any) -> bool:  # noqa: ANN401 - whatever a caller brings
    try:
        if isinstance(pose, list | tuple):  # without an array, which warns of masked entries
            return len(pose) == 3 and not any(map(np.ndim, pose))  # noqa: PLR2004 - a vector
        return bool(np.shape(pose) == (3,))
    except ValueError:  # of rows of several lengths
        return False
