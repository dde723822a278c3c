"""The belt's discrete programme written in CasADi: the same nodes, elements, energies and bounds as in the core.

Unknowns are the position x, the frame as a quaternion q, the bend ω_ζ and the rib slope β at every node. Every element
is the same function, so that all derivatives are those of one element, mapped over the belt and added up.
"""

from __future__ import annotations

import shutil
import subprocess
from enum import Enum
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from speed import guess
from speed.problem import LENGTH, WIDTH, Energy

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from speed.problem import Floats, Pose

    Indices = NDArray[np.int64]

POSE = 7
STATE = POSE + 2
CONTROL = 2
END = 3 + 3 + 1
"""Conditions at the end: position, orientation, square rib."""
START = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The natural pose."""
TERMS = 10
"""Terms of the series of the rotation; an element turns by far less than 1 rad, where they leave less than 1e-18."""
FLAT = 1e-3
"""Below this y² artanh(y)/y is taken by its series."""
GAUSS = tuple(0.5 + sign * 3.0**0.5 / 6.0 for sign in (-1.0, 1.0))
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")


def _series(square: Any, first: int) -> Any:
    """Σ (−θ²)ᵏ/(2k + first)!: cos θ, sin θ/θ, (1 − cos θ)/θ² and (θ − sin θ)/θ³ for `first` = 0, 1, 2, 3."""
    factorials = np.cumprod(np.arange(1.0, 2 * TERMS + first + 1))
    total: Any = 0.0
    for k in reversed(range(TERMS)):
        n = 2 * k + first
        total = (1.0 / factorials[n - 1] if n else 1.0) - square * total
    return total


def _artanh_ratio(y: Any) -> Any:
    """artanh(y)/y."""
    square = y * y
    is_flat = square < FLAT
    series: Any = 0.0
    for k in reversed(range(6)):
        series = 1.0 / (2 * k + 1) + square * series
    steep = ca.if_else(is_flat, 0.5, y)
    return ca.if_else(is_flat, series, ca.atanh(steep) / steep)


def _quaternion_product(a: Any, b: Any) -> Any:
    real = a[0] * b[0] - ca.dot(a[1:], b[1:])
    return ca.vertcat(real, a[0] * b[1:] + b[0] * a[1:] + ca.cross(a[1:], b[1:]))


def _rotated(q: Any, v: Any) -> Any:
    twice = 2.0 * ca.cross(q[1:], v)
    return v + q[0] * twice + ca.cross(q[1:], twice)


def element(energy: Energy, length: float, width: float, fields: Any) -> tuple[Any, Any, Any]:
    """Displacement and turn (a quaternion) by the fourth-order Magnus step, and energy, from (ω_ζ, β) at both ends."""
    bends = [(1.0 - t) * fields[0] + t * fields[2] for t in GAUSS]
    slopes = [(1.0 - t) * fields[1] + t * fields[3] for t in GAUSS]
    first, second = (ca.vertcat(0.0, -slope * bend, bend) for bend, slope in zip(bends, slopes, strict=True))
    bracket = 3.0**0.5 / 12.0 * length**2
    along = ca.DM([0.0, 1.0, 0.0])
    turn = 0.5 * length * (first + second) + bracket * ca.cross(first, second)
    shortening = (length**3 / 80.0) * (bends[1] - bends[0]) ** 2
    way = (length - shortening) * along + bracket * ca.cross(first - second, along)
    square = ca.dot(turn, turn)
    once = ca.cross(turn, way)
    displacement = way + _series(square, 2) * once + _series(square, 3) * ca.cross(turn, once)
    quaternion = ca.vertcat(_series(0.25 * square, 0), 0.5 * _series(0.25 * square, 1) * turn)
    power = 2.5 if energy == "fishbone" else 2.0
    density = sum(0.5 * bend**2 * (1.0 + slope**2) ** power for bend, slope in zip(bends, slopes, strict=True))
    if energy == "wunderlich":
        density *= _artanh_ratio(0.5 * width * (fields[3] - fields[1]) / length)
    return displacement, quaternion, 0.5 * length * density


class Form(Enum):
    """How the unknowns are laid out. Both are (x, q, ω_ζ, β) at every node."""

    NODAL = "nodal"
    """Nothing else: an element reads the fields of both its nodes. Fewest unknowns."""
    STAGED = "staged"
    """Between nodes the control (ω_ζ at the next node, s), so that each node follows from the one before."""


class Programme:
    """The programme of a straight belt between two clamps, its end pose a parameter.

    `lower` and `upper` bound the unknowns, `lowest` and `highest` the conditions: those of each element in turn, then
    those of the end.
    """

    def __init__(self, form: Form, energy: Energy, elements: int) -> None:
        self.elements = elements
        self.length = LENGTH / elements
        self.control = CONTROL if form is Form.STAGED else 0
        self.stage = STATE + self.control
        count = elements * self.stage + STATE
        fixed = [*range(POSE), POSE + 1]
        self.free = np.setdiff1d(np.arange(count), fixed)
        steepest = 2.0 / WIDTH
        bounds = np.full(count, np.inf)
        ranges = np.zeros((elements, STATE if self.control else STATE - 1))
        if self.control:
            bounds[self.stage - 1 :: self.stage] = steepest
        else:
            ranges[:, -1] = steepest * self.length
        self.upper = bounds[self.free]
        self.lower = -self.upper
        self.highest = np.concatenate([ranges.ravel(), np.zeros(END)])
        self.lowest = -self.highest
        self._write(energy)

    def _write(self, energy: Energy) -> None:
        """The functions of one element, mapped over the belt, and what is assembled of them."""
        local, conditions, cost = self._element(energy)
        gradient, jacobian = ca.gradient(cost, local), ca.jacobian(conditions, local)
        factor, weights = ca.SX.sym("factor"), ca.SX.sym("weights", conditions.numel())
        hessian = ca.hessian(factor * cost + ca.dot(weights, conditions), local)[0]
        # Rates and gaps: everything of an element from its own unknowns.
        values = ca.Function("values", [local], [cost, conditions]).map(self.elements)
        slopes = ca.Function("slopes", [local], [gradient, jacobian]).map(self.elements)
        curves = ca.Function("curves", [local, factor, weights], [hessian]).map(self.elements)

        self.x, self.pose = ca.MX.sym("x", len(self.free)), ca.MX.sym("p", POSE)
        self.factor, self.weights = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(self.highest))
        full = ca.vertcat(*START, self.x[0], 0.0, self.x[1:])
        places = self._places()
        locals_ = ca.reshape(full[places.ravel()], places.shape[1], self.elements)
        costs, met = values(locals_)
        end = _end(full[-STATE:], self.pose)
        self.cost = ca.sum2(costs)
        self.conditions = ca.vertcat(ca.vec(met), end)

        gradients, jacobians = slopes(locals_)
        per_element = conditions.numel()
        rows = per_element * np.arange(self.elements)[:, None] + np.arange(per_element)
        nothing = np.zeros_like(places)
        columns = self._free_numbers()
        n, m = len(self.free), rows.size
        self.gradient = ca.densify(
            _assembled(gradients, ca.Sparsity.dense(places.shape[1], 1), columns[places], nothing, (n, 1))
        )
        own = _assembled(jacobians, jacobian.sparsity(), rows, columns[places], (m, n))
        self.jacobian = ca.vertcat(own, ca.jacobian(end, self.x))
        per = ca.reshape(self.weights[:m], per_element, self.elements)
        hessians = curves(locals_, self.factor, per)
        self.hessian = _assembled(hessians, hessian.sparsity(), columns[places], columns[places], (n, n))

    def _element(self, energy: Energy) -> tuple[Any, Any, Any]:
        """Unknowns of an element (this node, control, next node), its conditions and its energy."""
        local = ca.SX.sym("local", self.stage + STATE)
        here, control, there = ca.vertsplit(local, np.cumsum([0, STATE, self.control, STATE]).tolist())
        is_led = self.control > 0
        following = ca.vertcat(control[0], here[POSE + 1] + self.length * control[1]) if is_led else there[POSE:]
        displacement, turn, cost = element(energy, self.length, WIDTH, ca.vertcat(here[POSE:], following))
        position = here[:3] + _rotated(here[3:POSE], displacement)
        reached = ca.vertcat(position, _quaternion_product(here[3:POSE], turn))
        if is_led:
            return local, there - ca.vertcat(reached, following), cost
        return local, ca.vertcat(there[:POSE] - reached, there[POSE + 1] - here[POSE + 1]), cost

    def _places(self) -> Indices:
        """Where the unknowns of each element are among all, fixed or not."""
        return self.stage * np.arange(self.elements)[:, None] + np.arange(self.stage + STATE)

    def _free_numbers(self) -> Indices:
        """Numbers among the free unknowns; −1 of the fixed."""
        numbers = np.full(self.elements * self.stage + STATE, -1)
        numbers[self.free] = np.arange(len(self.free))
        return numbers

    def start(self, pose: Pose) -> Floats:
        """The core's guess, carried from the start along the belt."""
        bends = guess.bends(pose, np.linspace(0.0, 1.0, self.elements + 1))
        x = np.zeros((self.elements + 1, self.stage))
        x[:, POSE] = bends
        if self.control:
            x[:-1, STATE] = bends[1:]
        # In the plane of the arch, to the fourth order as the programme has it only up to the square of the step.
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (bends[1:] + bends[:-1]) * self.length)])
        middle = 0.5 * (angle[1:] + angle[:-1])
        x[1:, 0] = -np.cumsum(np.sin(middle)) * self.length
        x[1:, 1] = np.cumsum(np.cos(middle)) * self.length
        x[:, 3], x[:, 6] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        return np.asarray(x.ravel()[self.free])

    def parameters(self, pose: Pose) -> Floats:
        """The end pose as position and quaternion."""
        return np.concatenate([pose.position, Rotation.from_rotvec(pose.rotation).as_quat(scalar_first=True)])

    def curve(self, x: Floats) -> tuple[Floats, Floats]:
        """Positions and tangents at the nodes."""
        full = np.zeros(self.elements * self.stage + STATE)
        full[:POSE] = START
        full[self.free] = x
        nodes = np.concatenate([full, np.zeros(self.control)]).reshape(-1, self.stage)
        frames = Rotation.from_quat(nodes[:, 3:POSE], scalar_first=True)
        return nodes[:, :3], frames.apply([0.0, 1.0, 0.0])

    def plain(self) -> dict[str, Any]:
        """As one hands it to CasADi, which then finds the derivatives."""
        return {"x": self.x, "p": self.pose, "f": self.cost, "g": self.conditions}

    def compiled(self, *, for_fatrop: bool, folder: Path) -> str:
        """A shared library of the functions that CasADi's interface of IPOPT or of fatrop asks for by these names."""
        weighted = {"x": self.x, "p": self.pose, "lam_f": self.factor, "lam_g": self.weights}
        at = dict(list(weighted.items())[:2])
        by_x = self.factor * self.gradient + self.jacobian.T @ self.weights
        by_pose = ca.gradient(ca.dot(self.weights, self.conditions), self.pose)
        values = {"f": self.cost, "g": self.conditions}
        gradient, jacobian = {"grad_f_x": self.gradient}, {"g": self.conditions, "jac_g_x": self.jacobian}
        by_all = {"grad_gamma_x": by_x, "grad_gamma_p": by_pose}
        upper = {"triu_hess_gamma_x_x": ca.triu(self.hessian)}
        whole = {"grad_gamma_x": by_x, "hess_gamma_x_x": self.hessian}
        functions = {
            "nlp": (at, values),
            "nlp_f": (at, {"f": self.cost}),
            "nlp_g": (at, {"g": self.conditions}),
            "nlp_grad": (weighted, values | by_all),
            "nlp_grad_f": (at, gradient if for_fatrop else {"f": self.cost} | gradient),
            "nlp_jac_g": (at, jacobian),
            "nlp_hess_l": (weighted, whole if for_fatrop else upper),
        }
        name = "fatrop" if for_fatrop else "ipopt"
        generator = ca.CodeGenerator(f"{name}.c")
        for function, (inputs, outputs) in functions.items():
            generator.add(ca.Function(function, [*inputs.values()], [*outputs.values()], [*inputs], [*outputs]))
        source = generator.generate(f"{folder}/")
        library = f"{folder}/{name}.so"
        subprocess.run([compiler(), *FLAGS, source, "-o", library], check=True)
        return library


def compiler() -> str:
    """The path of gcc."""
    path = shutil.which("gcc")
    if path is None:
        raise SystemExit("the compiled rivals need gcc; on Debian and Ubuntu: apt install gcc")
    return path


def _end(state: Any, pose: Any) -> Any:
    """Misses of position and orientation at the end, and the rib slope there."""
    away = ca.vertcat(pose[3], -pose[4:])
    return ca.vertcat(state[:3] - pose[:3], _quaternion_product(away, state[3:POSE])[1:], state[POSE + 1])


def _assembled(blocks: Any, block: Any, rows: Indices, columns: Indices, shape: tuple[int, int]) -> Any:
    """The sparse sum of equal blocks, each entry at the row and the column of its element; dropped where that is −1."""
    at, by = (rows[:, block.row()].ravel(), columns[:, block.get_col()].ravel())
    kept = np.flatnonzero((at >= 0) & (by >= 0))
    places, entries = np.unique(by[kept] * shape[0] + at[kept], return_inverse=True)
    pattern = ca.Sparsity.triplet(*shape, (places % shape[0]).tolist(), (places // shape[0]).tolist())
    adding = ca.Sparsity.triplet(len(places), len(at), entries.tolist(), kept.tolist())
    return ca.MX(pattern, ca.DM(adding, 1.0) @ blocks.nz[:])
