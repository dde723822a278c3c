"""Random scenarios of 14 kinds converge to results that an audit confirms, and the audit notices errors."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from audit import failures
from audit_model import Shape
from audit_random import SEED, audited
from random_scenarios import ENERGIES, KINDS, scaled, scenario

Json = dict[str, Any]

numbers = pytest.mark.parametrize(
    "numbers",
    [
        pytest.param(range(3), id="few"),
        pytest.param(range(3, 23), id="many", marks=pytest.mark.full),
    ],
)


@numbers
@pytest.mark.parametrize("kind", KINDS)
def test_random_scenarios_converge_to_what_they_claim(kind: str, numbers: range) -> None:
    records = [audited(kind, number, SEED) for number in numbers]
    assert [record for record in records if record["status"] != "converged"] == []
    assert [record for record in records if record["failures"]] == []


def test_result_that_no_finer_mesh_improves_is_within_the_tolerance() -> None:
    """Its mesh is the first one, which is searched to a rough tolerance only."""
    found = fb.solve(fb.Scenario.from_dict(scenario("corners", 6, SEED)))
    assert found.status != "converged" or max(found.residuals) <= 1e-8


@pytest.mark.parametrize(("kind", "number"), [("layers", 9), ("layers", 73), ("hinges and slides", 12)])
def test_places_where_ribs_turn_over_are_not_those_of_the_mesh(kind: str, number: int) -> None:
    """Energies that do not know the width: one Newton step on a finer mesh finds ribs that turn over where they did."""
    found = fb.solve(fb.Scenario.from_dict(scenario(kind, number, SEED)), strict=True)
    fine = found.refined(4 * (len(found.u) - 1))
    assert fine is not None
    assert found.error is not None
    assert found.energy == pytest.approx(fine.energy, rel=1e-3)
    assert max(found.error) <= 1e-3


@pytest.mark.parametrize("number", [31, 43])
def test_ribs_that_all_but_miss_the_inner_edge_of_an_arc_do_not_cross(number: int) -> None:
    made = scenario("mixed", number, SEED)
    found = fb.solve(fb.Scenario.from_dict(made), strict=True)
    assert failures(made, found.to_dict()) == []


def test_mesh_is_not_refined_in_vain() -> None:
    """Facets, finer ones on a finer mesh: from 300 elements on, the force stays off by some 1e-3."""
    found = fb.solve(fb.Scenario.from_dict(scenario("arcs", 133, SEED)), strict=True)
    assert found.iterations <= 2500
    assert len(found.u) <= 2000


def test_refined_stays_at_its_minimum_where_the_other_mesh_is_rough_for_it() -> None:
    """From a mesh graded towards a corner; another minimum has the energy 4.7837."""
    made = scenario("corners", 115, SEED)
    made["solver"] = {"accuracy": 1e-4}
    found = fb.solve(fb.Scenario.from_dict(made), strict=True)
    other = found.refined(1441)
    assert other is not None
    assert other.energy == pytest.approx(found.energy, rel=1e-4)
    assert other.energy == pytest.approx(4.72021, rel=1e-5)


def test_random_scenarios_are_the_same_every_time_and_differ() -> None:
    for kind in KINDS:
        assert scenario(kind, 1, SEED) == scenario(kind, 1, SEED)
        assert scenario(kind, 1, SEED) != scenario(kind, 4, SEED) != scenario(kind, 1, SEED + 1)
    assert [scenario("clamps", number, SEED)["energy"] for number in range(3)] == list(ENERGIES)


def test_scaling_changes_units_and_back() -> None:
    made = scenario("mixed", 3, SEED)
    there = scaled(made, 250.0, 7.0)
    assert there["belt"]["width"] == 250.0 * made["belt"]["width"]
    back = scaled(there, 1.0 / 250.0, 1.0 / 7.0)
    assert fb.Scenario.from_dict(back).to_dict()["belt"]["width"] == pytest.approx(made["belt"]["width"])


# --------------------------------------------------------------------------------------------- what the audit notices


@functools.cache
def _solved(kind: str, number: int) -> tuple[Json, Json]:
    made = scenario(kind, number, SEED)
    return made, fb.solve(fb.Scenario.from_dict(made), strict=True).to_dict()


def solved(kind: str, number: int) -> tuple[Json, Json]:
    """Tables and result that a test may change."""
    return copy.deepcopy(_solved(kind, number))


def times(name: str, factor: float) -> Callable[[Json], None]:
    def change(result: Json) -> None:
        result[name] = (np.asarray(result[name]) * factor).tolist()

    return change


def shifted(result: Json) -> None:
    """A spine that is off by a thousandth from its middle on."""
    x = np.asarray(result["position"])
    x[len(x) // 2 :, 0] += 1e-3
    result["position"] = x.tolist()


def reaction(result: Json) -> None:
    result["supports"][1]["force"][1] *= 1.001


def without_law(result: Json) -> None:
    """All forces and moments in balance, and a hundredth too large."""
    for wrench in (*result["supports"], result["internal"]):
        for name in ("force", "moment"):
            wrench[name] = (1.01 * np.asarray(wrench[name])).tolist()


CHANGES = {
    "energy": (times("elastic_energy", 1.001), "elastic energy"),
    "torsion": (times("torsion", 1.000001), "torsion is −βω_ζ"),
    "curvature": (times("curvature", 1.000001), "curvature"),
    "bend": (times("bend", 1.003), "spine by integration"),
    "spine": (shifted, "spine by integration"),
    "reaction": (reaction, "balance of the whole"),
    "forces": (without_law, "law of bending"),
    "frames": (times("frame", 1.000001), "frames are orthonormal"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_audit_notices_a_wrong(name: str) -> None:
    change, claim = CHANGES[name]
    tables, result = solved("clamps", 0)
    assert failures(tables, result) == []
    change(result)
    assert [line for line in failures(tables, result) if line.startswith(claim)]


@pytest.mark.parametrize(
    ("kind", "number", "change", "claims"),
    [
        ("clamps", 0, {"rigidity": 1.02}, {"elastic energy", "law of bending"}),
        ("clamps", 2, {"width": 0.3}, {"law of bending", "elastic energy"}),
        ("natural bend", 0, {"natural_bend": 4.0}, {"elastic energy"}),
        ("gravity", 0, {"density": 1.1}, {"balance of the whole", "potential of the loads"}),
    ],
)
def test_audit_notices_another_belt(kind: str, number: int, change: Json, claims: set[str]) -> None:
    """The right result of another scenario."""
    tables, result = solved(kind, number)
    assert failures(tables, result) == []
    tables["belt"] |= change
    assert {line.partition(":")[0] for line in failures(tables, result)} >= claims


def test_audit_notices_supports_and_links_that_are_missed() -> None:
    tables, result = solved("link", 0)
    tables["links"][0]["offset"][0] += 1e-5
    tables["supports"][1]["position"][2] += 1e-5
    found = {line.partition(":")[0] for line in failures(tables, result)}
    assert {"offset of a link", "position of a support"} <= found


def test_audit_notices_ribs_that_pull_on_each_other() -> None:
    """A result of `wunderlich` taken for one of `sadowsky`: no pressure of ribs that touch explains what is left."""
    tables, result = solved("clamps", 2)
    assert result["energy_model"] == "wunderlich"
    result["energy_model"] = "sadowsky"
    assert [line for line in failures(tables, result) if line.startswith("law of ribs")]


def test_audit_integrates_a_circle() -> None:
    """A quarter of a circle of one element has its end where Runge-Kutta steps of a quarter of it say, to 3e-4."""
    frame = [np.eye(3), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]
    angle = np.pi / 2.0
    result = {
        "u": [0.0, 1.0],
        "position": [[0.0, 0.0, 0.0], [1.0 / angle, 1.0 / angle, 0.0]],
        "frame": frame,
        "bend": [-angle, -angle],
        "rib_slope": [0.0, 0.0],
        "energy_model": "wunderlich",
    }
    shape = Shape({"belt": {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}}, result)
    x, frames = shape.poses
    np.testing.assert_allclose(x[0, -1], result["position"][1], atol=3e-4)
    np.testing.assert_allclose(frames[0, -1], frame[1], atol=3e-4)
    assert shape.integral(shape.densities[0]).sum() == pytest.approx(0.5 * angle**2)
