"""The mesh follows the error: estimates are honest, layers and slender belts are resolved."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.optimize import brentq

import fishbone as fb
from conftest import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable

CLAMP = [0.0, 0.0, 0.0]


def scenario(
    supports: list[dict[str, Any]], *, width: float = 0.1, energy: str = "wunderlich", **tables: Any
) -> dict[str, Any]:
    belt = {"width": width, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]} | tables.pop("belt", {})
    return {"energy": energy, "belt": belt, "supports": supports} | tables


def clamps(position: list[float], rotation: list[float]) -> list[dict[str, Any]]:
    return [
        {"at": "start", "position": CLAMP, "rotation": CLAMP},
        {"at": "end", "position": position, "rotation": rotation},
    ]


def pins(distance: float) -> list[dict[str, Any]]:
    return [{"at": "start", "position": CLAMP}, {"at": "end", "position": [0.0, distance, 0.0]}]


def solve(tables: dict[str, Any], **solver: Any) -> fb.Equilibrium:
    return fb.solve(fb.Scenario.from_dict(tables | {"solver": tables.get("solver", {}) | solver}), strict=True)


def quarter_twist(slenderness: float) -> dict[str, Any]:
    return scenario(clamps([0.1, 0.8, 0.0], [0.0, math.pi / 2, 0.0]), width=1.0 / slenderness)


def curved_twist() -> dict[str, Any]:
    segments = [{"kind": "straight", "length": 0.6}, {"kind": "arc", "length": 0.4, "curvature": 1.4}]
    return scenario(clamps([0.1, 0.6, 0.3], [0.3, 0.4, 0.0]), belt={"segments": segments})


CASES: dict[str, Callable[[], dict[str, Any]]] = {
    "example 1": lambda: scenario(clamps([0.0, 0.5, 0.1], CLAMP)),
    "example 1, fishbone": lambda: scenario(clamps([0.0, 0.5, 0.1], CLAMP), energy="fishbone"),
    "example 2": lambda: scenario(clamps([0.0, 0.7, 0.0], [0.0, math.pi / 6, 0.0])),
    "planar": lambda: scenario(clamps([0.0, 0.6, 0.0], CLAMP)),
    "curved": curved_twist,
}


MOST = {"example 1, fishbone": 80}
"""Its force has the same error on 80 and on 160 elements, by ribs at the bound: no halving tells that."""


def off(coarse: fb.Equilibrium, fine: fb.Equilibrium) -> list[float]:
    """The true errors, by a much finer mesh: energy, position, force, radius."""
    bend = [np.abs(belt.curvature).max() for belt in (coarse, fine)]
    force = [
        np.concatenate([np.concatenate(belt.reaction(end)) for end in ("start", "end")]) for belt in (coarse, fine)
    ]
    # The largest norm of a force or moment counts in the estimate; by components this is the same but for a factor.
    largest = np.linalg.norm(force[1].reshape(-1, 3), axis=1).max()
    shared = [np.abs(fine.u - u).argmin() for u in coarse.u]
    moved = np.linalg.norm(coarse.position - fine.position[shared], axis=1)
    return [
        abs(coarse.energy / fine.energy - 1.0),
        float(moved.max()),
        float(np.linalg.norm((force[0] - force[1]).reshape(-1, 3), axis=1).max() / largest),
        abs(bend[0] / bend[1] - 1.0),
    ]


@pytest.mark.parametrize(
    ("name", "elements"),
    [(name, elements) for name in CASES for elements in (40, 80) if elements < MOST.get(name, 100)],
)
def test_estimated_errors_are_honest(name: str, elements: int) -> None:
    tables = CASES[name]()
    coarse, fine = (solve(tables, elements=count, tolerance=1e-9) for count in (elements, 16 * elements))
    estimate = coarse.error
    assert estimate is not None
    for quantity, estimated, true in zip(estimate._fields[:3], estimate[:3], off(coarse, fine)[:3], strict=True):
        assert 0.3 * true <= estimated <= 10.0 * true + 1e-9, (quantity, estimated, true)


@pytest.mark.parametrize("name", CASES)
def test_default_mesh_is_as_accurate_as_it_says(name: str) -> None:
    tables = CASES[name]()
    found, fine = solve(tables), solve(tables, elements=1280)
    assert found.error is not None
    assert max(found.error) <= 1e-3
    assert not found.warnings
    assert found.energy == pytest.approx(fine.energy, rel=1e-3)
    force = np.concatenate(fine.reaction("end"))
    np.testing.assert_allclose(np.concatenate(found.reaction("end")), force, atol=2e-3 * np.abs(force).max())


def test_accuracy_is_bought_with_elements() -> None:
    tables = CASES["example 2"]()
    counts = [solve(tables, accuracy=accuracy).u.size for accuracy in (1e-2, 1e-3, 1e-4)]
    assert counts[0] < counts[1] < counts[2]


def test_coarse_fixed_mesh_is_warned_of() -> None:
    found = solve(CASES["example 2"](), elements=80)
    [warning] = found.warnings
    assert found.error is not None
    name, largest = max(found.error._asdict().items(), key=lambda error: error[1])
    assert f"the estimated error of the {name}, {largest:.1e}".replace("e-0", "e-") in warning
    assert "solver.accuracy, 0.001" in warning


def test_tape_under_its_own_weight_hangs_as_a_catenary() -> None:
    """A polyimide tape of 25 µm pinned 1 mm short of its length; horizontal force by the catenary's parameter a."""
    length, chord = 1.0, 0.999
    half = brentq(lambda x: np.sinh(x) / x - length / chord, 1e-3, 1.0)
    a = chord / 2.0 / half
    material = {"preset": "polyimide", "thickness": 25e-6}
    belt = {"width": 0.1, "material": material, "segments": [{"kind": "straight", "length": length}]}
    tables = {
        "energy": "wunderlich",
        "belt": belt,
        "supports": pins(chord),
        "loads": {"gravity": [-9.81, 0.0, 0.0]},
        "solver": {"bulge": [-1.0, 0.0, 0.0]},
    }
    found = solve(tables)
    weight = -found.reaction("start").force[0] * 2.0
    assert -found.position[:, 0].min() == pytest.approx(a * (np.cosh(half) - 1.0), rel=1e-3)
    assert found.reaction("end").force[1] == pytest.approx(abs(weight) / length * a, rel=1e-3)
    assert found.stable is True


@pytest.mark.parametrize("slack", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("rigidity", [1e-5, 1e-7, 1e-9])
def test_nearly_taut_belt_hangs_as_a_catenary(slack: float, rigidity: float) -> None:
    """A belt of weight 1 pinned at its ends; the rest is what bending adds, R_f/(T U²) and less."""
    half = brentq(lambda x: np.sinh(x) / x - 1.0 / (1.0 - slack), 1e-3, 1.0, xtol=1e-15)
    a = 0.5 * (1.0 - slack) / half
    tables = scenario(pins(1.0 - slack), loads={"gravity": [-1.0, 0.0, 0.0]}, solver={"bulge": [-1.0, 0.0, 0.0]})
    tables["belt"] |= {"rigidity": rigidity, "density": 1.0, "width": 0.02}
    found = solve(tables)
    assert found.u.size < 500
    assert -found.position[:, 0].min() == pytest.approx(a * (np.cosh(half) - 1.0), rel=3e-4)
    assert found.reaction("end").force[1] == pytest.approx(a, rel=1e-4)


@pytest.mark.parametrize("slack", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("yaw", [0.0, 0.3, 2.5])
@pytest.mark.parametrize("rise", [0.0, 0.6, -1.0])
def test_belt_with_hardly_any_slack_hangs_in_any_direction(slack: float, yaw: float, rise: float) -> None:
    """Between pins of unequal height: sinh(x)/x = √(1 − (height/length)²) · length/span, x = weight · span / (2 H)."""
    level, height = (1.0 - slack) * math.cos(rise), (1.0 - slack) * math.sin(rise)
    ratio = math.sqrt(1.0 - height**2) / level
    half = brentq(lambda x: np.sinh(x) / x - ratio, 1e-6, 5.0, xtol=1e-15)
    tables = scenario(pins(1.0), loads={"gravity": [-1.0, 0.0, 0.0]}, solver={"bulge": [-1.0, 0.0, 0.0]})
    tables["supports"][1]["position"] = [height, level * math.cos(yaw), level * math.sin(yaw)]
    tables["belt"] |= {"rigidity": 1e-8, "density": 1.0, "width": 0.05}
    found = solve(tables)
    force = found.reaction("end").force
    assert np.hypot(force[1], force[2]) == pytest.approx(0.5 * level / half, rel=1e-4)
    assert force[1:] == pytest.approx(np.hypot(force[1], force[2]) * np.array([np.cos(yaw), np.sin(yaw)]), rel=1e-4)
    assert found.stable is True


@pytest.mark.parametrize("lean", [0.3, math.pi / 3, 2.0])
@pytest.mark.parametrize("pull", [1e3, 1e5])
def test_leaning_clamp_under_tension_bends_as_the_elastica(lean: float, pull: float) -> None:
    """R = √(R_f/F) / (2 sin(φ/2)): the first integral of the elastica that is straight along the pull far away."""
    supports = [{"at": "start", "position": CLAMP, "rotation": [0.0, 0.0, -lean]}]
    tables = scenario(supports, loads={"points": [{"at": "end", "force": [0.0, pull, 0.0]}]})
    found = solve(tables)
    assert found.bend_radius.spine is not None
    radius = math.sqrt(1.0 / pull) / (2.0 * math.sin(lean / 2.0))
    assert found.bend_radius.spine.value == pytest.approx(radius, rel=2e-3)
    assert found.error is not None
    assert max(found.error) <= 1e-3


@pytest.mark.parametrize("energy", ["wunderlich", "sadowsky", "fishbone"])
def test_slender_belts_tend_to_a_limit(energy: str) -> None:
    energies = []
    for slenderness in (100.0, 300.0, 1000.0, 3000.0, 10000.0):
        found = solve(quarter_twist(slenderness) | {"energy": energy})
        assert found.iterations < 1000
        assert found.error is not None
        assert max(found.error) <= 1e-3
        energies.append(found.energy)
    falls = -np.diff(energies)
    assert np.all(falls > 0.0)
    assert np.all(falls[1:] < 0.8 * falls[:-1])


@pytest.mark.parametrize("energy", ["wunderlich", "sadowsky", "fishbone"])
@pytest.mark.parametrize(
    ("position", "rotation"),
    [
        ([0.4, 0.5, 0.2], [0.5, -0.4, 0.9]),
        ([0.1, 0.6, -0.3], [-0.6, 1.1, 0.2]),
        ([-0.2, 0.7, 0.1], [0.3, -1.2, -0.4]),
    ],
)
def test_energy_of_a_slender_belt_is_off_its_limit_in_proportion_to_the_width(
    energy: str, position: list[float], rotation: list[float]
) -> None:
    energies = [
        solve(scenario(clamps(position, rotation), width=width, energy=energy)).energy for width in (4e-3, 2e-3, 5e-4)
    ]
    limit = 2.0 * energies[1] - energies[0]
    assert energies[2] == pytest.approx(limit + 0.125 * (energies[0] - limit), rel=1e-3)


def test_ends_drawn_past_each_other_are_carried_or_refused() -> None:
    for distance, energy in ((-0.9, 550.80), (-0.95, 1161.26)):
        found = solve(scenario(clamps([0.0, distance, 0.0], CLAMP)))
        assert found.energy == pytest.approx(energy, rel=1e-3)
    for distance in (-0.97, -0.99):
        found = fb.solve(fb.Scenario.from_dict(scenario(clamps([0.0, distance, 0.0], CLAMP))))
        turns = np.einsum("kij,kij->k", found.frame[:-1], found.frame[1:])
        assert found.status != "converged" or np.arccos(0.5 * (turns.min() - 1.0)) <= 0.5


def test_error_does_not_depend_on_where_the_world_has_its_origin() -> None:
    tip = [{"at": "end", "force": [30.0, 0.0, 0.0]}]
    free = {"at": "start", "position": [0.0, "free", 0.0], "rotation": CLAMP}
    held_along = {"at": 0.5, "position": ["free", 0.5, "free"]}
    for supports in ([clamps([0.0, 0.0, 0.0], CLAMP)[0]], [free, held_along]):
        errors = []
        for way in ([0.0, 0.0, 0.0], [1e3, -2e3, 5e2]):
            tables = scenario(supports, loads={"points": tip})
            moved = [
                support
                | {
                    "position": [
                        x if x == "free" else x + shift for x, shift in zip(support["position"], way, strict=True)
                    ]
                }
                for support in supports
            ]
            errors.append(solve(tables | {"supports": moved}, elements=40).error)
        assert np.allclose(errors[0], errors[1], rtol=1e-3), errors
        assert errors[0].energy > 1e-8


@pytest.mark.parametrize(("solver", "width", "distance"), [({"elements": 40}, 0.1, -0.9), ({}, 0.5, -0.97)])
def test_only_a_fixed_mesh_is_advised_to_be_left_out(solver: dict[str, Any], width: float, distance: float) -> None:
    tables = scenario(clamps([0.0, distance, 0.0], CLAMP), width=width, solver=solver)
    found = fb.solve(fb.Scenario.from_dict(tables))
    assert "no finer mesh confirms the shape" in found.message
    assert ("leave out solver.elements" in found.message) == bool(solver)


def hinge(tolerance: float, elements: int | None, energy: str = "shell") -> fb.Equilibrium:
    tables = fb.load(ROOT / "scenarios" / "hinge.toml").to_dict() | {"energy": energy}
    tables["solver"] |= {"tolerance": tolerance, "elements": elements}
    tables["solver"] = {key: value for key, value in tables["solver"].items() if value is not None}
    return fb.solve(fb.Scenario.from_dict(tables))


@pytest.mark.parametrize("elements", [200, None])
def test_a_lower_tolerance_leaves_the_mesh_and_the_estimate_as_they_are(elements: int | None) -> None:
    coarse, fine = hinge(1e-8, elements), hinge(1e-12, elements)
    np.testing.assert_array_equal(fine.u, coarse.u)
    assert fine.status == "converged"
    assert max(fine.residuals) <= 1e-12
    assert fine.energy == pytest.approx(coarse.energy, rel=1e-8)
    np.testing.assert_allclose(fine.error, coarse.error, rtol=1e-3)


@pytest.mark.parametrize(
    ("energy", "elements"),
    [("wunderlich", 300), ("wunderlich", 1000), ("wunderlich", 4000), ("shell", 300), ("shell", 1000)],
)
def test_the_lowest_tolerance_is_met_on_every_mesh(energy: str, elements: int) -> None:
    found = hinge(1e-13, elements, energy)
    assert found.status == "converged"
    assert max(found.residuals) <= 1e-13
    assert found.energy == pytest.approx(hinge(1e-8, elements, energy).energy, rel=1e-8)


def pulled(tolerance: float) -> fb.Equilibrium:
    """A strip whose end is pulled with a force in which a tolerance is far below rounding."""
    clamp = {"at": "start", "position": CLAMP, "rotation": [0.0, 0.0, 0.4]}
    loads = {"points": [{"at": "end", "force": [0.0, 1e6, 0.0]}]}
    tables = scenario([clamp], loads=loads, solver={"tolerance": tolerance, "elements": 80})
    return fb.solve(fb.Scenario.from_dict(tables))


def test_a_tolerance_below_rounding_is_named() -> None:
    found = pulled(1e-13)
    assert found.status == "not_converged"
    assert found.message.startswith("solver.tolerance, 1.0e-13, is below what rounding leaves")
    assert found.energy == pytest.approx(pulled(1e-8).energy, rel=1e-8)


ONE_STEP: dict[str, dict[str, Any]] = {
    "a hinged circuit": {
        "belt": {
            "width": 0.1978,
            "rigidity": 1.0,
            "segments": [
                {"kind": "straight", "length": 0.30718},
                {"kind": "arc", "length": 0.3538, "curvature": -2.786},
                {"kind": "straight", "length": 0.33902},
            ],
            "density": 1.0,
        },
        "energy": "wunderlich",
        "supports": [
            {"at": "start", "position": [0, 0, 0]},
            {
                "at": "end",
                "position": [0.10567, 0.66839, -0.12923],
                "rotation": [1.6009, 0.64157, -0.94565],
                "hinge": "zeta",
                "moment": 1.5842,
            },
        ],
        "loads": {"gravity": [0.024561, -0.2184, -0.094833]},
    },
    "a strip with a corner that hangs": {
        "belt": {
            "width": 0.014512,
            "rigidity": 1.0,
            "segments": [
                {"kind": "straight", "length": 0.31003},
                {"kind": "corner", "angle": -0.67647},
                {"kind": "straight", "length": 0.68997},
            ],
            "density": 1.0,
        },
        "energy": "wunderlich",
        "supports": [
            {"at": "start", "position": [0, 0, 0], "rotation": [0.85464, -0.36005, -0.87627]},
            {"at": "end", "position": [0.05883, 0.6368, 0.068]},
        ],
        "loads": {"gravity": [1189.7, -1138.4, -3080.3]},
    },
}
"""Belts of which one Newton step on the finer mesh misses the change of the forces, or of the tightest bend, by far."""


@pytest.mark.parametrize("name", ONE_STEP)
def test_estimate_holds_where_one_newton_step_does_not(name: str) -> None:
    found = fb.solve(fb.Scenario.from_dict(ONE_STEP[name]), strict=True)
    fine = found.refined(1600)
    assert found.error is not None
    assert fine is not None

    def forces(of: fb.Equilibrium) -> list[Any]:
        return [np.array(held["force"]) for held in of.to_dict()["supports"]]

    moves = [float(np.linalg.norm(own - true)) for own, true in zip(forces(found), forces(fine), strict=True)]
    force = max(moves) / max(float(np.linalg.norm(true)) for true in forces(fine))
    radii = [of.to_dict()["least_spine_radius"]["value"] for of in (found, fine)]
    assert force <= found.error.force / 0.3
    assert abs(radii[0] / radii[1] - 1.0) <= found.error.radius / 0.3


def test_refinement_ends_where_every_mesh_has_a_minimum_of_its_own() -> None:
    lengths = [0.3386, 0.3926, 0.3429]
    first, second, third = ({"kind": "straight", "length": length} for length in lengths)
    corner = {"kind": "corner", "angle": -1.0891}
    belt = {"segments": [first | {"rigidity": 2.1478}, corner, second, third | {"rigidity": 0.9547}], "poisson": 0.4568}
    pose = clamps([0.05324, 0.34304, -0.41177], [-1.37667, 0.32508, -0.07241])
    found = fb.solve(fb.Scenario.from_dict(scenario(pose, width=0.05, belt=belt)), strict=True)
    assert found.error is not None
    assert max(found.error) <= 1e-3
    # One search of the three leads from mesh to mesh, to 15 000 elements if it is let.
    assert found.iterations < 5000
