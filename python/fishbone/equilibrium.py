"""Equilibria: what a solve ends with."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fishbone import _core
from fishbone.errors import InvalidArgument, InvalidScenario, NoSupport, NotConverged
from fishbone.sensitivity import Sensitivity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import EnergyModel, Place, Status
    from fishbone.scenario import Scenario

    Floats = NDArray[np.float64]

MIN_ACROSS, MAX_ACROSS = 2, 10_001
"""Ribs are straight: two points hold all there is to a rib, and more are for rendering."""

MAX_MODES = 100
"""More than what a mesh resolves."""

MAX_REACH = 10.0
"""Farther than any support of a belt of length 1 needs to go."""


class Reaction(NamedTuple):
    """What a support does to the belt, world axes.

    Shapes: (3,) each.
    Units: force [N], moment about the support point [N·m], in the scenario's own units.
    """

    force: Floats
    moment: Floats


class Internal(NamedTuple):
    """What the belt beyond u does to the part before it, world axes, the moment about the spine point.

    Shapes: (n, 3) each.
    """

    force: Floats
    moment: Floats


class Edges(NamedTuple):
    """The ribs' ends on the −ζ and on the +ζ side.

    Shapes: (n, 3) each.
    """

    minus: Floats
    plus: Floats


class Outline(NamedTuple):
    """The outline of the flat board as polylines, flat coordinates (y, z): along η and ζ of the start.

    Shapes: (m, 2) each.
    """

    minus: Floats
    """The edge on the −ζ side, from the start of the belt to its end."""
    plus: Floats
    """The edge on the +ζ side, from the start of the belt to its end."""
    loops: list[Floats]
    """What to draw: one closed, counter-clockwise loop of an open belt; the two edges of a closed one."""


class Residuals(NamedTuple):
    """Max-norms of what an exact solution has at 0, with lengths in U and energy in mean R_f/U."""

    stationarity: float
    constraint: float
    complementarity: float


class Mode(NamedTuple):
    """A motion from an equilibrium that the second variation of the energy does not couple with other modes.

    Its scale is such that the mean over the board of the squared displacement is 1, the board taken as a strip across
    the spine that turns with the frame, all of it weighing alike. n is the number of nodes.
    """

    eigenvalue: float
    """Second variation of the energy: twice what it rises by, per squared displacement."""
    translation: Floats
    """Displacement of the spine, shape (n, 3)."""
    rotation: Floats
    """Rotation of the frame, left, in world axes, shape (n, 3)."""
    bend: Floats
    """Change of the bend ω_ζ, shape (n,)."""
    rib_slope: Floats
    """Change of the rib slope β, shape (n,)."""


class SnapMargin(NamedTuple):
    """Where a support may not be moved without the belt's losing its stability."""

    distance: float
    """How far it is: the norm of displacement in U and rotation in rad."""
    direction: Floats
    """Where to: displacement in U and rotation left in world axes, of norm 1, shape (6,)."""
    snaps: bool
    """Whether the equilibrium ends there, in a fold; else it goes on, no longer stable, where others branch off."""
    position: Floats
    """Position of the support there, shape (3,)."""
    rotation: Floats
    """Rotation vector of the support there, shape (3,)."""


class HighestPoint(NamedTuple):
    """The point of the spine farthest along the scenario's `bulge`; position has shape (3,)."""

    u: float
    position: Floats


class BendRadius(NamedTuple):
    """The least radius of bend over the whole width, and where it is: u along the spine, v across."""

    value: float
    u: float
    v: float


class SpineRadius(NamedTuple):
    """The least radius of bend on the spine, and where it is."""

    value: float
    u: float


class RibMargin(NamedTuple):
    """How far the ribs are from crossing at an edge, least over u, and where."""

    value: float
    u: float


class Equilibrium:
    """The shape of a belt and all that is reported of it.

    A solve that fails ends with one too: look at `status` before anything else. n is the number of nodes; a node
    at a corner of the board comes twice, before and after it. Arrays are float64 in C order, and the caller's own.

    Units: those of the scenario; angles in rad.
    """

    __slots__ = ("_inner", "_sensitivity", "scenario")

    def __init__(self, scenario: Scenario, inner: _core.Equilibrium) -> None:
        self.scenario = scenario
        self._inner = inner
        self._sensitivity: Sensitivity | None = None

    @property
    def status(self) -> Status:
        """How the solve ended: "converged", "infeasible" or "not_converged"."""
        return self._inner.status

    @property
    def message(self) -> str:
        """One line: why the solve ended so, and what to try."""
        return self._inner.message

    @property
    def warnings(self) -> list[str]:
        """What should be known before the result is relied on, one line each."""
        return self._inner.warnings

    @property
    def energy(self) -> float:
        """Total potential, loads included."""
        return self._inner.energy

    @property
    def elastic_energy(self) -> float:
        """Energy of bending alone."""
        return self._inner.elastic_energy

    @property
    def energy_model(self) -> EnergyModel:
        """The energy minimised: "fishbone", "sadowsky" or "wunderlich"."""
        return self._inner.energy_model

    @property
    def twist(self) -> float:
        """Total torsion ∫ ω_η du [rad]: whole extra turns of the end show here and nowhere else."""
        return self._inner.twist

    @property
    def stable(self) -> bool | None:
        """Whether the equilibrium is a local minimum; None where that cannot be decided.

        So it is where it has a mode of no second variation, and where a part of the belt is flat under stress: there
        any slope of the ribs is as good as any other, and along which of them the belt would give way is not seen.
        """
        return self._inner.stable

    @property
    def negative_modes(self) -> int | None:
        """Number of independent motions, of those that supports and touching ribs leave, by which the energy falls."""
        return self._inner.negative_modes

    @property
    def zero_modes(self) -> int | None:
        """Number of independent motions along which the energy stays, to second order."""
        return self._inner.zero_modes

    def refined(self, elements: int) -> Equilibrium | None:
        """The same equilibrium, stable or not, with another number of elements; None where there is none like it.

        Errors: `InvalidArgument` where `elements` is none that a scenario takes.
        """
        tables = self.scenario.to_dict()
        tables["solver"]["elements"] = elements
        try:
            scenario = type(self.scenario).from_dict(tables)
        except InvalidScenario as error:
            raise InvalidArgument(str(error)) from None
        found = self._inner.refined(elements)
        return None if found is None else Equilibrium(scenario, found[1])

    def modes(self, count: int) -> list[Mode]:
        """The lowest modes, rising: fewer where the mesh has no more.

        Errors: `NoModes` unless the solve has converged by the intrinsic method; `InvalidArgument` for a count below 1.
        """
        if not 1 <= count <= MAX_MODES:
            raise InvalidArgument(f"count: found {count}, allowed 1 to {MAX_MODES}")
        return [Mode(*mode) for mode in self._inner.modes(count)]

    @property
    def iterations(self) -> int:
        """Newton iterations of the solve."""
        return self._inner.iterations

    @property
    def solve_time(self) -> float:
        """Wall time of the solve [s]."""
        return self._inner.solve_time

    @property
    def residuals(self) -> Residuals:
        """How far the result is from an exact solution of its discrete equations."""
        return Residuals(*self._inner.residuals)

    @property
    def u(self) -> Floats:
        """Arc length of the nodes along the spine.

        Shapes: (n,).
        """
        return self._inner.u

    @property
    def position(self) -> Floats:
        """Spine position x(u).

        Shapes: (n, 3).
        """
        return self._inner.position

    @property
    def frame(self) -> Floats:
        """Frame R(u), whose columns are ξ (normal), η (tangent) and ζ (width direction).

        Shapes: (n, 3, 3).
        Source: Eq. (1), (2).
        """
        return self._inner.frame

    @property
    def bend(self) -> Floats:
        """Bend ω_ζ.

        Shapes: (n,).
        Source: Eq. (4).
        """
        return self._inner.bend

    @property
    def torsion(self) -> Floats:
        """Torsion ω_η.

        Shapes: (n,).
        Source: Eq. (4).
        """
        return self._inner.torsion

    @property
    def rib_slope(self) -> Floats:
        """Rib slope β = tan α.

        Shapes: (n,).
        Source: Eq. (31).
        """
        return self._inner.rib_slope

    @property
    def rib_angle(self) -> Floats:
        """Rib angle α [rad].

        Shapes: (n,).
        Source: Eq. (30).
        """
        return self._inner.rib_angle

    @property
    def curvature(self) -> Floats:
        """Principal curvature κ₁, the one that is not zero.

        Shapes: (n,).
        Source: Eq. (29).
        """
        return self._inner.curvature

    @property
    def internal(self) -> Internal:
        """Internal force and moment at the nodes."""
        return Internal(self._inner.internal_force, self._inner.internal_moment)

    @property
    def edges(self) -> Edges:
        """The two edges of the belt, as the ribs' ends."""
        return Edges(*self._inner.edges)

    @property
    def highest_point(self) -> HighestPoint:
        """The highest point of the spine."""
        u, position = self._inner.highest_point
        return HighestPoint(u, np.array(position))

    @property
    def least_bend_radius(self) -> BendRadius | None:
        """The tightest bend of the whole belt, often at an edge; None where nothing bends.

        It falls with every refinement of the mesh, because ribs all but meet on an edge where the bend changes sign:
        compare `least_spine_radius`.
        """
        least = self._inner.least_bend_radius
        return None if least is None else BendRadius(*least)

    @property
    def least_spine_radius(self) -> SpineRadius | None:
        """The tightest bend on the spine; None where nothing bends."""
        least = self._inner.least_spine_radius
        return None if least is None else SpineRadius(*least)

    @property
    def rib_margin(self) -> RibMargin:
        """How far the ribs are from crossing inside the belt.

        Source: Eq. (33).
        """
        return RibMargin(*self._inner.rib_margin)

    @property
    def crosses_itself(self) -> tuple[float, float] | None:
        """Arc lengths of the first two places that pass through each other; None where the belt stays clear of itself.

        The model knows no contact, so an equilibrium may do what a belt cannot. What only touches or lies on itself
        does not cross; what lies closer than the sagitta of an element, |κ₁| h²/8, is not told apart.
        """
        return self._inner.crosses_itself

    @property
    def links(self) -> Floats:
        """Force of each link on the belt at its `to`, in the order of the scenario; at its `from` it is the opposite.

        Shapes: (m, 3).
        """
        return np.array(self._inner.links).reshape(-1, 3)

    @property
    def half_turns(self) -> int | None:
        """Signed half turns with which a closed belt ended; None of an open one."""
        return self._inner.half_turns

    def reaction(self, support: Place) -> Reaction:
        """What a support does to the belt, by its index (int) or place ("start", "end", arc length as a float).

        Errors: `NoSupport`.
        """
        _, force, moment = self._inner.reactions[self._support_index(support)]
        return Reaction(np.array(force), np.array(moment))

    def snap_margin(
        self,
        support: Place = "end",
        direction: npt.ArrayLike | None = None,
        *,
        reach: float = 1.0,
    ) -> SnapMargin | None:
        """How far a support may move before the belt is stable no longer; None where that is not within `reach`.

        Along `direction`, [displacement in U, rotation left in world axes], of which the length does not matter; or
        without one to wherever it is nearest, as far as can be told: from the nearest place along the six axes, either
        way, on along the normal of the boundary of stability. A belt that is drawn taut before has lost nothing.
        Stability that is lost and won again within a step of a twentieth of the reach may go unnoticed. The support is
        named as for `reaction`, and must hold a position and a rotation.

        Shapes: direction (6,).
        Errors: `NoSupport`; `NoMargin` unless the equilibrium is stable, and where it can be followed only a part of
        `reach` without losing its stability: along a direction always, without one if nothing else is found;
        `InvalidArgument` for what is no direction or reach.
        """
        if not (np.ndim(reach) == 0 and 0.0 < reach <= MAX_REACH):
            raise InvalidArgument(f"reach: found {reach!r}, allowed above 0 and up to {MAX_REACH:g}, in U and rad")
        along = None if direction is None else _direction(direction)
        margin = self._inner.margin(self._support_index(support), along, reach)
        if margin is None:
            return None
        distance, towards, is_fold, position, rotation = margin
        return SnapMargin(distance, np.array(towards), is_fold, np.array(position), np.array(rotation))

    def sensitivity(self) -> Sensitivity:
        """The derivatives of everything by what the scenario says, as one factorised system: made once, used often.

        Errors: `NoSensitivity` unless the equilibrium has converged to a minimum that its supports determine.
        """
        if self._sensitivity is None:
            self._sensitivity = Sensitivity(self._inner.sensitivity())
        return self._sensitivity

    def jacobian(self, support: Place) -> Floats:
        """Derivatives of the spine's positions by the motion of a support, which is named as for `reaction`.

        The last axis is [translation, left world-axes rotation about the support point]; components that the support
        leaves free move nothing. For other derivatives, and for single directions at less cost, see `sensitivity`.

        Shapes: (n, 3, 6).
        Errors: `NoSupport`; `NoSensitivity` unless the equilibrium has converged to a minimum that its supports
        determine.
        """
        return self.sensitivity().jacobian(self._support_index(support))

    def _support_index(self, support: Place) -> int:
        if isinstance(support, int | np.integer):
            count = len(self._inner.reactions)
            try:
                return range(count)[int(support)]
            except IndexError:
                raise _no_support(support, f"found {count} supports") from None
        length = float(self.u[-1])
        place = {"start": 0.0, "end": length}.get(support) if isinstance(support, str) else float(support)
        places = [at for at, _, _ in self._inner.reactions]
        for index, at in enumerate(places):
            if place is not None and math.isclose(at, place, abs_tol=1e-9 * length):
                return index
        raise _no_support(support, f'found supports at u = {places}, allowed one of them, "start", "end" or an index')

    def surface(self, n_across: int = 9) -> Floats:
        """Points of the surface, on every rib from the −ζ edge to the +ζ edge.

        Shapes: (n, n_across, 3).
        Errors: `InvalidArgument` where n_across is below 2.
        """
        return self._inner.surface(_across(n_across))

    def mesh(self, n_across: int = 9) -> tuple[Floats, NDArray[np.int64]]:
        """Vertices and triangles of the surface.

        Shapes: (p, 3) and (m, 3).
        Errors: `InvalidArgument` where n_across is below 2.
        """
        return self._inner.mesh(_across(n_across))

    def outline(self, tolerance: float | None = None) -> Outline:
        """The outline of the flat board, exact but for its arcs: no chord is farther from one than `tolerance`.

        The default is a thousandth of the width. A closed belt is cut open at its start.

        Errors: `InvalidArgument` where the tolerance is not positive.
        """
        if tolerance is None:
            tolerance = 1e-3 * float(self.scenario.to_dict()["belt"]["width"])
        if not 0.0 < tolerance < math.inf:
            raise InvalidArgument(f"tolerance: found {tolerance}, allowed a positive finite number")
        return Outline(*self._inner.outline(tolerance))

    def flat_spine(self) -> Floats:
        """The nodes' places in the flat board, coordinates (y, z).

        Shapes: (n, 2).
        """
        return self._inner.flat_spine()

    def flat_ribs(self) -> Floats:
        """The ends of the nodes' ribs in the flat board, on the −ζ side and on the +ζ side, coordinates (y, z).

        Shapes: (n, 2, 2).
        """
        return self._inner.flat_ribs()

    def flat_mesh(self, n_across: int = 9) -> tuple[Floats, NDArray[np.int64]]:
        """Vertices (y, z) and triangles of the flat board, which `mesh` has bent: triangle by triangle the same.

        Shapes: (p, 2) and (m, 3). A closed belt has the vertices of its seam once more, where the flat board ends.
        Errors: `InvalidArgument` where n_across is below 2.
        """
        return self._inner.flat_mesh(_across(n_across))

    def material_points(self, flat: npt.ArrayLike) -> Floats:
        """Where points (y, z) of the flat board are on the bent one; NaN where they are off the board.

        Shapes: (m, 2) to (m, 3).
        Errors: `InvalidArgument` for another shape.
        """
        return self._inner.material_points(_flat_points(flat))

    def rib_feet(self, flat: npt.ArrayLike) -> Floats:
        """Arc length u of the ribs through points (y, z) of the flat board; NaN where they are off the board.

        Shapes: (m, 2) to (m,).
        Errors: `InvalidArgument` for another shape.
        """
        return self._inner.rib_feet(_flat_points(flat))

    @property
    def stiffeners(self) -> list[tuple[float, float]]:
        """From where to where along the spine the board is rigid; in pieces where supports or loads lie in between."""
        return self._inner.stiffeners

    def to_dict(self) -> dict[str, Any]:
        """The result as plain numbers, lists and text, schema "fishbone.result/1"."""
        result: dict[str, Any] = json.loads(self._inner.to_json())
        return result | {"solve_time": self.solve_time}

    def __repr__(self) -> str:
        return f"<Equilibrium: {self.status}, energy {self.energy:.5g}, {self.iterations} iterations>"


def solve(
    scenario: Scenario, *, start: tuple[npt.ArrayLike, npt.ArrayLike] | None = None, strict: bool = False
) -> Equilibrium:
    """Finds the equilibrium of a scenario; a failure is a value too, see `Equilibrium.status`.

    The search begins at an arch on the side of the scenario's `bulge` or, where `start` is given, at that shape and
    nowhere else: bend and rib slope at equal steps of the arc length, from the start of the belt to its end. Other
    threads run meanwhile, and Ctrl-C ends the solve.

    Shapes: start (m,) and (m,), m at least 2.
    Errors: `NotConverged`, which carries the equilibrium, where `strict` is asked for; `InvalidArgument` where
    `scenario` is none or `start` no shape.
    """
    core = core_of(scenario)
    shape = None if start is None else _shape(start)
    inner = _core.solve(core) if shape is None else _core.solve_from(core, *shape)
    equilibrium = Equilibrium(scenario, inner)
    if strict and equilibrium.status != "converged":
        raise NotConverged(equilibrium, shape)
    return equilibrium


def _shape(start: tuple[npt.ArrayLike, npt.ArrayLike]) -> tuple[list[float], list[float]]:
    """Bend and rib slope of a start, checked."""
    try:
        bend, slope = (np.asarray(field, dtype=np.float64) for field in start)
    except (TypeError, ValueError):
        raise InvalidArgument("start: found no pair of arrays, allowed bend and rib slope") from None
    if bend.shape != slope.shape or bend.ndim != 1 or len(bend) < 2:  # noqa: PLR2004 - a start and an end
        raise InvalidArgument(f"start: found shapes {bend.shape} and {slope.shape}, allowed (m,) twice, m at least 2")
    if not (np.isfinite(bend).all() and np.isfinite(slope).all()):
        raise InvalidArgument("start: found what is not finite, allowed finite numbers")
    return bend.tolist(), slope.tolist()


def solve_many(
    scenarios: Iterable[Scenario], *, progress: Callable[[int, int], object] | None = None
) -> list[Equilibrium]:
    """Finds the equilibria of many scenarios over all cores, in the order given; a failure spoils no other.

    `progress(solved, all)` is called now and then from the calling thread. Other threads run meanwhile, and Ctrl-C ends
    the solves. The environment variable RAYON_NUM_THREADS limits the number of threads.

    Errors: `InvalidArgument` where one of `scenarios` is none; whatever `progress` raises.
    """
    scenarios = list(scenarios)
    found = _core.solve_many([core_of(scenario) for scenario in scenarios], progress)
    return [Equilibrium(scenario, inner) for scenario, inner in zip(scenarios, found, strict=True)]


def core_of(scenario: Scenario) -> _core.Scenario:
    """The core's scenario behind one.

    Errors: `InvalidArgument` where it is none.
    """
    inner = getattr(scenario, "_inner", None)
    if not isinstance(inner, _core.Scenario):
        raise InvalidArgument(f"scenario: found {type(scenario).__name__}, allowed a Scenario, as fishbone.load gives")
    return inner


def _no_support(support: Place, found: str) -> NoSupport:
    error = NoSupport(f"support {support!r}: {found}")
    error.support = support
    return error


def _across(n_across: int) -> int:
    if not MIN_ACROSS <= n_across <= MAX_ACROSS:
        raise InvalidArgument(f"n_across: found {n_across}, allowed {MIN_ACROSS} to {MAX_ACROSS}")
    return n_across


def _direction(direction: npt.ArrayLike) -> list[float]:
    vector = np.asarray(direction, dtype=np.float64)
    if vector.shape != (6,) or not np.isfinite(vector).all() or not vector.any():
        raise InvalidArgument(f"direction: found {direction!r}, allowed six finite numbers, not all 0")
    numbers: list[float] = vector.tolist()
    return numbers


def _flat_points(flat: npt.ArrayLike) -> list[list[float]]:
    points = np.asarray(flat, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:  # noqa: PLR2004 - (y, z)
        raise InvalidArgument(f"flat: found an array of shape {points.shape}, allowed (m, 2)")
    rows: list[list[float]] = points.tolist()
    return rows
