"""Supports and links: those that some strip meets are met, those that none can meet are refused at once."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0

import fishbone as fb
from helpers import arc, belt, board, solve_any, support

FOLDER = Path(__file__).parents[1] / "benchmarks"


def benchmark() -> ModuleType:
    """The generator of random scenarios, which integrates its strips on its own."""
    spec = importlib.util.spec_from_file_location("random_scenarios", FOLDER / "random_scenarios.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


RANDOM = benchmark()


# ------------------------------------------------------------------------------------------------ many supports


@pytest.mark.parametrize("pins", [10, 20, 30, 60])
def test_pins_in_line_have_the_energy_of_a_wave_from_pin_to_pin(pins: int) -> None:
    """θ = a sin πku closes the length from pin to pin if J₀(a) is the pins' distance; ½ ∫ θ'² is near to a² π² k²/4."""
    reach = 0.95
    amplitude = brentq(lambda a: j0(a) - reach, 0.1, 1.0)
    places = [(i / pins, [0.0, reach * i / pins, 0.0]) for i in range(pins + 1)]
    supports: list[Any] = [{"at": u, "position": position} for u, position in places]
    found = solve_any(belt(supports, width=0.02))
    assert found.status == "converged"
    assert found.energy == pytest.approx(0.25 * (amplitude * math.pi * pins) ** 2, rel=0.02)
    assert found.warnings == []


@pytest.mark.parametrize(("kind", "least"), [("link", 1.0), ("points", 0.96)])
def test_supports_and_links_that_a_strip_meets_are_met(kind: str, least: float) -> None:
    found = [solve_any(tables) for tables in RANDOM.scenarios(kind, 30, 2)]
    assert not [equilibrium.message for equilibrium in found if equilibrium.status == "infeasible"]
    assert np.mean([equilibrium.status == "converged" for equilibrium in found]) >= least


# ------------------------------------------------------------------------------------------------ out of reach


def test_quarter_twist_over_the_whole_length_needs_slack() -> None:
    """The edges of length 1 would be the diagonals √(1 + V²/2)."""
    width = 0.2
    ends = [support("start", [0, 0, 0], [0, 0, 0]), support("end", [0, 1, 0], [0, math.pi / 2, 0])]
    found = solve_any(belt(ends, width=width))
    assert (found.status, found.iterations) == ("infeasible", 0)
    missing = 1.0 - math.sqrt(1.0 - width**2 / 2.0)
    assert f"move them closer, by {missing:.6f} at least" in found.message


def test_clamped_stiffeners_that_leave_the_rest_too_short_are_refused() -> None:
    """The ends of two stiffeners of 5, which point the same way, are √(20² + 60²) apart, held by 60 of belt."""

    def folded(y: float) -> fb.Scenario:
        stiff, soft = ({"kind": kind, "length": length} for kind, length in (("rigid", 5.0), ("straight", 60.0)))
        ends = [support("start", [0, 0, 0], [0, 0, 0]), support("end", [20, y, 0], [0, 0, math.pi])]
        tables = board([stiff, soft, stiff], ends, width=5.0) | {"solver": {"bulge": [0.0, 1.0, 0.0]}}
        return fb.Scenario.from_dict(tables)

    reach = math.sqrt(60.0**2 - 20.0**2)
    refused = fb.solve(folded(reach + 1e-3))
    assert (refused.status, refused.iterations) == ("infeasible", 0)
    assert "at u = 5 and u = 65" in refused.message
    assert fb.solve(folded(reach - 5.0)).status == "converged"
    tracker = fb.Tracker(folded(0.0))
    update = tracker.update([20.0, 60.0, 0.0], [0.0, 0.0, math.pi])
    assert (update.status, update.iterations) == ("infeasible", 0)
    assert tracker.update([20.0, 1.0, 0.0], [0.0, 0.0, math.pi]).status == "converged"


def test_link_that_leaves_the_rest_too_short_is_refused() -> None:
    ends = [support("start", [0, 0, 0], [0, 0, 0]), support("end", [0, 0.9, 0], [0, 0, 0])]
    back = {"from": 0.3, "to": 0.7, "offset": [0.0, -0.2, 0.0]}
    found = solve_any(belt(ends) | {"links": [back]})
    assert (found.status, found.iterations) == ("infeasible", 0)
    assert "less the offset of links[0]" in found.message


@pytest.mark.parametrize("seed", range(40))
def test_clamps_of_a_strip_are_never_out_of_reach(seed: int) -> None:
    """Straight boards and arcs, from flat to strongly bent: the nearer to flat, the less slack."""
    rng = np.random.default_rng(seed)
    geodesic = rng.choice([0.0, rng.uniform(-3.0, 3.0)])
    strip = RANDOM.random_strip(rng, geodesic, 10.0 ** rng.uniform(-3.0, 0.0))
    ends = [RANDOM.held(strip, node, with_frame=True) for node in (0, RANDOM.STEPS)]
    tables = belt(ends, width=strip.width)
    if geodesic != 0.0:
        tables["belt"]["segments"] = [{"kind": "arc", "length": 1.0, "curvature": geodesic}]
    tables["solver"] = {"elements": 20}
    assert solve_any(tables).status != "infeasible"


def quarter_arc(lift: float) -> dict[str, Any]:
    """A quarter of a wide ring, its ends held as on the flat board but for a lift of one end off the plane."""
    radius = 2.0 / math.pi
    end = support("end", [lift, radius, radius], [math.pi / 2.0, 0.0, 0.0])
    return board([arc(1.0, math.pi / 2.0)], [support("start", [0, 0, 0], [0, 0, 0]), end], width=0.3)


def test_end_beyond_the_way_along_an_arc_is_infeasible_at_once() -> None:
    """From end to end the shortest way on the board is two tangents of the inner edge, and the edge between them."""
    radius, inner = 2.0 / math.pi, 2.0 / math.pi - 0.15
    turn = math.acos(inner / radius)
    longest = 2.0 * inner * math.tan(turn) + inner * (math.pi / 2.0 - 2.0 * turn)
    lift = math.sqrt(longest**2 - 2.0 * radius**2)
    found = solve_any(quarter_arc(1.01 * lift))
    assert (found.status, found.iterations) == ("infeasible", 0)
    belt_length = float(found.message.split("(")[1].split(")")[0])
    assert longest <= belt_length <= (1.0 + 1e-4) * longest
    assert solve_any(quarter_arc(0.0)).status == "converged"
