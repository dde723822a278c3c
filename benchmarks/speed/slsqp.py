"""SciPy's SLSQP on the core's own discrete programme, in NumPy, as written without a tool for optimal control.

The fields at the nodes are the only unknowns, the pose is carried along the belt; all derivatives are exact, those of
an element by complex steps, all elements at once. `solve_bvp` is no choice here: along a part of both examples the ribs
are on the bound |s| = 2/V, and where those parts begin and end is not known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import LinearConstraint, minimize
from scipy.spatial.transform import Rotation

from speed import guess
from speed.problem import LENGTH, WIDTH, Answer, Energy, Pose
from speed.stopwatch import timed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from speed.problem import Floats

    Complex = NDArray[np.complex128]

GAUSS = np.array([0.5 - 3.0**0.5 / 6.0, 0.5 + 3.0**0.5 / 6.0])
STEP = 1e-40
ITERATIONS = 1000
LARGEST = (60.0, 5.0)
"""Bounds on bend and rib slope, which no shape reaches; they keep trial steps from running away."""
ALONG = np.array([0.0, 1.0, 0.0])
FLAT = 1e-4


def _series(square: Any, first: int) -> Any:
    """Σ (−θ²)ᵏ/(2k + first)!, of `first` 1 to 3: sin θ/θ, (1 − cos θ)/θ² and (θ − sin θ)/θ³.

    In closed form where an element turns far: a trial step may make it.
    """
    is_small = square.real < 1.0
    small, large = np.where(is_small, square, 0.0), np.where(is_small, 1.0, square)
    total = term = 1.0 / np.prod(np.arange(1.0, first + 1)) + 0.0 * small
    for k in range(1, 10):
        term = -term * small / ((2 * k + first) * (2 * k + first - 1))
        total = total + term
    angle = np.sqrt(large)
    closed = {
        1: np.sin(angle) / angle,
        2: (1.0 - np.cos(angle)) / large,
        3: (angle - np.sin(angle)) / (angle * large),
    }
    return np.where(is_small, total, closed[first])


def _hat(v: Any) -> Any:
    """[v]× of many vectors (n, 3)."""
    zero = 0.0 * v[:, 0]
    rows = [[zero, -v[:, 2], v[:, 1]], [v[:, 2], zero, -v[:, 0]], [-v[:, 1], v[:, 0], zero]]
    return np.moveaxis(np.array(rows), 2, 0)


def _elements(energy: Energy, length: float, fields: Complex) -> tuple[Complex, Complex, Complex]:
    """Displacements (n, 3), rotations (n, 3, 3) and energies (n,) from (ω_ζ, β) at both ends (n, 4)."""
    bend = fields[:, [0]] * (1.0 - GAUSS) + fields[:, [2]] * GAUSS
    slope = fields[:, [1]] * (1.0 - GAUSS) + fields[:, [3]] * GAUSS
    first, second = (np.stack([0.0 * bend[:, i], -slope[:, i] * bend[:, i], bend[:, i]], axis=1) for i in (0, 1))
    bracket = 3.0**0.5 / 12.0 * length**2
    turn = 0.5 * length * (first + second) + bracket * np.cross(first, second)
    shortening = length**3 / 80.0 * (second - first)[..., 2:] ** 2
    way = (length - shortening) * ALONG + bracket * np.cross(first - second, ALONG)
    square = np.sum(turn * turn, axis=1)[:, None]
    once = np.cross(turn, way)
    displacement = way + _series(square, 2) * once + _series(square, 3) * np.cross(turn, once)
    hat = _hat(turn)
    rotation = np.eye(3) + _series(square, 1)[:, :, None] * hat + _series(square, 2)[:, :, None] * (hat @ hat)
    density = np.sum(0.5 * bend**2 * (1.0 + slope**2) ** (2.5 if energy == "fishbone" else 2.0), axis=1)
    if energy == "wunderlich":
        y = 0.5 * WIDTH * (fields[:, 3] - fields[:, 1]) / length
        is_flat = np.abs(y) < FLAT
        steep = np.where(is_flat, 0.5, y)
        # Steps of the search may leave the bound, where there is no energy.
        inside = np.clip(steep.real, -1.0 + 1e-15, 1.0 - 1e-15) + 1j * steep.imag
        density = density * np.where(is_flat, 1.0 + y**2 / 3.0, np.arctanh(inside) / inside)
    return displacement, rotation, 0.5 * length * density


class Slsqp:
    """Sequential quadratic programming with dense matrices and an estimate of the Hessian."""

    def __init__(self, energy: Energy, elements: int) -> None:
        self.energy: Energy = energy
        self.elements = elements
        self.length = LENGTH / elements
        nodes = 2 * np.arange(elements)[:, None] + np.arange(4)
        self.nodes = nodes
        self.unknown = np.setdiff1d(np.arange(2 * elements + 2), [1, 2 * elements + 1])
        rise = np.zeros((elements, 2 * elements + 2))
        rise[np.arange(elements), nodes[:, 3]], rise[np.arange(elements), nodes[:, 1]] = 1.0, -1.0
        most = 2.0 * self.length / WIDTH
        if energy == "wunderlich":
            most *= 1.0 - 1e-9
        largest = np.tile(LARGEST, elements + 1)[self.unknown]
        self.bounds = np.stack([-largest, largest], axis=1)
        self.jets = _Jets(np.zeros(len(self.unknown)), energy, self.length, np.zeros((elements, 4)))
        self.ribs = LinearConstraint(rise[:, self.unknown], -most, most)

    def cold(self, pose: Pose) -> Answer:
        """From the core's guess."""
        fields = np.zeros((self.elements + 1, 2))
        fields[:, 0] = guess.bends(pose, np.linspace(0.0, 1.0, self.elements + 1))
        self.found = fields.ravel()[self.unknown]
        return self.warm(pose)

    def warm(self, pose: Pose) -> Answer:
        """From the last shape; the estimate of the Hessian begins anew."""
        ends = {"type": "eq", "fun": self._miss, "jac": self._miss_slope, "args": (pose,)}
        seconds, found = timed(
            minimize,
            self._cost,
            self.found,
            jac=True,
            method="SLSQP",
            constraints=[ends, self.ribs],
            bounds=self.bounds,
            options={"maxiter": ITERATIONS, "ftol": 1e-12},
        )
        self.found = found.x
        return Answer(bool(found.success), seconds, int(found.nit), float(found.fun))

    def curve(self) -> tuple[Floats, Floats]:
        """Positions and tangents of the last answer."""
        jets = self._jets(self.found)
        return jets.positions, jets.frames[:, :, 1]

    def _jets(self, x: Floats) -> _Jets:
        """Everything at a point; the last is kept, since objective and conditions ask for the same ones."""
        if not np.array_equal(x, self.jets.x):
            self.jets = _Jets(x, self.energy, self.length, self._full(x))
        return self.jets

    def _full(self, x: Floats) -> Floats:
        fields = np.zeros(2 * self.elements + 2)
        fields[self.unknown] = x
        return np.asarray(fields[self.nodes])

    def _cost(self, x: Floats) -> tuple[float, Floats]:
        jets = self._jets(x)
        total = np.zeros(2 * self.elements + 2)
        np.add.at(total, self.nodes, jets.costs)
        return jets.cost, total[self.unknown]

    def _miss(self, x: Floats, pose: Pose) -> Floats:
        """Miss of the end pose, the orientation by the skew part of QᵀR."""
        jets = self._jets(x)
        turn = Rotation.from_rotvec(-pose.rotation).as_matrix() @ jets.frames[-1]
        return np.concatenate([jets.positions[-1] - pose.position, _axial(turn)])

    def _miss_slope(self, x: Floats, pose: Pose) -> Floats:
        jets = self._jets(x)
        turn = Rotation.from_rotvec(-pose.rotation).as_matrix() @ jets.frames[-1]
        to_miss = 0.5 * (np.trace(turn) * np.eye(3) - turn.T) @ jets.frames[-1].T
        body = _axial(np.swapaxes(jets.rotation, 1, 2)[:, None] @ jets.rotations)
        world = np.einsum("nij,nkj->nki", jets.frames[1:], body)
        arms = jets.positions[-1] - jets.positions[1:]
        moved = np.einsum("nij,nkj->nki", jets.frames[:-1], jets.displacements) + np.cross(world, arms[:, None])
        total = np.zeros((2 * self.elements + 2, 6))
        np.add.at(total, self.nodes, np.concatenate([moved, world @ to_miss.T], axis=2))
        return np.asarray(total[self.unknown].T)


class _Jets:
    """The belt at a point, with derivatives by the four unknowns of every element by complex steps, all at once.

    Shapes: displacements (n, 4, 3), rotation (n, 3, 3), rotations (n, 4, 3, 3), costs (n, 4).
    """

    def __init__(self, x: Floats, energy: Energy, length: float, fields: Floats) -> None:
        self.x = x.copy()
        steps = (fields[:, None, :] + 1j * STEP * np.eye(4)).reshape(-1, 4)
        ways, turns, costs = (part.reshape(-1, 4, *part.shape[1:]) for part in _elements(energy, length, steps))
        self.displacements, self.rotations, self.costs = ways.imag / STEP, turns.imag / STEP, costs.imag / STEP
        self.rotation, self.cost = turns[:, 0].real, float(costs[:, 0].real.sum())
        frames, positions = [np.eye(3)], [np.zeros(3)]
        for way, turn in zip(ways[:, 0].real, self.rotation, strict=True):
            positions.append(positions[-1] + frames[-1] @ way)
            frames.append(frames[-1] @ turn)
        self.positions, self.frames = np.array(positions), np.array(frames)


def _axial(matrices: Floats) -> Floats:
    """Axial vectors of the skew parts, (…, 3)."""
    skew = 0.5 * (matrices - np.swapaxes(matrices, -1, -2))
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
