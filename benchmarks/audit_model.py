"""A belt and its result as the audit reads them, written from the model and not from the solver.

Poses are integrated by Runge-Kutta steps from node to node, integrals are by Boole's rule, forces and moments inside
the belt follow from what acts on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Iterator

Array = npt.NDArray[np.float64]
Json = dict[str, Any]

MATERIALS = {
    "polyimide": (2.5e9, 0.34, 1420.0),
    "rolledcopper": (117e9, 0.34, 8940.0),
    "acrylicadhesive": (0.2e9, 0.42, 1200.0),
}
"""Young's modulus, Poisson's ratio and density of those materials that the random scenarios name."""
BOOLE = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
PARTS = len(BOOLE) - 1
SAME_PLACE = 1e-9
"""Arc lengths that are the same, over the length."""


@dataclass(frozen=True)
class Board:
    """The belt of a scenario: for arc lengths, what the board is there."""

    tables: Json

    @cached_property
    def ends(self) -> Array:
        """Arc lengths of the joints of segments; a corner has no length."""
        return np.concatenate([[0.0], np.cumsum([segment.get("length", 0.0) for segment in self.segments])])

    @property
    def segments(self) -> list[Json]:
        """The parts of the board, in order."""
        return list(self.tables["belt"]["segments"])

    @property
    def length(self) -> float:
        """U."""
        return float(self.ends[-1])

    @property
    def width(self) -> float:
        """V."""
        return float(self.tables["belt"]["width"])

    @cached_property
    def sheet(self) -> tuple[float, float, float]:
        """Rigidity, Poisson's ratio and mass per length of the whole width."""
        belt = self.tables["belt"]
        if "layers" in belt:
            names = [layer["material"].replace(" ", "").replace("-", "").lower() for layer in belt["layers"]]
            young, poisson, density = np.array([MATERIALS[name] for name in names]).T
            thickness = np.array([layer["thickness"] for layer in belt["layers"]])
        elif "material" in belt:
            own = belt["material"]
            young, poisson, density, thickness = (
                np.array([own[name]]) for name in ("young", "poisson", "density", "thickness")
            )
        else:
            return float(belt.get("rigidity", 1.0)), float(belt.get("poisson", 0.3)), float(belt.get("density", 0.0))
        stiff = young / (1.0 - poisson**2)
        middle = np.cumsum(thickness) - 0.5 * thickness
        neutral = (stiff * thickness * middle).sum() / (stiff * thickness).sum()
        inertia = thickness**3 / 12.0 + thickness * (middle - neutral) ** 2
        bending = (stiff * inertia).sum()
        return (
            float(self.width * bending),
            float((poisson * stiff * inertia).sum() / bending),
            float(self.width * (density * thickness).sum()),
        )

    def segment_at(self, u: float) -> int:
        """Number of the segment around an arc length."""
        return int(np.searchsorted(self.ends, u, side="right")) - 1

    def rigidity(self, number: int, u: Array) -> Array:
        """R_f of a segment at arc lengths of the belt."""
        own = self.segments[number].get("rigidity", self.sheet[0])
        if isinstance(own, dict):
            return np.interp(u - self.ends[number], own["u"], own["value"])
        return np.full_like(u, own)

    def natural_bend(self, number: int) -> float:
        """ω_ζ of the unloaded segment."""
        return float(self.segments[number].get("natural_bend", self.tables["belt"].get("natural_bend", 0.0)))

    def place(self, at: str | float) -> float:
        """The arc length of a place."""
        return {"start": 0.0, "end": self.length}[at] if isinstance(at, str) else float(at)

    def corner_at(self, u: float) -> float:
        """The angle of the board's corners at an arc length."""
        here = np.abs(self.ends[1:] - u) < SAME_PLACE * self.length
        angles = [segment.get("angle", 0.0) for segment in self.segments]
        return float(np.dot(angles, here))


def density(model: str, fields: tuple[Any, ...], board: tuple[Any, ...]) -> Any:
    """Elastic energy per length.

    `fields` are bend, rib slope, its mean over the element and its rate, `board` R_f, κ_g, natural bend, ν and width.
    The rib convergence is one number an element. Complex fields give derivatives by complex steps.
    """
    (bend, slope, mean, rate), (rigidity, geodesic, natural, poisson, width) = fields, board
    square = 1.0 + slope**2
    bending = (bend * square) ** 2
    factor = long = area = 1.0
    if model == "wunderlich":
        s = rate + geodesic * (1.0 + mean**2)
        low, high = (rib_end(geodesic, 1.0 + mean**2, width, side) for side in (-1.0, 1.0))
        small = np.abs(s) * width < 1e-4
        safe = np.where(small, 1.0 / width, s)
        ratio = (1.0 - safe * low) / (1.0 - safe * high)
        # Ribs that cross on the board have no energy: a claim that meets no number is not met.
        with np.errstate(invalid="ignore"):
            logarithm = np.log(ratio)
        series = (high - low) + s * (high**2 - low**2) / 2.0 + s**2 * (high**3 - low**3) / 3.0
        factor = np.where(small, series, logarithm / safe) / width
        # Of the strip between two ribs, (1 − s v) dv du is the area: what the natural bend adds is integrated over it.
        long = (high - low) / width
        area = long - s * (high**2 - low**2) / (2.0 * width)
    mixed = -2.0 * natural * square * bend + 2.0 * (1.0 - poisson) * natural * slope**2 * bend
    lengthened = np.sqrt(square) if model == "fishbone" else 1.0
    return 0.5 * rigidity * (bending * factor + mixed * long + natural**2 * area) * lengthened


def rib_end(geodesic: Any, square: Any, width: float, side: float) -> Any:
    """Where a rib meets the edge on a side: v of v − κ_g v² (1 + β²)/2 = ±V/2 − κ_g V²/8; NaN where it passes by."""
    reach, below = rib_root(geodesic, square, width, side)
    # Twice the reach over one and the root has no difference of near numbers.
    with np.errstate(invalid="ignore"):
        return 2.0 * reach / (1.0 + np.sqrt(below))


def rib_root(geodesic: Any, square: Any, width: float, side: float) -> tuple[Any, Any]:
    """How far a rib reaches where it is square, and what is below the root of its end: negative if it passes by."""
    reach = side * width / 2.0 - geodesic * width**2 / 8.0
    return reach, 1.0 - 2.0 * geodesic * square * reach


class Shape:
    """A result's fields on the elements of its mesh, at the five points of Boole's rule in each.

    Shapes: (m,) of m elements; (m, 5) of their points.
    """

    def __init__(self, tables: Json, result: Json) -> None:
        self.tables, self.result, self.board = tables, result, Board(tables)
        self.u, self.x, self.frame, self.bend, self.slope = (
            np.asarray(result[name], dtype=np.float64) for name in ("u", "position", "frame", "bend", "rib_slope")
        )
        self.first = np.flatnonzero(np.diff(self.u) > SAME_PLACE * self.board.length)
        self.h = self.u[self.first + 1] - self.u[self.first]
        self.share = np.linspace(0.0, 1.0, PARTS + 1)
        self.at = self.u[self.first, None] + self.h[:, None] * self.share
        self.segment = [self.board.segment_at(u) for u in self.at[:, PARTS // 2]]
        self.is_rigid = np.array([self.board.segments[i]["kind"] == "rigid" for i in self.segment])
        self.geodesic = np.array([self.board.segments[i].get("curvature", 0.0) for i in self.segment])
        self.rigidity = np.array([self.board.rigidity(i, u) for i, u in zip(self.segment, self.at, strict=True)])
        self.natural = np.array([self.board.natural_bend(i) for i in self.segment])
        self.rate = (self.slope[self.first + 1] - self.slope[self.first]) / self.h
        self.bends, self.slopes = (self.along(field) for field in (self.bend, self.slope))
        self.poses = self.integrated()

    def along(self, field: Array) -> Array:
        """A field that is linear in every element, at the points."""
        return (1.0 - self.share) * field[self.first, None] + self.share * field[self.first + 1, None]

    def rates(self, share: float) -> Array:
        """(κ_g, −β ω_ζ, ω_ζ) at a share of every element."""
        bend, slope = (
            (1.0 - share) * field[self.first] + share * field[self.first + 1] for field in (self.bend, self.slope)
        )
        return np.stack([self.geodesic, -slope * bend, bend], axis=1)

    def integrated(self) -> tuple[Array, Array]:
        """Positions and frames at the points, by Runge-Kutta steps from the pose at the start of each element."""
        x, frame = self.x[self.first], self.frame[self.first]
        positions, frames = [x], [frame]
        step = self.h[:, None] / PARTS
        for part in range(PARTS):
            increments = []
            for offset, back in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)):
                rates = self.rates((part + offset) / PARTS)
                here = frame + (back * step[:, :, None] * increments[-1][1] if increments else 0.0)
                increments.append((here[:, :, 1], here @ skew(rates)))
            weights = (1.0, 2.0, 2.0, 1.0)
            x = x + step * sum(w * i[0] for w, i in zip(weights, increments, strict=True)) / 6.0
            frame = frame + step[:, :, None] * sum(w * i[1] for w, i in zip(weights, increments, strict=True)) / 6.0
            positions.append(x)
            frames.append(frame)
        return np.stack(positions, axis=1), np.stack(frames, axis=1)

    def parameters(self) -> tuple[Any, ...]:
        """What the density takes of the board."""
        poisson = self.board.sheet[1]
        return self.rigidity, self.geodesic[:, None], self.natural[:, None], poisson, self.board.width

    @cached_property
    def densities(self) -> list[Array]:
        """The density and its derivatives by bend, rib slope, its mean and its rate; 0 on stiffeners."""
        step = 1e-30
        fields = np.broadcast_arrays(self.bends, self.slopes, self.slopes[:, [PARTS // 2]], self.rate[:, None])
        model, soft = self.result["energy_model"], ~self.is_rigid[:, None]
        values = [density(model, tuple(fields), self.parameters())]
        for i in range(len(fields)):
            moved = tuple(field + (step * 1j if i == j else 0j) for j, field in enumerate(fields))
            values.append(density(model, moved, self.parameters()).imag / step)
        return [value * soft for value in values]

    def integral(self, values: Array) -> Array:
        """Integrals over every element of values at the points: (m, 5, …) to (m, …)."""
        return np.einsum("mp...,p,m->m...", values, BOOLE, self.h)

    @cached_property
    def weight(self) -> Array:
        """Force per length."""
        gravity = self.tables.get("loads", {}).get("gravity", (0.0, 0.0, 0.0))
        return np.asarray(gravity, dtype=np.float64) * self.board.sheet[2]

    def node(self, at: str | float) -> int:
        """The first node at a place, before a corner."""
        return int(np.flatnonzero(np.abs(self.u - self.board.place(at)) < 1e-7 * self.board.length)[0])

    def point_loads(self) -> Iterator[tuple[int, Array, Array]]:
        """Node, force and point of application of the forces."""
        for load in self.tables.get("loads", {}).get("points", []):
            k = self.node(load["at"])
            yield k, np.asarray(load["force"]), self.x[k] + self.frame[k] @ np.asarray(load.get("lever", np.zeros(3)))

    def applied(self) -> Iterator[tuple[int, Array]]:
        """Node and wrench about the origin of all that acts at nodes."""
        for k, force, at in self.point_loads():
            yield k, wrench(force, at)
        for support in self.result["supports"]:
            k = self.node(support["at"])
            yield k, wrench(np.asarray(support["force"]), self.x[k], np.asarray(support["moment"]))
        for link, reaction in zip(self.tables.get("links", []), self.result["links"], strict=True):
            for at, sign in ((link["to"], 1.0), (link["from"], -1.0)):
                yield self.node(at), wrench(sign * np.asarray(reaction["force"]), self.x[self.node(at)])

    @cached_property
    def weights(self) -> Array:
        """Wrench about the origin of the weight of every element."""
        moment = np.cross(self.integral(self.poses[0]), self.weight)
        return np.hstack([self.h[:, None] * self.weight, moment])

    @cached_property
    def beyond(self) -> Array:
        """Wrench about the origin that what lies beyond the start of every element exerts, by what acts there."""
        total = np.cumsum(self.weights[::-1], axis=0)[::-1]
        for k, acting in self.applied():
            total = total + (self.first < k)[:, None] * acting
        if self.tables["belt"].get("closed", False):
            # What goes through the seam is known from the result alone; it is read where nothing acts.
            quiet = np.ones(len(self.first), dtype=bool)
            for k, _ in self.applied():
                quiet &= self.first != k
            m = int(np.flatnonzero(quiet)[np.count_nonzero(quiet) // 2])
            total = total + (self.internal[self.first[m]] - total[m])
        return total

    @cached_property
    def internal(self) -> Array:
        """The result's wrenches at the nodes, about the origin."""
        force, moment = (np.asarray(self.result["internal"][name], dtype=np.float64) for name in ("force", "moment"))
        return np.hstack([force, moment + np.cross(self.x, force)])

    @cached_property
    def moments(self) -> Array:
        """Internal moment about the spine in the axes of the frame, at the points, by what acts beyond."""
        x, frames = self.poses
        passed = (x - x[:, :1]) * 0.0
        lever = np.zeros_like(passed)
        for p in range(1, PARTS + 1):
            # By Hermite's rule from point to point, as exact as the poses.
            d = self.h[:, None] / PARTS
            piece = d / 2.0 * (x[:, p - 1] + x[:, p]) + d**2 / 12.0 * (frames[:, p - 1, :, 1] - frames[:, p, :, 1])
            lever[:, p] = lever[:, p - 1] + piece
            passed[:, p] = passed[:, p - 1] + d * self.weight
        force = self.beyond[:, None, :3] - passed
        about_origin = self.beyond[:, None, 3:] - np.cross(lever, self.weight)
        moment = about_origin - np.cross(x, force)
        return np.einsum("mpij,mpi->mpj", frames, moment)


def skew(rates: Array) -> Array:
    """[ω]× of every row."""
    zero = np.zeros(len(rates))
    a, b, c = rates.T
    return np.stack([zero, -c, b, c, zero, -a, -b, a, zero], axis=1).reshape(-1, 3, 3)


def wrench(force: Array, at: Array, moment: Array | float = 0.0) -> Array:
    """Force, and moment about the origin."""
    return np.concatenate([force, moment + np.cross(at, force)])
