"""Continuation of equilibria along a path, stable or not, with folds, bifurcations and snaps."""

from __future__ import annotations

import functools
import itertools
import math
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np

from fishbone import _core
from fishbone.equilibrium import Equilibrium, Reaction, solve
from fishbone.errors import InvalidArgument
from fishbone.names import Kind, Motion
from fishbone.pose import numbers_of
from fishbone.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import End, Place, Status

    Floats = NDArray[np.float64]
    Columns = dict[str, NDArray[Any]]

SCHEMA = "fishbone.diagram/1"
SNAP = "snap"
"""The event in the row of a table that holds the minimum after a snap."""
QUANTILES = ("bend_radius.p999", "bend_radius.p99", "bend_radius.p95")
"""The columns of the radii exceeded on 99.9, 99 and 95 % of the area."""
MAX_STEP = 1.0
MIN_STATES, MAX_STATES = 2, 100_000
MAX_BRANCHES = 1000


class Poses(NamedTuple):
    """Poses through which a support is led from its own: a path for `follow`.

    Units: those of the scenario; rad.
    """

    poses: Sequence[tuple[npt.ArrayLike, npt.ArrayLike]]
    """Each a position and a rotation vector, world axes, shapes (3,)."""
    support: Place = "end"
    """The support that moves, named as for `Equilibrium.reaction`; it must hold a position and a rotation."""
    motion: Motion = "straight"
    """The motion between poses. "straight": the point on a straight line and the frame about a fixed axis; "screw":
    both as a screw. Either way by the shorter turn."""


class Origin(NamedTuple):
    """The event of another branch at which a branch begins."""

    branch: int
    """Index of the other branch."""
    event: int
    """Index of the event on the other branch."""


class Event(NamedTuple):
    """A place on a branch where the number of negative modes changes, or where other edges hold the ribs."""

    kind: Kind
    """The kind of event.

    At a "fold" the branch turns back. At a "pitchfork" the branch meets another branch that is its own mirror image, or
    that turns back there. At a "transcritical" event it crosses another branch at an angle. At a "bifurcation" the
    other branches could not be followed. At "edges" the ribs beside a bend of the board come to other edges, and the
    branch goes on.
    """
    parameter: float
    """The parameter of the event; the diagram's `parameter_name` names it."""
    state: int
    """Index of the state of the branch at the event, or closest to it."""
    negative_modes: tuple[int, int]
    """Numbers before and after the event, in the order of the states."""
    snapped: Equilibrium | None
    """The minimum to which the belt goes past the loss of its stability, if one was found."""
    snapped_parameter: float | None
    """The parameter of `snapped`, a little past the event."""
    confirmed: bool = True
    """Whether the event is found again on a mesh of elements half as long, within 0.01 of the path or of its leg.

    If not, it may be an event of the mesh, not of the belt.
    """
    jump: float = 0.0
    """Largest displacement of a node in the snap; 0 without one. Jumps of less than `solver.snap_size` widths are no
    snaps."""
    released: float = 0.0
    """Energy released in the snap, in the unit of the scenario."""


class _Report(NamedTuple):
    """The quantities that the core reports of all states of a branch, in the order of the core."""

    parameter: Floats
    energy: Floats
    height: Floats
    force: Floats
    moment: Floats
    least_bend_radius: Floats
    least_spine_radius: Floats
    area_radii: list[Floats]
    rib_margin: Floats
    stable: list[bool | None]
    status: list[Status]
    residual_and_error: list[Floats]


class Branch:
    """A curve of equilibria: m states in order.

    The quantities of the states are computed at first use. Arrays are copies.

    Units: those of the scenario.
    """

    def __init__(self, inner: _core.Diagram, index: int, start: Equilibrium) -> None:
        self._inner = inner
        self._index = index
        self._start = start
        origin = inner.origin(index)
        self.origin: Origin | None = None if origin is None else Origin(*origin)
        """The event of another branch where this branch begins; None for the first branch, which begins with the
        path."""
        self.end: End = inner.end(index)
        """The reason of the end of the branch: the path ends ("range"); the branch meets another branch head on
        ("event"), or its own start ("closed"); the belt loses its stability there and goes on elsewhere ("unstable");
        the belt has no slack left ("no_slack"); the ribs beside a bend come to other edges, with which no equilibrium
        is found ("edges"); the `states` of `follow` are used up ("budget"); or no step, however short, converges
        ("lost")."""
        self.events: list[Event] = [_event(*event) for event in inner.events(index)]
        """The events of the branch in order."""

    def __len__(self) -> int:
        return self._inner.states(self._index)

    @property
    def parameter(self) -> Floats:
        """The parameter of the path; the diagram's `parameter_name` names it.

        Shapes: (m,).
        """
        return self._report.parameter.copy()

    @property
    def energy(self) -> Floats:
        """Total potential, loads included.

        Shapes: (m,).
        """
        return self._report.energy.copy()

    @property
    def height(self) -> Floats:
        """The coordinate of the highest point of the spine along the scenario's `bulge`.

        Shapes: (m,).
        """
        return self._report.height.copy()

    @property
    def negative_modes(self) -> NDArray[np.int64]:
        """Number of independent motions along which the energy falls.

        Shapes: (m,).
        """
        return np.array(self._inner.negative_modes(self._index), dtype=np.int64)

    @property
    def stable(self) -> list[bool | None]:
        """Whether each state is a local minimum; None where not decided, as `Equilibrium.stable`.

        It is not decided next to an event, and from an event that a finer mesh does not confirm to the one that brings
        the number of negative modes back; nor always where a part of the belt is flat under load: there the slope of
        the ribs costs no energy, and `negative_modes` does not include it.
        """
        return list(self._report.stable)

    @property
    def status(self) -> list[Status]:
        """The status of each state, as `Equilibrium.status`: all are "converged" but those that miss the tolerance."""
        return list(self._report.status)

    @property
    def residual(self) -> Floats:
        """Largest residual of each state, lengths in U and energy in mean R_f/U.

        Shapes: (m,).
        """
        return self._report.residual_and_error[0].copy()

    @property
    def error(self) -> Floats:
        """The largest of the errors by the mesh of each state, as `Equilibrium.error`, relative; NaN where not known.

        The mesh is graded anew on the way where its error is ten times `solver.accuracy`, or fifty times where ribs
        turn with `fishbone` or `sadowsky`, unless `solver.elements` fixes it.

        Shapes: (m,).
        """
        return self._report.residual_and_error[1].copy()

    @property
    def least_bend_radius(self) -> Floats:
        """The least bend radius of the whole belt; NaN where nothing bends. See `Equilibrium.least_bend_radius`.

        Shapes: (m,).
        """
        return self._report.least_bend_radius.copy()

    @property
    def least_spine_radius(self) -> Floats:
        """The least bend radius on the spine; NaN where nothing bends.

        Shapes: (m,).
        """
        return self._report.least_spine_radius.copy()

    @property
    def area_radii(self) -> Floats:
        """The bend radii exceeded on 99.9, 99 and 95 % of the board's area; infinite where it is flat.

        Shapes: (m, 3).
        """
        return np.column_stack(self._report.area_radii)

    @property
    def rib_margin(self) -> Floats:
        """The least slack of the rib bound; ribs cross inside the belt where it is negative.

        Shapes: (m,).
        Source: Eq. (33).
        """
        return self._report.rib_margin.copy()

    @property
    def position(self) -> Floats:
        """Spine positions x(u), at the nodes of the state with the most nodes.

        Shapes: (m, n, 3).
        """
        return self._positions.copy()

    def reaction(self, support: Place) -> Reaction:
        """Force and moment of a support on the belt in every state; the support is named as for `Equilibrium.reaction`.

        Shapes: (m, 3) each.
        Errors: `NoSupport`.
        """
        index = _index_of(self._start, support)
        return Reaction(self._report.force[:, index].copy(), self._report.moment[:, index].copy())

    def equilibrium(self, state: int) -> Equilibrium:
        """The equilibrium of a state, by its index; negative indices count from the end.

        Errors: `InvalidArgument` where there is no such state.
        """
        count = len(self)
        if not _is_whole(state) or not -count <= state < count:
            raise InvalidArgument(f"state: found {state}, allowed {-count} to {count - 1}")
        scenario, found = self._inner.equilibrium(self._index, int(state) % count)
        return Equilibrium(Scenario._wrap(scenario), found)  # noqa: SLF001 - of this package

    @functools.cached_property
    def _report(self) -> _Report:
        return _Report(*self._inner.report(self._index))

    @functools.cached_property
    def _positions(self) -> Floats:
        return np.stack(self._inner.positions(self._index))

    def __repr__(self) -> str:
        return f"<Branch: {len(self)} states, {len(self.events)} events, end {self.end!r}>"


class Diagram:
    """The branches of equilibria that are connected along a path."""

    def __init__(
        self,
        inner: _core.Diagram,
        start: Equilibrium,
        way: _Way,
    ) -> None:
        self.start = start
        """The equilibrium at the start of the path."""
        self.parameter_name = way.parameter_name
        """The name of `parameter`: the field where one number changes; "share of the path", 0 to 1, where several
        change; for poses "place on the path", 0 at the first pose of the support and 1, 2, … at the poses given."""
        self.goal = way.inner.goal
        """The parameter at the end of the path."""
        last = len(start._inner.reactions) - 1  # noqa: SLF001 - of this package
        self.support = way.support if way.support is not None else last if last >= 0 else None
        """Index of the support that the path moves, or else of the last support; None where there is no support."""
        self._angles = way.angles
        self.branches = [Branch(inner, index, start) for index in range(inner.branches)]
        """The branch of `start`, then the branches that leave it, in the order found."""

    @property
    def scenario(self) -> Scenario:
        """The scenario at the start of the path."""
        return self.start.scenario

    @property
    def reached(self) -> float:
        """The parameter nearest to the end of the path among the states of all branches."""
        parameters = np.concatenate([branch.parameter for branch in self.branches])
        return float(parameters[np.argmin(np.abs(parameters - self.goal))])

    @property
    def is_complete(self) -> bool:
        """Whether a branch leads to the end of the path, or the first turns back and is followed to its own end."""
        first = self.branches[0]
        rounding = 1e-9 * abs(self.goal - float(first.parameter[0]))
        return abs(self.reached - self.goal) <= rounding or first.end in {"range", "event", "closed"}

    def angle(self, parameter: npt.ArrayLike) -> Floats | None:
        """The angle in degrees by which the support has turned from its first pose, at places on the path.

        None of paths other than poses that turn about one axis. Turns like that of the first leg are positive.

        Shapes: that of `parameter`.
        """
        if self._angles is None:
            return None
        return np.asarray(
            np.interp(np.asarray(parameter, dtype=np.float64), np.arange(len(self._angles)), self._angles),
            dtype=np.float64,
        )

    def table(self) -> Columns:
        """A table of all states of all branches, as columns: for `pandas.DataFrame(…)` or a CSV file.

        The columns are branch, state, parameter, energy, height, stable, negative_modes, event (its kind, or empty),
        supports[0].force.x … supports[k].moment.z, least_spine_radius, bend_radius.p999, bend_radius.p99,
        bend_radius.p95 (exceeded on 99.9, 99 and 95 % of the area), least_bend_radius (over the width; of developable
        belts a property of the mesh), rib_margin, status, residual, error (the largest by the mesh), confirmed (of the
        event; True without one), jump, released, and angle along poses that have one. Where nothing bends the radii on
        the spine and over the width are NaN.

        A branch that ends where the belt snaps has one row more, of the minimum after the snap: its event is "snap",
        and jump and released are the size of the snap, NaN in other rows.

        Shapes: (number of rows,) each.
        """
        tables = [_table(index, branch) for index, branch in enumerate(self.branches)]
        columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
        angle = self.angle(columns["parameter"])
        return columns if angle is None else columns | {"angle": angle}

    def to_dict(self) -> dict[str, Any]:
        """The diagram as plain numbers, lists and text, schema "fishbone.diagram/1", with the results of all states."""
        return {
            "schema": SCHEMA,
            "parameter_name": self.parameter_name,
            "goal": self.goal,
            "reached": self.reached,
            "scenario": self.scenario.to_dict(),
            "branches": [_branch_to_dict(branch) for branch in self.branches],
        }

    def __repr__(self) -> str:
        states = sum(map(len, self.branches))
        events = sum(len(branch.events) for branch in self.branches)
        return f"<Diagram: {self.parameter_name}, {len(self.branches)} branches, {states} states, {events} events>"


def follow(  # noqa: PLR0913 - keywords all but two
    scenario: Scenario | Equilibrium,
    path: Mapping[str, float | npt.ArrayLike] | Poses,
    *,
    step: float = 0.05,
    states: int = 1000,
    branches: int = 10,
    snaps: bool = False,
    progress: Callable[[int, float], object] | None = None,
) -> Diagram:
    """Follows an equilibrium along a path, through folds and instabilities, and the branches that leave it.

    A scenario is solved first. The path is either a mapping of fields to their last values, such as
    `{"supports[1].position[2]": 0.4}`, or `Poses`. A list stands for numbers by their index:
    `{"supports[1].position": [0, 0.7, 0.4]}` changes `supports[1].position[0]`, `[1]` and `[2]`. All numbers change
    together, linearly, from their values in the scenario.

    `step` is the greatest length of a step along a branch: the norm of the change of the parameter, which runs from 0
    to 1 or to the number of poses, and of the motion of the belt in U. `states` is the greatest number of states of a
    branch, `branches` the greatest number of branches. With `snaps` the belt is led along its minima alone: a branch
    ends where the belt snaps, and the next begins at the minimum to which it snaps. `progress(branch, share of the
    path)` is called from the calling thread during the continuation; the share falls where a branch has turned back.
    Other threads run meanwhile, and Ctrl-C ends the continuation.

    Errors: `NoPath` where the scenario has no such numbers, where nothing changes, and where the scenario at the end
    of the path is invalid; `NoBranch` where the start has not converged or may move at no cost of energy; `NoSupport`;
    `InvalidArgument`; any error that `progress` raises.
    """
    _check(step, states, branches)
    if not isinstance(scenario, Scenario | Equilibrium):
        raise InvalidArgument(f"scenario: found {type(scenario).__name__}, allowed a Scenario or an Equilibrium")
    if isinstance(path, Poses):
        start = _solved(scenario)
        way = _led(start, path)
    else:
        # An invalid path is refused before a long solve.
        way = _changed(scenario if isinstance(scenario, Scenario) else scenario.scenario, path)
        start = _solved(scenario)
    inner = _core.follow(start._inner, way.inner, float(step), int(states), int(branches), bool(snaps), progress)  # noqa: SLF001
    return Diagram(inner, start, way)


def out_of_reach(scenario: Scenario | Equilibrium, path: Mapping[str, float | npt.ArrayLike] | Poses) -> str | None:
    """Where and why no belt can be led along a path, as far as the distance check of a solve proves it; else None.

    A scenario whose support is led through poses is solved first; nothing else is solved.

    Errors: those of `follow` for the path.
    """
    if isinstance(path, Poses):
        way = _led(_solved(scenario), path)
    else:
        way = _changed(scenario if isinstance(scenario, Scenario) else scenario.scenario, path)
    found = way.inner.out_of_reach()
    return None if found is None else f"at {found[0]:g} along the path ({way.parameter_name}), {found[1]}"


# ------------------------------------------------------------------------------------------------------- the path


class _Way(NamedTuple):
    """A path of the core, the name of its parameter, and the support that it moves."""

    inner: _core.Path
    parameter_name: str
    support: int | None
    angles: Floats | None = None
    """Of poses that turn about one axis: the angle at each of them in degrees, 0 at the first."""


def _changed(scenario: Scenario, path: Mapping[str, Any]) -> _Way:
    """The path of numbers."""
    if not isinstance(path, Mapping):
        raise InvalidArgument(f"path: found {type(path).__name__}, allowed fields with their last values, or Poses")
    numbers = [number for field, value in path.items() for number in _numbers(field, value)]
    fields = [field for field, _ in numbers]
    for field in fields:
        if fields.count(field) > 1:
            raise InvalidArgument(f"{field}: found twice in the path, allowed once")
    inner = _core.Path.numbers(scenario._inner, numbers)  # noqa: SLF001 - of this package
    moved = (re.match(r"supports\[(\d+)\]", field) for field in fields)
    support = next((int(found[1]) for found in moved if found is not None), None)
    return _Way(inner, fields[0] if len(fields) == 1 else "share of the path", support)


def _numbers(field: str, value: Any) -> Iterator[tuple[str, float]]:  # noqa: ANN401 - whatever a caller may bring
    """A field with its number, or with each number of its list."""
    if not isinstance(field, str):
        raise InvalidArgument(f"path: found the field {field!r}, allowed a name such as supports[1].position[2]")
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from _numbers(f"{field}[{index}]", item)
    elif _is_number(value):
        yield field, float(value)
    else:
        raise InvalidArgument(f"{field}: found {value!r}, allowed a finite number or a list of such")


def _led(start: Equilibrium, path: Poses) -> _Way:
    """The path of a support's poses."""
    motions = get_args(Motion)
    if path.motion not in motions:
        allowed = " or ".join(f'"{motion}"' for motion in motions)
        raise InvalidArgument(f"motion: found {path.motion!r}, allowed {allowed}")
    if not isinstance(path.poses, Iterable):
        raise InvalidArgument(f"poses: found {path.poses!r}, allowed pairs of a position and a rotation")
    poses = []
    for index, pose in enumerate(path.poses):
        try:
            position, rotation = pose
        except (TypeError, ValueError):
            raise InvalidArgument(f"poses[{index}]: found {pose!r}, allowed a position and a rotation") from None
        place = numbers_of(f"poses[{index}][0]", position, (3,)).tolist()
        turn = numbers_of(f"poses[{index}][1]", rotation, (3,)).tolist()
        poses.append((place, turn))
    # The source's method has no reactions, and the core refuses it whatever the support.
    support = _index_of(start, path.support) if start._inner.reactions else 0  # noqa: SLF001 - of this package
    inner = _core.Path.poses(start.scenario._inner, support, poses, path.motion)  # noqa: SLF001 - of this package
    turns = [_turn(rotation) for _, rotation in poses]
    return _Way(inner, "place on the path", support, _angles([_frame_at(start, support), *turns]))


def _frame_at(start: Equilibrium, support: int) -> Floats:
    """The frame at a support."""
    at = start.scenario.to_dict()["supports"][support]["at"]
    node = {"start": 0, "end": -1}.get(at)
    frame: Floats = start.frame[int(np.argmin(np.abs(start.u - at))) if node is None else node]
    return frame


def _turn(rotation: Sequence[float]) -> Floats:
    """The rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(rotation))
    x, y, z = np.asarray(rotation) / angle if angle > 0.0 else np.zeros(3)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Floats = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew
    return turn


def _angles(turns: Sequence[Floats]) -> Floats | None:
    """The angles in degrees from the first of several rotation matrices; None unless all turns have one axis."""
    parallel = 1e-6
    axis: Floats | None = None
    angles = [0.0]
    for before, after in itertools.pairwise(turns):
        turn = after @ before.T
        sine = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        size = float(np.linalg.norm(sine))
        if size > parallel and axis is None:
            axis = sine / size
        if size > parallel and axis is not None and np.linalg.norm(np.cross(axis, sine)) > parallel * size:
            return None
        sign = 1.0 if axis is None or sine @ axis >= 0.0 else -1.0
        angles.append(angles[-1] + sign * math.degrees(math.atan2(size, 0.5 * (np.trace(turn) - 1.0))))
    return None if axis is None else np.array(angles)


def _solved(scenario: Scenario | Equilibrium) -> Equilibrium:
    return scenario if isinstance(scenario, Equilibrium) else solve(scenario)


def _check(step: float, states: int, branches: int) -> None:
    if not _is_number(step) or not 0.0 < step <= MAX_STEP:
        raise InvalidArgument(f"step: found {step!r}, allowed above 0 up to {MAX_STEP:g}")
    if not _is_whole(states) or not MIN_STATES <= states <= MAX_STATES:
        raise InvalidArgument(f"states: found {states!r}, allowed {MIN_STATES} to {MAX_STATES}")
    if not _is_whole(branches) or not 1 <= branches <= MAX_BRANCHES:
        raise InvalidArgument(f"branches: found {branches!r}, allowed 1 to {MAX_BRANCHES}")


def _is_number(number: object) -> bool:
    """Whether the object is a number that a finite float can hold."""
    if not isinstance(number, int | float | np.integer | np.floating) or isinstance(number, bool):
        return False
    try:
        return math.isfinite(number)
    except OverflowError:
        return False


def _is_whole(number: object) -> bool:
    return isinstance(number, int | np.integer) and not isinstance(number, bool)


def _index_of(start: Equilibrium, support: Place) -> int:
    return start._support_index(support)  # noqa: SLF001 - of this package


# ----------------------------------------------------------------------------------------------------- the results


def _event(  # noqa: PLR0913, PLR0917 - as the core gives them
    kind: Kind,
    parameter: float,
    state: int,
    negative_modes: tuple[int, int],
    confirmed: bool,  # noqa: FBT001 - by the core
    snapped: tuple[float, _core.Scenario, _core.Equilibrium, float, float] | None,
) -> Event:
    if snapped is None:
        return Event(kind, parameter, state, negative_modes, None, None, confirmed)
    place, scenario, found, jump, released = snapped
    equilibrium = Equilibrium(Scenario._wrap(scenario), found)  # noqa: SLF001 - of this package
    return Event(kind, parameter, state, negative_modes, equilibrium, place, confirmed, jump, released)


def _table(index: int, branch: Branch) -> Columns:
    """The rows of a branch, with that of the snap where it ends with one."""
    columns = _columns(index, branch)
    last = branch.events[-1] if branch.events else None
    if branch.end != "unstable" or last is None or last.snapped is None:
        return columns
    snap = _snap_row(index, last, last.snapped)
    return {name: np.append(column, np.array([snap[name]], column.dtype)) for name, column in columns.items()}


def _snap_row(index: int, event: Event, shape: Equilibrium) -> dict[str, Any]:
    """The row of the minimum after a snap."""
    bulge = np.array(shape.scenario.to_dict()["solver"]["bulge"])
    least, on_spine = shape.least_bend_radius, shape.least_spine_radius
    row: dict[str, Any] = {
        "branch": index,
        "state": event.state,
        "parameter": event.snapped_parameter,
        "energy": shape.energy,
        "height": float(shape.highest_point.position @ bulge / np.linalg.norm(bulge)),
        "stable": shape.stable,
        "negative_modes": shape.negative_modes or 0,
        "event": SNAP,
    }
    for support in range(len(shape._inner.reactions)):  # noqa: SLF001 - of this package
        row |= _components(support, shape.reaction(support))
    return row | {
        "least_spine_radius": math.nan if on_spine is None else on_spine.value,
        **dict(zip(QUANTILES, shape.bend_radius.area, strict=True)),
        "least_bend_radius": math.nan if least is None else least.value,
        "rib_margin": shape.rib_margin.value,
        "status": shape.status,
        "residual": max(shape.residuals),
        "error": max((e for e in shape.error or () if not math.isnan(e)), default=math.nan),
        "confirmed": event.confirmed,
        "jump": event.jump,
        "released": event.released,
    }


def _components(support: int, reaction: Reaction) -> Columns:
    """The components of a reaction, or of several, by the names of their columns."""
    return {
        f"supports[{support}].{quantity}.{axis}": np.moveaxis(vectors, -1, 0)[i]
        for quantity, vectors in reaction._asdict().items()
        for i, axis in enumerate("xyz")
    }


def _columns(index: int, branch: Branch) -> Columns:
    count = len(branch)
    # Wide enough for the name of a snap and of every kind.
    kinds, confirmed = np.full(count, "", dtype=f"U{max(map(len, get_args(Kind)))}"), np.full(count, fill_value=True)
    for event in branch.events:
        kinds[event.state], confirmed[event.state] = event.kind, event.confirmed
    columns: Columns = {
        "branch": np.full(count, index),
        "state": np.arange(count),
        "parameter": branch.parameter,
        "energy": branch.energy,
        "height": branch.height,
        "stable": np.array(branch.stable, dtype=object),
        "negative_modes": branch.negative_modes,
        "event": kinds,
    }
    supports = len(branch._start._inner.reactions)  # noqa: SLF001 - of this package
    for support in range(supports):
        columns |= _components(support, branch.reaction(support))
    return columns | {
        "least_spine_radius": branch.least_spine_radius,
        **dict(zip(QUANTILES, branch.area_radii.T, strict=True)),
        "least_bend_radius": branch.least_bend_radius,
        "rib_margin": branch.rib_margin,
        "status": np.array(branch.status),
        "residual": branch.residual,
        "error": branch.error,
        "confirmed": confirmed,
        "jump": np.full(count, math.nan),
        "released": np.full(count, math.nan),
    }


def _branch_to_dict(branch: Branch) -> dict[str, Any]:
    parameter, negative_modes = branch.parameter.tolist(), branch.negative_modes.tolist()
    status, residual = branch.status, branch.residual.tolist()
    return {
        "origin": None if branch.origin is None else branch.origin._asdict(),
        "end": branch.end,
        "events": [_event_to_dict(event) for event in branch.events],
        "states": [
            {
                "parameter": parameter[state],
                "negative_modes": negative_modes[state],
                "status": status[state],
                "residual": residual[state],
                "result": branch.equilibrium(state).to_dict(),
            }
            for state in range(len(branch))
        ],
    }


def _event_to_dict(event: Event) -> dict[str, Any]:
    snapped = None
    if event.snapped is not None:
        snapped = {
            "parameter": event.snapped_parameter,
            "jump": event.jump,
            "released": event.released,
            "result": event.snapped.to_dict(),
        }
    return {
        "kind": event.kind,
        "parameter": event.parameter,
        "state": event.state,
        "negative_modes": list(event.negative_modes),
        "confirmed": event.confirmed,
        "snapped": snapped,
    }
