"""The result schema of the public contract, `fishbone.result/1`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    ORIGIN,
    Energy,
    Json,
    belt,
    clamped,
    example1,
    example2,
    result,
    solve,
    solve_any,
    support,
)

KEYS = {
    "schema",
    "status",
    "energy",
    "elastic_energy",
    "energy_model",
    "u",
    "position",
    "frame",
    "bend",
    "torsion",
    "rib_slope",
    "rib_angle",
    "curvature",
    "edges",
    "internal",
    "supports",
    "side",
    "least_bend_radius",
    "bend_radius",
    "rib_margin",
    "crosses_itself",
    "stable",
    "negative_modes",
    "zero_modes",
    "residuals",
    "error",
    "iterations",
    "solve_time",
    "scenario",
}

SHAPES: dict[str, tuple[int, ...]] = {
    "u": (),
    "position": (3,),
    "frame": (3, 3),
    "bend": (),
    "torsion": (),
    "rib_slope": (),
    "rib_angle": (),
    "curvature": (),
    "edges.minus": (3,),
    "edges.plus": (3,),
    "internal.force": (3,),
    "internal.moment": (3,),
}


def one_end_clamped(energy: Energy | None = None) -> Json:
    return belt([support("start", ORIGIN, ORIGIN)], energy=energy)


def too_far(energy: Energy | None = None) -> Json:
    return clamped((0.0, 1.25, 0.0), energy=energy)


SCENARIOS = {"example1": example1, "example2": example2, "flat": one_end_clamped}
scenario_name = pytest.mark.parametrize("name", SCENARIOS)
energy_model = pytest.mark.parametrize("energy", ENERGIES)


def field(output: Json, path: str) -> Any:
    value: Any = output
    for key in path.split("."):
        value = value[key]
    return value


@energy_model
@scenario_name
def test_result_has_every_key_of_the_schema(energy: Energy, name: str) -> None:
    """CONTRACT, "Result"; more keys are allowed, `links` is there only where the scenario has any."""
    output = result(solve(SCENARIOS[name](energy)))
    assert set(output) >= KEYS
    assert output.get("links", []) == []
    assert output["schema"] == "fishbone.result/1"
    assert output["energy_model"] == energy
    assert set(output["edges"]) >= {"minus", "plus"}
    assert set(output["internal"]) >= {"force", "moment"}
    assert set(output["least_bend_radius"]) >= {"value", "u", "v"}
    assert set(output["bend_radius"]["spine"]) >= {"value", "u"}
    assert set(output["bend_radius"]["area"]) >= {"p999", "p99", "p95"}
    assert set(output["rib_margin"]) >= {"value", "u"}
    assert set(output["residuals"]) >= {"stationarity", "constraint", "complementarity"}
    for entry in output["supports"]:
        assert set(entry) >= {"at", "force", "moment"}


@energy_model
@scenario_name
def test_result_fields_have_one_entry_per_node(energy: Energy, name: str) -> None:
    output = result(solve(SCENARIOS[name](energy)))
    nodes = len(output["u"])
    for path, shape in SHAPES.items():
        values = np.array(field(output, path), dtype=np.float64)
        assert values.shape == (nodes, *shape), path
        assert np.all(np.isfinite(values)), path


@energy_model
@scenario_name
def test_result_is_plain_json_without_nan(energy: Energy, name: str) -> None:
    """Written and read back it is the same; a flat belt's infinite bend radius may not be Infinity."""
    output = result(solve(SCENARIOS[name](energy)))
    assert json.loads(json.dumps(output, allow_nan=False)) == output


def test_result_of_an_infeasible_scenario_is_plain_json_too() -> None:
    """A failed solve is a value with the same schema."""
    output = result(solve_any(too_far()))
    assert output["schema"] == "fishbone.result/1"
    assert output["status"] == "infeasible"
    assert json.loads(json.dumps(output, allow_nan=False)) == output


def test_failed_solve_raises_only_on_request() -> None:
    """CONTRACT: an exception only with `strict=True`, of the package's own root."""
    scenario = fb.Scenario.from_dict(too_far())
    assert fb.solve(scenario).status == "infeasible"
    with pytest.raises(fb.FishboneError, match="0\\.25"):
        fb.solve(scenario, strict=True)


@energy_model
@scenario_name
def test_arrays_are_those_of_the_result(energy: Energy, name: str) -> None:
    """Attributes are float64 arrays in C order with the same numbers."""
    equilibrium = solve(SCENARIOS[name](energy))
    output = result(equilibrium)
    for path in ("u", "position", "frame", "bend", "torsion", "rib_slope", "rib_angle"):
        array = getattr(equilibrium, path)
        assert isinstance(array, np.ndarray), path
        assert array.dtype == np.float64, path
        assert array.flags.c_contiguous, path
        assert np.array_equal(array, np.array(output[path])), path
    assert output["energy"] == equilibrium.energy
    assert output["status"] == equilibrium.status
    assert output["stable"] == equilibrium.stable


@energy_model
@scenario_name
def test_derived_fields_follow_from_bend_and_rib_slope(energy: Energy, name: str) -> None:
    """Eq. (29)-(32): ω_η = −βω_ζ, α = arctan β, κ₁ = −ω_ζ (1+β²)."""
    output = result(solve(SCENARIOS[name](energy)))
    bend, slope = np.array(output["bend"]), np.array(output["rib_slope"])
    assert np.array(output["torsion"]) == pytest.approx(-slope * bend, rel=1e-12, abs=1e-12)
    assert np.array(output["rib_angle"]) == pytest.approx(np.arctan(slope), rel=1e-12, abs=1e-12)
    expected = -bend * (1.0 + slope**2)
    assert np.array(output["curvature"]) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_frames_are_row_major_with_the_axes_in_columns(energy: Energy, name: str) -> None:
    """Column 1 is the tangent: it is the direction of the spine's central differences to O(h²)."""
    output = result(solve(SCENARIOS[name](energy)))
    position, frame = np.array(output["position"]), np.array(output["frame"])
    chord = position[2:] - position[:-2]
    tangent = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    assert np.max(np.abs(frame[1:-1, :, 1] - tangent)) < 0.05


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_total_energy_without_loads_is_elastic(energy: Energy, name: str) -> None:
    """`energy` is the total potential, loads included; there are none."""
    output = result(solve(SCENARIOS[name](energy)))
    assert output["energy"] == pytest.approx(output["elastic_energy"], rel=1e-14)
    assert output["energy"] > 0.0


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_residuals_meet_the_default_tolerance(energy: Energy, name: str) -> None:
    """CONTRACT: tolerance 1e-8 on stationarity, constraints and complementarity."""
    output = result(solve(SCENARIOS[name](energy)))
    for key in ("stationarity", "constraint", "complementarity"):
        assert 0.0 <= output["residuals"][key] <= 1e-8, key


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_least_energy_shape_is_not_called_unstable(energy: Energy, name: str) -> None:
    """Both examples are minima (the shells' second variation is positive); null is allowed where it is not known."""
    output = result(solve(SCENARIOS[name](energy)))
    assert output["stable"] in (True, None)
    assert output["negative_modes"] in (0, None)


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_least_bend_radius_is_no_larger_than_that_of_the_spine(energy: Energy, name: str) -> None:
    """(1 − v s)/|κ₁| over the whole width: at v = 0 it is 1/|κ₁|. 2 % for the sampling along u."""
    output = result(solve(SCENARIOS[name](energy)))
    least = output["least_bend_radius"]
    on_spine = 1.0 / float(np.max(np.abs(output["curvature"])))
    assert 0.0 <= least["value"] <= 1.02 * on_spine
    assert 0.0 <= least["u"] <= 1.0
    assert abs(least["v"]) <= 0.05 * (1.0 + 1e-12)


@energy_model
def test_flat_belt_has_no_least_bend_radius(energy: Energy) -> None:
    """It is infinite, which JSON has no number for."""
    assert result(solve(one_end_clamped(energy)))["least_bend_radius"]["value"] is None


@energy_model
@pytest.mark.parametrize("name", ["example1", "example2"])
def test_scenario_of_a_result_solves_to_the_same_result(energy: Energy, name: str) -> None:
    """`scenario` is the input, normalised: a valid input itself."""
    output = result(solve(SCENARIOS[name](energy)))
    again = result(fb.solve(fb.Scenario.from_dict(output["scenario"])))
    assert again["energy"] == output["energy"]
    assert again["position"] == output["position"]
    assert again["scenario"] == output["scenario"]


def test_counts_and_times_are_sensible() -> None:
    """`iterations` a count, `solve_time` in seconds."""
    output = result(solve(example1("sadowsky")))
    assert isinstance(output["iterations"], int)
    assert 0 < output["iterations"] < 1000
    assert 0.0 < output["solve_time"] < 60.0
