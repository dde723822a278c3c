"""Measures the tables of docs/validation.md, save those of ritz.py, random_poses.py and peers.py.

All of them, or those that the command line names.
"""

from __future__ import annotations

import platform
import statistics
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import fishbone as fb
from cases import (
    ENERGIES,
    EXAMPLES,
    SHEET,
    apart,
    clamped,
    closed,
    distance_to_shell,
    example,
    gentle_arc,
    heavy,
    helix,
    on_shell,
    orders,
    refine,
    shapes,
    shell,
    shell_peak,
    solve,
    thick,
)
from fishbone import examples as shipped
from tables import ROOT, VALIDATION, number, scientific, signed, table, vector, write

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

REFERENCE = {
    ("example1", "fishbone"): ("23.504", "(0.3691, 0.2500, 0.0500)"),
    ("example1", "sadowsky"): ("23.260", "(0.3693, 0.2500, 0.0500)"),
    ("example1", "wunderlich"): ("23.60", "(0.3684, 0.2500, 0.0500)"),
    ("example2", "fishbone"): ("18.950", "(0.2936, 0.43, −0.0670)"),
    ("example2", "sadowsky"): ("17.707", "(0.2947, 0.424, −0.0727)"),
    ("example2", "wunderlich"): ("18.73", "(0.2898, 0.43, −0.0788)"),
}
SHELL_CASES = (
    "example1_2h",
    "example1",
    "example1_h2",
    "example1_h4",
    "example1_narrow",
    "example2_2h",
    "example2",
    "example2_h2",
    "example2_h4",
    "offset05",
    "offset10_far",
    "planar",
    "curved",
    "curved_h8",
    "rounded_corner",
    "rounded_corner_h8",
)
GALLERY = ROOT / "docs" / "gallery.md"
SHAPES = ROOT / "docs" / "shapes.md"
STRIP = ROOT / "docs" / "strip-shell.md"
ALL = (*ENERGIES, "shell")
"""The energies, that of a strip of finite thickness included."""
MESHES = (40, 80, 160, 320, 640, 1280)
STRIP_MESHES = (40, 80, 160, 320, 640, 1280)
REPETITIONS = 31


def reference_rows() -> Iterator[list[str]]:
    """Values computed independently, and ours."""
    for (name, energy), (value, peak) in REFERENCE.items():
        row = [f"{name}, `{energy}`", value, peak]
        for elements in (80, 160):
            shape = solve(example(name), energy, elements)
            row += [number(shape.energy, 3), vector(shape.highest_point.position)]
        yield row


def shell_rows() -> Iterator[list[str]]:
    """Distances from the shell in 1e-3 of its length, its energy, and by how many per cent others are off."""
    for name in SHELL_CASES:
        data = shell(name)
        thickness = f"{data['thickness'] / SHEET:g} × {SHEET:g}"
        distances = [number(1e3 * distance_to_shell(name, energy), 2) for energy in ALL]
        off = [100.0 * (on_shell(name, energy).energy / data["energy"] - 1.0) for energy in ALL]
        yield [f"`{name}`", thickness, *distances, number(data["energy"], 3), *(signed(share, 2) for share in off)]


def peak_rows() -> Iterator[list[str]]:
    """Highest point of example 2."""
    for factor, name in (("2 ×", "_2h"), ("", ""), ("1/2 ×", "_h2"), ("1/4 ×", "_h4")):
        title = f"shell, thickness {factor} {SHEET:g}".replace("  ", " ")
        yield [title, vector(shell_peak(f"example2{name}"), 3)]
    for energy in reversed(ALL):
        shape = solve(thick(example("example2")), energy, 160)
        yield [f"`{energy}`, 160 elements", vector(shape.highest_point.position, 3)]
    yield ["the source prints", "(0.3, 0.4, −0.01)"]


def elastica_rows() -> Iterator[list[str]]:
    """The planar clamped belt in elliptic integrals: U (2 E/K − 1) = d, height k U/K, thrust (4 K/U)² R_f."""
    for distance in (0.3, 0.6, 0.9):
        m = brentq(lambda m, d=distance: 2.0 * ellipe(m) / ellipk(m) - 1.0 - d, 1e-12, 0.9999, xtol=1e-15)
        first, second = ellipk(m), ellipe(m)
        exact = [32.0 * first * (second - (1.0 - m) * first), np.sqrt(m) / first, (4.0 * first) ** 2]
        for elements in (80, 160):
            shape = solve(clamped((0.0, distance, 0.0)), "wunderlich", elements)
            found = [shape.energy, shape.highest_point.position[0], -shape.reaction("end").force[1]]
            errors = [scientific(abs(ours / value - 1.0)) for ours, value in zip(found, exact, strict=True)]
            yield [number(distance, 1), str(elements), *(number(value, 5) for value in exact), *errors]


def cylinder_rows() -> Iterator[list[str]]:
    """A belt wound on a cylinder of radius 0.5 U, ribs free at the ends: R_f U/(2R²) = 2 at any winding angle."""
    for angle in (0.0, 0.2, 0.5):
        position, frame = helix(-(np.cos(angle) ** 2) / 0.5, np.tan(angle))
        tables = clamped(position, frame.as_rotvec(), square_rib=False)
        yield [number(angle, 1), *(number(solve(tables, energy).energy, 6) for energy in ENERGIES)]


def published_rows() -> Iterator[list[str]]:
    """Weight, closed belts: published or exact values, and ours on two meshes."""
    for weight in (5.0, 20.0, 50.0):
        tables = heavy(weight, edgewise=False)
        sags = [-solve(tables, "wunderlich", elements).position[-1, 0] for elements in (80, 320)]
        yield _published(f"heavy elastica, weight {weight:g} R_f/U²: sag of its end [U]", heavy_sag(weight), sags, 5)
    thresholds = [buckling_weight(elements) for elements in (100, 400)]
    yield _published("belt on edge buckles by its weight at [R_f/U²], `sadowsky`, V = U/50", 21.491, thresholds, 2)
    half_width = np.pi / 30.0
    for title, half_turns, exact in (("Möbius band", 1, 18.63), ("ring", 0, 2.0 * np.pi)):
        energies = [solve(closed(half_turns), "wunderlich", elements).energy for elements in (240, 960)]
        yield _published(f"{title}: energy over D V/2", exact, [energy / half_width for energy in energies], 3)


def _published(title: str, exact: float, found: list[float], decimals: int) -> list[str]:
    return [title, f"{exact:.{decimals}f}", *(number(value, decimals) for value in found)]


def heavy_sag(weight: float) -> float:
    """Sag of the end of the heavy elastica: R_f a'' = −q (U − u) cos a, by collocation."""

    def slope(u: Any, a: Any) -> Any:
        return np.stack([a[1], -weight * (1.0 - u) * np.cos(a[0]), np.sin(a[0])])

    u = np.linspace(0.0, 1.0, 200)
    start = np.stack([np.minimum(weight * u / 3.0, 1.2), 0.0 * u, u])
    found = solve_bvp(slope, lambda a, b: np.array([a[0], b[1], a[2]]), u, start, tol=1e-9, max_nodes=100_000)
    assert found.success
    return float(found.y[2, -1])


def buckling_weight(elements: int) -> float:
    """Weight at which the amplitude of the buckled state is 0; the elastic energy is its square."""
    weights = np.array([22.0, 22.5, 23.0, 24.0, 25.0])
    board = {"width": 0.02}
    squares = [
        solve(heavy(weight, edgewise=True, push=0.002, **board), "sadowsky", elements).elastic_energy
        for weight in weights
    ]
    return float(np.polynomial.Polynomial.fit(squares, weights, 2)(0.0))


def gallery_rows() -> Iterator[list[str]]:
    """The shipped scenarios as they are."""
    for name in shipped.names():
        belt = fb.solve(fb.load(ROOT / "scenarios" / f"{name}.toml"), strict=True)
        on_spine = belt.least_spine_radius
        assert on_spine is not None
        force = np.linalg.norm(belt.reaction(0).force) if belt.scenario.to_dict()["supports"] else None
        yield [
            f"[`{name}`](#{name})",
            f"`{belt.energy_model}`",
            f"{belt.energy:.4g}".replace("-", "−"),
            f"{on_spine.value:.4g}",
            "" if force is None else f"{force:.4g}",
            {True: "yes", None: "not known"}[belt.stable],
            str(belt.iterations),
        ]


def shape_rows() -> Iterator[list[str]]:
    """The stable shapes of one board; those drawn have a letter."""
    letters = dict(zip(map(id, apart(shapes(), 5)), "abcde", strict=True))
    for shape in shapes():
        radius, margin = shape.least_spine_radius, shape.snap_margin(reach=0.3)
        assert radius is not None
        assert margin is not None
        yield [
            letters.get(id(shape), ""),
            number(shape.energy, 2),
            number(shape.twist, 2),
            number(radius.value, 4),
            number(float(np.linalg.norm(shape.reaction("end").force)), 1),
            number(margin.distance, 3),
            "yes" if margin.snaps else "no",
        ]


def convergence_rows() -> Iterator[list[str]]:
    """Changes of the energy from mesh to mesh, with the observed order."""
    gentle = [refine(gentle_arc(), energy, MESHES) for energy in ("fishbone", "wunderlich")]
    sharp = [refine(example("example1"), energy, MESHES) for energy in ENERGIES]
    for i, (coarse, fine) in enumerate(pairwise(MESHES)):
        cells = []
        for refinement in (*gentle, *sharp):
            order = "" if i == 0 else f" ({number(orders(refinement.energy)[i - 1], 1)})"
            cells.append(scientific(refinement.energy[i]) + order)
        yield [f"{coarse} → {fine}", *cells]


def strip_rows() -> Iterator[list[str]]:
    """Changes from mesh to mesh with `shell`: of energy and spine, with the observed orders."""
    found = [refine(thick(example(name)), "shell", STRIP_MESHES) for name in EXAMPLES]
    for i, (coarse, fine) in enumerate(pairwise(STRIP_MESHES)):
        cells = []
        for refinement in found:
            for changes in (refinement.energy, refinement.position):
                order = "" if i == 0 else f" ({number(orders(changes)[i - 1], 1)})"
                cells.append(scientific(changes[i]) + order)
        yield [f"{coarse} → {fine}", *cells]


def radius_rows() -> Iterator[list[str]]:
    """Least bend radius over the width and on the spine, and the radius of the area, example 1."""
    for elements in (80, 160, 320, 640, 1280):
        row = [str(elements)]
        for energy in ENERGIES:
            shape = solve(example("example1"), energy, elements)
            least = shape.least_bend_radius
            assert least is not None
            on_spine, over_area = shape.bend_radius
            assert on_spine is not None
            row += [scientific(least.value), number(on_spine.value, 4), number(over_area.p99, 4)]
        yield row


def timing_rows() -> Iterator[list[str]]:
    """Median times of the two methods."""
    for name in EXAMPLES:
        for energy in ENERGIES:
            tables = example(name) | {"energy": energy}
            tables["solver"] |= {"elements": 80}
            yield _timing(f"{name}, `{energy}`", tables)
        tables = example(name)
        tables["solver"] |= {"method": "ritz"}
        yield _timing(f"{name}, the source's method", tables)


def _timing(title: str, tables: dict[str, Any]) -> list[str]:
    scenario = fb.Scenario.from_dict(tables)
    shapes = [fb.solve(scenario) for _ in range(REPETITIONS)]
    times = [1e3 * shape.solve_time for shape in shapes]
    return [
        title,
        str(shapes[0].iterations),
        f"{statistics.median(times):.3g}",
        f"{min(times):.3g}",
        f"{max(times):.3g}",
    ]


def processor() -> str:
    """Name of the processor, or of its architecture where the system does not have it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def write_timing() -> None:
    """Writes the times, with the machine."""
    header = ["case", "iterations", "median [ms]", "least", "most"]
    machine = f"{processor()}, one thread, {REPETITIONS} solves each, fishbone {fb.__version__}."
    write("timing", f"{machine}\n\n{table(header, timing_rows())}")


BY_ENERGY = [f"`{energy}`" for energy in ENERGIES]
RADII = [text for energy in BY_ENERGY for text in (energy, "on the spine", "99 % of the area")]
GENTLE = [f"gentle arc, `{energy}`" for energy in ("fishbone", "wunderlich")]
SHARP = [f"example 1, {energy}" for energy in BY_ENERGY]
SHELL_ENERGIES = ["energy of the shell", *(f"`{energy}` off by [%]" for energy in ALL)]
STRIP_CHANGES = [f"{name}: {text}" for name in ("example 1", "example 2") for text in ("energy", "spine")]
TABLES: dict[str, tuple[list[str], Callable[[], Iterator[list[str]]], Path]] = {
    "reference values": (
        ["case", "reference", "highest point [U]", "80 elements", "highest point", "160 elements", "highest point"],
        reference_rows,
        VALIDATION,
    ),
    "shell": (
        ["case", "thickness [U]", *(f"`{energy}`" for energy in ALL), *SHELL_ENERGIES],
        shell_rows,
        VALIDATION,
    ),
    "peak": (["example 2", "highest point [U]"], peak_rows, VALIDATION),
    "elastica": (
        ["d [U]", "elements", "energy", "height", "thrust", "error", "error", "error"],
        elastica_rows,
        VALIDATION,
    ),
    "cylinder": (["winding angle [rad]", *BY_ENERGY], cylinder_rows, VALIDATION),
    "published": (["case", "published or exact", "coarse mesh", "four times as fine"], published_rows, VALIDATION),
    "gallery": (
        ["scenario", "density", "energy", "least radius", "force at the start", "minimum", "iterations"],
        gallery_rows,
        GALLERY,
    ),
    "shapes": (
        ["shape", "energy", "twist", "least radius", "force", "margin", "snaps there"],
        shape_rows,
        SHAPES,
    ),
    "convergence": (["elements", *GENTLE, *SHARP], convergence_rows, VALIDATION),
    "bend radius": (["elements", *RADII], radius_rows, VALIDATION),
    "strip": (["elements", *STRIP_CHANGES], strip_rows, STRIP),
}


def main() -> None:
    """Writes all tables, or those that the command line names."""
    for name in sys.argv[1:] or (*TABLES, "timing"):
        if name == "timing":
            write_timing()
            continue
        header, rows, page = TABLES[name]
        write(name, table(header, rows()), page)


if __name__ == "__main__":
    main()
