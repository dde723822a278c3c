"""The shipped scenarios: their limits under refinement, and surfaces isometric to the flat board.

The values of the source's two examples come from an independent solver (MODEL §4), that of the Möbius band from
Starostin & van der Heijden (2007), all others from meshes of 640 elements and more.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fishbone as fb
from fishbone import examples, export
from helpers import Json, solve

SCENARIOS = Path(__file__).parent.parent / "scenarios"
ENERGY_ERROR = 1e-3
PLACE_ERROR = 2e-3

# Energy, highest point in U.
GOLDEN: dict[str, tuple[float, tuple[float, float, float]]] = {
    "bent": (11.536, (0.2955, 0.3708, -0.0224)),
    "cantilever": (-5.2392e-5, (0.0305, 0.0987, 0.0197)),
    "curl": (-7.289, (-0.3168, -0.0213, 0.2170)),
    "curved": (12.867, (0.3077, 0.3062, 0.1438)),
    "example1": (23.504, (0.3691, 0.2500, 0.0500)),
    "example2": (18.950, (0.2936, 0.4334, -0.0670)),
    "hinge": (1.2775e-4, (-0.0208, 0.2551, 0.3309)),
    "mobius": (18.63 * np.pi / 30.0, (0.1301, 0.1259, -0.1144)),
    "planar": (17.6586, (0.3487, 0.3000, 0.0)),
    "polystyrene": (1.9020e-3, (0.3685, 0.2500, 0.0500)),
    "twist": (20.809, (0.1549, 0.2775, -0.0001)),
}

names = pytest.mark.parametrize("name", GOLDEN)


def tables(name: str) -> Json:
    plain: Json = fb.load(SCENARIOS / f"{name}.toml").to_dict()
    return plain


def test_every_shipped_scenario_is_in_the_table() -> None:
    assert sorted(GOLDEN) == examples.names()


@names
def test_scenario_comes_to_what_finer_meshes_say(name: str) -> None:
    equilibrium = solve(tables(name))
    energy, highest = GOLDEN[name]
    assert equilibrium.energy == pytest.approx(energy, rel=ENERGY_ERROR)
    place = equilibrium.highest_point.position / equilibrium.u[-1]
    if name != "mobius":  # it may slide along itself, held at a place of its own choice
        np.testing.assert_allclose(place, highest, atol=PLACE_ERROR)
    assert equilibrium.warnings == []
    assert equilibrium.crosses_itself is None


@names
def test_mesh_is_the_flat_board_bent(name: str) -> None:
    """Lengths are kept, triangle by triangle, but for what chords lose: less than a thousandth of the width."""
    equilibrium = solve(tables(name))
    (points, triangles), (flat, flat_triangles) = equilibrium.mesh(2), equilibrium.flat_mesh(2)
    assert triangles.shape == flat_triangles.shape
    for i, j in ((0, 1), (1, 2), (2, 0)):
        bent = np.linalg.norm(points[triangles[:, i]] - points[triangles[:, j]], axis=1)
        before = np.linalg.norm(flat[flat_triangles[:, i]] - flat[flat_triangles[:, j]], axis=1)
        np.testing.assert_allclose(bent, before, atol=1e-3 * tables(name)["belt"]["width"])


@names
def test_mesh_has_the_area_of_the_outline(name: str) -> None:
    """No rib crosses another: all of the board is covered once."""
    equilibrium = solve(tables(name))
    width, length = tables(name)["belt"]["width"], equilibrium.u[-1]
    area = float(export.mesh(equilibrium).area)
    corners = 2.0 * (width / 2.0) ** 2 * abs(sum(abs(segment.get("angle", 0.0)) for segment in segments(name)))
    assert area == pytest.approx(width * length, rel=2e-3, abs=corners)
    loops = equilibrium.outline().loops
    if len(loops) == 1:
        y, z = loops[0].T
        assert area == pytest.approx(0.5 * np.sum(y[:-1] * z[1:] - y[1:] * z[:-1]), rel=2e-3)


def segments(name: str) -> list[Json]:
    board: list[Json] = tables(name)["belt"]["segments"]
    return board


@names
def test_nodes_ribs_and_spine_are_material_points(name: str) -> None:
    """`material_points` takes the flat spine and the flat ribs' ends to the bent ones, `rib_feet` back to u."""
    equilibrium = solve(tables(name))
    inner = slice(8, -8, 5)
    scale = 1e-6 * equilibrium.u[-1]
    spine = equilibrium.flat_spine()[inner]
    np.testing.assert_allclose(equilibrium.material_points(spine), equilibrium.position[inner], atol=scale)
    np.testing.assert_allclose(equilibrium.rib_feet(spine), equilibrium.u[inner], atol=scale)
    first, last = equilibrium.flat_ribs()[inner].transpose(1, 0, 2)
    inside = 1e-9 * (last - first)
    for edge, flat in zip(equilibrium.edges, (first + inside, last - inside), strict=True):
        np.testing.assert_allclose(equilibrium.material_points(flat), edge[inner], atol=scale)


def test_points_off_the_board_have_no_place() -> None:
    equilibrium = solve(tables("bent"))
    assert np.isnan(equilibrium.material_points([[0.9, -0.3]])).all()
    assert np.isnan(equilibrium.rib_feet([[0.9, -0.3]])).all()


def test_stiffeners_are_where_the_scenario_has_them() -> None:
    equilibrium = solve(tables("hinge"))
    (first, last), end = equilibrium.stiffeners, equilibrium.u[-1]
    np.testing.assert_allclose([*first, *last], [0.0, 0.005, end - 0.005, end], atol=1e-12)
    assert solve(tables("bent")).stiffeners == []


def test_outline_is_as_fine_as_asked_for() -> None:
    equilibrium = solve(tables("curved"))
    coarse, fine = (equilibrium.outline(tolerance) for tolerance in (1e-2, 1e-6))
    assert len(coarse.minus) < len(fine.minus)
    for line, offset in ((fine.minus, 0.05), (fine.plus, -0.05)):
        # Offsets of a quarter of a circle of radius 2/π about (0, 2/π).
        radius = np.linalg.norm(line - [0.0, 2.0 / np.pi], axis=1)
        np.testing.assert_allclose(radius, 2.0 / np.pi + offset, atol=1e-12)
    np.testing.assert_array_equal(fine.loops[0][0], fine.loops[0][-1])


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1e-12, float("nan"), float("inf")])
def test_a_tolerance_that_is_none_is_refused(tolerance: float) -> None:
    with pytest.raises(fb.InvalidArgument, match="tolerance: found"):
        solve(tables("curved")).outline(tolerance)


@pytest.mark.parametrize("points", [[0.0, 0.0], [[0.0, 0.0, 0.0]], 1.0])
def test_points_of_another_shape_are_refused(points: object) -> None:
    equilibrium = solve(tables("curved"))
    for method in (equilibrium.material_points, equilibrium.rib_feet):
        with pytest.raises(fb.InvalidArgument, match=r"allowed \(m, 2\)"):
            method(points)
