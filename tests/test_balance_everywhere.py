"""Forces and moments are in balance in every kind of problem, as a whole and at every node.

What acts on the belt at points (supports, links, loads) and its weight sum to nothing; what lies beyond a node acts on
what lies before it with the internal force and moment there. Weights are integrated over the spine by the cubic Hermite
through its nodes, h/2 (x₀ + x₁) + h²/12 (η₀ − η₁).
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ORIGIN,
    SAME_PLACE,
    Array,
    Json,
    applied_wrenches,
    arc,
    board,
    corner,
    gravity_of,
    internal_wrenches,
    load_points,
    load_potential,
    place,
    result,
    rigid,
    solve,
    straight,
    support,
    total_length,
    weight_beyond,
)

SCENARIOS = sorted((Path(__file__).parent.parent / "scenarios").glob("*.toml"))
# Relative to the largest moment, or force times the length: the error of the solver's tolerance of 1e-8.
BALANCE_ERROR = 1e-7

START = support("start", ORIGIN, ORIGIN)
END = support("end", (0.06, 0.62, 0.08), (0.3, 0.2, -0.25))
FAR_END = support("end", (0.15, 0.55, 0.37), (math.pi / 3.0, 0.1, 0.0))
PIN: Json = {"at": 0.5, "position": [0.25, 0.33, 0.02]}
HINGE: Json = {**END, "hinge": "zeta", "square_rib": False}
WEIGHT: Json = {"gravity": (-2.0, 0.5, -1.0), "density": 2.0}
LOADS: list[Json] = [
    {"at": 0.3, "force": [-1.0, 0.5, 0.2]},
    {"at": 0.7, "force": [0.3, -0.2, 0.4], "lever": [0.05, -0.02, 0.04]},
]
LINK: Json = {"from": 0.3, "to": 0.7, "offset": [0.0, 0.24, 0.03]}
SLACK_LINK: Json = {"from": 0.6, "to": 0.9, "offset": [-0.1, 0.18, 0.03]}
"""Beside a pin at 0.5, the offset of the other would lock the belt: its energy has no limit as the mesh gets finer."""
ELL = [straight(0.5), corner(math.pi / 3.0), straight(0.5)]
ROUNDED = [straight(0.4), arc(0.2, math.pi / 0.6), straight(0.4)]
STIFFER = straight(0.15, rigidity=2.0)
MANY = [straight(0.2), arc(0.2, 1.0), rigid(0.1), straight(0.15), corner(0.4), STIFFER, arc(0.2, -1.0)]
PLAIN = [straight(1.0)]


def make(segments: list[Json], supports: list[Json], **options: Any) -> Callable[[], Json]:
    options.setdefault("elements", 80)
    options.setdefault("bulge", (1.0, 0.0, 0.0))
    return lambda: json.loads(json.dumps(board(segments, supports, **options)))


CASES: dict[str, Callable[[], Json]] = {
    "clamped": make(PLAIN, [START, END]),
    "fishbone": make(PLAIN, [START, END], energy="fishbone"),
    "sadowsky": make(PLAIN, [START, END], energy="sadowsky"),
    "corner": make(ELL, [START, FAR_END]),
    "arc": make(ROUNDED, [START, FAR_END]),
    "stiffener": make([straight(0.4), rigid(0.1), straight(0.5)], [START, END]),
    "many": make(MANY, [START, END]),
    "natural bend": make(PLAIN, [START, END], natural_bend=1.0),
    "heavy": make(PLAIN, [START, END], **WEIGHT),
    "heavy cantilever": make(PLAIN, [START], **WEIGHT),
    "heavy corner": make(ELL, [START, FAR_END], **WEIGHT),
    "heavy many": make(MANY, [START, END], **WEIGHT),
    "loads": make(PLAIN, [START, END], points=LOADS),
    "loads on a cantilever": make(PLAIN, [START], points=[*LOADS, {"at": "end", "force": [-1.0, 0.0, 0.5]}]),
    "load at a clamp": make(PLAIN, [START, END], points=[{"at": "end", "force": [3.0, 1.0, 0.0]}]),
    "heavy and loaded": make(ELL, [START, FAR_END], points=LOADS, **WEIGHT),
    "pin": make(PLAIN, [START, PIN, END]),
    "load at a pin": make(PLAIN, [START, PIN, END], points=[{"at": 0.5, "force": [3.0, 1.0, 0.0]}]),
    "inner clamp": make(PLAIN, [START, {**PIN, "rotation": [0.1, 0.2, 0.1]}, END]),
    "orientation": make(PLAIN, [START, {"at": 0.5, "rotation": [0.1, 0.2, 0.1]}, END]),
    "slide": make(PLAIN, [START, {"at": 0.5, "position": [0.3, "free", "free"]}, END]),
    "hinge": make(PLAIN, [START, HINGE]),
    "link": make(PLAIN, [START, END], links=[LINK]),
    "link on a cantilever": make(PLAIN, [START], links=[LINK]),
    "link and loads": make(PLAIN, [START, PIN, END], links=[SLACK_LINK], points=LOADS, **WEIGHT),
    "held inside only": make(PLAIN, [{**PIN, "rotation": [0.0, 0.0, 0.3]}], points=LOADS, **WEIGHT),
}
CLOSED: dict[str, Callable[[], Json]] = {
    "ring": make(PLAIN, [], closed=True, half_turns=0, width=0.04),
    "moebius": make(PLAIN, [], closed=True, half_turns=1, width=0.04, elements=200),
    "hanging ring": make(PLAIN, [START], closed=True, half_turns=0, width=0.04, **WEIGHT),
    "loaded ring": make(PLAIN, [START], closed=True, half_turns=0, width=0.04, points=LOADS),
}

for path in SCENARIOS:
    tables: Json = fb.load(path).to_dict()
    (CLOSED if tables["belt"].get("closed") else CASES)[path.name] = partial(copy.deepcopy, tables)

open_case = pytest.mark.parametrize("name", CASES)
any_case = pytest.mark.parametrize("name", [*CASES, *CLOSED])


def scenario_of(name: str) -> Json:
    return (CASES | CLOSED)[name]()


def largest(equilibrium: fb.Equilibrium, scenario: Json) -> float:
    """The largest moment, or force times the length, that acts anywhere."""
    length = total_length(scenario)
    internal = np.max(np.abs(internal_wrenches(equilibrium)), axis=0)
    applied = [np.abs(acting) for _, acting in applied_wrenches(equilibrium, scenario)]
    peak = np.max([internal, *applied], axis=0)
    return float(max(np.max(peak[:3]) * length, np.max(peak[3:])))


def in_units_of(wrenches: Array, scenario: Json) -> Array:
    """Forces times the length, so that all six numbers are moments."""
    return np.asarray(wrenches * np.repeat([total_length(scenario), 1.0], 3), dtype=np.float64)


def assert_in_balance(equilibrium: fb.Equilibrium, scenario: Json) -> None:
    total = weight_beyond(equilibrium, scenario)[0]
    total = total + np.sum([acting for _, acting in applied_wrenches(equilibrium, scenario)] or [np.zeros(6)], axis=0)
    error = np.max(np.abs(in_units_of(total, scenario)))
    assert error <= BALANCE_ERROR * largest(equilibrium, scenario), total


def beyond(equilibrium: fb.Equilibrium, scenario: Json, *, here: bool) -> Array:
    """Wrench about the origin of all forces beyond every node; forces at the node itself count if `here`.

    Shapes: (n, 6)
    """
    total = weight_beyond(equilibrium, scenario)
    for u, acting in applied_wrenches(equilibrium, scenario):
        counts = equilibrium.u < u - SAME_PLACE
        if here:
            counts = counts | (np.abs(equilibrium.u - u) <= SAME_PLACE)
        total = total + counts[:, None] * acting
    return total


def assert_node_by_node(equilibrium: fb.Equilibrium, scenario: Json) -> None:
    """A force at the end is beyond it, a force at the start before it; inside, nodes lie on either side of a force."""
    actual = internal_wrenches(equilibrium)
    errors = [
        np.max(np.abs(in_units_of(actual - beyond(equilibrium, scenario, here=here), scenario)), axis=1)
        for here in (False, True)
    ]
    error = np.minimum(*errors)
    error[0], error[-1] = errors[0][0], errors[1][-1]
    worst = int(np.argmax(error))
    assert error[worst] <= BALANCE_ERROR * largest(equilibrium, scenario), f"at u = {equilibrium.u[worst]}"


@any_case
def test_belt_is_in_balance(name: str) -> None:
    """Forces and moments of supports, links, loads and weight sum to zero."""
    scenario = scenario_of(name)
    assert_in_balance(solve(scenario), scenario)


@open_case
def test_internal_force_and_moment_are_those_of_what_lies_beyond(name: str) -> None:
    scenario = scenario_of(name)
    assert_node_by_node(solve(scenario), scenario)


@pytest.mark.parametrize("name", CLOSED)
def test_part_of_a_closed_belt_is_in_balance_with_the_rest(name: str) -> None:
    """From node to node the internal wrench changes by what acts in between, whatever goes through the seam."""
    scenario = scenario_of(name)
    equilibrium = solve(scenario)
    actual = internal_wrenches(equilibrium)[1:-1]
    expected = beyond(equilibrium, scenario, here=False)[1:-1]
    at_a_load = np.min(
        [np.abs(equilibrium.u[1:-1] - u) for u, _ in applied_wrenches(equilibrium, scenario)] or 1.0, axis=0
    )
    through = (actual - expected)[np.broadcast_to(at_a_load > SAME_PLACE, len(actual))]
    error = np.max(np.abs(in_units_of(through - through[0], scenario)))
    assert error <= BALANCE_ERROR * max(largest(equilibrium, scenario), 1e-3)


@any_case
def test_energy_is_elastic_energy_and_potential(name: str) -> None:
    """Where there are loads their potential is in `energy`; where not, the two are the same."""
    scenario = scenario_of(name)
    equilibrium = solve(scenario)
    scale = abs(equilibrium.energy) + abs(equilibrium.elastic_energy)
    expected = load_potential(equilibrium, scenario)
    assert equilibrium.energy - equilibrium.elastic_energy == pytest.approx(expected, abs=1e-8 * scale)
    if not np.any(gravity_of(scenario)) and not load_points(equilibrium, scenario):
        assert equilibrium.energy == equilibrium.elastic_energy


@any_case
def test_result_lists_supports_and_links_as_the_scenario_does(name: str) -> None:
    """One entry each, in order, three numbers to a vector."""
    scenario = scenario_of(name)
    output = result(solve(scenario))
    if scenario["supports"]:
        listed, asked = ([place(scenario, table["at"]) for table in t["supports"]] for t in (output, scenario))
        assert listed == pytest.approx(asked, abs=1e-12)
    assert len(output["links"]) == len(scenario.get("links", []))
    for entry in output["supports"]:
        assert len(entry["force"]) == len(entry["moment"]) == 3
    for entry in output["links"]:
        assert len(entry["force"]) == 3
    for field in ("force", "moment"):
        assert np.shape(output["internal"][field]) == (len(output["u"]), 3)
