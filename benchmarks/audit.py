"""An audit of results that shares no code with the solver: it reads a scenario's tables and the dictionary of the result.

Every claim of a converged result is computed again from the fields at the nodes: poses by Runge-Kutta steps, integrals by
Boole's rule, densities from their formulas, forces and moments from what acts on the belt. `failures` lists those that
do not hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

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
AXES = {"xi": 0, "eta": 1, "zeta": 2}
BOOLE = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
PARTS = len(BOOLE) - 1
SAME_PLACE = 1e-9
"""Arc lengths that are the same, over the length."""

# What may be off, relative.
ROUNDING = 1e-9
SUPPORTS = 1e-7
BALANCE = 1e-6
HONESTY = 10.0 / 3.0
"""Largest ratio of an error to its estimate."""
LEAST_ERROR = 1e-5
"""Errors by the mesh that need no estimate."""
STATIONARITY = 2e-2
"""Moments that miss the law of bending, over the largest moment; a mesh of accuracy 1e-3 misses it by less."""
ACTIVE = 1e-4
"""Slack 1 ∓ s v below which ribs may press on each other."""


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
        return list(self.tables["belt"]["segments"])

    @property
    def length(self) -> float:
        return float(self.ends[-1])

    @property
    def width(self) -> float:
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
        return float(
            sum(segment["angle"] for segment, ends in zip(self.segments, here, strict=True) if ends and "angle" in segment)
        )


def density(model: str, fields: tuple[Any, Any, Any], board: tuple[Any, ...]) -> Any:
    """Elastic energy per length: of bend, rib slope and its rate; of R_f, κ_g, natural bend, ν and width.

    Complex fields give derivatives by complex steps.
    """
    (bend, slope, rate), (rigidity, geodesic, natural, poisson, width) = fields, board
    square = 1.0 + slope**2
    bending = (bend * square) ** 2
    factor = 1.0
    if model == "wunderlich":
        s = rate + geodesic * square
        low, high = (rib_end(geodesic, square, width, side) for side in (-1.0, 1.0))
        small = np.abs(s) * width < 1e-4
        safe = np.where(small, 1.0 / width, s)
        ratio = (1.0 - safe * low) / (1.0 - safe * high)
        series = (high - low) + s * (high**2 - low**2) / 2.0 + s**2 * (high**3 - low**3) / 3.0
        factor = np.where(small, series, np.log(np.where(ratio.real > 0.0, ratio, 1e300)) / safe) / width
    curled = natural**2 - 2.0 * natural * square * bend + 2.0 * (1.0 - poisson) * natural * slope**2 * bend
    lengthened = np.sqrt(square) if model == "fishbone" else 1.0
    return 0.5 * rigidity * (bending * factor + curled) * lengthened


def rib_end(geodesic: Any, square: Any, width: float, side: float) -> Any:
    """Where a rib meets the edge on a side: v of v − κ_g v² (1 + β²)/2 = ±V/2 − κ_g V²/8."""
    reach = side * width / 2.0 - geodesic * width**2 / 8.0
    # Twice the reach over one and the root has no difference of near numbers.
    return 2.0 * reach / (1.0 + np.sqrt(1.0 - 2.0 * geodesic * square * reach + 0j if np.iscomplexobj(square) else
                                        np.maximum(1.0 - 2.0 * geodesic * square * reach, 0.0)))


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
    def densities(self) -> tuple[Array, Array, Array, Array]:
        """The density and its derivatives by bend, rib slope and its rate; 0 on stiffeners."""
        step = 1e-30
        fields = [self.bends, self.slopes, np.broadcast_to(self.rate[:, None], self.bends.shape)]
        model, soft = self.result["energy_model"], ~self.is_rigid[:, None]
        value = density(model, (fields[0], fields[1], fields[2]), self.parameters())
        derivatives = []
        for i in range(3):
            moved = [field + (step * 1j if i == j else 0j) for j, field in enumerate(fields)]
            derivatives.append(density(model, (moved[0], moved[1], moved[2]), self.parameters()).imag / step * soft)
        return np.real(value) * soft, derivatives[0], derivatives[1], derivatives[2]

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
            # What goes through the seam is known from the result alone: at the middle of the longest stretch without loads.
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


# ----------------------------------------------------------------------------------------------------------- claims


def failures(tables: Json, result: Json) -> list[str]:
    """What does not hold of a converged result, one line each with the size of the miss over what is allowed."""
    shape = Shape(tables, result)
    claims = (geometry, poses, supports, ribs, balance, energy, stationarity)
    misses = [(name, miss / allowed) for claim in claims for name, miss, allowed in claim(shape)]
    return [f"{name}: {ratio:.3g} of what is allowed" for name, ratio in misses if not ratio <= 1.0]


Misses = "Iterator[tuple[str, float, float]]"


def geometry(shape: Shape) -> Misses:
    """Frames, torsion, angle of ribs, curvature, edges and lengths."""
    frame, bend, slope, result = shape.frame, shape.bend, shape.slope, shape.result
    gram = np.einsum("nij,nik->njk", frame, frame)
    yield "frames are orthonormal", np.abs(gram - np.eye(3)).max(), ROUNDING
    yield "frames are right-handed", float(np.linalg.det(frame).min() < 0.0), 0.5
    scale = np.abs(bend * (1.0 + slope**2)).max() + 1e-3 / shape.board.length
    yield "torsion is −βω_ζ", np.abs(np.asarray(result["torsion"]) + slope * bend).max(), ROUNDING * scale
    yield "rib angle", np.abs(np.asarray(result["rib_angle"]) - np.arctan(slope)).max(), ROUNDING
    curvature = np.asarray(result["curvature"])
    yield "curvature", np.abs(curvature + bend * (1.0 + slope**2)).max(), ROUNDING * scale
    ruling = frame[:, :, 2] - slope[:, None] * frame[:, :, 1]
    for side in ("minus", "plus"):
        rib = np.asarray(result["edges"][side]) - shape.x
        off = np.linalg.norm(np.cross(rib, ruling), axis=1) / np.linalg.norm(ruling, axis=1)
        yield f"rib to the {side} edge lies on the ruling", off.max(), ROUNDING * shape.board.length
    yield "length", abs(shape.h.sum() - shape.board.length), ROUNDING * shape.board.length
    chord = np.linalg.norm(shape.x[shape.first + 1] - shape.x[shape.first], axis=1)
    yield "chord against arc", (chord / shape.h).max() - 1.0, LEAST_ERROR
    turn = np.linalg.norm(Rotation.from_matrix(relative(shape)).as_rotvec(), axis=1)
    yield "turn of an element", turn[~shape.is_rigid].max(), 0.5
    joint = np.flatnonzero(np.diff(shape.u) <= SAME_PLACE * shape.board.length)
    for k in joint:
        turned = Rotation.from_rotvec([shape.board.corner_at(shape.u[k]), 0.0, 0.0]).as_matrix()
        yield "frames at a joint", np.abs(frame[k] @ turned - frame[k + 1]).max(), 1e-8
        angle = np.arctan(slope[k]) - np.arctan(slope[k + 1]) - shape.board.corner_at(shape.u[k])
        yield "rib at a joint", abs(angle), 1e-8
        yield "position at a joint", np.abs(shape.x[k + 1] - shape.x[k]).max(), ROUNDING * shape.board.length


def relative(shape: Shape) -> Array:
    """Turn of every element, from its first frame to its last."""
    return np.einsum("mji,mjk->mik", shape.frame[shape.first], shape.frame[shape.first + 1])


def poses(shape: Shape) -> Misses:
    """Poses follow from bend, rib slope and in-plane curvature: element by element, and all along."""
    x, frames = shape.poses
    length = shape.board.length
    allowed = max(LEAST_ERROR, HONESTY * (shape.result["error"]["position"] or 1e-3))
    off_x, off_frame = x[:, -1] - shape.x[shape.first + 1], frames[:, -1] - shape.frame[shape.first + 1]
    yield "frame over an element", np.abs(off_frame).max(), 3e-4
    # A turn e of the frame after an element and a shift of its end move all that follows.
    turns = np.einsum("mij,mkj->mik", frames[:, -1], shape.frame[shape.first + 1])
    axial = 0.5 * np.stack([turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]], 1)
    moved = np.cumsum(off_x - np.cross(axial, shape.x[shape.first + 1]), axis=0)
    turned = np.cumsum(axial, axis=0)
    drift = moved + np.cross(turned, shape.x[shape.first + 1])
    yield "spine by integration", np.linalg.norm(drift, axis=1).max(), allowed * length


def supports(shape: Shape) -> Misses:
    """Supports and links hold, and exert nothing where they are free."""
    length = shape.board.length
    reactions = shape.result["supports"]
    forces = [np.linalg.norm(np.asarray(one["force"])) * length for one in reactions]
    scale = max([*forces, *(np.linalg.norm(one["moment"]) for one in reactions), 1e-6 * shape.board.sheet[0] / length])
    ends = {0.0, length} if not shape.tables["belt"].get("closed", False) else set()
    for support, reaction in zip(shape.tables.get("supports", []), reactions, strict=True):
        k, force, moment = shape.node(support["at"]), np.asarray(reaction["force"]), np.asarray(reaction["moment"])
        position = support.get("position", ["free"] * 3)
        for i, component in enumerate(position):
            if component == "free":
                yield "force where a coordinate is free", abs(force[i]) * length, BALANCE * scale
            else:
                yield "position of a support", abs(shape.x[k, i] - component), SUPPORTS * length
        if "rotation" not in support:
            yield "moment of a pin", np.abs(moment).max(), BALANCE * scale
            continue
        wanted = Rotation.from_rotvec(support["rotation"]).as_matrix()
        if "hinge" in support:
            axis = AXES[support["hinge"]]
            yield "axis of a hinge", np.abs(shape.frame[k, :, axis] - wanted[:, axis]).max(), SUPPORTS
            yield "moment about a hinge", abs(moment @ wanted[:, axis]), BALANCE * scale
        else:
            yield "frame of a support", np.abs(shape.frame[k] - wanted).max(), SUPPORTS
        square = "position" in support and shape.board.place(support["at"]) in ends
        if support.get("square_rib", square):
            yield "square rib", abs(shape.slope[k]), SUPPORTS
    for link in shape.tables.get("links", []):
        offset = shape.x[shape.node(link["to"])] - shape.x[shape.node(link["from"])]
        yield "offset of a link", np.abs(offset - np.asarray(link["offset"])).max(), SUPPORTS * length
    if shape.tables["belt"].get("closed", False):
        yield "seam, position", np.linalg.norm(shape.x[-1] - shape.x[0]), SUPPORTS * length
        sign = (-1.0) ** shape.result["half_turns"]
        yield "seam, frame", np.abs(shape.frame[-1] - shape.frame[0] * [sign, 1.0, sign]).max(), SUPPORTS
        yield "seam, ribs", abs(shape.slope[-1] - sign * shape.slope[0]), SUPPORTS


def slacks(shape: Shape) -> tuple[Array, Array]:
    """Slack of the ribs of every element against crossing at the −ζ and the +ζ edge, and v of these edges, (m, 2) each."""
    middle = 0.5 * (shape.slope[shape.first] + shape.slope[shape.first + 1])
    square = 1.0 + middle**2
    s = shape.rate + shape.geodesic * square
    half = shape.board.width / 2.0
    low = np.where(shape.geodesic < 0.0, rib_end(shape.geodesic, square, shape.board.width, -1.0), -half)
    high = np.where(shape.geodesic > 0.0, rib_end(shape.geodesic, square, shape.board.width, 1.0), half)
    v = np.stack([low, high], axis=1)
    return 1.0 - s[:, None] * v, v


def ribs(shape: Shape) -> Misses:
    """Ribs do not cross on the board, Eq. (33); stiffeners do not bend."""
    slack, _ = slacks(shape)
    yield "ribs cross", -slack[~shape.is_rigid].min(), 1e-9
    inside = np.concatenate([shape.first[shape.is_rigid], shape.first[shape.is_rigid] + 1])
    if inside.size:
        yield "bend of a stiffener", np.abs(shape.bend[inside]).max() * shape.board.length, ROUNDING
        yield "ribs beside a stiffener", np.abs(shape.slope[inside]).max(), SUPPORTS


def in_moments(shape: Shape, wrenches: Array) -> Array:
    """Wrenches with forces times the length."""
    return np.abs(wrenches * np.repeat([shape.board.length, 1.0], 3))


def largest(shape: Shape) -> float:
    """The largest moment, or force times the length, and no less than a millionth of R_f/U."""
    acting = [wrench_ for _, wrench_ in shape.applied()]
    every = np.vstack([shape.internal, shape.weights, *acting])
    return float(max(in_moments(shape, every).max(), 1e-6 * shape.board.sheet[0] / shape.board.length))


def balance(shape: Shape) -> Misses:
    """Forces and moments: of the belt as a whole, and of the part beyond every node."""
    allowed = (BALANCE + LEAST_ERROR * bool(shape.weight.any())) * largest(shape)
    total = shape.weights.sum(axis=0) + sum((acting for _, acting in shape.applied()), np.zeros(6))
    yield "balance of the whole", in_moments(shape, total).max(), allowed
    off = in_moments(shape, shape.internal[shape.first] - shape.beyond).max(axis=1)
    # At a node where something acts the result has the force before it or after it.
    for k, acting in shape.applied():
        here = shape.first == k
        off[here] = np.minimum(off, in_moments(shape, shape.internal[shape.first] - shape.beyond - acting).max(axis=1))[here]
    yield "balance of the part beyond a node", off.max(), allowed


def energy(shape: Shape) -> Misses:
    """Elastic energy and potential of the loads, by other quadrature."""
    elastic, total = shape.result["elastic_energy"], shape.result["energy"]
    scale = max(abs(elastic), abs(total), 1e-9 * shape.board.sheet[0] / shape.board.length)
    allowed = max(LEAST_ERROR, HONESTY * shape.result["error"]["energy"]) * scale
    yield "elastic energy", abs(shape.integral(shape.densities[0]).sum() - elastic), allowed
    hung = sum(float(force @ at) for _, force, at in shape.point_loads())
    potential = -float(shape.integral(shape.poses[0]).sum(axis=0) @ shape.weight) - hung
    yield "potential of the loads", abs(total - elastic - potential), LEAST_ERROR * max(scale, abs(potential))
    radius = shape.result["least_spine_radius"]["value"]
    tightest = np.abs(np.asarray(shape.result["curvature"])).max()
    if radius is not None:
        yield "least radius on the spine", radius * tightest - 1.0, ROUNDING


def stationarity(shape: Shape) -> Misses:
    """The law of bending, weakly: no change of bend or rib slope at a node lowers energy against the internal moment.

    By bend: ∂e/∂ω_ζ = m_ζ − β m_η. By rib slope: ∂e/∂β + ω_ζ m_η − (∂e/∂β')' is what ribs that touch press on each other.
    """
    _, by_bend, by_slope, by_rate = shape.densities
    _, torsional, bending = np.moveaxis(shape.moments, 2, 0)
    soft = ~shape.is_rigid[:, None]
    moment = max(np.abs(shape.moments).max(), 1e-6 * shape.board.sheet[0] / shape.board.length)
    bend_rest, slope_rest, span = (np.zeros(len(shape.u)) for _ in range(3))
    off_bend = (by_bend - (bending - shape.slopes * torsional)) * soft
    off_slope = (by_slope + shape.bends * torsional) * soft
    for end, hat in ((0, 1.0 - shape.share), (1, shape.share)):
        np.add.at(bend_rest, shape.first + end, shape.integral(off_bend * hat))
        fall = (2 * end - 1) / shape.h
        np.add.at(slope_rest, shape.first + end, shape.integral(off_slope * hat + by_rate * fall[:, None]))
        np.add.at(span, shape.first + end, 0.5 * shape.h * ~shape.is_rigid)
    fold_seam(shape, bend_rest, slope_rest, span)
    free = span > 0.0
    worst = np.abs(bend_rest[free] / span[free]).max()
    yield "law of bending", worst, STATIONARITY * moment
    yield from pressing_ribs(shape, slope_rest, moment)


def fold_seam(shape: Shape, bend_rest: Array, slope_rest: Array, span: Array) -> None:
    """The two nodes of a seam are one."""
    if not shape.tables["belt"].get("closed", False):
        return
    sign = (-1.0) ** shape.result["half_turns"]
    for rest in (bend_rest, slope_rest):
        rest[0] += sign * rest[-1]
        rest[-1] = 0.0
    span[0] += span[-1]
    span[-1] = span[0]


def pressing_ribs(shape: Shape, rest: Array, moment: float) -> Misses:
    """Ribs press on each other only where they touch, and never pull: the rest is a sum of such pressures."""
    slack, v = slacks(shape)
    columns = []
    for m, side in np.argwhere((slack < ACTIVE) & ~shape.is_rigid[:, None]):
        k = shape.first[m]
        turn = shape.geodesic[m] * (shape.slope[k] + shape.slope[k + 1]) / 2.0
        column = np.zeros(len(rest))
        column[k : k + 2] = v[m, side] * np.array([turn - 1.0 / shape.h[m], turn + 1.0 / shape.h[m]])
        columns.append(column)
    # A change of slope at a joint goes on beyond it, with the derivative of the rule of corners.
    rows = np.vstack([rest, *columns])
    for k in np.flatnonzero(np.diff(shape.u) <= SAME_PLACE * shape.board.length)[::-1]:
        rows[:, k] += rows[:, k + 1] * (1.0 + shape.slope[k + 1] ** 2) / (1.0 + shape.slope[k] ** 2)
        rows[:, k + 1] = 0.0
    if shape.tables["belt"].get("closed", False):
        rows[1:, 0] += (-1.0) ** shape.result["half_turns"] * rows[1:, -1]
        rows[1:, -1] = 0.0
    counted = ~is_held(shape)
    left = rows[0, counted]
    if columns:
        _, miss = nnls(rows[1:, counted].T, -left)
    else:
        miss = np.linalg.norm(left)
    scale = moment * max(np.abs(shape.bend).max() * shape.board.width, 1e-3)
    yield "law of ribs", miss, STATIONARITY * scale


def is_held(shape: Shape) -> npt.NDArray[np.bool_]:
    """Nodes whose rib slope is prescribed, or may be bounded by an edge that this audit does not know: beside corners."""
    held = np.zeros(len(shape.u), dtype=bool)
    rigid = shape.first[shape.is_rigid]
    held[rigid] = held[rigid + 1] = True
    ends = {0.0, shape.board.length} if not shape.tables["belt"].get("closed", False) else set()
    for support in shape.tables.get("supports", []):
        square = "position" in support and "rotation" in support and shape.board.place(support["at"]) in ends
        if support.get("square_rib", square):
            held |= np.abs(shape.u - shape.board.place(support["at"])) <= SAME_PLACE * shape.board.length
    reach = shape.board.width * (1.0 + np.abs(shape.slope))
    for place, segment in zip(shape.board.ends[1:], shape.board.segments, strict=True):
        if segment["kind"] == "corner":
            held |= np.abs(shape.u - place) < 2.0 * reach
    return held
