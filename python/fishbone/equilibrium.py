"""Equilibria: the results of a solve."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fishbone import _core
from fishbone.errors import InvalidArgument, InvalidScenario, NotConverged
from fishbone.places import support_index
from fishbone.sensitivity import Sensitivity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import EnergyModel, Place, Status
    from fishbone.scenario import Scenario

    Floats = NDArray[np.float64]

MIN_ACROSS, MAX_POINTS = 2, 5_000_000
"""Points on a rib, and on the ribs of all nodes: a gigabyte with the triangles between them."""

MIN_TOLERANCE = 1e-6
"""Distance of an outline from its chords over the width of the belt."""

MAX_MODES = 100
"""Number of modes, more than a mesh resolves."""

MAX_REACH = 10.0
"""Displacement in U and rotation in rad, farther than any support of a belt needs to move."""


class Reaction(NamedTuple):
    """Force and moment of a support on the belt, world axes; a component is NaN where the shape does not determine it.

    Shapes: (3,) each.
    Units: force [N], moment about the support point [N·m], in the scenario's own units.
    """

    force: Floats
    moment: Floats


class Internal(NamedTuple):
    """Force and moment of the belt beyond u on the part before u, world axes, the moment about the spine point.

    A component is NaN where the shape does not determine it.

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
    """The lines to draw: of an open belt one closed, counter-clockwise loop; of a closed belt its two edges."""


class Residuals(NamedTuple):
    """Max-norms of the residuals, 0 for an exact solution, with lengths in U and energy in mean R_f/U."""

    stationarity: float
    constraint: float
    complementarity: float


class MeshError(NamedTuple):
    """Estimated errors of a result by its mesh, relative and not negative.

    NaN where a quantity is not determined, or so small that its error is not known; 0 where it is zero.
    """

    energy: float
    """Error of the energy, the zero of potentials at the belt's start, over it or a larger elastic energy."""
    position: float
    """Largest error of a position on the spine over U; NaN of a closed belt that may slide along itself."""
    force: float
    """Largest error of a reaction or link force over the largest force of all, forces in R_f/U², moments in R_f/U."""
    radius: float
    """Error of the tightest bend on the spine over this bend."""


class Mode(NamedTuple):
    """A motion from an equilibrium that the second variation of the energy does not couple with other modes.

    The mean over the board of the squared displacement is 1. The board is taken as a strip across the spine, of uniform
    mass, that turns with the frame. n is the number of nodes.
    """

    eigenvalue: float
    """Second variation of the energy: twice the rise of the energy, per squared displacement."""
    translation: Floats
    """Displacement of the spine, shape (n, 3)."""
    rotation: Floats
    """Rotation of the frame, left, in world axes, shape (n, 3)."""
    bend: Floats
    """Change of the bend ω_ζ, shape (n,)."""
    rib_slope: Floats
    """Change of the rib slope β, shape (n,)."""


class SnapMargin(NamedTuple):
    """The nearest pose of a support at which the belt loses its stability."""

    distance: float
    """Distance of that pose: the norm of displacement in U and rotation in rad."""
    direction: Floats
    """Direction to that pose: displacement in U and left world-axes rotation, of norm 1, shape (6,)."""
    snaps: bool
    """True where the equilibrium ends, at a fold; False where it continues, unstable, and others branch off."""
    position: Floats
    """Position of the support at that pose, shape (3,)."""
    rotation: Floats
    """Rotation vector of the support at that pose, shape (3,)."""
    confirmed: bool
    """Whether a mesh twice as fine loses its stability at much the same distance along the direction. A mesh may have
    losses of its own where ribs turn over from element to element."""


class HighestPoint(NamedTuple):
    """The point of the spine farthest along the scenario's `bulge`; position has shape (3,)."""

    u: float
    position: Floats


class BendRadius(NamedTuple):
    """The least bend radius over the whole width, and its place: u along the spine, v across.

    Where ribs are straight, u is that of the foot of its rib.
    """

    value: float
    u: float
    v: float


class SpineRadius(NamedTuple):
    """The least bend radius on the spine, and its place."""

    value: float
    u: float


class AreaRadii(NamedTuple):
    """The bend radii exceeded on 99.9, 99 and 95 % of the board's area; `math.inf` where more than the rest is flat."""

    p999: float
    p99: float
    p95: float


class BendRadii(NamedTuple):
    """The tightness of a belt: quantities that converge under refinement of the mesh."""

    spine: SpineRadius | None
    """The least bend radius on the spine; None where nothing bends."""
    area: AreaRadii
    """The bend radii exceeded on given shares of the area."""


class AreaStrains(NamedTuple):
    """The strains not exceeded on 99.9, 99 and 95 % of the board's area, stiffeners included."""

    p999: float
    p99: float
    p95: float


class StrainExtremes(NamedTuple):
    """A strain over the board, at a point the larger magnitude of both principal strains; dimensionless."""

    value: float
    """The largest at least V/5 away from clamps, as for `least_bend_radius`; NaN where no part is so far from them."""
    u: float
    """Its place along the spine."""
    v: float
    """Its place across, square to the spine in the flat board."""
    area: AreaStrains
    """The strains not exceeded on given shares of the area, beside clamps too."""


class Strain(NamedTuple):
    """The strain of a strip of finite thickness."""

    membrane: StrainExtremes
    """Strain of the middle plane; of layers, that of their neutral surface."""
    layers: list[StrainExtremes]
    """Strain of the layers from bottom (−ξ) to top, the larger one of both faces; a plain sheet is one layer."""


class PointStrain(NamedTuple):
    """Curvature and strain at m points of the board, symmetric tensors by axes along the spine and across it."""

    curvature: Floats
    """Curvature: the second fundamental form by the normal ξ, along a straight spine −ω_ζ, shape (m, 2, 2)."""
    membrane: Floats
    """Strain of the middle plane; the mixed component is half of the angle, shape (m, 2, 2)."""
    layers: Floats
    """Largest magnitude of a principal strain on both faces of each layer, bottom (−ξ) to top, shape (m, layers)."""


class RibMargin(NamedTuple):
    """The least slack of the rib bound, 2/V − |s|, and its place; s is the rib convergence."""

    value: float
    u: float


class Equilibrium:
    """The shape of a belt, with its forces, its stability and its residuals.

    A solve that fails also returns an `Equilibrium`: check `status` first. n is the number of nodes; a node at a corner
    of the board comes twice, before and after the corner. Arrays are float64 in C order, and copies.

    Units: those of the scenario; angles in rad.
    """

    __slots__ = ("_inner", "_sensitivity", "scenario")

    def __init__(self, scenario: Scenario, inner: _core.Equilibrium) -> None:
        self.scenario = scenario
        self._inner = inner
        self._sensitivity: Sensitivity | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Equilibrium, (self.scenario, self._inner)

    @property
    def status(self) -> Status:
        """How the solve ended: "converged", "infeasible" or "not_converged"."""
        return self._inner.status

    @property
    def message(self) -> str:
        """One line: why the solve ended with this status, and what to try."""
        return self._inner.message

    @property
    def warnings(self) -> list[str]:
        """Reasons not to rely on the result, one line each."""
        return self._inner.warnings

    @property
    def energy(self) -> float:
        """Total potential, loads included."""
        return self._inner.energy

    @property
    def elastic_energy(self) -> float:
        """Energy of bending, with the energy "shell" of bending and stretching: the potential without that of loads."""
        return self._inner.elastic_energy

    @property
    def energy_model(self) -> EnergyModel:
        """The energy minimised: "fishbone", "sadowsky", "wunderlich" or "shell"."""
        return self._inner.energy_model

    @property
    def twist(self) -> float:
        """Total torsion ∫ ω_η du [rad], the only quantity that shows whole extra turns of the end."""
        return self._inner.twist

    @property
    def stable(self) -> bool | None:
        """Whether the equilibrium is a local minimum; None where the second variation does not decide.

        It does not decide where it is zero along a mode, and where a part of the belt is flat under stress: there the
        slope of the ribs costs no energy, and the count with square ribs does not show a loss of stability along
        slanted ones.
        """
        return self._inner.stable

    @property
    def negative_modes(self) -> int | None:
        """Number of independent motions along which the energy falls, of those that supports and active ribs leave."""
        return self._inner.negative_modes

    @property
    def zero_modes(self) -> int | None:
        """Number of independent motions along which the energy stays, to second order."""
        return self._inner.zero_modes

    def refined(self, elements: int) -> Equilibrium | None:
        """The same equilibrium, stable or not, with another number of elements; None where none is found.

        Errors: `InvalidArgument` where a scenario may not have this number of elements.
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
        """The `count` lowest modes, rising; fewer where the mesh has fewer.

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
        """The residuals of the discrete equations."""
        return Residuals(*self._inner.residuals)

    @property
    def error(self) -> MeshError | None:
        """The estimated error by the mesh, by one Newton step on a mesh twice as fine.

        None of a solve that has not converged by the intrinsic method, and where the finer mesh has no equilibrium next
        to this one.
        """
        error = self._inner.error
        return None if error is None else MeshError(*error)

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
        """Torsion ω_η: −β ω_ζ, with the energy "shell" m − β ω_ζ, where m is the twist of the rib.

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
        """Principal curvature κ₁ of greatest magnitude of the surface at the spine.

        Of the developable energies it is −ω_ζ (1 + β²), across the rib, and the other principal curvature is zero.

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
        """The point of the spine farthest along the scenario's `bulge`."""
        u, position = self._inner.highest_point
        return HighestPoint(u, np.array(position))

    @property
    def side(self) -> int:
        """The side to which the belt bulges: 1 along the scenario's `bulge`, -1 against it, 0 where it lies on neither.

        It is the sign of the mean distance of the spine along `bulge` from the straight lines between the places where
        supports hold a position; with fewer than two such places, from the tangent at that place, or at the start. A
        mean distance within 1e-4 U is 0, and a belt that no support holds has no side.
        """
        return self._inner.side

    @property
    def least_bend_radius(self) -> BendRadius | None:
        """The least bend radius of the whole belt, often at an edge; None where nothing bends.

        The radius of developable belts is a property of the mesh, because ribs all but meet on an edge where the bend
        changes sign. `bend_radius` converges.

        With `energy = "shell"` it converges. It is the least at least V/5 away from clamps: from both ends (of a closed
        belt, from its seam), stiffeners, corners, and places where the bend may jump, as at supports that hold a
        rotation. Nearer, at a clamp's corners, a sheet is bent far more, and the model does not know it. None also
        where no part of the board is so far from clamps.
        """
        least = self._inner.least_bend_radius
        return None if least is None else BendRadius(*least)

    @property
    def least_spine_radius(self) -> SpineRadius | None:
        """The least bend radius on the spine; None where nothing bends."""
        least = self._inner.least_spine_radius
        return None if least is None else SpineRadius(*least)

    @property
    def bend_radius(self) -> BendRadii:
        """The least bend radius on the spine, and the radii exceeded on 99.9, 99 and 95 % of the board's area.

        The whole area counts: stiffeners, and corners that no rib reaches, have an infinite radius.
        """
        return BendRadii(self.least_spine_radius, AreaRadii(*self._inner.area_radii))

    def area_below(self, radius: float) -> float:
        """The share of the board's area with a bend radius below `radius`, between 0 and 1.

        Errors: `InvalidArgument` unless the radius is positive and finite.
        """
        if not (np.ndim(radius) == 0 and 0.0 < radius < math.inf):
            raise InvalidArgument(f"radius: found {radius!r}, allowed a positive finite number")
        return self._inner.area_below(radius)

    @property
    def strain(self) -> Strain | None:
        """The strain of the middle plane and of every layer; None unless the energy is "shell"."""
        strain = self._inner.strain
        if strain is None:
            return None
        membrane, layers = strain
        return Strain(_extremes(*membrane), [_extremes(*layer) for layer in layers])

    def strain_at(self, places: npt.ArrayLike) -> PointStrain | None:
        """Curvature and strain at places (u, v) of the flat board, u along the spine and v square to it.

        None unless the energy is "shell". Stiffeners have none; NaN off the board. Nearer than V/5 to a clamp the
        values have not been compared with shells.

        Shapes: (m, 2).
        Errors: `InvalidArgument` for another shape.
        """
        found = self._inner.strain_at(_flat_points("places", places))
        if found is None:
            return None
        tensors = np.array([[0, 1], [1, 2]])
        curvature, membrane, layers = found
        return PointStrain(curvature[:, tensors], membrane[:, tensors], layers)

    @property
    def rib_margin(self) -> RibMargin:
        """The least slack of the rib bound; ribs cross inside the belt where it is negative.

        Source: Eq. (33).
        """
        return RibMargin(*self._inner.rib_margin)

    @property
    def crosses_itself(self) -> tuple[float, float] | None:
        """Arc lengths of the first two places that pass through each other; None where the belt stays clear of itself.

        The model has no contact, so an equilibrium may pass through itself. A belt that only touches itself or lies on
        itself does not cross. Crossings within the sagitta of an element, |κ₁| h²/8, are not resolved.
        """
        return self._inner.crosses_itself

    @property
    def links(self) -> Floats:
        """Force of each link on the belt at its `to`, in the order of the scenario; the opposite acts at its `from`.

        A component is NaN where the shape does not determine it.

        Shapes: (m, 3).
        """
        return np.array(self._inner.links).reshape(-1, 3)

    @property
    def half_turns(self) -> int | None:
        """Signed half turns with which a closed belt ended; None for an open belt."""
        return self._inner.half_turns

    def reaction(self, support: Place) -> Reaction:
        """Force and moment of a support on the belt.

        The support is named by its index (int) or its place ("start", "end", or an arc length as a float).

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
        """The distance that a support may move before the belt loses its stability; None where it is above `reach`.

        `direction` is [displacement in U, left world-axes rotation], of any length. Without a direction the nearest
        pose is sought: first along the six axes, either way, then along the normal of the boundary of stability. The
        pose found is a local minimum of the distance. A belt that is drawn straight has no slack, but has not lost its
        stability. A loss of stability that is regained within a twentieth of the reach may be missed. The support is
        named as for `reaction`, and must hold a position and a rotation.

        Shapes: direction (6,).
        Errors: `NoSupport`; `NoMargin` unless the equilibrium is stable, and where it can be followed only a part of
        `reach` without losing its stability (without a direction only if no direction finds a loss);
        `InvalidArgument` for an invalid direction or reach.
        """
        if not (np.ndim(reach) == 0 and 0.0 < reach <= MAX_REACH):
            raise InvalidArgument(f"reach: found {reach!r}, allowed above 0 and up to {MAX_REACH:g}, in U and rad")
        along = None if direction is None else _direction(direction)
        margin = self._inner.margin(self._support_index(support), along, reach)
        if margin is None:
            return None
        distance, towards, is_fold, position, rotation, confirmed = margin
        return SnapMargin(distance, np.array(towards), is_fold, np.array(position), np.array(rotation), confirmed)

    def sensitivity(self) -> Sensitivity:
        """The derivatives of the equilibrium by the parameters of the scenario; factorised at the first call.

        Errors: `NoSensitivity` unless the equilibrium has converged to a minimum that its supports determine.
        """
        if self._sensitivity is None:
            self._sensitivity = Sensitivity(self._inner)
        return self._sensitivity

    def jacobian(self, support: Place) -> Floats:
        """Derivatives of the spine's positions by the motion of a support, which is named as for `reaction`.

        The last axis is [translation, left world-axes rotation about the support point]; for components that the
        support leaves free the derivatives are 0. `sensitivity` has other derivatives, and single directions at less
        cost.

        Shapes: (n, 3, 6).
        Errors: `NoSupport`; `NoSensitivity` unless the equilibrium has converged to a minimum that its supports
        determine.
        """
        return self.sensitivity().jacobian(self._support_index(support))

    def _support_index(self, support: Place) -> int:
        places = [at for at, _, _ in self._inner.reactions]
        return support_index(support, places, float(self.u[-1]))

    def _across(self, n_across: int) -> int:
        most = MAX_POINTS // len(self.u)
        if not MIN_ACROSS <= n_across <= most:
            raise InvalidArgument(f"n_across: found {n_across}, allowed {MIN_ACROSS} to {most} on {len(self.u)} nodes")
        return n_across

    def surface(self, n_across: int = 9) -> Floats:
        """Points of the surface, on every rib from the −ζ edge to the +ζ edge.

        Shapes: (n, n_across, 3).
        Errors: `InvalidArgument` where n_across is below 2, or where all nodes have more than 5 million points.
        """
        return self._inner.surface(self._across(n_across))

    def surface_triangles(self, n_across: int = 9) -> NDArray[np.int64]:
        """Triangles of `surface`: indices of its points in order, counter-clockwise about +ξ.

        They are the same for all shapes with as many nodes, as a display wants them. `mesh` has the whole board: the
        corners beyond the last ribs, too, and of a closed belt its joint.

        Shapes: (2 (n − 1)(n_across − 1), 3).
        Errors: as `surface`.
        """
        points = np.arange(len(self.u) * self._across(n_across)).reshape(len(self.u), n_across)
        corners = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
        a, b, c, d = (corner.ravel() for corner in corners)
        triangles = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1)
        return triangles.reshape(-1, 3)

    def mesh(self, n_across: int = 9, *, fixed: bool = False) -> tuple[Floats, NDArray[np.int64]]:
        """Vertices and triangles of the surface.

        They cover the whole board, and their numbers depend on the shape. With `fixed` they are those of `surface` and
        `surface_triangles`: all shapes with as many nodes have the same triangles, so that a display updates the
        vertices alone.

        Shapes: (p, 3) and (m, 3).
        Errors: as `surface`.
        """
        if fixed:
            return self.surface(n_across).reshape(-1, 3), self.surface_triangles(n_across)
        return self._inner.mesh(self._across(n_across))

    def outline(self, tolerance: float | None = None) -> Outline:
        """The outline of the flat board, exact except on arcs: chords are within `tolerance` of their arc.

        The default tolerance is a thousandth of the width, the least a millionth. A closed belt is cut open at its
        start.

        Errors: `InvalidArgument` for another tolerance.
        """
        width = float(self.scenario.to_dict()["belt"]["width"])
        if tolerance is None:
            tolerance = 1e-3 * width
        if not MIN_TOLERANCE * width <= tolerance < math.inf:
            least = f"a finite number from {MIN_TOLERANCE * width:g}, a millionth of the width"
            raise InvalidArgument(f"tolerance: found {tolerance}, allowed {least}")
        return Outline(*self._inner.outline(tolerance))

    def flat_spine(self) -> Floats:
        """Places of the nodes in the flat board, coordinates (y, z).

        Shapes: (n, 2).
        """
        return self._inner.flat_spine()

    def flat_ribs(self) -> Floats:
        """The ends of the nodes' ribs in the flat board, on the −ζ side and on the +ζ side, coordinates (y, z).

        Shapes: (n, 2, 2).
        """
        return self._inner.flat_ribs()

    def flat_mesh(self, n_across: int = 9) -> tuple[Floats, NDArray[np.int64]]:
        """Vertices (y, z) and triangles of the flat board, in the order of the triangles of `mesh`.

        Shapes: (p, 2) and (m, 3). For a closed belt the vertices of the seam come twice: at the start and at the end.
        Errors: as `surface`.
        """
        return self._inner.flat_mesh(self._across(n_across))

    def material_points(self, flat: npt.ArrayLike) -> Floats:
        """The points (y, z) of the flat board on the bent belt; NaN for points off the board.

        Shapes: (m, 2) to (m, 3).
        Errors: `InvalidArgument` for another shape.
        """
        return self._inner.material_points(_flat_points("flat", flat))

    def rib_feet(self, flat: npt.ArrayLike) -> Floats:
        """Arc length u of the ribs through points (y, z) of the flat board; NaN for points off the board.

        Shapes: (m, 2) to (m,).
        Errors: `InvalidArgument` for another shape.
        """
        return self._inner.rib_feet(_flat_points("flat", flat))

    @property
    def stiffeners(self) -> list[tuple[float, float]]:
        """First and last arc length of each stiffener, in pieces where supports or loads lie in between."""
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
    """Finds an equilibrium of a scenario; a failed solve returns an `Equilibrium` too, see `Equilibrium.status`.

    The search starts from an arch on the side of the scenario's `bulge`, or only from the shape `start`: bend and rib
    slope at equal steps of the arc length, from the start of the belt to its end. Other threads run meanwhile, and
    Ctrl-C ends the solve.

    Shapes: start (m,) and (m,), m at least 2.
    Errors: `NotConverged`, which carries the equilibrium, where `strict` is true and the solve fails;
    `InvalidArgument` where `scenario` is no scenario or `start` no shape.
    """
    core = core_of(scenario)
    shape = None if start is None else _shape(start)
    inner = _core.solve(core) if shape is None else _core.solve_from(core, *shape)
    equilibrium = Equilibrium(scenario, inner)
    if strict and equilibrium.status != "converged":
        raise NotConverged(equilibrium)
    return equilibrium


def _shape(start: tuple[npt.ArrayLike, npt.ArrayLike]) -> tuple[list[float], list[float]]:
    """The bend and rib slope of a start, checked."""
    try:
        bend, slope = (np.asarray(field, dtype=np.float64) for field in start)
    except (TypeError, ValueError):
        raise InvalidArgument("start: found no pair of arrays, allowed bend and rib slope") from None
    if bend.shape != slope.shape or bend.ndim != 1 or len(bend) < 2:  # noqa: PLR2004 - a start and an end
        raise InvalidArgument(f"start: found shapes {bend.shape} and {slope.shape}, allowed (m,) twice, m at least 2")
    if not (np.isfinite(bend).all() and np.isfinite(slope).all()):
        raise InvalidArgument("start: found values that are not finite, allowed finite numbers")
    return bend.tolist(), slope.tolist()


def solve_many(
    scenarios: Iterable[Scenario], *, progress: Callable[[int, int], object] | None = None
) -> list[Equilibrium]:
    """Finds an equilibrium of each of many scenarios on all cores, in the order given.

    A failed solve does not affect the others. `progress(solved, all)` is called from the calling thread during the
    solves. Other threads run meanwhile, and Ctrl-C ends the solves. The environment variable RAYON_NUM_THREADS limits
    the number of threads.

    Errors: `InvalidArgument` where one of `scenarios` is no scenario; `RuntimeError` where the system gives no more
    threads; any error that `progress` raises.
    """
    scenarios = list(scenarios)
    found = _core.solve_many([core_of(scenario) for scenario in scenarios], progress)
    return [Equilibrium(scenario, inner) for scenario, inner in zip(scenarios, found, strict=True)]


def core_of(scenario: Scenario) -> _core.Scenario:
    """The core's scenario of a `Scenario`.

    Errors: `InvalidArgument` where `scenario` is no `Scenario`.
    """
    inner = getattr(scenario, "_inner", None)
    if not isinstance(inner, _core.Scenario):
        raise InvalidArgument(f"scenario: found {type(scenario).__name__}, allowed a Scenario, as fishbone.load gives")
    return inner


def _direction(direction: npt.ArrayLike) -> list[float]:
    vector = np.asarray(direction, dtype=np.float64)
    if vector.shape != (6,) or not np.isfinite(vector).all() or not vector.any():
        raise InvalidArgument(f"direction: found {direction!r}, allowed six finite numbers, not all 0")
    numbers: list[float] = vector.tolist()
    return numbers


def _extremes(largest: list[float], area: list[float]) -> StrainExtremes:
    value, u, v = largest
    return StrainExtremes(value, u, v, AreaStrains(*area))


def _flat_points(name: str, of: npt.ArrayLike) -> list[list[float]]:
    points = np.asarray(of, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:  # noqa: PLR2004 - (y, z)
        raise InvalidArgument(f"{name}: found an array of shape {points.shape}, allowed (m, 2)")
    rows: list[list[float]] = points.tolist()
    return rows
