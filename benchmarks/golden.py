"""Comparison with saved results, to the last digits: for changes of the code that must not change results.

    python benchmarks/golden.py save FILE [--only GROUP …]
    python benchmarks/golden.py compare FILE [--only GROUP …] [--tolerance 1e-10] [--strict]

`compare` compares the installed package with the saved results of another build, such as results/golden.json.gz. It
fails where a status differs, or a number by more than the tolerance; with --strict it fails too where the iterations
differ. A run takes two minutes on one core.

Energies and eigenvalues are compared each with itself, positions with the length of the belt, all else with the largest
of its kind in the case.

Rounding alone may change results. With other roundings of sines (glibc without FMA), solves, poses, trackers and
branches stay within 1e-14. But the source's method, which never converges, differs by 4e-7; the continuations of
sheared bands and of the S differ by 1e-10 to 2e-7; the nearest margin of the arch may be its mirror image; and the
branch that crosses the arch that is moved aside is a pitchfork or cannot be followed. The number of threads changes
nothing.
"""

from __future__ import annotations

import argparse
import functools
import gzip
import json
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import fishbone as fb
import random_poses
import shear
from branches import random_shape
from cases import ENERGIES, EXAMPLES, on_one_mesh
from tables import ROOT
from validation import processor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Case = dict[str, Any]
    """What is exact under "status" and "iterations", the length of the belt, and lists of numbers by QUANTITIES."""
    Cases = dict[str, Case]

SCHEMA = "fishbone.golden/1"
FILE = ROOT / "benchmarks" / "results" / "golden.json.gz"
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))
PACKAGES = ("fishbone", "numpy")
TOLERANCE = 1e-10
MARGINS_BY = 1e3
"""Factor on the tolerance of margins: the nearest one is where a search ends, to 1e-6 in its direction squared."""
NAMED = 10
"""Number of cases named, those that differ most."""
NOUGHT = 1e-6
"""Smallest scale of an energy, as a share of the largest energy of the case: that of a belt without slack is 0."""
NODES, FEW_NODES = 9, 3
POSES, STARTS, UPDATES, MODES = 1000, 60, 200, 4

QUANTITIES: dict[str, Callable[[Floats, Case], Floats]] = {
    "energy": lambda saved, _: np.maximum(np.abs(saved), NOUGHT * np.max(np.abs(saved))),
    "position": lambda saved, case: np.full_like(saved, case["length"]),
    "reaction": lambda saved, _: np.full_like(saved, np.max(np.abs(saved))),
    "parameter": lambda saved, _: np.full_like(saved, np.max(np.abs(saved))),
    "derivative": lambda saved, _: np.full_like(saved, np.max(np.abs(saved))),
    "eigenvalue": lambda saved, _: np.abs(saved),
}
"""The quantities compared, and the scale of each."""


# ----------------------------------------------------------------------------------------------- what is computed


def _flat(*arrays: Any) -> list[float]:
    return [float(value) for array in arrays for value in np.ravel(array)]


def _wrench(reaction: fb.Reaction, length: float) -> list[float]:
    """Force and moment in one unit."""
    return _flat(reaction.force, reaction.moment / length)


def _some(position: Floats, count: int) -> list[float]:
    """Positions of so many nodes, both ends among them."""
    return _flat(position[np.linspace(0, len(position) - 1, count).round().astype(int)])


def _case(equilibrium: fb.Equilibrium, nodes: int = NODES) -> Case:
    """A solve, with the forces of supports and links."""
    e, length = equilibrium, float(equilibrium.u[-1])
    status = {"status": [e.status, e.stable, e.negative_modes, e.zero_modes], "iterations": [e.iterations]}
    if e.status == "infeasible":
        return status | {"length": length}  # there is no shape
    supports = range(len(e.scenario.to_dict().get("supports", [])))
    try:
        reactions = [_wrench(e.reaction(index), length) for index in supports]
    except fb.NoSupport:
        reactions = []  # the source's method has none
    return status | {
        "length": length,
        "energy": [e.energy, e.elastic_energy],
        "position": _some(e.position, nodes),
        "reaction": _flat(*reactions, e.links),
    }


def _changed(scenario: fb.Scenario, energy: str | None = None, **solver: Any) -> fb.Scenario:
    """The scenario with another energy, and other settings of the solver."""
    tables = scenario.to_dict() | ({} if energy is None else {"energy": energy})
    tables["solver"] = tables.get("solver", {}) | solver
    return fb.Scenario.from_dict(tables)


@functools.cache
def _example(name: str) -> fb.Scenario:
    return fb.Scenario.from_dict(on_one_mesh(fb.load(ROOT / "scenarios" / f"{name}.toml").to_dict()))


@functools.cache
def _solved(name: str) -> fb.Equilibrium:
    return fb.solve(_example(name))


def scenarios() -> Cases:
    """Every shipped scenario as it is."""
    return {path.stem: _case(_solved(path.stem)) for path in SCENARIOS}


def variants() -> Cases:
    """Every shipped scenario by every energy and on a finer mesh; the source's method; supports out of reach."""
    given = {f"{p.stem}, {energy}": _changed(_example(p.stem), energy) for p in SCENARIOS for energy in ENERGIES}
    given |= {f"{p.stem}, 200 elements": _changed(_example(p.stem), elements=200) for p in SCENARIOS}
    given |= {f"{name}, ritz": _changed(_example(name), "fishbone", method="ritz") for name in EXAMPLES}
    given["out of reach"] = _arch(1.5)
    return {name: _case(fb.solve(scenario)) for name, scenario in given.items()}


def boards() -> Cases:
    """Cases beyond the shipped scenarios: links, inner supports, slides, hinges, several loads and rigidities."""
    return {name: _case(fb.solve(fb.Scenario.from_dict(on_one_mesh(tables)))) for name, tables in _boards()}


def _boards() -> Iterator[tuple[str, dict[str, Any]]]:
    start, end = _example("example1").to_dict()["supports"]
    straight = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    pin = {"at": 0.4, "position": [0.15, 0.3, 0.02]}
    yield "pin along the belt", {"belt": straight, "supports": [start, pin, end]}
    yield "pinned end", {"belt": straight, "supports": [start, {"at": "end", "position": [0.0, 0.6, 0.15]}]}
    slide = end | {"position": [0.0, "free", 0.1]}
    push = {"at": "end", "force": [0.0, -60.0, 0.0]}
    yield "slide under thrust", {"belt": straight, "supports": [start, slide], "loads": {"points": [push]}}
    yield "hinged end", {"belt": straight, "supports": [start, end | {"hinge": "zeta"}]}
    link = {"from": 0.2, "to": 0.9, "offset": [0.0, 0.3, 0.05]}
    yield "link", {"belt": straight, "supports": [start], "links": [link]}
    lever = {"at": 0.7, "force": [2.0, 0.0, -3.0], "lever": [0.0, 0.0, 0.05]}
    loads = {"gravity": [-1.0, 0.0, -0.5], "points": [lever, {"at": 0.3, "force": [4.0, 0.0, 0.0]}]}
    yield "weight and loads", {"belt": straight | {"density": 10.0}, "supports": [start, end], "loads": loads}
    for half_turns in (2, 3):
        yield f"{half_turns} half turns", {"belt": straight | {"closed": True, "half_turns": half_turns}}
    segments = [
        {"kind": "straight", "length": 0.3, "natural_bend": 2.0},
        {"kind": "corner", "angle": 0.6},
        {"kind": "arc", "length": 0.4, "curvature": -1.5},
        {"kind": "rigid", "length": 0.1},
        {"kind": "straight", "length": 0.3, "rigidity": {"u": [0.0, 0.2, 0.3], "value": [1.0, 2.0, 1.5]}},
    ]
    board = {"width": 0.1, "rigidity": 1.0, "natural_bend": -1.0, "segments": segments}
    held = {"at": "end", "position": [0.1, 0.6, 0.1], "rotation": [0.2, 0.1, -0.5]}
    for energy in ENERGIES:
        yield f"bent and stiffened, {energy}", {"energy": energy, "belt": board, "supports": [start, held]}


def poses(count: int = POSES) -> Cases:
    """The first so many of the random poses, the three energies in turn."""
    rng = np.random.default_rng(1)
    energies = [ENERGIES[index % len(ENERGIES)] for index in range(count)]
    asked = [random_poses.scenario(energy, *random_poses.pose(rng)) for energy in energies]
    found = fb.solve_many([fb.Scenario.from_dict(on_one_mesh(scenario.to_dict())) for scenario in asked])
    return {f"{index}, {found[index].energy_model}": _pose(found[index]) for index in range(count)}


def _pose(equilibrium: fb.Equilibrium) -> Case:
    reaction = {"reaction": _wrench(equilibrium.reaction("end"), 1.0)}
    return _case(equilibrium, FEW_NODES) | reaction


def starts() -> Cases:
    """Examples solved from random shapes, which lead to many equilibria and to none."""
    rng = np.random.default_rng(2)
    cases = {}
    for index in range(STARTS):
        name = EXAMPLES[index % len(EXAMPLES)]
        scenario = _changed(_example(name), ENERGIES[index % len(ENERGIES)])
        cases[f"{index}, {name}"] = _case(fb.solve(scenario, start=random_shape(rng)), FEW_NODES)
    return cases


def _arch(distance: float = 0.6, x: float = 0.0, angle: float = 0.0) -> fb.Scenario:
    """A planar belt between clamps in line, then its end moved aside and turned."""
    tables = _example("planar").to_dict()
    tables["supports"][1] |= {"position": [x, distance, 0.0], "rotation": [0.0, 0.0, angle]}
    return fb.Scenario.from_dict(tables)


def _strut() -> fb.Scenario:
    """A straight belt under thrust, its end held square and free to slide along y."""
    tables = _arch().to_dict()
    tables["supports"][1]["position"] = [0.0, "free", 0.0]
    tables["loads"] = {"points": [{"at": "end", "force": [0.0, -1.0, 0.0]}]}
    return fb.Scenario.from_dict(tables)


def _band(energy: str) -> fb.Scenario:
    """A wide band before it is sheared."""
    tables = _arch(0.75).to_dict()
    tables["energy"], tables["belt"]["width"] = energy, 1.0 / 6.0
    return fb.Scenario.from_dict(tables)


def _paths() -> Iterator[tuple[str, fb.Diagram]]:
    """Continuations: folds and pitchforks of planar belts, sheared bands, boards of all kinds."""
    x, z, angle = "supports[1].position[0]", "supports[1].position[2]", "supports[1].rotation[2]"
    yield "arch turned back", fb.follow(_arch(), {angle: -1.5})
    yield "arch moved aside", fb.follow(_arch(), {x: 0.7})
    yield "arch sheared", fb.follow(_arch(), {z: 0.25}, branches=1)
    yield "arch drawn taut", fb.follow(_arch(), {"supports[1].position[1]": 1.3})
    yield "strut", fb.follow(_strut(), {"loads.points[0].force[1]": -100.0})
    once = functools.partial(fb.follow, states=100, branches=1)
    for distance, fold in ((0.6, 0.61), (0.8, 0.48), (0.9, 0.35)):
        yield f"arch {distance} turned back and on", once(_arch(distance, 0.0, 1.6), {angle: -1.6})
        yield f"arch {distance} forth", once(_arch(distance, 0.0, -0.5), {x: 0.65})
        yield f"arch {distance} back", once(_arch(distance, 0.0, -0.5), {x: -0.4})
        yield f"S {distance}", once(_arch(distance, -fold), {x: 1.1 * fold})
    for energy in ("fishbone", "wunderlich"):
        yield f"band sheared, {energy}", fb.follow(_band(energy), {z: 0.4}, branches=1)
    yield "band sheared and back", fb.follow(shear.band(8, "wunderlich", 8), {z: 0.4}, branches=2)
    for motion in ("straight", "screw"):
        way = fb.Poses([([0.0, 0.7, 0.1], [0.0, 0.8, 0.0])], motion=motion)
        yield f"arch led {motion}", fb.follow(_arch(), way, branches=1)
    yield "mobius widened", fb.follow(_example("mobius"), {"belt.width": 0.15}, branches=1)
    for name in ("bent", "hinge", "curved"):
        tables = _example(name).to_dict()
        length = tables["belt"]["segments"][0]["length"]
        for field, last in (
            (z, tables["supports"][1]["position"][2] + 0.1 * length),
            ("belt.segments[0].length", 1.1 * length),
        ):
            yield f"{name}, {field}", fb.follow(_solved(name), {field: last}, states=60, branches=1)


def follow() -> Cases:
    """Branches, their ends, their events, and the minima after snaps."""
    return {name: _diagram(diagram) for name, diagram in _paths()}


def _diagram(diagram: fb.Diagram) -> Case:
    length = float(diagram.start.u[-1])
    case: Case = {"status": [], "iterations": [], "length": length}
    case |= {quantity: [] for quantity in ("energy", "position", "reaction", "parameter")}
    for branch in diagram.branches:
        case["status"] += [branch.origin, branch.end]
        case["iterations"].append(len(branch))
        states = [0, *(event.state for event in branch.events), -1]
        case["energy"] += _flat(branch.energy[states])
        case["position"] += _flat(*(_some(branch.position[state], FEW_NODES) for state in states))
        case["parameter"] += _flat(branch.parameter[states])
        if diagram.support is not None:
            force, moment = branch.reaction(diagram.support)
            case["reaction"] += _flat(force[states], moment[states] / length)
        for event in branch.events:
            case["status"] += [event.kind, *event.negative_modes, event.snapped is not None]
            case["parameter"].append(event.parameter)
            if event.snapped is not None:
                case["parameter"].append(event.snapped_parameter)
                case["energy"].append(event.snapped.energy)
    return case


def branches() -> Cases:
    """All equilibria of a few scenarios, rising in energy."""
    tables = _changed(_arch(), elements=40, bulge=[-1.0, 0.0, 0.0]).to_dict()
    given = {
        "arch": _arch(),
        "mirrored arch": fb.Scenario.from_dict(tables),
        "example1": _changed(_example("example1"), elements=40),
    }
    return {name: _levels(fb.branches(scenario)) for name, scenario in given.items()}


def _levels(found: list[fb.Equilibrium]) -> Case:
    levels = [_pose(equilibrium) for equilibrium in found]
    merged = {key: [value for level in levels for value in level[key]] for key in levels[0] if key != "length"}
    return merged | {"length": levels[0]["length"]}


def margins() -> Cases:
    """Margins of a support: to a fold, to a pitchfork, and to the nearest loss of stability."""
    arch = fb.solve(_arch())
    margins = {
        "arch, to its fold": arch.snap_margin(direction=(0.0, 0.0, 0.0, 0.0, 0.0, -1.0), reach=1.5),
        "arch, to its pitchfork": arch.snap_margin(direction=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), reach=0.7),
        "arch, drawn taut": arch.snap_margin(direction=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0), reach=0.6),
        "arch": arch.snap_margin(),
        "example2": _solved("example2").snap_margin(),
    }
    return {name: _margin(margin) for name, margin in margins.items()}


def _margin(margin: fb.SnapMargin | None) -> Case:
    if margin is None:
        return {"status": [None], "iterations": [], "length": 1.0}
    return {
        "status": [margin.snaps],
        "iterations": [],
        "length": 1.0,
        "parameter": [margin.distance],
        "position": _flat(margin.position, margin.rotation, margin.direction),
    }


def trackers() -> Cases:
    """Updates on a closed path around two examples, and of an arch that is turned until it snaps."""
    cases = {}
    for name in EXAMPLES:
        cases |= _tracked(name, _changed(_example(name), elements=64), _way(name))
    way = [(np.array([0.0, 0.9, 0.0]), np.array([0.0, 0.0, angle])) for angle in np.linspace(0.0, -2.2, UPDATES)]
    return cases | _tracked("arch", _arch(0.9), way)


def _way(name: str) -> list[tuple[Floats, Floats]]:
    end = _example(name).to_dict()["supports"][1]
    turns = np.linspace(0.0, 2.0 * np.pi, UPDATES)
    shift = 0.03 * np.column_stack([np.sin(turns), 0.7 * np.sin(2.0 * turns), np.cos(turns) - 1.0])
    turn = 0.15 * np.column_stack([np.sin(turns), np.sin(3.0 * turns), 0.4 * (np.cos(turns) - 1.0)])
    return [(end["position"] + x, end["rotation"] + r) for x, r in zip(shift, turn, strict=True)]


def _tracked(name: str, scenario: fb.Scenario, way: Iterable[tuple[Floats, Floats]]) -> Cases:
    tracker = fb.Tracker(scenario)
    cases = {}
    for index, pose in enumerate(way):
        update = tracker.update(*pose)
        cases[f"{name}, {index}"] = {
            "status": [update.status, update.snapped],
            "iterations": [update.iterations],
            "length": float(tracker.u[-1]),
            "energy": [update.energy],
            "position": _some(tracker.position, FEW_NODES),
            "reaction": _wrench(tracker.reaction("end"), float(tracker.u[-1])),
        }
    return cases


def derivatives() -> Cases:
    """Jacobians and products of sensitivities: the norm of each array, and its product with fixed weights."""
    cases = {}
    for name in (*EXAMPLES, "bent", "curved", "twist", "cantilever"):
        equilibrium = _solved(name)
        system = equilibrium.sensitivity()
        count, nodes = len(equilibrium.scenario.to_dict()["supports"]), len(equilibrium.u)
        change = system.forward(
            supports=_weights((count, 6)), rigidity=_weights((nodes,)), width=0.1, gravity=_weights((3,))
        )
        gradient = system.adjoint(
            position=_weights((nodes, 3)), bend=_weights((nodes,)), reactions=_weights((count, 6)), energy=1.0
        )
        arrays = {"jacobian": system.jacobian(count - 1)}
        arrays |= {f"forward, {key}": value for key, value in vars(change).items()}
        arrays |= {f"adjoint, {key}": value for key, value in vars(gradient).items()}
        cases |= {f"{name}, {key}": _product(np.asarray(value)) for key, value in arrays.items()}
    return cases


def _weights(shape: tuple[int, ...]) -> Floats:
    """Numbers without any symmetry, always the same."""
    return np.cos(1.0 + np.arange(np.prod(shape, dtype=int))).reshape(shape)


def _product(array: Floats) -> Case:
    numbers = _flat(np.linalg.norm(array), np.sum(array * _weights(array.shape)))
    return {"status": [list(array.shape)], "iterations": [], "length": 1.0, "derivative": numbers}


def modes() -> Cases:
    """Lowest eigenvalues of the second variation."""
    return {
        path.stem: {
            "status": [],
            "iterations": [],
            "length": 1.0,
            "eigenvalue": [mode.eigenvalue for mode in _solved(path.stem).modes(MODES)],
        }
        for path in SCENARIOS
    }


GROUPS: dict[str, Callable[[], Cases]] = {
    group.__name__: group
    for group in (scenarios, variants, boards, poses, starts, follow, branches, margins, trackers, derivatives, modes)
}


def compute(names: Iterable[str]) -> dict[str, Cases]:
    """Groups of cases by their names, as they are in a file."""
    shown = track(list(names), "computing", console=Console(stderr=True), transient=True)
    found: dict[str, Cases] = json.loads(json.dumps({name: GROUPS[name]() for name in shown}))
    return found


# --------------------------------------------------------------------------------------------------------- files


def about() -> dict[str, Any]:
    """The build and its machine."""
    return {
        "schema": SCHEMA,
        "commit": _commit(Path(fb.__file__).parent),
        "processor": processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {"python": platform.python_version()} | {package: version(package) for package in PACKAGES},
    }


def _commit(folder: Path) -> str:
    """The commit of a folder: that of the package, which need not be that of this script."""
    command = ["git", "describe", "--always", "--dirty"]
    run = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    return run.stdout.strip() or "unknown"


def write(path: Path, table: Mapping[str, Any]) -> None:
    """The same table is the same bytes."""
    text = json.dumps(table, separators=(",", ":"))
    path.write_bytes(gzip.compress(text.encode(), mtime=0))


def read(path: Path) -> dict[str, Any]:
    """The table that `write` wrote."""
    table: dict[str, Any] = json.loads(gzip.decompress(path.read_bytes()))
    if table["schema"] != SCHEMA:
        raise SystemExit(f"{path}: found schema {table['schema']}, allowed {SCHEMA}")
    return table


# ---------------------------------------------------------------------------------------------------- comparison


class Difference(NamedTuple):
    """How a case differs from the saved one."""

    name: str
    status: str
    """The differences in words; empty if there are none."""
    iterations: bool
    values: dict[str, float]
    """Largest relative differences by quantity."""

    @property
    def largest(self) -> float:
        """Over all quantities."""
        return max(self.values.values(), default=0.0)


def difference(name: str, saved: Case, found: Case | None) -> Difference:
    """Between a saved case and the one found."""
    if found is None:
        return Difference(name, "not computed", iterations=False, values={})
    status = "" if saved["status"] == found["status"] else _told(saved["status"], found["status"])
    quantities = [quantity for quantity in QUANTITIES if quantity in saved or quantity in found]
    values = {quantity: relative(quantity, saved, found) for quantity in quantities}
    return Difference(name, status, saved["iterations"] != found["iterations"], values)


def _told(saved: list[Any], found: list[Any]) -> str:
    pairs = ((one, other) for one, other in zip(saved, found, strict=False) if one != other)
    one, other = next(pairs, (f"{len(saved)} entries", f"{len(found)}"))
    return f"saved {one}, found {other}"


def relative(quantity: str, saved: Case, found: Case) -> float:
    """Largest relative difference of the numbers of a case; infinite where they cannot be compared."""
    old, new = (np.array(case.get(quantity, []), dtype=np.float64) for case in (saved, found))
    if old.shape != new.shape:
        return np.inf
    if not old.size or np.array_equal(old, new, equal_nan=True):
        return 0.0
    scale = QUANTITIES[quantity](old, saved)
    apart = np.max(np.abs(new - old) / np.where(scale > 0.0, scale, 1.0))
    return float(apart) if np.isfinite(apart) else np.inf


def compare(saved: dict[str, Cases], found: dict[str, Cases]) -> dict[str, list[Difference]]:
    """The differences of all saved cases, of the groups that were computed."""
    return {
        group: [difference(name, case, cases.get(name)) for name, case in saved.get(group, {}).items()]
        for group, cases in found.items()
    }


def show(differences: dict[str, list[Difference]], console: Console) -> None:
    """The table: a row for each group."""
    table = Table("group", title="largest relative differences")
    for header in ("cases", "status", "iterations", *QUANTITIES):
        table.add_column(header, justify="right")
    for group, cases in differences.items():
        counts = [len(cases), sum(bool(case.status) for case in cases), sum(case.iterations for case in cases)]
        table.add_row(group, *map(str, counts), *(_largest(quantity, cases) for quantity in QUANTITIES))
    console.print(table)


def _largest(quantity: str, cases: list[Difference]) -> str:
    values = [case.values[quantity] for case in cases if quantity in case.values]
    return f"{max(values):.1e}".replace("0.0e+00", "0") if values else ""


def wrong(differences: dict[str, list[Difference]], tolerance: float) -> list[str]:
    """A line for each case beyond its tolerance: cases of another status first, then by the difference."""
    cases = [(group, case) for group, listed in differences.items() for case in listed]
    allowed = {group: tolerance * (MARGINS_BY if group == "margins" else 1.0) for group in differences}
    beyond = [(group, case) for group, case in cases if case.status or case.largest > allowed[group]]
    beyond.sort(key=lambda pair: (not pair[1].status, -pair[1].largest))
    return [f"{group}: {case.name}: {_reason(case, allowed[group])}" for group, case in beyond]


def _reason(case: Difference, tolerance: float) -> str:
    values = [f"{quantity} {value:.1e}" for quantity, value in case.values.items() if value > tolerance]
    return "; ".join([case.status, *values] if case.status else values)


def main() -> None:
    """Saves or compares."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("save", "compare"):
        command = commands.add_parser(name)
        command.add_argument("file", type=Path)
        command.add_argument("--only", nargs="+", choices=GROUPS, default=list(GROUPS))
    command.add_argument("--tolerance", type=float, default=TOLERANCE)
    command.add_argument("--strict", action="store_true", help="fail where iterations differ, too")
    options = parser.parse_args()
    console = Console(width=120)
    began = time.perf_counter()
    if options.command == "save":
        write(options.file, about() | {"groups": compute(options.only)})
        size = options.file.stat().st_size / 1e3
        console.print(f"{options.file}: {size:.0f} kB in {time.perf_counter() - began:.0f} s")
        return
    saved = read(options.file)
    found = compute(options.only)
    differences = compare(saved["groups"], found)
    show(differences, console)
    console.print(f"{about()['commit']} against {saved['commit']}, in {time.perf_counter() - began:.0f} s")
    for group, cases in found.items():
        new = len(cases.keys() - saved["groups"].get(group, {}).keys())
        if new:
            console.print(f"{group}: {new} cases are not in the file")
    lines = wrong(differences, options.tolerance)
    for line in lines[:NAMED]:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if len(lines) > NAMED:
        console.print(f"and {len(lines) - NAMED} more")
    counts = any(case.iterations for cases in differences.values() for case in cases)
    sys.exit(1 if lines or (options.strict and counts) else 0)


if __name__ == "__main__":
    main()
