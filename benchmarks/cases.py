"""The cases that tables and figures share, and their measured quantities."""

from __future__ import annotations

import functools
import json
import math
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import fishbone as fb
from fishbone.names import EnergyModel
from tables import ROOT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ENERGIES = tuple(energy for energy in get_args(EnergyModel) if energy != "shell")
"""Energies of developable belts."""
EXAMPLES = ("example1", "example2")
SHELLS = ROOT / "tests" / "data" / "shell"
SHAPES = ROOT / "docs" / "shapes.toml"
APART = 0.2
SHEET = 0.0007
"""Thickness of the source's sheet in U: 140 µm of 200 mm."""


def clamped(
    position: Any, rotation: Any = (0.0, 0.0, 0.0), *, square_rib: bool = True, **belt: float
) -> dict[str, Any]:
    """Tables of a straight belt from the natural pose to another one."""
    length = belt.pop("length", 1.0)
    ends = (("start", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ("end", position, rotation))
    return {
        "belt": {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": length}]} | belt,
        "supports": [{"at": at, "position": x, "rotation": r, "square_rib": square_rib} for at, x, r in ends],
    }


def helix(bend: float, slope: float) -> tuple[Floats, Rotation]:
    """End pose of a belt of unit length and constant bend and rib slope, as the exponential of its twist."""
    twist = np.zeros((4, 4))
    twist[:3, :3] = np.array([[0.0, -bend, -slope * bend], [bend, 0.0, 0.0], [slope * bend, 0.0, 0.0]])
    twist[1, 3] = 1.0
    pose = expm(twist)
    return pose[:3, 3], Rotation.from_matrix(pose[:3, :3])


def gentle_arc() -> dict[str, Any]:
    """A helix whose end is displaced a little, ribs free at the ends: no rib comes near the bound."""
    position, frame = helix(-1.5, 0.25)
    turn = Rotation.from_rotvec([0.05, 0.05, -0.1]) * frame
    return clamped(position + np.array([0.03, 0.02, 0.01]), turn.as_rotvec(), square_rib=False)


@functools.cache
def shapes() -> list[fb.Equilibrium]:
    """The stable shapes of one board that do not pass through themselves, rising in energy."""
    found = fb.branches(fb.load(SHAPES))
    return [shape for shape in found if shape.stable and shape.crosses_itself is None]


def apart(found: list[fb.Equilibrium], count: int) -> list[fb.Equilibrium]:
    """The lowest shapes that differ from all lower ones by a fifth of the length somewhere."""
    chosen: list[fb.Equilibrium] = []
    for shape in found:
        moves = [np.linalg.norm(places(shape) - places(lower), axis=1).max() for lower in chosen]
        if min(moves, default=1.0) > APART:
            chosen.append(shape)
    return chosen[:count]


def places(shape: fb.Equilibrium) -> Floats:
    """Places of the spine at the same arc lengths on any mesh.

    Shape: (101, 3)
    """
    u = np.linspace(0.0, shape.u[-1], 101)
    return np.stack([np.interp(u, shape.u, x) for x in shape.position.T], axis=1)


@functools.cache
def _solve(text: str) -> fb.Equilibrium:
    return fb.solve(fb.Scenario.from_dict(json.loads(text)), strict=True)


def solve(tables: dict[str, Any], energy: str, elements: int | None = None) -> fb.Equilibrium:
    """The equilibrium, solved once per run."""
    plain = fb.Scenario.from_dict(tables | {"energy": energy}).to_dict()
    if elements is not None:
        plain["solver"]["elements"] = elements
    return _solve(json.dumps(plain, sort_keys=True))


def example(name: str) -> dict[str, Any]:
    """Tables of a shipped scenario."""
    return fb.load(ROOT / "scenarios" / f"{name}.toml").to_dict()


def shell(name: str) -> dict[str, Any]:
    """A shell reference, see tests/data/README.md."""
    data: dict[str, Any] = json.loads((SHELLS / f"{name}.json").read_text())
    return data


def on_shell(name: str, energy: str) -> fb.Equilibrium:
    """The belt of a shell reference; a curved board has equilibria on both sides and bulges to the shell's side."""
    data = shell(name)
    turn = Rotation.from_matrix(data["end_rotation_matrix"]).as_rotvec()
    sheet = ("length", "width", "thickness", "poisson")
    tables = clamped(data["end_position"], turn, **{key: data[key] for key in sheet})
    if "segments" not in data:
        return solve(tables, energy)
    tables["belt"]["segments"] = [_strip(length, curvature) for length, curvature in data["segments"]]
    sides = [solve(tables | {"solver": {"bulge": [side, 0.0, 0.0]}}, energy) for side in (1.0, -1.0)]
    return min(sides, key=lambda belt: _distance(belt, data))


def _strip(length: float, curvature: float) -> dict[str, Any]:
    if curvature == 0.0:
        return {"kind": "straight", "length": length}
    return {"kind": "arc", "length": length, "curvature": curvature}


def curve(u: Any, position: Any, tangent: Any) -> CubicHermiteSpline:
    """The curve through the positions with the tangents given there."""
    return CubicHermiteSpline(u, np.asarray(position), np.asarray(tangent), axis=0)


def shell_peak(name: str) -> Floats:
    """The shell's point of greatest x on its centre line."""
    data = shell(name)
    line = curve(data["u"], data["position"], data["tangent"])
    fine = line(np.linspace(data["u"][0], data["u"][-1], 20_001))
    return np.asarray(fine[np.argmax(fine[:, 0])])


def thick(tables: dict[str, Any], thickness: float = SHEET, poisson: float = 0.34) -> dict[str, Any]:
    """Tables of the same belt with a thickness."""
    return tables | {"belt": tables["belt"] | {"thickness": thickness, "poisson": poisson}}


def distance_to_shell(name: str, energy: str) -> float:
    """RMS distance of the spine from the shell's centre line, over the shell's 101 points."""
    return _distance(on_shell(name, energy), shell(name))


def _distance(belt: fb.Equilibrium, data: dict[str, Any]) -> float:
    # Nodes are repeated where fields may jump.
    nodes = np.flatnonzero(np.diff(belt.u, prepend=-1.0) > 0.0)
    return off_shell(belt.u[nodes], belt.position[nodes], belt.frame[nodes, :, 1], data)


def off_shell(u: Any, position: Any, tangent: Any, data: dict[str, Any]) -> float:
    """RMS distance of a curve, given by positions and tangents, from a shell's centre line, over the points of that."""
    line = curve(u, position, tangent)
    return float(np.sqrt(np.mean(np.sum((line(data["u"]) - data["position"]) ** 2, axis=1))))


def heavy(weight: float, *, edgewise: bool, push: float = 0.0, **belt: Any) -> dict[str, Any]:
    """A cantilever of unit length under its own weight, flat or standing on edge; its rib at the clamp is free."""
    start = clamped((0.0, 0.0, 0.0), square_rib=False, **belt)
    return {
        "belt": start["belt"] | {"density": 1.0},
        "supports": start["supports"][:1],
        "loads": {
            "gravity": [0.0, 0.0, -weight] if edgewise else [-weight, 0.0, 0.0],
            "points": [{"at": "end", "force": [push, 0.0, 0.0]}] if push else [],
        },
    }


def closed(half_turns: int) -> dict[str, Any]:
    """The band of Starostin and van der Heijden: length 2π, half-width π/30, plate rigidity 1."""
    board = example("mobius")["belt"]
    return {"belt": board | {"half_turns": half_turns}}


class Refinement(NamedTuple):
    """Changes from each mesh to the next finer one: of the energy, and the largest of the spine at common nodes."""

    elements: tuple[int, ...]
    energy: Floats
    position: Floats


def refine(tables: dict[str, Any], energy: str, elements: tuple[int, ...]) -> Refinement:
    """Solves on meshes, each with elements half as long as those of the mesh before."""
    shapes = [solve(tables, energy, count) for count in elements]
    common = [shape.position[:: count // elements[0]] for shape, count in zip(shapes, elements, strict=True)]
    return Refinement(
        elements,
        np.abs(np.diff([shape.energy for shape in shapes])),
        np.abs(np.diff(common, axis=0)).max(axis=(1, 2)),
    )


def orders(changes: Floats) -> Floats:
    """Observed order of convergence from each change to the next."""
    return np.asarray(np.log2(changes[:-1] / changes[1:]))


def on_one_mesh(tables: dict[str, Any]) -> dict[str, Any]:
    """The scenario on 8 U/V equal elements, at least 80, unless it names a number: no difference is of the mesh."""
    belt = tables["belt"]
    length = sum(segment.get("length", 0.0) for segment in belt["segments"])
    elements = max(80, math.ceil(8.0 * length / belt["width"] - 1e-6))
    return tables | {"solver": {"elements": elements} | tables.get("solver", {})}
