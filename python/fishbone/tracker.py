"""Tracking of a minimum while some of its supports move, fast enough for the control loop of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from fishbone import _core
from fishbone.equilibrium import MAX_POINTS, Edges, Equilibrium, Reaction, solve
from fishbone.errors import InvalidArgument
from fishbone.places import support_index
from fishbone.pose import Pose, numbers_of, parts_of
from fishbone.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import End, Place, Status

    Floats = NDArray[np.float64]


State: TypeAlias = bytes | bytearray | memoryview
"""The state of a tracker."""
_STATES = (bytes, bytearray, memoryview)
MOST_ITERATIONS = 2**63
"""Number of iterations from which on a limit is none."""
ROUNDING = 1e-12
"""Relative distance beyond an edge up to which a point is on it."""


class Update(NamedTuple):
    """The result of an update of a `Tracker`."""

    status: Status
    """Whether the belt is in equilibrium at the new poses; unless "converged" it is at `fraction` of the way."""
    snapped: bool
    """Whether the minimum followed ended or lost its stability on the way, so that the tracker is at another one, by
    `solver.snap_size` widths or more."""
    energy: float
    """Total potential, in the unit of the scenario."""
    iterations: int
    """Steps of Newton's method."""
    residual: float
    """Largest violation of what supports and links prescribe where the tracker is, lengths in U and turns in rad."""
    jump: float
    """Largest displacement of a node in a snap; 0 without one."""
    released: float
    """Energy released in snaps, in the unit of the scenario."""
    message: str
    """One line: why the poses were not reached, and what to try; empty where they were."""
    solved_afresh: bool
    """Whether the belt could not be followed to the poses, so that the scenario there was solved afresh."""
    fraction: float
    """Share of the way to the new poses that was reached, 1 where "converged". The tracker is there, in equilibrium."""
    taut: bool
    """Whether the belt has no slack, so that its shape does not determine all reactions: these are NaN."""
    crosses_itself: bool | None
    """Whether the belt passes through itself, as `Equilibrium.crosses_itself` finds; None unless this was asked for."""


class Updates(NamedTuple):
    """The results of `Tracker.update_many`, m of them: one for each pose that was tried.

    Units: those of the scenario.
    """

    updates: list[Update]
    """The result of each update."""
    valid: int
    """Number of poses that were reached; of the next one the tracker has made a `fraction` of the way."""
    u: Floats
    """Arc length of the nodes of the shape before the first update, shape (n,)."""
    position: Floats
    """Spine positions at these nodes after each update, shape (m, n, 3)."""
    force: Floats
    """Force of the moving support on the belt after each update, shape (m, 3); of k > 1 moving supports (m, k, 3)."""
    moment: Floats
    """Moment of the moving support on the belt about the support point, shape (m, 3), or (m, k, 3)."""


class LowestEigenvalue(NamedTuple):
    """The lowest eigenvalue of a `Tracker`'s second variation, and how it changes with the motion of a support.

    The shape is stable where it is positive; where it comes to zero the belt snaps, or other shapes branch off.
    """

    value: float
    """The eigenvalue of the first of `Equilibrium.modes`: twice the rise of the energy per squared displacement."""
    gradient: Floats
    """Derivatives by [translation, left world-axes rotation about the support point], shape (6,). NaN where the shape
    cannot be followed either way; where it can be followed one way alone they are those of this side."""


class Tracker:
    """A minimum of a belt whose supports move: every update starts from the shape before, and stays on its branch.

    A tracker starts at an equilibrium, such as one of `branches`, at that of a scenario, which is solved first, or in
    the `state` of another tracker. It moves `support`, or all of `supports`, named as for `Equilibrium.reaction`:
    clamps, hinges and pins, each of which must hold all of a position; a state has its own. All properties are those
    after the last update.

    `copy.copy`, `copy.deepcopy` and `pickle` make trackers that move by themselves, as `copy` does.

    Threads and handlers of signals may read the properties during an update: they get those before it. Of the methods
    one runs at a time: another thread waits, and a handler that interrupts one gets a `RuntimeError` from the others.

    Errors: `NoTracker` where the solve finds no minimum, or where a support cannot be moved; `NoSupport`;
    `InvalidArgument` for bytes that are no state of this version, for supports beside a state, and where no support or
    one twice is to move.
    """

    __slots__ = ("_half_width", "_inner")
    _inner: _core.Tracker
    _half_width: float | None
    """Half the width of the belt, once it is known."""

    def __init__(
        self,
        start: Scenario | Equilibrium | State,
        support: Place = "end",
        *,
        supports: Sequence[Place] | None = None,
    ) -> None:
        self._half_width = None
        if isinstance(start, _STATES):
            if supports is not None or support != "end":
                raise InvalidArgument("supports: found supports beside a state, allowed none: it has its own")
            self._inner = _core.Tracker.from_bytes(bytes(start))
            return
        found = start if isinstance(start, Equilibrium) else solve(start)
        inner = found._inner  # noqa: SLF001 - of this package
        if isinstance(supports, str) or not isinstance(supports, Iterable | None):
            raise InvalidArgument(f'supports: found {supports!r}, allowed a list of supports, as ["start", "end"]')
        places = [support] if supports is None else list(supports)
        # The source's method has no reactions, and the core refuses it whatever the supports.
        moving = [found._support_index(place) for place in places] if inner.reactions else [0]  # noqa: SLF001
        if not moving or len(set(moving)) < len(moving):
            raise InvalidArgument(f"supports: found {places!r}, allowed one support or several, each once")
        self._inner = _core.Tracker(inner, moving)

    @classmethod
    def restore(cls, state: State) -> Tracker:
        """A tracker in the state of another one: the updates of both have the same results, bit for bit.

        Errors: `InvalidArgument` for what is no state of this version.
        """
        if not isinstance(state, _STATES):
            raise InvalidArgument(f"state: found {type(state).__name__}, allowed the bytes of Tracker.state")
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
        tracker._half_width = None  # noqa: SLF001 - its own class
        tracker._inner = inner  # noqa: SLF001 - its own class
        return tracker

    def update(
        self,
        position: Pose | npt.ArrayLike | Mapping[Place, Pose | npt.ArrayLike],
        rotation: npt.ArrayLike | None = None,
        *,
        max_time: float | None = None,
        max_iterations: int | None = None,
        check_crossing: bool = False,
    ) -> Update:
        """Moves the support to a position and a rotation vector, world axes, and follows the minimum.

        In place of both a `Pose` may be given, which takes quaternions, too, or a homogeneous matrix, or a position
        alone, which keeps the rotation; of a pin the rotation is not read. Where several supports move, a mapping has
        the poses of some of them by their names; the others stay. All move together, straight to their poses and turned
        the shorter way round.

        An update ends after `max_time`, once the iteration or the estimate of the mesh that it is in has ended, which
        takes milliseconds, or after `max_iterations`; then it is at a `fraction` of the way, and a further one goes on.
        With `max_iterations` alone it is the same on every run.

        Shapes: (3,) each; a matrix (4, 4).
        Units: those of the scenario; rad; s.
        Errors: `InvalidArgument` for other shapes, for numbers that are not finite, for two poses of one support, and
        for limits that are not positive; `NoSupport`; `InvalidScenario` for a pose that no scenario may hold, such as a
        position too many lengths away, and for a support that does not move. The tracker then stays where it was.
        """
        if isinstance(position, Mapping):
            if rotation is not None:
                raise InvalidArgument("rotation: found one beside poses by support, allowed none")
            to = [(self._index_of(place), *parts_of("pose", pose)) for place, pose in position.items()]
            if len({index for index, *_ in to}) < len(to):
                raise InvalidArgument(f"pose: found two of one support in {list(position)}, allowed one of each")
        else:
            moving = self._inner.moving
            if len(moving) != 1:
                found = f"found one for {len(moving)} moving supports"
                raise InvalidArgument(f'pose: {found}, allowed poses by support, as {{"end": pose}}')
            pose: Any = position if rotation is None else (position, rotation)
            to = [(moving[0], *parts_of("pose", pose))]
        time, iterations = _limit("max_time", max_time), _limit("max_iterations", max_iterations)
        if iterations is not None and not iterations.is_integer():
            raise InvalidArgument(f"max_iterations: found {max_iterations}, allowed a whole number")
        steps = None if iterations is None else int(min(iterations, MOST_ITERATIONS))
        return Update(*self._inner.update(to, time, steps, _flag("check_crossing", check_crossing)))

    def update_many(
        self, positions: npt.ArrayLike, rotations: npt.ArrayLike | None = None, *, stop_on_snap: bool = True
    ) -> Updates:
        """Moves the support from pose to pose, as `update` does, without Python in between.

        Ends after poses at which no equilibrium was found and, unless `stop_on_snap` is false, after a snap. Positions
        and reactions are those after each update, also of one that has not reached its poses.

        Shapes: (m, 3) both; of k > 1 moving supports (m, k, 3), in the order in which the tracker was given them.
        Without rotations all are kept.
        Units: those of the scenario; rad.
        Errors: those of `update`, before the first update; `InvalidArgument` where all shapes have more than 5 million
        nodes.
        """
        moving = self._inner.moving
        shape = (None, 3) if len(moving) == 1 else (None, len(moving), 3)
        rows = numbers_of("positions", positions, shape).reshape(-1, len(moving), 3)
        turns: list[Any] = [[None] * len(moving)] * len(rows)
        if rotations is not None:
            turned = numbers_of("rotations", rotations, shape).reshape(-1, len(moving), 3)
            if len(turned) != len(rows):
                raise InvalidArgument(f"rotations: found {len(turned)}, allowed {len(rows)}, one a position")
            turns = turned.tolist()
        to = [list(zip(moving, *poses, strict=True)) for poses in zip(rows.tolist(), turns, strict=True)]
        u = self.u
        if len(to) * len(u) > MAX_POINTS:
            points = f"found {len(to)} of {len(u)} nodes each"
            raise InvalidArgument(f"positions: {points}, allowed up to {MAX_POINTS // 10**6} million nodes in all")
        found, (shapes, force, moment) = self._inner.update_many(to, _flag("stop_on_snap", stop_on_snap))
        updates = [Update(*update) for update in found]
        valid = sum(update.status == "converged" for update in updates)
        each = (len(updates), *shape[1:])
        shapes = shapes.reshape(len(updates), len(u), 3)
        return Updates(updates, valid, u, shapes, force.reshape(each), moment.reshape(each))

    def regrasp(self, *, hold: End | float | None = None, release: Place | None = None) -> Update:
        """Takes hold of the belt at a place, an end or an arc length, and lets another support go.

        The new support is a clamp that moves from then on, with the other supports that move. What supports still
        hold between them keeps its shape, but for ribs near the new support, which are free to turn; a part that none
        holds any more comes to rest from the shape that it has. `jump` is the largest displacement of what is still
        held, and it has `snapped` if this is a fifth of the width or more. Where no equilibrium is found the tracker
        stays as it was.

        Units: `hold` in those of the scenario.
        Errors: `InvalidArgument` where neither is given, for a `hold` that is no place, and where no support would be
        left to move; `NoSupport`; `InvalidScenario` for supports that no scenario may have, such as two at one place.
        """
        if hold is None and release is None:
            raise InvalidArgument("regrasp: found neither a hold nor a release, allowed one or both")
        index = None if release is None else self._index_of(release)
        if hold is None and self._inner.moving == [index]:
            found = f"found {release!r}, the only support that moves"
            raise InvalidArgument(f"release: {found}, allowed with a hold, or where another one moves")
        return Update(*self._inner.regrasp(None if hold is None else self._arc_length(hold), index))

    def _arc_length(self, hold: End | float) -> float:
        ends = {"start": 0.0, "end": float(self.u[-1])}
        if isinstance(hold, str) and hold not in ends:
            raise InvalidArgument(f'hold: found {hold!r}, allowed "start", "end" or an arc length')
        return ends[hold] if isinstance(hold, str) else float(numbers_of("hold", hold, ()))

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

    def jacobian(self, support: Place | None = None, v: float | Literal["minus", "plus"] = 0.0) -> Floats:
        """Derivatives of positions by the motion of a support, by default of the first that moves.

        They are of the points of the board at v across on the ribs of the nodes, or of those at the ribs' ends on an
        edge, named as in `Equilibrium.edges`: of points that stay, while ribs and their ends slide over the board. The
        last axis is [translation, left world-axes rotation about the support point]; for components that the support
        leaves free the derivatives are 0. No Newton step is taken.

        Shapes: (n, 3, 6).
        Units: `v` in those of the scenario.
        Errors: `NoSupport`; `NoSensitivity` where the belt has no slack or a part of it has stayed flat under load;
        `InvalidArgument` of points beyond the edges, and of points off the spine with the energy "shell".
        """
        return self._inner.derivatives(self._index_or_first(support), self._across(v).tolist())[0]

    def _across(self, v: float | Literal["minus", "plus"]) -> Floats:
        """Places across the board at the nodes."""
        if isinstance(v, str):
            if v not in Edges._fields:
                raise InvalidArgument(f'v: found "{v}", allowed "minus", "plus" or a number')
            return self._inner.rib_ends()[Edges._fields.index(v)]
        number = float(numbers_of("v", v, ()))
        if number != 0.0:
            self._check_across(number)
        return np.full(len(self.u), number)

    def _check_across(self, v: float) -> None:
        if self._half_width is None:
            self._half_width = 0.5 * float(self.equilibrium().scenario.to_dict()["belt"]["width"])
        if abs(v) > self._half_width * (1.0 + ROUNDING):
            raise InvalidArgument(f"v: found {v:g}, allowed {-self._half_width:g} to {self._half_width:g}")

    def stiffness(self, support: Place | None = None) -> Floats:
        """Derivatives of a support's reaction by its motion, by default of the first that moves.

        Rows are [force, moment], columns [translation, left world-axes rotation about the support point]. The moment is
        about the point that moves, so that the matrix is not symmetric where the support bears a load.

        Shapes: (6, 6).
        Errors: as `jacobian`.
        """
        return self._inner.derivatives(self._index_or_first(support), [0.0] * len(self.u))[1]

    def lowest_eigenvalue(self, support: Place | None = None) -> LowestEigenvalue:
        """The lowest eigenvalue of the second variation, and its gradient by the motion of a support that moves.

        By default this is the first of them. The gradient is that of central differences: copies of the tracker follow
        the shape for 1e-5 of the length, or of a radian, to either side.

        Units: those of the scenario; rad.
        Errors: `NoSupport`; `InvalidArgument` of a support that does not move; `NoModes` where the second variation is
        singular.
        """
        index = self._index_or_first(support)
        if index not in self._inner.moving:
            found = f"found {support!r}, which does not move"
            raise InvalidArgument(f"support: {found}, allowed those that the tracker moves")
        return LowestEigenvalue(*self._inner.lowest_eigenvalue(index))

    def _index_or_first(self, support: Place | None) -> int:
        return self._inner.moving[0] if support is None else self._index_of(support)

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


def _limit(name: str, limit: float | None) -> float | None:
    """A limit of an update, checked."""
    if limit is None:
        return None
    number = float(numbers_of(name, limit, ()))
    if number <= 0.0:
        raise InvalidArgument(f"{name}: found {limit}, allowed a finite positive number")
    return number


def _flag(name: str, flag: object) -> bool:
    """A flag, checked."""
    if not isinstance(flag, bool | np.bool_):
        raise InvalidArgument(f"{name}: found {flag!r}, allowed True or False")
    return bool(flag)
