"""An audit of results that shares no code with the solver.

It reads a scenario's tables and the dictionary of the result. Every claim of a converged result is computed again from
the fields at the nodes; `failures` lists those that do not hold.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls
from scipy.sparse import csr_array, eye_array, lil_array
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from audit_model import SAME_PLACE, Array, Json, Shape, rib_end, rib_root

if TYPE_CHECKING:
    from collections.abc import Iterator

    Misses = Iterator[tuple[str, float, float]]
    """Claims, each with its miss and the miss that is allowed."""

AXES = {"xi": 0, "eta": 1, "zeta": 2}


# What may be off, relative.
ROUNDING = 1e-9
SUPPORTS = 1e-7
BALANCE = 1e-6
HONESTY = 10.0 / 3.0
"""Largest ratio of an error to its estimate."""
LEAST_ERROR = 3e-5
"""Errors by the mesh that need no estimate."""
LONGEST_CHORD = 1e-3
"""Excess of an element's chord over its length, by the error of the pose where the bend changes its sign."""
MOST_TURN = 0.5
"""Turn of an element, in rad."""
FRAME = 3e-4
"""Error of the pose over one element, in rad."""
STATIONARITY = 5e-3
"""Moments that miss the law of bending, over the largest moment; a mesh of accuracy 1e-3 misses it by less."""
ACTIVE = 1e-4
"""Slack 1 ∓ s v below which ribs may press on each other."""


GRAZING = 0.01
"""What is below the root of a rib's end where the rib all but passes by the edge: see docs/theory.md."""

# ----------------------------------------------------------------------------------------------------------- claims


def failures(tables: Json, result: Json) -> list[str]:
    """What does not hold of a converged result, one line each with the size of the miss over what is allowed.

    What an error by the mesh makes of a claim is allowed in proportion, where the result says that its error is large.
    """
    shape = Shape(tables, result)
    claims = (geometry, poses, supports, ribs, balance, energy, stationarity)
    misses = [(name, miss / allowed) for claim in claims for name, miss, allowed in claim(shape)]
    return [f"{name}: {ratio:.3g} of what is allowed" for name, ratio in misses if not ratio <= 1.0]


def roughness(shape: Shape) -> float:
    """Error by the mesh that the result states over the one that a scenario asks for by default, and no less than 1."""
    return max(1.0, *(error / 1e-3 for error in shape.result["error"].values() if error is not None))


def geometry(shape: Shape) -> Misses:
    """Residuals, frames, torsion, angle of ribs, curvature, edges and lengths."""
    frame, bend, slope, result = shape.frame, shape.bend, shape.slope, shape.result
    tolerance = shape.tables.get("solver", {}).get("tolerance", 1e-8)
    yield "residuals", max(result["residuals"].values()), tolerance
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
    yield "chord against arc", (chord / shape.h).max() - 1.0, LONGEST_CHORD * roughness(shape)
    turn = np.linalg.norm(Rotation.from_matrix(relative(shape)).as_rotvec(), axis=1)
    yield "turn of an element", turn[~shape.is_rigid].max(), MOST_TURN * roughness(shape)
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
    yield "frame over an element", np.abs(off_frame).max(), FRAME * roughness(shape)
    # A turn e of the frame after an element and a shift of its end move all that follows.
    turns = np.einsum("mij,mkj->mik", frames[:, -1], shape.frame[shape.first + 1])
    axial = Rotation.from_matrix(turns).as_rotvec()
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
    """Slack of the ribs of every element against crossing, and v of the edges: −ζ and +ζ, (m, 2) each."""
    middle = 0.5 * (shape.slope[shape.first] + shape.slope[shape.first + 1])
    square = 1.0 + middle**2
    s = shape.rate + shape.geodesic * square
    half = shape.board.width / 2.0
    low = np.where(shape.geodesic < 0.0, rib_end(shape.geodesic, square, shape.board.width, -1.0), -half)
    high = np.where(shape.geodesic > 0.0, rib_end(shape.geodesic, square, shape.board.width, 1.0), half)
    v = np.stack([low, high], axis=1)
    return 1.0 - s[:, None] * v, v


def meet_edges(shape: Shape) -> npt.NDArray[np.bool_]:
    """Ribs that meet the edges of their own arc, not at a graze; others leave across edges unknown here.

    Shapes: (m, 2) of the elements, −ζ and +ζ
    """
    middle = 0.5 * (shape.slope[shape.first] + shape.slope[shape.first + 1])
    below = [rib_root(shape.geodesic, 1.0 + middle**2, shape.board.width, side)[1] for side in (-1.0, 1.0)]
    return np.stack(below, axis=1) > GRAZING


def ribs(shape: Shape) -> Misses:
    """Ribs do not cross on the board, Eq. (33); stiffeners do not bend."""
    slack, _ = slacks(shape)
    yield "ribs cross", -slack[meet_edges(shape) & ~shape.is_rigid[:, None]].min(), 1e-9
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
        other = in_moments(shape, shape.internal[shape.first] - shape.beyond - acting).max(axis=1)
        off[here] = np.minimum(off, other)[here]
    yield "balance of the part beyond a node", off.max(), allowed


def energy(shape: Shape) -> Misses:
    """Elastic energy and potential of the loads, by other quadrature."""
    elastic, total = shape.result["elastic_energy"], shape.result["energy"]
    scale = max(abs(elastic), abs(total), 1e-9 * shape.board.sheet[0] / shape.board.length)
    error = shape.result["error"]["energy"]
    # An energy of next to nothing, of which no error is claimed, is next to nothing.
    allowed = (
        1e-13 * shape.board.sheet[0] / shape.board.length
        if error is None
        else max(LEAST_ERROR, HONESTY * error) * scale
    )
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

    By bend: ∂e/∂ω_ζ = m_ζ − β m_η. By rib slope: ∂e/∂β + ω_ζ m_η − (∂e/∂β')' is the pressure of ribs that touch.
    """
    _, by_bend, by_slope, by_mean, by_rate = shape.densities
    _, torsional, bending = np.moveaxis(shape.moments, 2, 0)
    soft = ~shape.is_rigid[:, None]
    moment = max(np.abs(shape.moments).max(), 1e-6 * shape.board.sheet[0] / shape.board.length)
    bend_rest, slope_rest, span = (np.zeros(len(shape.u)) for _ in range(3))
    off_bend = (by_bend - (bending - shape.slopes * torsional)) * soft
    off_slope = (by_slope + shape.bends * torsional) * soft
    for end, hat in ((0, 1.0 - shape.share), (1, shape.share)):
        np.add.at(bend_rest, shape.first + end, shape.integral(off_bend * hat))
        fall = (2 * end - 1) / shape.h[:, None]
        rest = shape.integral(off_slope * hat + 0.5 * by_mean + by_rate * fall)
        np.add.at(slope_rest, shape.first + end, rest)
        np.add.at(span, shape.first + end, 0.5 * shape.h * ~shape.is_rigid)
    fold_seam(shape, bend_rest, span)
    free = span > 0.0
    worst = np.abs(bend_rest[free] / span[free]).max()
    yield "law of bending", worst, STATIONARITY * roughness(shape) * moment
    if not np.isfinite(slope_rest).all():
        yield "law of ribs", np.nan, 1.0
        return
    yield from pressing_ribs(shape, slope_rest, moment)


def fold_seam(shape: Shape, bend_rest: Array, span: Array) -> None:
    """The two nodes of a seam have one bend."""
    if not shape.tables["belt"].get("closed", False):
        return
    sign = (-1.0) ** shape.result["half_turns"]
    bend_rest[0] += sign * bend_rest[-1]
    bend_rest[-1] = 0.0
    span[0] += span[-1]
    span[-1] = span[0]


def pressing_ribs(shape: Shape, rest: Array, moment: float) -> Misses:
    """Ribs press on each other only where they touch, and never pull: the rest is a sum of such pressures."""
    slack, v = slacks(shape)
    places, sides = np.nonzero((slack < ACTIVE) & ~shape.is_rigid[:, None])
    k = shape.first[places]
    turn = shape.geodesic[places] * (shape.slope[k] + shape.slope[k + 1]) / 2.0
    pressures = lil_array((len(rest), len(places)))
    pressures[k, np.arange(len(k))] = v[places, sides] * (turn - 1.0 / shape.h[places])
    pressures[k + 1, np.arange(len(k))] = v[places, sides] * (turn + 1.0 / shape.h[places])
    go_on, counted = joined(shape), ~is_held(shape)
    left, columns = (go_on @ rest)[counted], (go_on @ pressures.tocsr())[counted]
    scale = moment * max(np.abs(shape.bend).max() * shape.board.width, 1e-3)
    allowed = STATIONARITY * roughness(shape) * scale
    yield "law of ribs", least_rest(left, columns, allowed), allowed


def least_rest(left: Array, columns: csr_array, enough: float) -> float:
    """Norm of what pressures, which are not negative, leave of a rest: the least one, or one that is small enough."""
    columns = columns[:, np.flatnonzero(np.abs(columns).sum(axis=0))]
    square = columns.T @ columns
    if square.shape[0] == 0:
        return float(np.linalg.norm(left))
    damping = 1e-12 * square.trace() / square.shape[0]
    pressure = spsolve((square + damping * eye_array(square.shape[0])).tocsc(), -(columns.T @ left))
    rest = float(np.linalg.norm(left + columns @ np.maximum(pressure, 0.0)))
    return rest if rest <= enough else float(nnls(columns.toarray(), -left)[1])


def joined(shape: Shape) -> csr_array:
    """Sums over nodes that have one rib slope: of a joint, by the rule of corners, and of a seam.

    Shapes: (n, n)
    """
    sums = eye_array(len(shape.u)).tolil()
    for k in np.flatnonzero(np.diff(shape.u) <= SAME_PLACE * shape.board.length)[::-1]:
        sums[k] += sums[k + 1] * (1.0 + shape.slope[k + 1] ** 2) / (1.0 + shape.slope[k] ** 2)
        sums[k + 1] *= 0.0
    if shape.tables["belt"].get("closed", False):
        sums[0] += (-1.0) ** shape.result["half_turns"] * sums[len(shape.u) - 1]
        sums[len(shape.u) - 1] *= 0.0
    return sums.tocsr()


def is_held(shape: Shape) -> npt.NDArray[np.bool_]:
    """Nodes whose rib slope is prescribed, or may be bounded by edges that this audit does not know.

    These are beside corners, and where ribs lean past the end of their own arc.
    """
    held = np.zeros(len(shape.u), dtype=bool)
    for k in np.flatnonzero(shape.is_rigid):
        held |= np.abs(shape.u - shape.at[k, 0]) <= SAME_PLACE * shape.board.length
        held |= np.abs(shape.u - shape.at[k, -1]) <= SAME_PLACE * shape.board.length
    ends = {0.0, shape.board.length} if not shape.tables["belt"].get("closed", False) else set()
    for support in shape.tables.get("supports", []):
        square = "position" in support and "rotation" in support and shape.board.place(support["at"]) in ends
        if support.get("square_rib", square):
            held |= np.abs(shape.u - shape.board.place(support["at"])) <= SAME_PLACE * shape.board.length
    lean = shape.board.width * np.abs(shape.slope)
    for place, segment in zip(shape.board.ends[1:], shape.board.segments, strict=True):
        if segment["kind"] == "corner":
            held |= np.abs(shape.u - place) < 2.0 * (shape.board.width + lean)
    curvatures = [segment.get("curvature", 0.0) for segment in shape.board.segments]
    for place, (before, after) in zip(shape.board.ends[1:-1], pairwise(curvatures), strict=True):
        if before != after:
            held |= np.abs(shape.u - place) < lean
    return held
