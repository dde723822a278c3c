"""The strip of finite thickness on boards of arcs, and where it leaves its flat shape."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fishbone as fb
from helpers import ORIGIN, Json, arc, board, solve, support, thick


def clamped_arc(curvature: float, elements: int) -> Json:
    """An arc with a quarter of slack, moved aside by a width."""
    reach = 0.75 / curvature
    end = [0.1, reach * math.sin(curvature), reach * (1.0 - math.cos(curvature))]
    supports = [support("start", ORIGIN, ORIGIN), support("end", end, [curvature, 0.0, 0.0])]
    return thick(board([arc(1.0, curvature)], supports, elements=elements), 3e-4)


@pytest.mark.parametrize("curvature", [1.5, math.pi, -6.0])
def test_an_unloaded_arc_has_no_energy(curvature: float) -> None:
    """The term that chooses a rib slope vanishes where ribs are square."""
    free = solve(thick(board([arc(1.0, curvature)], [support("start", ORIGIN, ORIGIN)], elements=80)))
    assert abs(free.energy) < 1e-9
    assert np.abs(free.bend).max() < 1e-5


def test_a_light_weight_stores_half_its_work() -> None:
    """Clapeyron: of a small load the elastic energy is minus the energy."""
    scenario = thick(board([arc(1.0, 1.5)], [support("start", ORIGIN, ORIGIN)], elements=80))
    scenario["belt"]["density"] = 1.0
    heavy = solve(scenario | {"loads": {"gravity": [-0.01, 0.0, 0.0]}})
    assert heavy.energy < 0.0
    assert heavy.elastic_energy == pytest.approx(-heavy.energy, rel=1e-4)


def test_strains_of_an_arc_have_no_spikes_that_grow_with_the_mesh() -> None:
    """Slanted ribs of an arc are longer than V/2 towards its inner edge, where they all but meet."""
    found = [solve(clamped_arc(2.5, elements)) for elements in (80, 320)]
    strains = [strip.strain for strip in found]
    assert strains[0] is not None
    assert strains[1] is not None
    (coarse,), (fine,) = (strain.layers for strain in strains)
    assert coarse.value == pytest.approx(fine.value, rel=0.2)
    assert coarse.area.p95 == pytest.approx(fine.area.p95, rel=0.02)
    radii = [strip.bend_radius.area for strip in found]
    assert radii[0].p99 == pytest.approx(radii[1].p99, rel=0.02)


def test_curvature_is_the_principal_one_of_the_surface() -> None:
    strip = solve(clamped_arc(1.4, 160))
    inside = (strip.u > 0.2) & (strip.u < 0.8)
    places = np.column_stack([strip.u[inside], np.zeros(inside.sum())])
    at = strip.strain_at(places)
    assert at is not None
    largest = [max(np.linalg.eigvalsh(tensor), key=abs) for tensor in at.curvature]
    expected = np.array(largest)
    assert np.abs(strip.curvature[inside] - expected).max() < 0.03 * np.abs(expected).max()
    assert strip.bend_radius.spine.value == pytest.approx(1.0 / np.abs(strip.curvature).max(), rel=2e-2)


@pytest.mark.parametrize("share", [1.1, 1.5])
def test_a_strip_on_edge_falls_aside_beyond_its_critical_load(share: float) -> None:
    """A developable cantilever stays flat there: its torsion is stiffer. Prandtl's load is 4.0126 √(EI GJ)/U²."""
    nu = 0.34
    critical = 4.0126 * math.sqrt((1.0 - nu**2) * 2.0 * (1.0 - nu))
    load = {"points": [{"at": "end", "force": [0.0, 0.0, share * critical]}]}
    strip = solve(
        thick(board([{"kind": "straight", "length": 1.0}], [support("start", ORIGIN, ORIGIN)], width=0.05))
        | {"loads": load}
    )
    assert strip.stable
    assert abs(strip.position[-1, 0]) > 0.1


def test_derivatives_by_the_rigidity_of_a_strictly_solved_strip() -> None:
    """All rigidities alike change forces and no place."""
    scenario = clamped_arc(1.4, 80)
    scenario["solver"]["tolerance"] = 1e-11
    strip = fb.solve(fb.Scenario.from_dict(scenario))
    for factor in (1.0, 1e-3):
        change = strip.sensitivity().forward(rigidity=factor * np.ones(len(strip.u)))
        assert change.energy == pytest.approx(factor * strip.energy, rel=1e-6)
        assert np.abs(change.position).max() < 1e-8


def test_coarse_meshes_are_warned_of_for_the_width_and_for_their_error() -> None:
    warnings = solve(clamped_arc(1.4, 20)).warnings
    assert any("V/8 is safe" in warning for warning in warnings)
    assert any("error" in warning for warning in warnings)
