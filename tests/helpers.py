"""Scenarios by the public contract, and reference computations written from the model, not from the code.

Nothing in here calls the package except `solve`, so that every expected value is independent of it.
"""

from __future__ import annotations

import functools
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_bvp, solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipj, ellipk, elliprd, elliprf

import fishbone as fb

Array = npt.NDArray[np.float64]
Nodes = npt.NDArray[np.intp]
Json = dict[str, Any]
Energy = Literal["fishbone", "sadowsky", "wunderlich", "shell"]

ENERGIES: tuple[Energy, ...] = ("fishbone", "sadowsky", "wunderlich")
"""Energies of developable belts."""
SHELL_DATA = Path(__file__).parent / "data" / "shell"

ORIGIN = (0.0, 0.0, 0.0)
GAUSS_POINTS = (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0)


# ------------------------------------------------------------------------------------------------ scenarios


def numbers(values: Any) -> list[float]:
    """Plain floats, so that a scenario is JSON whatever it was made from."""
    return [float(v) for v in np.asarray(values, dtype=np.float64)]


def support(
    at: str,
    position: Any = None,
    rotation: Any = None,
    square_rib: bool | None = None,
) -> Json:
    """One `[[supports]]` table; fields that are None are left out: free, or the default."""
    table: Json = {"at": at}
    if position is not None:
        table["position"] = numbers(position)
    if rotation is not None:
        table["rotation"] = numbers(rotation)
    if square_rib is not None:
        table["square_rib"] = square_rib
    return table


def belt(
    supports: list[Json],
    *,
    energy: Energy | None = None,
    length: float = 1.0,
    width: float = 0.1,
    rigidity: float | None = 1.0,
    elements: int | None = None,
    bulge: Any = None,
) -> Json:
    """A straight belt held by `supports`; fields that are None have the package's default."""
    board: Json = {"width": width, "segments": [{"kind": "straight", "length": length}]}
    if rigidity is not None:
        board["rigidity"] = rigidity
    scenario: Json = {"belt": board, "supports": supports}
    if energy is not None:
        scenario["energy"] = energy
    solver: Json = {}
    if elements is not None:
        solver["elements"] = elements
    if bulge is not None:
        solver["bulge"] = numbers(bulge)
    if solver:
        scenario["solver"] = solver
    return scenario


def clamped(
    end_position: Any,
    end_rotation: Any = ORIGIN,
    *,
    start_position: Any = ORIGIN,
    start_rotation: Any = ORIGIN,
    square_rib: bool | None = None,
    energy: Energy | None = None,
    length: float = 1.0,
    width: float = 0.1,
    rigidity: float | None = 1.0,
    elements: int | None = None,
    bulge: Any = None,
) -> Json:
    """A straight belt clamped at both ends."""
    return belt(
        [
            support("start", start_position, start_rotation, square_rib),
            support("end", end_position, end_rotation, square_rib),
        ],
        energy=energy,
        length=length,
        width=width,
        rigidity=rigidity,
        elements=elements,
        bulge=bulge,
    )


def example1(energy: Energy | None = None, **options: Any) -> Json:
    """The source's first example, Eq. (44)-(46)."""
    return clamped((0.0, 0.5, 0.1), energy=energy, **options)


def example2(energy: Energy | None = None, **options: Any) -> Json:
    """The source's second example, Eq. (47)-(50): η(U) and ζ(U) are turned by 30° about x."""
    return clamped((0.0, 0.7, 0.0), (math.pi / 6.0, 0.0, 0.0), energy=energy, **options)


@functools.cache
def _solve_once(text: str) -> fb.Equilibrium:
    return fb.solve(fb.Scenario.from_dict(json.loads(text)))


def solve_any(scenario: Json) -> fb.Equilibrium:
    """The equilibrium, solved once per test session, whatever its status."""
    return _solve_once(json.dumps(scenario, sort_keys=True))


def solve(scenario: Json) -> fb.Equilibrium:
    """The converged equilibrium, solved once per test session."""
    equilibrium = solve_any(scenario)
    assert equilibrium.status == "converged", f"{equilibrium.status}: {scenario}"
    return equilibrium


def result(equilibrium: fb.Equilibrium) -> Json:
    """The result schema's dictionary."""
    as_dict: Json = equilibrium.to_dict()
    return as_dict


def internal(equilibrium: fb.Equilibrium) -> tuple[Array, Array]:
    """Internal force and moment at the nodes.

    Shapes: (n, 3), (n, 3)
    """
    fields = result(equilibrium)["internal"]
    return np.asarray(fields["force"], dtype=np.float64), np.asarray(fields["moment"], dtype=np.float64)


def end_wrench(equilibrium: fb.Equilibrium, at: Literal["start", "end"]) -> Array:
    """Force and moment of a support on the belt in one vector.

    Shapes: (6,)
    """
    force, moment = equilibrium.reaction(at)
    return np.concatenate([np.asarray(force), np.asarray(moment)])


# ---------------------------------------------------------------------------------------- rotations and poses


def rotation_matrix(rotation_vector: Any) -> Array:
    """exp([rotation]×), by SciPy.

    Shapes: (3, 3)
    """
    return np.asarray(Rotation.from_rotvec(numbers(rotation_vector)).as_matrix(), dtype=np.float64)


def rotation_vector(matrix: Array) -> Array:
    """The logarithm of a rotation matrix.

    Shapes: (3,)
    """
    return np.asarray(Rotation.from_matrix(matrix).as_rotvec(), dtype=np.float64)


def skew(w: Array) -> Array:
    """[w]×, so that skew(w) @ r = w × r."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def constant_twist_pose(bend: float, slope: float, length: float) -> tuple[Array, Array]:
    """End pose of a belt of constant bend and rib slope, from the natural pose.

    With ω = (0, −β ω_ζ, ω_ζ) constant, T' = T [[ [ω]×, e_η ], [0, 0]], so T(U) = exp(U [[ [ω]×, e_η ], [0, 0]]).

    Shapes: position (3,), frame (3, 3)
    """
    twist = np.zeros((4, 4))
    twist[:3, :3] = skew(np.array([0.0, -slope * bend, bend]))
    twist[1, 3] = 1.0
    pose = np.asarray(expm(length * twist), dtype=np.float64)
    return pose[:3, 3], pose[:3, :3]


def integrate_pose(u: Array, bend: Array, slope: Array) -> tuple[Array, Array]:
    """Positions and frames at the nodes from the natural pose, by an adaptive Runge-Kutta method.

    Solves x' = η, R' = R [ω]×, ω = (0, −β ω_ζ, ω_ζ) with bend and slope linear between the nodes. This knows nothing of
    Magnus steps: it differs from the package's poses by the package's discretisation error alone.

    Shapes: u, bend, slope (n,) -> position (n, 3), frame (n, 3, 3)
    """

    def rate(s: float, state: Array) -> Array:
        w = np.interp(s, u, bend)
        b = np.interp(s, u, slope)
        frame = state[3:].reshape(3, 3)
        omega = np.array([0.0, -b * w, w])
        return np.concatenate([frame[:, 1], (frame @ skew(omega)).ravel()])

    start = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    path = solve_ivp(
        rate,
        (float(u[0]), float(u[-1])),
        start,
        method="DOP853",
        t_eval=u,
        rtol=1e-10,
        atol=1e-12,
        max_step=float(np.max(np.diff(u))),
    )
    states = np.asarray(path.y, dtype=np.float64).T
    return states[:, :3], states[:, 3:].reshape(-1, 3, 3)


# ------------------------------------------------------------------------------------------- energy of a shape


def width_factor(y: Array) -> Array:
    """g(y) = artanh(y)/y of the Wunderlich energy, with its series near 0 (MODEL §2)."""
    small = np.abs(y) < 1e-3
    safe = np.where(small, 0.5, np.minimum(np.abs(y), np.nextafter(1.0, 0.0)))
    series = 1.0 + y**2 / 3.0 + y**4 / 5.0
    return np.asarray(np.where(small, series, np.arctanh(safe) / safe), dtype=np.float64)


def energy_by_quadrature(
    energy: Energy, u: Array, bend: Array, slope: Array, *, width: float, rigidity: float
) -> float:
    """Elastic energy of piecewise-linear bend and slope, two Gauss points per element (MODEL §2, §3).

    Density: R_f/2 κ₁² times sqrt(1+β²) (`fishbone`, Eq. (34)), 1 (`sadowsky`) or artanh(y)/y, y = β' V/2
    (`wunderlich`),
    with κ₁ = −ω_ζ (1+β²).
    """
    step = np.diff(u)
    y = np.diff(slope) / step * width / 2.0
    total = 0.0
    for c in GAUSS_POINTS:
        w = (1.0 - c) * bend[:-1] + c * bend[1:]
        b = (1.0 - c) * slope[:-1] + c * slope[1:]
        density = 0.5 * rigidity * (w * (1.0 + b**2)) ** 2
        if energy == "fishbone":
            density = density * np.sqrt(1.0 + b**2)
        elif energy == "wunderlich":
            density = density * width_factor(y)
        total += float(np.sum(0.5 * step * density))
    return total


# ------------------------------------------------------------------------------------------------ planar elastica


@dataclass(frozen=True)
class Elastica:
    """First symmetric buckled state of a planar inextensible belt, clamped at both ends, in closed form.

    Let ϑ be the angle of the tangent from +y towards +x: x' = sin ϑ, y' = cos ϑ, and let the clamps push with P along
    y.
    Balance of moments, R_f ϑ'' = −P sin ϑ, with ϑ(0) = ϑ(U/2) = ϑ(U) = 0, is a pendulum over one whole period:

        λ = sqrt(P/R_f) = 4 K(k)/U,   k = sin(ϑ_max/2),
        sin(ϑ/2) = k sn(λu),   ϑ' = 2 k λ cn(λu),
        x(u) = (2k/λ) (1 − cn λu),   y(u) = (2 E(am λu) − λu)/λ,   E(am λu) = ∫₀^{λu} dn².

    At u = U: y(U) = d = U (2 E/K − 1), which gives k. At u = U/2: height x = 4k/λ = kU/K. Energy:
    (R_f/2) ∫ ϑ'² = 2 R_f k² λ ∫₀^{4K} cn² = 8 R_f λ (E − (1−k²) K) = (32 R_f/U) K (E − (1−k²) K), because
    ∫₀^{K} cn² = (E − (1−k²) K)/k².

    The frame turns about +z by −ϑ, so that ω_ζ = −ϑ' = −2kλ cn(λu). The clamp at the end pushes with (0, −P, 0) and
    turns
    with (0, 0, R_f ω_ζ(U)) = (0, 0, −2 k λ R_f).

    Pinned ends (free to turn) make half a wave, λ = 2K/U with the same k(d): a quarter of the energy and of the force.
    """

    distance: float
    length: float = 1.0
    rigidity: float = 1.0

    @functools.cached_property
    def m(self) -> float:
        """k², from 2 E/K − 1 = d/U."""
        ratio = self.distance / self.length
        return float(brentq(lambda m: 2.0 * ellipe(m) / ellipk(m) - 1.0 - ratio, 1e-14, 0.9999, xtol=1e-15))

    @property
    def k(self) -> float:
        return math.sqrt(self.m)

    @property
    def rate(self) -> float:
        """λ = 4K/U."""
        return 4.0 * float(ellipk(self.m)) / self.length

    @property
    def thrust(self) -> float:
        """P."""
        return self.rigidity * self.rate**2

    @property
    def energy(self) -> float:
        k_complete, e_complete = float(ellipk(self.m)), float(ellipe(self.m))
        return 32.0 * self.rigidity / self.length * k_complete * (e_complete - (1.0 - self.m) * k_complete)

    @property
    def height(self) -> float:
        return self.k * self.length / float(ellipk(self.m))

    @property
    def end_moment(self) -> float:
        """R_f ω_ζ(U), about +z."""
        return -2.0 * self.k * self.rate * self.rigidity

    def bend(self, u: Array) -> Array:
        """ω_ζ(u) = −2kλ cn(λu)."""
        _, cn, _, _ = ellipj(self.rate * u, self.m)
        return -2.0 * self.k * self.rate * np.asarray(cn, dtype=np.float64)

    def position(self, u: Array) -> Array:
        """The closed form. E(am t) by half-waves of am and Carlson's integrals: E(φ) = s R_F(c², Δ², 1) − k² s³/3
        R_D(c², Δ², 1)
        with s, c, Δ = sn, cn, dn. SciPy's `ellipeinc` is off by 1e-1 at isolated arguments (seen at am(3K/4)).

        Shapes: (n,) -> (n, 3)
        """
        t = self.rate * u
        half_wave = 2.0 * float(ellipk(self.m))
        turns = np.round(t / half_wave)
        sn, cn, dn, _ = ellipj(t - turns * half_wave, self.m)
        arguments = (cn**2, dn**2, 1.0)
        remainder = sn * elliprf(*arguments) - self.m * sn**3 / 3.0 * elliprd(*arguments)
        second_kind = 2.0 * turns * float(ellipe(self.m)) + remainder
        x = 2.0 * self.k / self.rate * (1.0 - np.where(turns % 2 == 0, cn, -cn))
        y = (2.0 * second_kind - t) / self.rate
        return np.column_stack([x, y, np.zeros_like(x)])


# --------------------------------------------------------------------------------------------- reading a shape


def spine(equilibrium: fb.Equilibrium) -> CubicHermiteSpline:
    """The spine through the nodes with the frames' own tangents: fourth order, like the poses."""
    return CubicHermiteSpline(equilibrium.u, equilibrium.position, equilibrium.frame[:, :, 1], axis=0)


def highest_point(equilibrium: fb.Equilibrium, direction: Any = (1.0, 0.0, 0.0)) -> Array:
    """The spine's farthest point along `direction`, between the nodes too.

    Shapes: (3,)
    """
    axis = np.asarray(direction, dtype=np.float64)
    height = CubicHermiteSpline(equilibrium.u, equilibrium.position @ axis, equilibrium.frame[:, :, 1] @ axis)
    stationary = np.asarray(height.derivative().roots(extrapolate=False), dtype=np.float64)
    candidates = np.concatenate([stationary[np.isfinite(stationary)], equilibrium.u[[0, -1]]])
    highest = candidates[int(np.argmax(height(candidates)))]
    return np.asarray(spine(equilibrium)(highest), dtype=np.float64)


def shell(name: str) -> Json:
    """One shell reference, see data/README.md."""
    data: Json = json.loads((SHELL_DATA / f"{name}.json").read_text())
    return data


def shell_scenario(name: str, energy: Energy) -> Json:
    """The belt of a shell reference, solver settings left at their defaults."""
    data = shell(name)
    return clamped(
        data["end_position"],
        rotation_vector(np.array(data["end_rotation_matrix"])),
        energy=energy,
        length=data["length"],
        width=data["width"],
        rigidity=data["rigidity"],
    )


THICKNESS = 7e-4
"""Thickness of the sheet in the source's experiment, in U."""


def thick(scenario: Json, thickness: float = THICKNESS, poisson: float = 0.34) -> Json:
    """The scenario with a thickness, and the energy that knows it."""
    return {**scenario, "energy": "shell", "belt": {**scenario["belt"], "thickness": thickness, "poisson": poisson}}


def thick_shell_scenario(name: str) -> Json:
    """The strip of finite thickness of a shell reference, on the shell's side."""
    data = shell(name)
    segments = [
        arc(length, k) if k else straight(length) for length, k in data.get("segments", [[data["length"], 0.0]])
    ]
    highest = max(data["position"], key=lambda point: abs(point[0]))
    end = support("end", data["end_position"], rotation_vector(np.array(data["end_rotation_matrix"])))
    belt = board(
        segments,
        [support("start", ORIGIN, ORIGIN), end],
        width=data["width"],
        rigidity=data["rigidity"],
        bulge=(math.copysign(1.0, highest[0]), 0.0, 0.0),
    )
    return thick(belt, data["thickness"], data["poisson"])


def rms_distance(a: Array, b: Array) -> float:
    """Root of the mean squared distance of corresponding points.

    Shapes: (n, 3), (n, 3)
    """
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1))))


def distance_to_shell(name: str, energy: Energy) -> float:
    """RMS distance of the belt's spine to the shell's centre line, over the shell's 101 points."""
    data = shell(name)
    curve = spine(solve(shell_scenario(name, energy)))
    return rms_distance(np.asarray(curve(np.array(data["u"]))), np.array(data["position"]))


def observed_orders(errors: Array) -> Array:
    """log₂ of the ratio of successive errors, the element number doubling from one to the next."""
    return np.asarray(np.log2(errors[:-1] / errors[1:]), dtype=np.float64)


# ------------------------------------------------------------------------- boards of several segments, loads, links

SAME_PLACE = 1e-9


def straight(length: float, **options: Any) -> Json:
    """A straight strip; `natural_bend` and `rigidity` are its options."""
    return {"kind": "straight", "length": length, **options}


def arc(length: float, curvature: float, **options: Any) -> Json:
    """A strip curved in its plane: positive turns η towards ζ."""
    return {"kind": "arc", "length": length, "curvature": curvature, **options}


def corner(angle: float) -> Json:
    """A bend of the board: positive turns η towards ζ."""
    return {"kind": "corner", "angle": angle}


def rigid(length: float) -> Json:
    """A stiffener."""
    return {"kind": "rigid", "length": length}


def board(
    segments: list[Json],
    supports: list[Json],
    *,
    energy: Energy = "wunderlich",
    width: float = 0.1,
    rigidity: float | None = 1.0,
    elements: int | None = None,
    bulge: Any = None,
    gravity: Any = None,
    points: list[Json] | None = None,
    links: list[Json] | None = None,
    **fields: Any,
) -> Json:
    """A belt of any segments under any loads; `fields` go to `[belt]`."""
    scenario = belt(supports, energy=energy, width=width, rigidity=rigidity, elements=elements, bulge=bulge)
    scenario["belt"].update(fields, segments=segments)
    loads: Json = {}
    if gravity is not None:
        loads["gravity"] = numbers(gravity)
    if points is not None:
        loads["points"] = points
    if loads:
        scenario["loads"] = loads
    if links is not None:
        scenario["links"] = links
    return scenario


def total_length(scenario: Json) -> float:
    return float(sum(segment.get("length", 0.0) for segment in scenario["belt"]["segments"]))


def place(scenario: Json, at: str | float) -> float:
    """The arc length of a place: a number, "start" or "end"."""
    if isinstance(at, str):
        return {"start": 0.0, "end": total_length(scenario)}[at]
    return float(at)


def node_at(equilibrium: fb.Equilibrium, u: float) -> int:
    """The last node at u: after a joint, where nodes are repeated."""
    nodes = np.flatnonzero(np.abs(equilibrium.u - u) < SAME_PLACE)
    assert nodes.size > 0, f"no node at {u}"
    return int(nodes[-1])


def joints(equilibrium: fb.Equilibrium) -> Nodes:
    """Nodes k whose next node is at the same place: the belt before and after a joint."""
    return np.flatnonzero(np.diff(equilibrium.u) < SAME_PLACE)


def elements_of(equilibrium: fb.Equilibrium) -> Nodes:
    """First nodes of the elements, joints left out."""
    return np.flatnonzero(np.diff(equilibrium.u) >= SAME_PLACE)


def spine_at(equilibrium: fb.Equilibrium, places: Any) -> Array:
    """The spine by a cubic Hermite in every element, so that it may have joints.

    Shapes: (m,) -> (m, 3)
    """
    u, x, tangent = equilibrium.u, equilibrium.position, equilibrium.frame[:, :, 1]
    first = elements_of(equilibrium)
    at = np.atleast_1d(np.asarray(places, dtype=np.float64))
    k = first[np.clip(np.searchsorted(u[first], at, side="right") - 1, 0, first.size - 1)]
    h = (u[k + 1] - u[k])[:, None]
    t = (at - u[k])[:, None] / h
    return np.asarray(
        (1.0 + 2.0 * t) * (1.0 - t) ** 2 * x[k]
        + t * (1.0 - t) ** 2 * h * tangent[k]
        + t**2 * (3.0 - 2.0 * t) * x[k + 1]
        - t**2 * (1.0 - t) * h * tangent[k + 1],
        dtype=np.float64,
    )


def spine_integrals(equilibrium: fb.Equilibrium) -> Array:
    """∫ x du over every element by the same Hermite: h/2 (x₀ + x₁) + h²/12 (η₀ − η₁); nothing over a joint.

    Shapes: (n - 1, 3)
    """
    h = np.diff(equilibrium.u)[:, None]
    x, tangent = equilibrium.position, equilibrium.frame[:, :, 1]
    return np.asarray(h / 2.0 * (x[:-1] + x[1:]) + h**2 / 12.0 * (tangent[:-1] - tangent[1:]), dtype=np.float64)


def load_points(equilibrium: fb.Equilibrium, scenario: Json) -> list[tuple[float, Array, Array]]:
    """Place, force and point of application x + Rℓ of the point loads."""
    loads = []
    for point in scenario.get("loads", {}).get("points", []):
        u = place(scenario, point["at"])
        k = node_at(equilibrium, u)
        lever = np.asarray(point.get("lever", ORIGIN), dtype=np.float64)
        acts_at = equilibrium.position[k] + equilibrium.frame[k] @ lever
        loads.append((u, np.asarray(point["force"], dtype=np.float64), acts_at))
    return loads


def gravity_of(scenario: Json) -> Array:
    return np.asarray(scenario.get("loads", {}).get("gravity") or ORIGIN, dtype=np.float64)


def mass_per_length(equilibrium: fb.Equilibrium, scenario: Json) -> float:
    """`density`, or else what the potential of the result implies: the tests have no numbers of presets."""
    gravity = gravity_of(scenario)
    if not np.any(gravity):
        return 0.0
    if "material" not in scenario["belt"] and "layers" not in scenario["belt"]:
        return float(scenario["belt"].get("density", 0.0))
    potential = equilibrium.energy - equilibrium.elastic_energy
    potential += sum(float(force @ at) for _, force, at in load_points(equilibrium, scenario))
    return float(-potential / (np.sum(spine_integrals(equilibrium), axis=0) @ gravity))


def load_potential(equilibrium: fb.Equilibrium, scenario: Json) -> float:
    """−∫ ρ g·x du − Σ F·(x + Rℓ) (MODEL §2)."""
    weight = mass_per_length(equilibrium, scenario) * gravity_of(scenario)
    hung = sum(float(force @ at) for _, force, at in load_points(equilibrium, scenario))
    return float(-np.sum(spine_integrals(equilibrium), axis=0) @ weight - hung)


def wrench(force: Array, acts_at: Array, moment: Any = ORIGIN) -> Array:
    """Force, and moment about the origin.

    Shapes: (6,)
    """
    return np.concatenate([force, np.asarray(moment, dtype=np.float64) + np.cross(acts_at, force)])


def applied_wrenches(equilibrium: fb.Equilibrium, scenario: Json) -> list[tuple[float, Array]]:
    """Place and wrench about the origin of all supports, links and point loads.

    A link acts with its force at `to` and against it at `from`.
    """
    output = result(equilibrium)
    acting = [(u, wrench(force, at)) for u, force, at in load_points(equilibrium, scenario)]
    for support_ in output["supports"]:
        u = place(scenario, support_["at"])
        position = equilibrium.position[node_at(equilibrium, u)]
        acting.append((u, wrench(np.asarray(support_["force"]), position, support_["moment"])))
    for link, reaction in zip(scenario.get("links", []), output.get("links", []), strict=True):
        for at, sign in ((link["to"], 1.0), (link["from"], -1.0)):
            u = place(scenario, at)
            position = equilibrium.position[node_at(equilibrium, u)]
            acting.append((u, wrench(sign * np.asarray(reaction["force"]), position)))
    return acting


def weight_beyond(equilibrium: fb.Equilibrium, scenario: Json) -> Array:
    """Wrench about the origin of the weight of the belt beyond every node.

    Shapes: (n, 6)
    """
    weight = mass_per_length(equilibrium, scenario) * gravity_of(scenario)
    force = np.diff(equilibrium.u)[:, None] * weight
    moment = np.cross(spine_integrals(equilibrium), weight)
    per_element = np.concatenate([np.hstack([force, moment]), np.zeros((1, 6))])
    return np.asarray(np.cumsum(per_element[::-1], axis=0)[::-1], dtype=np.float64)


def internal_wrenches(equilibrium: fb.Equilibrium) -> Array:
    """Internal force, and moment about the origin, at the nodes.

    Shapes: (n, 6)
    """
    force, moment = internal(equilibrium)
    return np.hstack([force, moment + np.cross(equilibrium.position, force)])


# -------------------------------------------------------------------------------------- planar cantilevers, by SciPy


@dataclass(frozen=True)
class Cantilever:
    """A planar elastica clamped at u = 0 in the natural pose, under its own weight, a tip force and a natural bend.

    Let ψ be the angle by which the frame has turned about +z: x' = −sin ψ, y' = cos ψ, ω_ζ = ψ'. With weight q du along
    −x, force (X, Y) at the tip plus the body lever (a, b) and flexural rigidity R(u) the potential

        ∫ [R/2 (ψ' − k)² + q x] du − X (x + a cos ψ − b sin ψ) − Y (y + a sin ψ + b cos ψ)    (tip values)

    is stationary where

        m' = X cos ψ + Y sin ψ − q (U − u) cos ψ,   m = R (ψ' − k),   ψ(0) = 0,
        m(U) = −X (a sin ψ + b cos ψ) + Y (a cos ψ − b sin ψ).
    """

    weight: float = 0.0
    force: tuple[float, float] = (0.0, 0.0)
    lever: tuple[float, float] = (0.0, 0.0)
    rigidity: tuple[float, float] = (1.0, 1.0)
    natural_bend: float = 0.0
    length: float = 1.0

    @functools.cached_property
    def states(self) -> Any:
        """ψ, m, x, y, energy as functions of u, by collocation (scipy.integrate.solve_bvp)."""
        u = np.linspace(0.0, self.length, 201)
        guess = np.vstack([np.zeros_like(u), np.zeros_like(u), np.zeros_like(u), u, np.zeros_like(u)])
        for share in np.linspace(0.1, 1.0, 10):
            solution = solve_bvp(
                functools.partial(self._rate, share=share),
                functools.partial(self._conditions, share=share),
                u,
                guess,
                tol=1e-9,
                max_nodes=100_000,
            )
            assert solution.success, solution.message
            guess = solution.sol(u)
        return solution.sol

    def _rate(self, u: Array, state: Array, *, share: float) -> Array:
        angle, moment = state[0], state[1]
        rigidity = self.rigidity[0] + (self.rigidity[1] - self.rigidity[0]) * u / self.length
        push, pull = share * self.force[0], share * self.force[1]
        hanging = share * self.weight * (self.length - u)
        return np.vstack(
            [
                moment / rigidity + self.natural_bend,
                (push - hanging) * np.cos(angle) + pull * np.sin(angle),
                -np.sin(angle),
                np.cos(angle),
                0.5 * moment**2 / rigidity,
            ]
        )

    def _conditions(self, start: Array, end: Array, *, share: float) -> Array:
        (push, pull), (a, b) = self.force, self.lever
        cosine, sine = np.cos(end[0]), np.sin(end[0])
        turning = -push * (a * sine + b * cosine) + pull * (a * cosine - b * sine)
        return np.array([start[0], end[1] - share * turning, start[2], start[3], start[4]])

    def position(self, u: Any) -> Array:
        """Shapes: (n,) -> (n, 3)"""
        state = self.states(np.atleast_1d(np.asarray(u, dtype=np.float64)))
        return np.column_stack([state[2], state[3], np.zeros_like(state[2])])

    @property
    def tip(self) -> Array:
        return np.asarray(self.position(self.length)[0], dtype=np.float64)

    @property
    def elastic_energy(self) -> float:
        return float(self.states(self.length)[4])
