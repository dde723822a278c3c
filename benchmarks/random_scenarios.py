"""Random scenarios of 14 kinds that some shape of the belt meets; seeds fixed. `audit_random.py` audits them.

Each is read off a random developable shape, and its supports and links hold places of this shape. So every scenario
is feasible, and a solve that does not converge has failed. The shapes are of two sorts, integrated without the solver:

- strips, whose bend and rib slope are smooth random functions of the arc length, with square ribs at both ends;
- rolls, boards with corners on a cylinder of random section, so that their ribs are parallel in the flat board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from collections.abc import Callable

Array = npt.NDArray[np.float64]
Json = dict[str, Any]

ENERGIES = ("fishbone", "sadowsky", "wunderlich")
STEPS = 2000
WAVES = 3
STEEPEST = 0.6
"""Largest rib convergence |s| V/2 of a strip: ribs cross at 1."""
PLAIN: list[Json] = [{"kind": "straight", "length": 1.0}]
AXES = ("xi", "eta", "zeta")


@dataclass(frozen=True)
class Strip:
    """A developable shape of length 1: arc lengths, positions and frames (columns ξ, η, ζ)."""

    width: float
    u: Array
    position: Array
    frame: Array

    def at(self, u: float) -> int:
        """Number of the node nearest to an arc length."""
        return int(np.abs(self.u - u).argmin())


# ------------------------------------------------------------------------------------------------------------ shapes


def waves(rng: np.random.Generator, u: Array, size: float) -> Array:
    """A smooth random function: cosines of falling amplitude."""
    orders = np.arange(WAVES + 1)
    return (rng.normal(0.0, size, WAVES + 1) / (1.0 + 0.5 * orders)) @ np.cos(np.pi * orders[:, None] * u)


def random_strip(
    rng: np.random.Generator, geodesic: Array | float = 0.0, bent: float = 1.0, soft: Array | float = 1.0
) -> Strip:
    """A strip with random smooth bend, `bent` times as large, and rib slope; its rates of turn are (κ_g, −β ω_ζ, ω_ζ).

    `geodesic` is the in-plane curvature, and `soft` is 0 where the strip is a stiffener and else rises to 1 beside it;
    numbers, or values at the nodes.
    """
    u = np.linspace(0.0, 1.0, STEPS + 1)
    geodesic, soft = np.broadcast_to(geodesic, u.shape), np.broadcast_to(soft, u.shape)
    width = min(rng.uniform(0.02, 0.2), 0.7 / max(np.abs(geodesic).max(), 1e-9))
    bend = bent * waves(rng, u, 3.0) * (soft > 0.0)
    slope = rng.normal(0.0, 1.0, WAVES) @ np.sin(np.pi * np.arange(1, WAVES + 1)[:, None] * u) * soft
    slope *= rng.uniform(0.0, 1.0) / np.abs(slope).max()
    while np.abs(np.gradient(slope, u) + geodesic * (1.0 + slope**2)).max() > 2.0 * STEEPEST / width:
        slope *= 0.9
    middle = 0.5 * (u[1:] + u[:-1])
    inner_bend, inner_slope = (np.interp(middle, u, field) for field in (bend, slope))
    rates = np.stack([0.5 * (geodesic[1:] + geodesic[:-1]), -inner_slope * inner_bend, inner_bend], axis=1)
    turns, halves = (Rotation.from_rotvec(rates / STEPS / parts).as_matrix() for parts in (1.0, 2.0))
    frame, position = np.empty((STEPS + 1, 3, 3)), np.zeros((STEPS + 1, 3))
    frame[0] = np.eye(3)
    for k in range(STEPS):
        position[k + 1] = position[k] + (frame[k] @ halves[k])[:, 1] / STEPS
        frame[k + 1] = frame[k] @ turns[k]
    return Strip(width, u, position, frame)


def random_roll(rng: np.random.Generator, segments: list[Json]) -> Strip:
    """A board of straight segments and corners on a random cylinder; at a corner the frame before it."""
    u = np.linspace(0.0, 1.0, STEPS + 1)
    heading, reached = np.zeros(STEPS + 1), 0.0
    for segment in segments:
        if segment["kind"] == "corner":
            heading[u > reached + 1e-9] += segment["angle"]
        reached += segment.get("length", 0.0)
    # In the flat board, (y, z): directions of the spine, of the ribs, and across the ribs.
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    lean = 0.5 * (heading.min() + heading.max()) + rng.uniform(-0.3, 0.3)
    across, rib = np.array([np.cos(lean), np.sin(lean)]), np.array([-np.sin(lean), np.cos(lean)])
    flat = np.vstack([np.zeros(2), np.cumsum(along[1:], axis=0) / STEPS])
    p, q = flat @ across, flat @ rib
    grid = np.linspace(p.min(), p.max(), STEPS + 1)
    angle = np.concatenate([[0.0], np.cumsum(waves(rng, np.linspace(0.0, 1.0, STEPS), 2.0))]) * (grid[1] - grid[0])
    middle = 0.5 * (angle[1:] + angle[:-1])
    section = np.stack([np.cos(middle), np.sin(middle)], axis=1) * (grid[1] - grid[0])
    drawn = np.vstack([np.zeros(2), np.cumsum(section, axis=0)])
    forward, up = (np.interp(p, grid, drawn[:, i]) for i in range(2))
    turn = np.interp(p, grid, angle)
    flat_axes = [np.array([0.0, *across]), np.array([0.0, *rib]), np.array([1.0, 0.0, 0.0])]
    position = forward[:, None] * flat_axes[0] + q[:, None] * flat_axes[1] + up[:, None] * flat_axes[2]
    bent = np.cos(turn)[:, None] * flat_axes[0] + np.sin(turn)[:, None] * flat_axes[2]
    normal = np.cos(turn)[:, None] * flat_axes[2] - np.sin(turn)[:, None] * flat_axes[0]
    tangent = (along @ across)[:, None] * bent + (along @ rib)[:, None] * flat_axes[1]
    frame = np.stack([normal, tangent, np.cross(normal, tangent)], axis=2)
    return Strip(rng.uniform(0.02, 0.1), u, position, frame)


# ----------------------------------------------------------------------------------------------------------- boards


def lengths(rng: np.random.Generator, count: int, least: float = 0.1) -> list[float]:
    """Random lengths that sum to 1, in steps of the nodes."""
    share = least + (1.0 - count * least) * rng.dirichlet(np.full(count, 2.0))
    ends = np.round(np.cumsum(share) * STEPS / 10.0) * 10.0 / STEPS
    ends[-1] = 1.0
    return [round(float(length), 6) for length in np.diff(ends, prepend=0.0)]


def random_arcs(rng: np.random.Generator) -> list[Json]:
    """One to four arcs and straight segments, with one arc at least."""
    parts = lengths(rng, int(rng.integers(1, 5)))
    curved = rng.integers(0, len(parts))
    return [arc_or_straight(rng, part, is_arc=i == curved or bool(rng.integers(0, 2))) for i, part in enumerate(parts)]


def arc_or_straight(rng: np.random.Generator, length: float, *, is_arc: bool) -> Json:
    """A segment; an arc turns by no more than a half turn."""
    if not is_arc:
        return {"kind": "straight", "length": length}
    most = min(6.0, np.pi / length)
    return {"kind": "arc", "length": length, "curvature": float(rng.uniform(0.05, 1.0) * most * rng.choice([-1, 1]))}


def with_stiffeners(rng: np.random.Generator) -> list[Json]:
    """Straight segments with one or two stiffeners between or beside them."""
    count = int(rng.integers(1, 3))
    parts = lengths(rng, 2 * count + 1, 0.08)
    segments: list[Json] = []
    for i, part in enumerate(parts):
        segments.append({"kind": "rigid" if i % 2 else "straight", "length": part})
    return segments[int(rng.integers(0, 2)) :] if count == 2 and rng.integers(0, 2) else segments


def stretched(segments: list[Json]) -> list[Json]:
    """The same segments, made longer together so that the whole is 1 long."""
    whole = sum(segment.get("length", 0.0) for segment in segments)
    ends = np.round(np.cumsum([segment["length"] / whole for segment in segments]) * STEPS) / STEPS
    return [segment | {"length": float(d)} for segment, d in zip(segments, np.diff(ends, prepend=0.0), strict=True)]


def strip_of(rng: np.random.Generator, segments: list[Json], bent: float = 1.0) -> Strip:
    """A random strip of a board of straight segments, arcs and stiffeners."""
    u = np.linspace(0.0, 1.0, STEPS + 1)
    geodesic, soft, reached = np.zeros_like(u), np.ones_like(u), 0.0
    for segment in segments:
        end = reached + segment["length"]
        inside = (u >= reached - 1e-9) & (u <= end + 1e-9)
        geodesic[inside] = segment.get("curvature", 0.0)
        if segment["kind"] == "rigid":
            away = np.maximum(reached - u, u - end)
            soft = soft * np.clip(away / 0.05, 0.0, 1.0)
        reached = end
    return random_strip(rng, geodesic, bent, soft)


def table_of(rng: np.random.Generator, length: float) -> Json:
    """A rigidity that varies along a segment, by factors up to 4."""
    count = int(rng.integers(2, 6))
    places = np.linspace(0.0, length, count)
    places[1:-1] += rng.uniform(-0.3, 0.3, count - 2) * length / (count - 1)
    return {"u": places.tolist(), "value": np.exp(rng.uniform(-0.7, 0.7, count)).tolist()}


# --------------------------------------------------------------------------------------------------------- supports


def held(strip: Strip, node: int, *, with_frame: bool) -> Json:
    """A support that holds a node of the strip where it is."""
    place = {0: "start", STEPS: "end"}.get(node, float(strip.u[node]))
    support: Json = {"at": place, "position": strip.position[node].tolist()}
    if with_frame:
        support["rotation"] = Rotation.from_matrix(strip.frame[node]).as_rotvec().tolist()
    return support


def clamped(strip: Strip) -> list[Json]:
    """Clamps at both ends."""
    return [held(strip, node, with_frame=True) for node in (0, STEPS)]


def clamped_or_pinned(rng: np.random.Generator, strip: Strip) -> list[Json]:
    """Two ends, each clamped or pinned."""
    return [held(strip, node, with_frame=bool(rng.integers(0, 2))) for node in (0, STEPS)]


def random_tie(rng: np.random.Generator, strip: Strip) -> Json:
    """A link between two places of the strip."""
    a, b = (strip.at(u) for u in np.sort(rng.uniform(0.05, 0.95, 2)) + np.array([-0.03, 0.03]))
    offset = (strip.position[b] - strip.position[a]).tolist()
    return {"from": float(strip.u[a]), "to": float(strip.u[b]), "offset": offset}


def random_forces(rng: np.random.Generator, count: int, size: float) -> list[Json]:
    """Dead forces up to a size, at the end or in between, some on a lever."""
    places: list[Any] = ["end" if rng.integers(0, 3) == 0 else float(rng.uniform(0.1, 0.95)) for _ in range(count)]
    forces: list[Json] = []
    for place in dict.fromkeys(places):
        lever: Json = {"lever": rng.normal(0.0, 0.03, 3).tolist()} if rng.integers(0, 3) == 0 else {}
        forces.append({"at": place, "force": (rng.normal(0.0, 0.5, 3) * size).tolist()} | lever)
    return forces


def weight(rng: np.random.Generator, most: float = 3.0) -> Json:
    """Gravity in a random or an axis' direction, from a tenth of R_f/U³ to 10^most of it, on a mass per length of 1."""
    direction = rng.normal(0.0, 1.0, 3) if rng.integers(0, 2) else np.eye(3)[rng.integers(0, 3)] * rng.choice([-1, 1])
    return {"gravity": (10.0 ** rng.uniform(-1.0, most) * direction / np.linalg.norm(direction)).tolist()}


def tables(strip: Strip, energy: str, segments: list[Json] | None = None, **parts: Any) -> Json:
    """The tables of a scenario of a strip; `belt` adds to the table of this name."""
    belt = {"width": strip.width, "rigidity": 1.0, "segments": segments or PLAIN} | parts.pop("belt", {})
    return {"energy": energy, "belt": belt, **parts}


# ------------------------------------------------------------------------------------------------------------ kinds


def clamps(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps."""
    strip = random_strip(rng)
    return tables(strip, energy, supports=clamped(strip))


def arcs(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps and a board of arcs."""
    segments = random_arcs(rng)
    strip = strip_of(rng, segments)
    return tables(strip, energy, segments, supports=clamped(strip))


def corners(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps with free ribs and a board of one to three bends."""
    count = int(rng.integers(1, 4))
    segments: list[Json] = []
    for i, part in enumerate(lengths(rng, count + 1, 0.2)):
        segments.append({"kind": "straight", "length": part})
        if i < count:
            segments.append({"kind": "corner", "angle": float(rng.uniform(0.1, 1.6 / count) * rng.choice([-1, 1]))})
    strip = random_roll(rng, segments)
    return tables(strip, energy, segments, supports=[clamp | {"square_rib": False} for clamp in clamped(strip)])


def rigid(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps and stiffeners."""
    segments = stretched(with_stiffeners(rng))
    strip = strip_of(rng, segments)
    return tables(strip, energy, segments, supports=clamped(strip))


def rigidities(rng: np.random.Generator, energy: str) -> Json:
    """Clamped or pinned ends and a rigidity by tables."""
    strip = random_strip(rng)
    parts = lengths(rng, int(rng.integers(1, 4)), 0.2)
    segments = [{"kind": "straight", "length": part, "rigidity": table_of(rng, part)} for part in parts]
    return tables(strip, energy, segments, supports=clamped_or_pinned(rng, strip))


def layers(rng: np.random.Generator, energy: str) -> Json:
    """A flexible circuit of layers in SI units, 3 to 30 cm long, under its own weight or not."""
    strip = random_strip(rng)
    copper = [{"material": "rolled copper", "thickness": float(rng.choice([12e-6, 18e-6, 35e-6]))}]
    film, glue = (
        [{"material": name, "thickness": float(rng.choice([12.5e-6, 25e-6, 50e-6]))}]
        for name in ("polyimide", "acrylic adhesive")
    )
    stack = [film + copper, film + glue + copper, film + glue + copper + glue + film, copper + film + copper]
    loads = {"loads": {"gravity": [-9.81, 0.0, 0.0]}} if rng.integers(0, 2) else {}
    made = tables(strip, energy, supports=clamped_or_pinned(rng, strip), **loads)
    made = scaled(made, rng.uniform(0.03, 0.3), 1.0)
    del made["belt"]["rigidity"]
    made["belt"]["layers"] = stack[rng.integers(0, len(stack))]
    return made


def natural_bend(rng: np.random.Generator, energy: str) -> Json:
    """A belt that was rolled up, whole or by segments, with two clamps or one."""
    strip = random_strip(rng)
    ends = clamped(strip)
    belt = {"poisson": float(rng.uniform(0.0, 0.45)), "natural_bend": float(rng.uniform(-6.0, 6.0))}
    segments: list[Json] = [{"kind": "straight", "length": part} for part in lengths(rng, int(rng.integers(1, 3)), 0.3)]
    if len(segments) > 1:
        segments[1]["natural_bend"] = float(rng.uniform(-6.0, 6.0))
    return tables(strip, energy, segments, belt=belt, supports=ends if rng.integers(0, 3) else ends[:1])


def gravity(rng: np.random.Generator, energy: str) -> Json:
    """A heavy belt with two ends held, or one clamp."""
    strip = random_strip(rng)
    ends = clamped_or_pinned(rng, strip) if rng.integers(0, 3) else clamped(strip)[:1]
    return tables(strip, energy, belt={"density": 1.0}, supports=ends, loads=weight(rng))


def points(rng: np.random.Generator, energy: str) -> Json:
    """Two ends, each clamped or pinned, and one to six points held in between, or one to three forces."""
    strip = random_strip(rng)
    start, end = clamped_or_pinned(rng, strip)
    if rng.integers(0, 2):
        forces = random_forces(rng, int(rng.integers(1, 4)), 10.0 ** rng.uniform(-1.0, 2.0))
        return tables(strip, energy, supports=[start, end], loads={"points": forces})
    count = int(rng.integers(1, 7))
    inner = (np.arange(count) + rng.uniform(0.2, 0.8, count)) / count
    between = [held(strip, strip.at(u), with_frame=False) for u in inner]
    return tables(strip, energy, supports=[start, *between, end])


def hinges_and_slides(rng: np.random.Generator, energy: str) -> Json:
    """A clamp, a hinge or a slide at the end, and some in between."""
    strip = random_strip(rng)
    supports = [held(strip, 0, with_frame=True)]
    if rng.integers(0, 3) == 0:
        supports.append(hinge_or_slide(rng, held(strip, strip.at(rng.uniform(0.3, 0.7)), with_frame=True)))
    supports.append(hinge_or_slide(rng, held(strip, STEPS, with_frame=True)))
    return tables(strip, energy, supports=supports)


def hinge_or_slide(rng: np.random.Generator, support: Json) -> Json:
    """The support with one axis or one or two coordinates released, or both."""
    sort = rng.integers(0, 3)
    if sort > 0:
        support = support | {"hinge": str(rng.choice(AXES))}
    if sort < 2:
        free = rng.permutation(3)[: rng.integers(1, 3)]
        support = support | {"position": ["free" if i in free else x for i, x in enumerate(support["position"])]}
    return support


def link(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps and a link."""
    strip = random_strip(rng)
    return tables(strip, energy, supports=clamped(strip), links=[random_tie(rng, strip)])


def closed(rng: np.random.Generator, energy: str) -> Json:
    """A ring, a Möbius band or a band of two half turns; free, held, drawn out by a pin, heavy or rolled before."""
    width = float(rng.uniform(0.02, 0.12))
    belt: Json = {"width": width, "rigidity": 1.0, "segments": PLAIN, "closed": True}
    belt["half_turns"] = int(rng.choice([0, 0, 1, -1, 2]))
    made: Json = {"energy": energy, "belt": belt}
    start = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0], "square_rib": False}
    sort = rng.integers(0, 5)
    if sort > 0:
        made["supports"] = [start]
    if sort == 2:
        direction = rng.normal(0.0, 1.0, 3)
        place = rng.uniform(0.1, 0.4) * direction / np.linalg.norm(direction)
        made["supports"] = [start, {"at": 0.5, "position": place.tolist()}]
    if sort == 3:
        belt["density"] = 1.0
        made["loads"] = weight(rng, 2.0)
    if sort == 4 and belt["half_turns"] % 2 == 0:
        belt["natural_bend"] = float(rng.uniform(-8.0, 8.0))
    return made


def units(rng: np.random.Generator, energy: str) -> Json:
    """A sheet of polyimide, PET or steel in mm, N and MPa, clamped or pinned, heavy or not."""
    strip = random_strip(rng)
    young, poisson, density = [(2500.0, 0.34, 1.42e-9), (4900.0, 0.38, 1.39e-9), (193e3, 0.29, 8.0e-9)][
        rng.integers(0, 3)
    ]
    made = scaled(tables(strip, energy, supports=clamped_or_pinned(rng, strip)), float(rng.uniform(50.0, 500.0)), 1.0)
    del made["belt"]["rigidity"]
    thickness = float(rng.choice([0.025, 0.05, 0.125]))
    made["belt"]["material"] = {"young": young, "poisson": poisson, "density": density, "thickness": thickness}
    return made | ({"loads": {"gravity": [0.0, 0.0, -9810.0]}} if rng.integers(0, 2) else {})


def mixed(rng: np.random.Generator, energy: str) -> Json:
    """Arcs, stiffeners, tables of rigidity, natural bend, weight, forces, a hinge, a pin and a link, each or not."""
    segments = random_arcs(rng) if rng.integers(0, 2) else stretched(with_stiffeners(rng))
    strip = strip_of(rng, segments, 0.7)
    for i, segment in enumerate(segments):
        if segment["kind"] != "rigid" and rng.integers(0, 2):
            segments[i] = segment | {"rigidity": table_of(rng, segment["length"])}
    belt: Json = {"density": 1.0} | ({"natural_bend": float(rng.uniform(-3.0, 3.0))} if rng.integers(0, 2) else {})
    start, end = held(strip, 0, with_frame=True), held(strip, STEPS, with_frame=True)
    end = [end, end | {"hinge": str(rng.choice(AXES))}, held(strip, STEPS, with_frame=False)][rng.integers(0, 3)]
    inner = [held(strip, strip.at(rng.uniform(0.3, 0.7)), with_frame=False)] if rng.integers(0, 3) == 0 else []
    loads = weight(rng, 1.5) if rng.integers(0, 2) else {}
    if rng.integers(0, 2):
        loads["points"] = random_forces(rng, int(rng.integers(1, 3)), 10.0 ** rng.uniform(-1.0, 1.0))
    parts: Json = {"loads": loads} if loads else {}
    if not inner and rng.integers(0, 4) == 0:
        parts["links"] = [random_tie(rng, strip)]
    return tables(strip, energy, segments, belt=belt, supports=[start, *inner, end], **parts)


KINDS: dict[str, Callable[[np.random.Generator, str], Json]] = {
    "clamps": clamps,
    "arcs": arcs,
    "corners": corners,
    "rigid": rigid,
    "tables": rigidities,
    "layers": layers,
    "natural bend": natural_bend,
    "gravity": gravity,
    "points": points,
    "hinges and slides": hinges_and_slides,
    "link": link,
    "closed": closed,
    "units": units,
    "mixed": mixed,
}


def scenario(kind: str, index: int, seed: int) -> Json:
    """The tables of one random scenario."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind), index])
    return KINDS[kind](rng, ENERGIES[index % len(ENERGIES)])


def scenarios(kind: str, count: int, seed: int) -> list[Json]:
    """The tables of random scenarios of a kind."""
    return [scenario(kind, index, seed) for index in range(count)]


# ------------------------------------------------------------------------------------------------------------ units

UNITS: dict[str, tuple[int, int]] = {
    "width": (1, 0),
    "length": (1, 0),
    "thickness": (1, 0),
    "position": (1, 0),
    "offset": (1, 0),
    "lever": (1, 0),
    "at": (1, 0),
    "from": (1, 0),
    "to": (1, 0),
    "u": (1, 0),
    "curvature": (-1, 0),
    "natural_bend": (-1, 0),
    "force": (0, 1),
    "young": (-2, 1),
    "rigidity": (2, 1),
    "value": (2, 1),
}
"""Powers of the units of length and force; mass is measured so that accelerations keep their numbers."""


def scaled(made: Any, length: float, force: float, name: str = "", within: str = "") -> Any:
    """The same scenario in units of which `length` and `force` make the old ones."""
    if isinstance(made, dict):
        return {key: scaled(value, length, force, key, name) for key, value in made.items()}
    if isinstance(made, list):
        return [scaled(value, length, force, name, within) for value in made]
    if name == "density":
        return made * force / length ** (3 if within == "material" else 1)
    if isinstance(made, str) or name not in UNITS:
        return made
    of_length, of_force = UNITS[name]
    return made * length**of_length * force**of_force
