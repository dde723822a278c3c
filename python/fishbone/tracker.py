"""Tracking of a minimum while one of its supports moves, fast enough for the control loop of a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fishbone import _core
from fishbone.equilibrium import Equilibrium, Reaction, solve
from fishbone.errors import InvalidArgument
from fishbone.places import support_index
from fishbone.pose import Pose, numbers_of, pose_of
from fishbone.scenario import Scenario

if TYPE_CHECKING:
    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import Place, Status

    Floats = NDArray[np.float64]


class Update(NamedTuple):
    """The result of an update of a `Tracker`."""

    status: Status
    """Unless "converged", no equilibrium was found at the new pose, and the tracker stays where it was."""
    snapped: bool
    """Whether the minimum followed ended or lost its stability on the way, so that the tracker is at another one, by
    `solver.snap_size` widths or more."""
    energy: float
    """Total potential, in the unit of the scenario."""
    iterations: int
    """Steps of Newton's method."""
    residual: float
    """Largest violation of what the supports and links prescribe, lengths in U and turns in rad."""
    jump: float
    """Largest displacement of a node in a snap; 0 without one."""
    released: float
    """Energy released in snaps, in the unit of the scenario."""
    message: str
    """One line: why the pose was not reached, and what to try; empty where it was."""
    solved_afresh: bool
    """Whether the belt could not be followed to the pose, so that the scenario there was solved afresh."""


class Updates(NamedTuple):
    """The results of `Tracker.update_many`, m of them: one for each pose that was tried.

    Units: those of the scenario.
    """

    updates: list[Update]
    """The result of each update."""
    valid: int
    """Number of poses that were reached: the tracker is at the last of these, or where it was if there is none."""
    u: Floats
    """Arc length of the nodes of the shape before the first update, shape (n,)."""
    position: Floats
    """Spine positions at these nodes after each update, shape (m, n, 3)."""
    force: Floats
    """Force of the moving support on the belt after each update, shape (m, 3)."""
    moment: Floats
    """Moment of the moving support on the belt about the support point, shape (m, 3)."""


class Tracker:
    """A minimum of a belt whose support moves: every update starts from the shape before, and stays on its branch.

    A tracker starts at an equilibrium, such as one of `branches`, at that of a scenario, which is solved first, or in
    the `state` of another tracker. `support` is named as for `Equilibrium.reaction`, and must hold a position and a
    rotation; a state has its own. All properties are those after the last update that converged.

    `copy.copy`, `copy.deepcopy` and `pickle` make trackers that move by themselves, as `copy` does.

    Threads and handlers of signals may read the properties during an update: they get those before it. Of the methods
    one runs at a time: another thread waits, and a handler that interrupts one gets a `RuntimeError` from the others.

    Errors: `NoTracker` where the solve finds no minimum, or where the support cannot be moved; `NoSupport`;
    `InvalidArgument` for bytes that are no state of this version.
    """

    __slots__ = ("_inner",)
    _inner: _core.Tracker

    def __init__(self, start: Scenario | Equilibrium | bytes, support: Place = "end") -> None:
        if isinstance(start, bytes):
            self._inner = _core.Tracker.from_bytes(start)
            return
        found = start if isinstance(start, Equilibrium) else solve(start)
        inner = found._inner  # noqa: SLF001 - of this package
        # The source's method has no reactions, and the core refuses it whatever the support.
        self._inner = _core.Tracker(inner, found._support_index(support) if inner.reactions else 0)  # noqa: SLF001

    @classmethod
    def restore(cls, state: bytes) -> Tracker:
        """A tracker in the state of another one: the updates of both have the same results, bit for bit.

        Errors: `InvalidArgument` for bytes that are no state of this version.
        """
        return cls(state)

    def state(self) -> bytes:
        """All that further updates depend on, as bytes for `restore`, also in another process."""
        return self._inner.to_bytes()

    def copy(self) -> Tracker:
        """Another tracker in the same state, which moves by itself."""
        return self._of(self._inner.copy())

    def __copy__(self) -> Tracker:
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> Tracker:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return Tracker._of, (self._inner,)

    @classmethod
    def _of(cls, inner: _core.Tracker) -> Tracker:
        tracker = cls.__new__(cls)
        tracker._inner = inner  # noqa: SLF001 - its own class
        return tracker

    def update(self, position: Pose | npt.ArrayLike, rotation: npt.ArrayLike | None = None) -> Update:
        """Moves the support to a position and a rotation vector, world axes, and follows the minimum.

        In place of both a `Pose` may be given, which takes quaternions, too, or a homogeneous matrix.

        Shapes: (3,) each; a matrix (4, 4).
        Units: those of the scenario; rad.
        Errors: `InvalidArgument` for other shapes and for numbers that are not finite; `InvalidScenario` for a pose
        that no scenario may hold, such as a position too many lengths away. The tracker then stays where it was.
        """
        if rotation is None:
            position, rotation = pose_of("pose", position)
        position, rotation = numbers_of("position", position, (3,)), numbers_of("rotation", rotation, (3,))
        return Update(*self._inner.update(position.tolist(), rotation.tolist()))

    def update_many(self, positions: npt.ArrayLike, rotations: npt.ArrayLike, *, stop_on_snap: bool = True) -> Updates:
        """Moves the support from pose to pose, as `update` does, without Python in between.

        Ends after a pose at which no equilibrium was found and, unless `stop_on_snap` is false, after a snap. Positions
        and reactions are those after each update; where an update fails those of the pose before, at which the tracker
        stays.

        Shapes: (m, 3) both.
        Units: those of the scenario; rad.
        Errors: those of `update`, before the first update.
        """
        rows = [numbers_of("positions", positions, (None, 3)), numbers_of("rotations", rotations, (None, 3))]
        if len(rows[0]) != len(rows[1]):
            raise InvalidArgument(f"rotations: found {len(rows[1])}, allowed {len(rows[0])}, one a position")
        u = self.u
        found, shapes, (force, moment) = self._inner.update_many(np.stack(rows, axis=1).tolist(), stop_on_snap)
        updates = [Update(*update) for update in found]
        valid = sum(update.status == "converged" for update in updates)
        return Updates(updates, valid, u, np.reshape(shapes, (len(shapes), len(u), 3)), force, moment)

    @property
    def energy(self) -> float:
        """Total potential."""
        return self._inner.energy

    @property
    def u(self) -> Floats:
        """Arc length at the nodes, shape (n,); an update may change the mesh, unless the scenario fixes it."""
        return self._inner.u

    @property
    def position(self) -> Floats:
        """Spine positions at the nodes, shape (n, 3)."""
        return self._inner.position

    @property
    def frame(self) -> Floats:
        """Frames at the nodes, columns ξ, η, ζ, shape (n, 3, 3)."""
        return self._inner.frame

    @property
    def bend(self) -> Floats:
        """Bend ω_ζ at the nodes, shape (n,)."""
        return self._inner.bend

    @property
    def rib_slope(self) -> Floats:
        """Rib slope β at the nodes, shape (n,)."""
        return self._inner.rib_slope

    def reaction(self, support: Place) -> Reaction:
        """Force and moment of a support on the belt, without a solve; named as for `Equilibrium.reaction`.

        A component is NaN where the shape does not determine it.

        Errors: `NoSupport`.
        """
        force, moment = self._inner.reaction(self._index_of(support))
        return Reaction(np.array(force), np.array(moment))

    def surface(self, n_across: int = 9) -> Floats:
        """Points of the surface, as `Equilibrium.surface`; `Equilibrium.surface_triangles` has its triangles.

        Shapes: (n, n_across, 3).
        Errors: as `Equilibrium.surface`.
        """
        return self.equilibrium().surface(n_across)

    def equilibrium(self) -> Equilibrium:
        """The equilibrium of the current shape."""
        scenario, found = self._inner.equilibrium()
        return Equilibrium(Scenario._wrap(scenario), found)  # noqa: SLF001 - of this package

    def _index_of(self, support: Place) -> int:
        return support_index(support, self._inner.supports, float(self.u[-1]))
