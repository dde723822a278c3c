"""Equilibria of the planar inextensible elastica between two clamps: a reference independent of the package.

Length 1, rigidity 1. The belt leaves the origin along +y; at arc length u its tangent is (−sin ϑ, cos ϑ), its bend ϑ',
with ϑ(0) = 0. A pose (x, y, a) is where it ends and ϑ(1) = a, whole turns counted. With the force (X, Y) on the belt of
the clamp at the end,

    E = ½ ∫ ϑ'² du,   ϑ'' = X cos ϑ + Y sin ϑ,   dE = X dx + Y dy + ϑ'(1) da.

Two discretisations that share nothing but this:

- `Planar`, of the energy: ϑ = a u + Σ cᵢ φᵢ(u), the φᵢ' orthonormal Legendre polynomials, so that E = ½ (a² + Σ cᵢ²).
  Equilibria are stationary points of E − X (x(1) − x) − Y (y(1) − y). Branches are followed by pseudo-arclength; folds
  are zeros of the system extended by its null vector; negative modes are those of the Hessian where the end is held.
- `Shot`, of the differential equation: from (ϑ'(0), X, Y) at the start, with the Jacobi fields, which are the
  derivatives by these three. Where a belt has a fold the determinant of the end pose by them is 0; where it is 0 before
  the end there is a conjugate point, and there are as many of these as negative modes.

Euler's loads: a straight strut under the dead thrust P whose far end is held square and slides along y only. With the
force X across, linear: ϑ'' + k² ϑ = X, k² = P, ϑ(0) = ϑ(1) = ∫ ϑ = 0. ϑ = A (1 − cos ku) + B sin ku has the determinant
2 (1 − cos k) − k sin k = 4 sin(k/2) (sin(k/2) − (k/2) cos(k/2)) = 0: k = 2πn, or tan(k/2) = k/2.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

Array = npt.NDArray[np.float64]

MODES = 80
POINTS = 112
NEWTON = 1e-14
"""Largest residual of an equilibrium, relative to its force plus 100: the rounding error."""
FORCE_SCALE = 4.0 * math.pi**2
"""Weight of the force beside the coefficients in the length of a branch."""
RESOLVED = 1e-5
"""Largest of the last coefficients of a shape that is followed: functionals of it are off by about its square."""
TURNS_WITHIN = 1e-3
"""A step in whose half the parameter may still be beyond that at both of its ends."""

TURN = np.array([0.0, 0.0, 1.0])
ALONG_X = np.array([1.0, 0.0, 0.0])
ALONG_Y = np.array([0.0, 1.0, 0.0])


class NoEquilibriumError(ArithmeticError):
    """Newton's method has not converged."""


# --------------------------------------------------------------------------------------------------------- basis


def basis(u: Array) -> Array:
    """φᵢ = (P_{i+1} − P_{i−1})(2u − 1) / (2 sqrt(2i + 1)), i = 1, …: 0 at both ends, ∫ φᵢ' φⱼ' = δᵢⱼ.

    Shapes: (n,) -> (n, MODES)
    """
    polynomials = legendre.legvander(2.0 * u - 1.0, MODES + 1)
    i = np.arange(1, MODES + 1)
    return np.asarray((polynomials[:, 2:] - polynomials[:, :-2]) / (2.0 * np.sqrt(2.0 * i + 1.0)), dtype=np.float64)


def basis_rate(u: Array) -> Array:
    """φᵢ' = sqrt(2i + 1) Pᵢ(2u − 1).

    Shapes: (n,) -> (n, MODES)
    """
    i = np.arange(1, MODES + 1)
    return np.asarray(np.sqrt(2.0 * i + 1.0) * legendre.legvander(2.0 * u - 1.0, MODES)[:, 1:], dtype=np.float64)


@functools.cache
def gauss() -> tuple[Array, Array, Array]:
    """Points and weights on [0, 1], and the basis there.

    Shapes: (POINTS,), (POINTS,), (POINTS, MODES)
    """
    points, weights = legendre.leggauss(POINTS)
    u = 0.5 * (np.asarray(points, dtype=np.float64) + 1.0)
    return u, 0.5 * np.asarray(weights, dtype=np.float64), basis(u)


def products(weight: Array) -> Array:
    """Σ weight φᵢ φⱼ over the Gauss points, by quarters: so small that BLAS takes no threads, which are slower.

    Shapes: (POINTS,) -> (MODES, MODES)
    """
    _, _, phi = gauss()
    parts = np.split(weight[:, None] * phi, 4), np.split(phi, 4)
    return np.asarray(sum(a.T @ b for a, b in zip(*parts, strict=True)), dtype=np.float64)


# --------------------------------------------------------------------------------------------------- equilibria


@dataclass(frozen=True)
class Planar:
    """A shape ϑ = a u + Σ cᵢ φᵢ with the force at its end; an equilibrium where `residual` is 0.

    Shapes: pose (x, y, a), coefficients (MODES,), force (X, Y)
    """

    pose: Array
    coefficients: Array
    force: Array

    @functools.cached_property
    def _trigonometry(self) -> tuple[Array, Array]:
        """sin ϑ, cos ϑ at the Gauss points."""
        u, _, phi = gauss()
        angle = self.pose[2] * u + phi @ self.coefficients
        return np.sin(angle), np.cos(angle)

    @functools.cached_property
    def _stiffening(self) -> Array:
        """−X sin ϑ + Y cos ϑ at the Gauss points: the term of the force in the second variation."""
        sine, cosine = self._trigonometry
        return np.asarray(self.force[1] * cosine - self.force[0] * sine, dtype=np.float64)

    @property
    def residual(self) -> Array:
        """Gradient of E − X (x(1) − x) − Y (y(1) − y) by (c, X, Y).

        Shapes: (MODES + 2,)
        """
        _, weight, phi = gauss()
        sine, cosine = self._trigonometry
        balance = self.coefficients + phi.T @ (weight * (self.force[0] * cosine + self.force[1] * sine))
        return np.concatenate([balance, [weight @ sine + self.pose[0], self.pose[1] - weight @ cosine]])

    @property
    def rounding(self) -> float:
        """The bound on `residual`."""
        return NEWTON * (100.0 + float(np.linalg.norm(self.force)))

    @property
    def matrix(self) -> Array:
        """Derivative of `residual` by (c, X, Y): symmetric, with the Hessian in its first MODES rows.

        Shapes: (MODES + 2, MODES + 2)
        """
        _, weight, phi = gauss()
        sine, cosine = self._trigonometry
        matrix = np.zeros((MODES + 2, MODES + 2))
        matrix[:MODES, :MODES] = np.eye(MODES) + products(weight * self._stiffening)
        matrix[:MODES, MODES:] = phi.T @ np.column_stack([weight * cosine, weight * sine])
        matrix[MODES:, :MODES] = matrix[:MODES, MODES:].T
        return matrix

    def by_pose(self, direction: Array) -> Array:
        """Derivative of `residual` by a motion of the end.

        Shapes: (3,) -> (MODES + 2,)
        """
        u, weight, phi = gauss()
        sine, cosine = self._trigonometry
        turn = weight * direction[2] * u
        return np.concatenate(
            [phi.T @ (turn * self._stiffening), [turn @ cosine + direction[0], turn @ sine + direction[1]]]
        )

    def change_of_matrix(self, null: Array, direction: Array) -> tuple[Array, Array]:
        """Derivatives of `matrix @ null`, at fixed `null`, by (c, X, Y) and by a motion of the end.

        Shapes: (MODES + 2,), (3,) -> (MODES + 2, MODES + 2), (MODES + 2,)
        """
        u, weight, phi = gauss()
        sine, cosine = self._trigonometry
        along = phi @ null[:MODES]
        x, y = self.force
        by_angle = weight * (-(x * cosine + y * sine) * along - sine * null[-2] + cosine * null[-1])
        across = np.column_stack([-weight * sine * along, weight * cosine * along])
        change = np.zeros((MODES + 2, MODES + 2))
        change[:MODES, :MODES] = products(by_angle)
        change[:MODES, MODES:] = phi.T @ across
        change[MODES:, :MODES] = change[:MODES, MODES:].T
        turn = direction[2] * u
        return change, np.concatenate([phi.T @ (by_angle * turn), across.T @ turn])

    def moved(self, direction: Array, step: float, change: Any) -> Planar:
        """The end moved by step · direction, coefficients and force by `change`."""
        return Planar(self.pose + step * direction, self.coefficients + change[:MODES], self.force + change[MODES:])

    @property
    def energy(self) -> float:
        """½ ∫ ϑ'²."""
        return float(0.5 * (self.pose[2] ** 2 + self.coefficients @ self.coefficients))

    def angle(self, u: Any) -> Array:
        """Shapes: (n,) -> (n,)"""
        at = np.atleast_1d(np.asarray(u, dtype=np.float64))
        return np.asarray(self.pose[2] * at + basis(at) @ self.coefficients, dtype=np.float64)

    def bend(self, u: Any) -> Array:
        """Shapes: (n,) -> (n,)"""
        at = np.atleast_1d(np.asarray(u, dtype=np.float64))
        return np.asarray(self.pose[2] + basis_rate(at) @ self.coefficients, dtype=np.float64)

    def position(self, u: Any) -> Array:
        """By Gauss's rule from 0 to every u.

        Shapes: (n,) -> (n, 2)
        """
        points, weight, _ = gauss()
        at = np.atleast_1d(np.asarray(u, dtype=np.float64))
        angle = self.angle(np.outer(at, points).ravel()).reshape(at.size, points.size)
        return np.asarray(at[:, None] * np.column_stack([-np.sin(angle) @ weight, np.cos(angle) @ weight]))

    @property
    def reaction(self) -> Array:
        """Force of the clamp at the end on the belt, and its moment about z: (X, Y, ϑ'(1)).

        Shapes: (3,)
        """
        return np.append(self.force, self.bend(1.0)[0])

    @property
    def height(self) -> float:
        """The point farthest along +x."""
        u = np.linspace(0.0, 1.0, 401)
        sine = np.sin(self.angle(u))
        stationary = [
            brentq(lambda at: float(np.sin(self.angle(at)[0])), u[i], u[i + 1], xtol=1e-15)
            for i in np.flatnonzero(sine[:-1] * sine[1:] < 0.0)
        ]
        return float(np.max(self.position([0.0, *stationary, 1.0])[:, 0]))

    @property
    def negative_modes(self) -> int:
        """Number of negative modes with the end held: that of the matrix, less one for each constraint."""
        return int(np.sum(np.linalg.eigvalsh(self.matrix) < 0.0)) - 2

    def mirrored(self) -> Planar:
        """The mirror image, x → −x."""
        return Planar(self.pose * [-1.0, 1.0, -1.0], -self.coefficients, self.force * [-1.0, 1.0])


def converge(near: Planar, iterations: int = 30) -> Planar:
    """The equilibrium with the pose of a shape near it, by Newton's method."""
    found = near
    for _ in range(iterations):
        residual = found.residual
        if np.max(np.abs(residual)) < found.rounding:
            return found
        found = found.moved(TURN, 0.0, -np.linalg.solve(found.matrix, residual))
        if not np.max(np.abs(found.residual)) < 1e6:
            break
    raise NoEquilibriumError(f"of pose {near.pose}")


def euler_load(mode: int) -> float:
    """P of the straight strut, ascending: k = 2πn, and tan(k/2) = k/2 between them."""
    n, between = divmod(mode, 2)
    if between:
        return float((2.0 * math.pi * (n + 1)) ** 2)
    low, high = n * math.pi, (n + 0.5) * math.pi
    half = brentq(lambda h: math.sin(h) - h * math.cos(h), low, high, xtol=1e-15, rtol=4.0 * np.finfo(float).eps)
    return float((2.0 * half) ** 2)


def buckled(distance: float, mode: int = 1) -> Planar:
    """The belt between parallel clamps in line, pose (0, d, 0): the arch to +x (mode 1) or the S (mode 2), by its load.

    From just below its Euler load, where ϑ is that mode with ½ ∫ ϑ² = 1 − y, followed along y.
    """
    load = euler_load(mode)
    k = math.sqrt(load)
    u, weight, phi = gauss()
    if mode % 2:
        shape, across = -np.sin(k * u), 0.0
    else:
        shape = 1.0 - np.cos(k * u) - (1.0 - math.cos(k)) / math.sin(k) * np.sin(k * u)
        across = load
    slack = 1e-3
    amplitude = math.sqrt(2.0 * slack / (weight @ shape**2))
    # cᵢ = ∫ ϑ' φᵢ' = −∫ ϑ'' φᵢ, and ϑ'' = X − P ϑ.
    coefficients = -phi.T @ (weight * amplitude * (across - load * shape))
    start = converge(Planar(np.array([0.0, 1.0 - slack, 0.0]), coefficients, np.array([amplitude * across, -load])))
    return at_parameter(start, -ALONG_Y, 1.0 - slack - distance)


# ------------------------------------------------------------------------------------------------------ branches


@dataclass(frozen=True)
class Branch:
    """Equilibria whose end is at base + λ · direction, followed by pseudo-arclength in the direction of the first step.

    The length counts the coefficients, the force in `FORCE_SCALE`, and λ.
    """

    start: Planar
    direction: Array
    step: float = 0.1
    longest: float = 0.4
    metric: Array = field(
        default_factory=lambda: np.concatenate([np.ones(MODES), np.full(2, FORCE_SCALE**-2), [1.0]]), repr=False
    )

    def tangent(self, at: Planar, before: Array) -> Array:
        """The unit tangent (dc, dX, dY, dλ) in the direction of the tangent before.

        Shapes: (MODES + 3,)
        """
        rows = np.vstack([np.column_stack([at.matrix, at.by_pose(self.direction)]), before * self.metric])
        tangent = np.linalg.solve(rows, np.append(np.zeros(MODES + 2), 1.0))
        return np.asarray(tangent / math.sqrt(tangent @ (self.metric * tangent)), dtype=np.float64)

    def _correct(self, predicted: Planar, tangent: Array) -> Planar:
        """Newton's method perpendicular to the tangent."""
        found = predicted
        for _ in range(7):
            residual = found.residual
            if np.max(np.abs(residual)) < found.rounding:
                return found
            rows = np.vstack([np.column_stack([found.matrix, found.by_pose(self.direction)]), tangent * self.metric])
            change = np.linalg.solve(rows, -np.append(residual, 0.0))
            found = found.moved(self.direction, float(change[-1]), change[:-1])
        raise NoEquilibriumError(f"near {predicted.pose}")

    def points(self) -> Iterator[tuple[Planar, Array]]:
        """Equilibria and tangents of the branch, from the start as long as the modes resolve the shape."""
        at, step = self.start, self.step
        tangent = self.tangent(at, np.append(np.zeros(MODES + 2), 1.0))
        yield at, tangent
        while step > 1e-6:
            try:
                ahead = self._correct(at.moved(self.direction, step * tangent[-1], step * tangent[:-1]), tangent)
                turned = self.tangent(ahead, tangent)
            except (NoEquilibriumError, np.linalg.LinAlgError):
                step *= 0.5
                continue
            cosine = float(turned @ (self.metric * tangent))
            if cosine < 0.98:
                step *= 0.5
                continue
            at, tangent = ahead, turned
            if np.max(np.abs(at.coefficients[-4:])) > RESOLVED:
                raise NoEquilibriumError(f"{MODES} modes are too few at {at.pose}")
            yield at, tangent
            step = min(self.longest, 1.5 * step if cosine > 0.995 else step)


def between(before: Planar, after: Planar, share: float) -> Planar:
    """The shape at a share of the way, not an equilibrium."""
    return Planar(
        before.pose + share * (after.pose - before.pose),
        before.coefficients + share * (after.coefficients - before.coefficients),
        before.force + share * (after.force - before.force),
    )


def at_parameter(start: Planar, direction: Array, parameter: float, *, longest: float = 0.4) -> Planar:
    """The equilibrium at start + λ · direction, λ > 0, if the branch reaches it before it turns back."""
    before = start

    def reached(at: Planar) -> float:
        return float((at.pose - start.pose) @ direction / (direction @ direction))

    for at, tangent in Branch(start, direction, step=min(0.1, longest), longest=longest).points():
        if tangent[-1] < 0.0:
            break
        if reached(at) >= parameter:
            share = (parameter - reached(before)) / (reached(at) - reached(before))
            return converge(replace(between(before, at, share), pose=start.pose + parameter * direction))
        before = at
    if longest < TURNS_WITHIN:
        raise NoEquilibriumError(f"the branch turns back before {start.pose + parameter * direction}")
    # The branch may turn back beyond this point.
    return at_parameter(before, direction, parameter - reached(before), longest=longest / 8.0)


# --------------------------------------------------------------------------------------------------------- folds


@dataclass(frozen=True)
class Fold:
    """A fold: its equilibrium, the null vector of its matrix, and the points of the branch around it."""

    state: Planar
    null: Array
    before: Planar
    after: Planar

    @property
    def pose(self) -> Array:
        """Shapes: (3,)"""
        return self.state.pose


def converge_fold(near: Planar, null: Array, direction: Array) -> tuple[Planar, Array]:
    """Newton's method on residual = 0, matrix @ null = 0, |null| = 1 in the coefficients, the null vector's."""
    size = MODES + 2
    at, null = near, null / np.linalg.norm(null[:MODES])
    normal = np.append(null[:MODES], np.zeros(2))
    for _ in range(20):
        error = np.concatenate([at.residual, at.matrix @ null, [normal @ null - 1.0]])
        if np.max(np.abs(error)) < 10.0 * at.rounding:
            return at, null
        by_state, by_end = at.change_of_matrix(null, direction)
        rows = np.zeros((2 * size + 1, 2 * size + 1))
        rows[:size, :size] = rows[size : 2 * size, size + 1 :] = at.matrix
        rows[:size, size] = at.by_pose(direction)
        rows[size : 2 * size, :size] = by_state
        rows[size : 2 * size, size] = by_end
        rows[-1, size + 1 :] = normal
        change = np.linalg.solve(rows, -error)
        at = at.moved(direction, float(change[size]), change[:size])
        null = null + change[size + 1 :]
    raise NoEquilibriumError(f"no fold near {near.pose}")


def folds(start: Planar, direction: Array, *, turns: float = 0.5, reach: float = 0.99) -> Iterator[Fold]:
    """The folds along a branch, in order.

    To the end of the last turn allowed, or until the belt is all but stretched, or to a pitchfork: there the branch
    turns back as its own image and has the same negative modes as before; see `pitchfork`.
    """
    before, tangent_before = start, np.zeros(MODES + 3)
    for at, tangent in Branch(start, direction).points():
        if tangent[-1] * tangent_before[-1] < 0.0:
            if before.negative_modes == at.negative_modes:
                return
            # The null vector is the tangent where dλ = 0.
            share = tangent_before[-1] / (tangent_before[-1] - tangent[-1])
            null = (1.0 - share) * tangent_before[:-1] + share * tangent[:-1]
            yield Fold(*converge_fold(between(before, at, share), null, direction), before, at)
        if math.hypot(at.pose[0], at.pose[1]) > reach or abs(at.pose[2]) > 2.0 * math.pi * turns:
            return
        before, tangent_before = at, tangent


def pitchfork(distance: float) -> Planar:
    """Where the two arches with the end at (x, d) and no turn meet the S between them: a mode of the S passes 0.

    Half a turn of the plane about the belt's middle maps the S to itself and the arches to each other. Beyond, x being
    larger, the S is the only one of the three and stable. The arch at −x is the mirror image of that at +x.
    """
    before = buckled(distance, mode=2).mirrored()
    for at, tangent in Branch(before, ALONG_X).points():
        assert tangent[-1] > 0.0
        if at.negative_modes == 0:
            break
        before = at

    def at_share(share: float) -> Planar:
        return converge(between(before, at, share))

    # Two eigenvalues are negative for the two constraints.
    share = brentq(lambda share: float(np.linalg.eigvalsh(at_share(share).matrix)[2]), 0.0, 1.0, xtol=1e-14)
    return at_share(share)


# ------------------------------------------------------------------------------------------------------ shooting


@dataclass(frozen=True)
class Shot:
    """The belt from ϑ'(0) and the force (X, Y), with its Jacobi fields, by an adaptive Runge-Kutta method.

    Shapes: unknowns (3,)
    """

    unknowns: Array
    tolerance: float = 1e-12

    @functools.cached_property
    def path(self) -> Any:
        """(x, y, ϑ, ϑ', E) and the derivatives of the first four by (ϑ'(0), X, Y), as functions of u."""
        bend, x, y = self.unknowns

        def rate(_: float, state: Array) -> Array:
            sine, cosine = math.sin(state[2]), math.cos(state[2])
            fields = state[5:].reshape(4, 3)
            stiffening = -x * sine + y * cosine
            turned = stiffening * fields[2] + np.array([0.0, cosine, sine])
            return np.concatenate(
                [
                    [-sine, cosine, state[3], x * cosine + y * sine, 0.5 * state[3] ** 2],
                    -cosine * fields[2],
                    -sine * fields[2],
                    fields[3],
                    turned,
                ]
            )

        start = np.zeros(17)
        start[3], start[14] = bend, 1.0
        found = solve_ivp(
            rate, (0.0, 1.0), start, method="DOP853", rtol=self.tolerance, atol=self.tolerance, dense_output=True
        )
        assert found.success, found.message
        return found

    @property
    def _end(self) -> Array:
        return np.asarray(self.path.y[:, -1], dtype=np.float64)

    @property
    def pose(self) -> Array:
        """(x, y, a) at the end.

        Shapes: (3,)
        """
        return self._end[:3]

    @property
    def energy(self) -> float:
        return float(self._end[4])

    @property
    def jacobian(self) -> Array:
        """The end pose by (ϑ'(0), X, Y).

        Shapes: (3, 3)
        """
        return self._end[5:14].reshape(3, 3)

    @property
    def conjugate_points(self) -> Array:
        """Zeros of the determinant of (x, y, ϑ) by the unknowns inside the span.

        There are none up to u = π/|F|^½: there ∫ η'² + (Y cos ϑ − X sin ϑ) η² > 0 of any η that is 0 at both ends.
        """
        first = min(1.0, math.pi / math.sqrt(math.hypot(*self.unknowns[1:])))

        def determinant(u: float) -> float:
            return float(np.linalg.det(self.path.sol(u)[5:14].reshape(3, 3)))

        u = np.linspace(first, 1.0, 400)
        values = np.array([determinant(at) for at in u])
        # A zero at the end itself belongs to a fold.
        inside = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        return np.array([brentq(determinant, u[i], u[i + 1], xtol=1e-13) for i in inside])


def shot_of(state: Planar) -> Shot:
    """The same belt by the other discretisation."""
    return Shot(np.append(state.bend(0.0), state.force))


def fold_of_shots(unknowns: Array, base: Array, direction: Array, parameter: float) -> tuple[Shot, float]:
    """The fold near a belt, its end at base + λ · direction: pose and determinant 0 by MINPACK; and its λ."""

    def miss(at: Array) -> Array:
        shot = Shot(at[:3] * scale)
        return np.append(shot.pose - base - at[3] * direction, np.linalg.det(shot.jacobian * scale) / size)

    scale = np.array([10.0, FORCE_SCALE, FORCE_SCALE])
    size = float(np.prod(np.linalg.norm(Shot(unknowns).jacobian * scale, axis=0)))
    found = root(miss, np.append(unknowns / scale, parameter), tol=1e-13)
    if np.max(np.abs(found.fun)) > 1e-10:
        raise NoEquilibriumError(f"no fold near {unknowns}: {found.message}")
    return Shot(found.x[:3] * scale), float(found.x[3])
