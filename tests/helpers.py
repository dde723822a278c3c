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
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipj, ellipk, elliprd, elliprf

import fishbone as fb

Array = npt.NDArray[np.float64]
Json = dict[str, Any]
Energy = Literal["fishbone", "sadowsky", "wunderlich"]

ENERGIES: tuple[Energy, ...] = ("fishbone", "sadowsky", "wunderlich")
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
    """One `[[supports]]` table; what is None is left out, that is: free, or the default."""
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
    """A straight belt held by `supports`; what is None is left to the package's default."""
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
