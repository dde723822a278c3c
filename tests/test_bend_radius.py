"""The bend radius on the spine and over the area, and the scales of a belt's material.

References: closed forms, and the distances and normals of neighbouring ribs on the surface.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    ORIGIN,
    Array,
    Energy,
    Json,
    belt,
    clamped,
    constant_twist_pose,
    result,
    rotation_vector,
    solve,
    support,
)

LAYERS = [
    ("polyimide", 25e-6),
    ("acrylic adhesive", 25e-6),
    ("rolled copper", 18e-6),
    ("polyimide", 25e-6),
    ("rolled copper", 18e-6),
    ("acrylic adhesive", 25e-6),
    ("polyimide", 25e-6),
]
"""A flexible circuit of two copper layers, thicknesses in m."""


def circuit(unit: float, segments: list[Json], supports: list[Json], elements: int | None = None) -> Json:
    """The circuit, 8 mm wide, with lengths in a unit [m]."""
    scenario = belt(supports, energy="wunderlich", width=8e-3 / unit, rigidity=None, elements=elements)
    scenario["belt"] |= {
        "layers": [{"material": name, "thickness": thickness / unit} for name, thickness in LAYERS],
        "segments": segments,
    }
    return scenario


def quarter_twist(elements: int) -> Json:
    """40 mm twisted by a quarter turn, the far end free to slide."""
    end = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, math.pi / 2.0, 0.0]}
    supports = [support("start", ORIGIN, ORIGIN), end]
    return circuit(1.0, [{"kind": "straight", "length": 40e-3}], supports, elements)


def u_fold(unit: float) -> Json:
    """60 mm with stiffeners of 5 mm, folded back on itself between boards 4 mm apart."""
    lengths = [("rigid", 5e-3), ("straight", 50e-3), ("rigid", 5e-3)]
    segments = [{"kind": kind, "length": length / unit} for kind, length in lengths]
    supports = [support("start", ORIGIN, ORIGIN), support("end", (4e-3 / unit, 0.0, 0.0), (0.0, 0.0, math.pi))]
    return circuit(unit, segments, supports)


def sampled_radii(equilibrium: fb.Equilibrium) -> tuple[Array, Array]:
    """Radius and area of the pieces of the surface between neighbouring ribs: the distance of the ribs over the angle
    between their normals, and from points alone the area."""
    points = equilibrium.surface(n_across=801)
    normal = equilibrium.frame[:, :, 0]
    angle = np.linalg.norm(np.diff(normal, axis=0), axis=1)
    middles = 0.5 * (points[:, 1:] + points[:, :-1])
    across = np.diff(points, axis=1)[:-1]
    along = np.diff(middles, axis=0)
    area = np.linalg.norm(np.cross(along, across), axis=2)
    radius = area / np.linalg.norm(across, axis=2) / angle[:, None]
    return radius.ravel(), area.ravel()


def sampled_quantile(equilibrium: fb.Equilibrium, share: float) -> float:
    radius, area = sampled_radii(equilibrium)
    order = np.argsort(radius)
    below = np.cumsum(area[order]) / area.sum()
    return float(radius[order][np.searchsorted(below, 1.0 - share)])


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize("angle", [-0.6, 0.0, 0.5])
def test_wound_belt_has_the_radius_of_its_cylinder_on_the_spine_and_over_the_area(angle: float, energy: Energy) -> None:
    """But for the two corners that no rib reaches: triangles with the legs V/2 and V/2 tan a."""
    position, frame = constant_twist_pose(-(math.cos(angle) ** 2) / 0.5, math.tan(angle), 1.0)
    equilibrium = solve(clamped(position, rotation_vector(frame), square_rib=False, energy=energy))
    on_spine, over_area = equilibrium.bend_radius
    assert on_spine is not None
    assert on_spine.value == pytest.approx(0.5, rel=1e-6)
    assert over_area == pytest.approx((0.5, 0.5, 0.5), rel=1e-4)
    flat = 0.05**2 * abs(math.tan(angle)) / 0.1
    assert equilibrium.area_below(0.5 * 0.99) == pytest.approx(0.0, abs=1e-4)
    assert equilibrium.area_below(0.5 * 1.01) == pytest.approx(1.0 - flat, abs=1e-4)


@pytest.mark.parametrize("elements", [80, 200, 400])
def test_radius_of_most_of_the_area_converges_where_the_least_over_the_width_falls(elements: int) -> None:
    """4.166, 4.163 and 4.161 mm by a quadrature of its own; the least radius falls from 60 to 8 µm."""
    equilibrium = solve(quarter_twist(elements))
    assert equilibrium.bend_radius.area.p99 == pytest.approx(4.163e-3, rel=3e-3)
    assert equilibrium.least_bend_radius is not None
    assert equilibrium.least_bend_radius.value < 161e-6


@pytest.mark.parametrize("share", [0.999, 0.99, 0.95])
def test_radii_over_the_area_are_those_of_the_sampled_surface(share: float) -> None:
    equilibrium = solve(quarter_twist(400))
    area = equilibrium.bend_radius.area
    found = {0.999: area.p999, 0.99: area.p99, 0.95: area.p95}[share]
    assert found == pytest.approx(sampled_quantile(equilibrium, share), rel=5e-3)
    assert equilibrium.area_below(found) == pytest.approx(1.0 - share, abs=1e-6)


def test_stiffeners_are_part_of_the_area() -> None:
    """The ends of the U fold's bent part are nearly straight: the whole area has a share of 10/60 that is flat."""
    equilibrium = solve(u_fold(1.0))
    assert equilibrium.area_below(1e3) == pytest.approx(50.0 / 60.0, abs=1e-3)
    on_spine = equilibrium.bend_radius.spine
    assert on_spine is not None
    assert on_spine.value == pytest.approx(5.1497e-3, rel=1e-3)  # elastica, by a boundary value solver
    assert on_spine.u == pytest.approx(30e-3, abs=1e-6)


@pytest.mark.parametrize("elements", [80, 81, 95])
def test_tightest_bend_of_the_spine_is_found_between_nodes(elements: int) -> None:
    """By symmetry it is at the middle or at both ends: of the elastica, at the middle."""
    end = support("end", (0.0, 0.6, 0.0), None)
    equilibrium = solve(belt([support("start", ORIGIN, None), end], elements=elements))
    on_spine = equilibrium.bend_radius.spine
    assert on_spine is not None
    assert on_spine.u == pytest.approx(0.5, abs=1e-4)
    assert on_spine == equilibrium.least_spine_radius


def test_flat_belt_has_no_radius_on_the_spine_and_infinite_ones_over_the_area() -> None:
    equilibrium = solve(belt([support("start", ORIGIN, ORIGIN)]))
    assert equilibrium.bend_radius == (None, (math.inf, math.inf, math.inf))
    assert equilibrium.area_below(1.0) == 0.0
    expected = {"spine": {"value": None, "u": None}, "area": {"p999": None, "p99": None, "p95": None}}
    assert result(equilibrium)["bend_radius"] == expected


def test_belt_that_rounding_bends_is_flat() -> None:
    """The taut belt, whose bends are of the order of the residual or less."""
    equilibrium = solve(belt([support("start", ORIGIN, ORIGIN), support("end", (0.0, 1.0, 0.0), ORIGIN)]))
    assert np.abs(equilibrium.bend).max() < 1e-8
    assert equilibrium.least_spine_radius is None
    assert equilibrium.least_bend_radius is None
    assert equilibrium.bend_radius == (None, (math.inf, math.inf, math.inf))


def test_belt_that_bends_a_little_is_not_flat() -> None:
    """A push to the side of 1e-6 R_f/U² bends a cantilever by as much at its clamp."""
    scenario = belt([support("start", ORIGIN, ORIGIN)])
    scenario["loads"] = {"points": [{"at": "end", "force": [1e-6, 0.0, 0.0]}]}
    equilibrium = solve(scenario)
    assert equilibrium.least_spine_radius is not None
    assert equilibrium.least_spine_radius.value == pytest.approx(1e6, rel=1e-2)


def test_result_has_the_radii_of_the_attributes() -> None:
    equilibrium = solve(quarter_twist(80))
    on_spine, over_area = equilibrium.bend_radius
    assert on_spine is not None
    assert result(equilibrium)["bend_radius"] == {"spine": on_spine._asdict(), "area": over_area._asdict()}


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf, (1.0, 2.0)])
def test_area_is_below_a_positive_finite_radius_only(radius: float) -> None:
    equilibrium = solve(quarter_twist(80))
    with pytest.raises(fb.InvalidArgument, match="radius: found"):
        equilibrium.area_below(radius)


def test_millimetres_are_warned_of_where_the_material_is_in_si_units() -> None:
    """Lengths in mm make 0.33 N a force of 3.3e5 N."""
    assert solve(u_fold(1.0)).warnings == []
    [warning] = solve(u_fold(1e-3)).warnings
    for words in ("60 m", "6.7e3 N", "metres", "millimetres"):
        assert words in warning
