"""Measures the table "Before and after" of docs/validation.md: cases that gave wrong answers on one mesh for all belts.

The column "before" has the results of uniform meshes of 8 U/V elements, measured once; "after" is measured here.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

import fishbone as fb
from cases import example
from tables import number, scientific, table, write

if TYPE_CHECKING:
    from collections.abc import Iterator

Json = dict[str, Any]

REPEATS = 20
"""Times a solve is repeated; the shortest counts."""
ORIGIN = [0.0, 0.0, 0.0]
QUARTER = math.pi / 2.0
CIRCUIT = [
    {"material": name, "thickness": thickness}
    for name, thickness in (
        ("polyimide", 25e-6),
        ("acrylic adhesive", 25e-6),
        ("rolled copper", 18e-6),
        ("polyimide", 25e-6),
        ("rolled copper", 18e-6),
        ("acrylic adhesive", 25e-6),
        ("polyimide", 25e-6),
    )
]


def solve(supports: list[Json], *, width: float = 0.1, length: float = 1.0, **parts: Any) -> fb.Equilibrium:
    """A straight belt; `belt` adds to the table of this name, the other parts are tables of the scenario."""
    belt = {"width": width, "segments": [{"kind": "straight", "length": length}]} | parts.pop("belt", {"rigidity": 1.0})
    return fb.solve(fb.Scenario.from_dict({"energy": "wunderlich", "belt": belt, "supports": supports, **parts}))


def clamp(at: Any, position: Any, rotation: Any = ORIGIN, **fields: Any) -> Json:
    """A support that holds position and orientation."""
    return {"at": at, "position": list(position), "rotation": list(rotation), **fields}


def pin(at: Any, position: Any) -> Json:
    """A support that holds the position."""
    return {"at": at, "position": list(position)}


def rows() -> Iterator[list[str]]:
    """Case, before, after, reference, source of the reference."""
    yield from layers()
    yield from slack()
    yield from slender()
    yield from fine_meshes()
    yield from verdicts()
    yield from lifted()
    yield from radii()
    yield from paths()
    yield from times()


def layers() -> Iterator[list[str]]:
    """Belts whose bend changes within a small part of their length."""
    tape = {"belt": {"material": {"preset": "polyimide", "thickness": 25e-6}}, "solver": {"bulge": [-1.0, 0.0, 0.0]}}
    hung = solve([pin("start", ORIGIN), pin("end", [0.0, 0.999, 0.0])], loads={"gravity": [-9.81, 0.0, 0.0]}, **tape)
    sag, force = -1e3 * hung.position[:, 0].min(), hung.reaction("end").force[1]
    yield ["tape of 25 µm under its weight: sag [mm]", "36.01", number(sag, 3), "19.362", "catenary"]
    yield ["the same: horizontal end force [N]", "0.1209", number(force, 5), "0.22449", "catenary"]
    leaning = solve(
        [clamp("start", ORIGIN, [0.0, 0.0, -math.pi / 3.0])],
        width=0.05,
        length=0.2,
        belt={"material": {"preset": "polyimide", "thickness": 1e-4}},
        loads={"points": [{"at": "end", "force": [0.0, 20.0, 0.0]}]},
    )
    radius = leaning.bend_radius.spine
    assert radius is not None
    yield ["leaning clamp, pulled: radius [mm]", "0.920", number(1e3 * radius.value, 4), "0.7674", "elastica"]
    for distance, before, right in (
        (-0.9, "stable, up to 10 rad an element", "550.8"),
        (-0.95, "1179.6, stable", ""),
        (-0.99, "stable, up to 10 rad an element", ""),
    ):
        past = solve([clamp("start", ORIGIN), clamp("end", [0.0, distance, 0.0])])
        source = "320 elements" if right else "carried, or refused"
        yield [f"ends drawn past each other to {number(distance, 2)} U: energy", before, outcome(past), right, source]


def outcome(found: fb.Equilibrium) -> str:
    """Energy with its estimated error, or the status."""
    if found.status != "converged" or found.error is None:
        return found.status.replace("_", " ")
    return f"{found.energy:.5g} (error {scientific(found.error.energy)})"


def slack() -> Iterator[list[str]]:
    """Belts under weight with hardly any slack."""
    for chord, before in ((0.9999, "not converged"), (0.99999, "")):
        half = brentq(lambda x, c=chord: np.sinh(x) / x - 1.0 / c, 1e-4, 1.0)
        a = chord / 2.0 / half
        hung = solve(
            [pin("start", ORIGIN), pin("end", [0.0, chord, 0.0])],
            width=0.02,
            belt={"rigidity": 1e-7, "density": 1.0},
            loads={"gravity": [-1.0, 0.0, 0.0]},
            solver={"bulge": [-1.0, 0.0, 0.0]},
        )
        found = [-hung.position[:, 0].min(), hung.reaction("end").force[1]]
        right = [a * (np.cosh(half) - 1.0), a]
        texts = [", ".join(f"{value:.5g}" for value in pair) for pair in (found, right)]
        after = texts[0] if hung.status == "converged" else outcome(hung)
        yield [
            f"{100.0 * (1.0 - chord):.1g} % slack under weight: sag, force",
            before,
            after,
            texts[1],
            "catenary",
        ]


def slender() -> Iterator[list[str]]:
    """A quarter twist with an offset, by slenderness."""
    for slenderness, before in (
        (100, "96 iterations"),
        (300, "340 ms an update"),
        (1000, "fails after a minute"),
        (3000, "fails after a minute"),
    ):
        supports = [clamp("start", ORIGIN), clamp("end", [0.1, 0.8, 0.0], [0.0, QUARTER, 0.0])]
        began = time.perf_counter()
        found = solve(supports, width=1.0 / slenderness)
        milliseconds = 1e3 * (time.perf_counter() - began)
        after = f"{outcome(found)}, {found.iterations} iterations, {milliseconds:.0f} ms"
        yield [f"quarter twist, U/V = {slenderness}: energy", before, after, "≤ 50 ms", "aim"]


def fine_meshes() -> Iterator[list[str]]:
    """The lowest modes of example 2."""
    for elements, before in ((160, ""), (640, "4797, 10288, null"), (1280, "8127, 43539, null"), (3000, "")):
        tables = example("example2") | {"energy": "wunderlich", "solver": {"elements": elements, "tolerance": 1e-9}}
        belt = fb.solve(fb.Scenario.from_dict(tables))
        after = f"{eigenvalues(belt, 0, 2)}, {'stable' if belt.stable else 'null'}"
        yield [
            f"example 2, {elements} elements: lowest modes",
            before,
            after,
            "1911, 2907, stable",
            "sparse factorisation",
        ]


def eigenvalues(belt: fb.Equilibrium, first: int, count: int) -> str:
    """Lowest modes from a number on, or why there are none."""
    try:
        return ", ".join(f"{mode.eigenvalue:.1f}" for mode in belt.modes(count)[first:])
    except fb.NoModes:
        return outcome(belt)


def verdicts() -> Iterator[list[str]]:
    """What is said of an equilibrium, or of there being none."""
    quarter_arc = {"rigidity": 1.0, "segments": [{"kind": "arc", "length": 1.0, "curvature": QUARTER}]}
    flat = solve([clamp("start", ORIGIN)], width=0.03, belt=quarter_arc)
    yield ["flat quarter arc held at one end: stable", "no", str(flat.stable).lower(), "true", "energy 0"]
    turned = solve([clamp("start", ORIGIN), {"at": "end", "rotation": [0.0, 0.0, 2.0 * math.pi]}])
    yield ["end turned by 2π: energy", "0, no warning", f"{turned.energy:.4f}", "19.7392, or a warning", "circle"]
    straight = solve([clamp("start", ORIGIN), clamp("end", [0.0, 1.0, 0.0])])
    force = abs(straight.reaction("end").force[1])
    after = f"{force:.3g}, {'warning' if straight.warnings else 'no warning'}"
    yield ["no slack between clamps: reaction", "0", after, "not determined, warning", "inextensible"]
    twisted = solve([clamp("start", ORIGIN), clamp("end", [0.0, 1.0, 0.0], [0.0, QUARTER, 0.0])], width=0.2)
    after = f"{twisted.status.replace('_', ' ')} after {twisted.iterations} iterations"
    yield ["quarter twist without slack", "not converged after 2803", after, "infeasible at once", "inextensible"]
    for pins in (20, 30, 60):
        line = [pin(i / pins, [0.0, 0.95 * i / pins, 0.0]) for i in range(1, pins)]
        found = solve([pin("start", ORIGIN), *line, pin("end", [0.0, 0.95, 0.0])], width=0.02)
        before = "not converged" if pins == 20 else "infeasible"
        yield [f"{pins} pins along a wave that fits", before, found.status.replace("_", " "), "converged", "the wave"]
    beam = solve([{"at": 0.5, "position": ["free", 0.0, "free"]}])
    yield ["free beam: first mode that bends", "error", eigenvalues(beam, 5, 6), "500.56", "beam"]
    band = {"rigidity": 1.0, "closed": True, "half_turns": 3}
    three = solve([], width=0.05, belt=band, solver={"elements": 240})
    after = f"{three.energy:.2f}, {three.half_turns}"
    yield [
        "three half turns, V = 0.05 U: energy, half turns",
        "a Möbius band, −1",
        after,
        "132.88, 3",
        "boundary value problem",
    ]
    wide = {"rigidity": 1.0, "closed": True, "half_turns": 1}
    for elements in (480, 640, 1280):
        mobius = solve([], width=0.5, belt=wide, solver={"elements": elements})
        after = f"{mobius.energy:.2f}" if mobius.status == "converged" else "not converged"
        before = "not converged" if elements < 1280 else ""
        yield [f"Möbius band, V = 0.5 U, {elements} elements: energy", before, after, "219.03", "limit of the meshes"]


def radii() -> Iterator[list[str]]:
    """The tightest bend of a circuit twisted by a quarter turn."""
    before = ("60", "13.8", "7.8", "3.5")
    for elements, least in zip((80, 200, 400, 800), before, strict=True):
        twist = solve(
            [clamp("start", ORIGIN), clamp("end", [0.0, "free", 0.0], [0.0, QUARTER, 0.0])],
            width=0.008,
            length=0.04,
            belt={"layers": CIRCUIT},
            solver={"elements": elements},
        )
        radius = 1e3 * twist.bend_radius.area.p99
        shortened = 1e3 * (0.04 - twist.position[-1, 1])
        after = f"{radius:.3f} mm on 99 % of the area, {shortened:.2f} mm shorter"
        yield [
            f"circuit twisted by 90°, {elements} elements: radius",
            f"{least} µm",
            after,
            "4.16 mm, 1.63 mm",
            "quadrature",
        ]


def lifted() -> Iterator[list[str]]:
    """A quarter arc with one coordinate of its end off the plane: the energy is in proportion to the square."""
    for lift in (1e-5, 1e-3):
        arc = solve(
            [clamp("start", ORIGIN), pin("end", [lift, "free", "free"])],
            width=0.03,
            belt={"rigidity": 1.0, "segments": [{"kind": "arc", "length": 1.0, "curvature": QUARTER}]},
        )
        after = f"{arc.energy / lift**2:.4f}, {'stable' if arc.stable else 'not stable'}"
        before = "off by 6 %, not stable" if lift == 1e-5 else ""
        yield [f"flat arc lifted by n = {scientific(lift, 0)} U: energy/n²", before, after, "2.044", "constant"]


def paths() -> Iterator[list[str]]:
    """The shipped hinge, inextensible, opened from flat to 130° and closed again, as one path from snap to snap."""
    tables = fb.load("scenarios/hinge.toml").to_dict() | {"energy": "wunderlich"}
    poses = [
        ([0.016 * math.sin(a), 0.016 + 0.016 * math.cos(a), 0.034], [0.0, 0.0, -a])
        for a in (0.0, math.radians(130.0), 0.0)
    ]
    tables["supports"][1] |= dict(zip(("position", "rotation"), poses[0], strict=True))
    tables["solver"]["elements"] = 200
    led = fb.follow(fb.Scenario.from_dict(tables), fb.Poses(poses[1:], motion="screw"), snaps=True)
    events = [event for branch in led.branches for event in branch.events if event.snapped is not None]
    right = (
        ("opening", "52.7°, 1.8 mm, 4.2 µJ"),
        ("closing", "2.5°, 0.14 mm, 1.2 µJ"),
        ("closing", "1°, 1.9 mm, 2.6 µJ"),
    )
    for event, (way, reference) in zip(events, right, strict=True):
        place = float(np.asarray(led.angle(event.parameter)))
        after = f"{place:.1f}°, {1e3 * event.jump:.2f} mm, {1e6 * event.released:.1f} µJ"
        yield [f"hinge, {way}: snap", "lost at 0.35 of the way", after, reference, "trackers on three meshes"]
    least = min(float(branch.least_spine_radius.min()) for branch in led.branches)
    yield ["hinge: least radius on the spine [mm]", "", f"{1e3 * least:.2f}", "10.26", "trackers on three meshes"]


def times() -> Iterator[list[str]]:
    """Times: of a default cold solve over one of 80 elements, and of the search for all equilibria."""
    for name in ("example1", "example2"):
        scenario = fb.load(f"scenarios/{name}.toml")
        coarse = fb.Scenario.from_dict(scenario.to_dict() | {"solver": {"elements": 80}})
        own, uniform = (min(fb.solve(one).solve_time for _ in range(REPEATS)) for one in (scenario, coarse))
        case = f"{name}: cold, with its error, over 80 elements"
        yield [case, "1, no error", f"{own / uniform:.1f} ({number(1e3 * own, 1)} ms)", "≤ 2", "aim"]
    began = time.perf_counter()
    found = len(fb.branches(fb.load("scenarios/example2.toml")))
    took = time.perf_counter() - began
    yield ["example 2: all equilibria", "10 s to 150 s", f"{found} in {took:.0f} s", "≤ 1 s", "aim"]


def main() -> None:
    """Writes the table."""
    write("before and after", table(["case", "before", "after", "reference", "from"], rows()))


if __name__ == "__main__":
    main()
