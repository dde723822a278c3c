"""The whole surface: straight ribs that do not cross, developable, isometric to the flat sheet."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    Array,
    Energy,
    Json,
    clamped,
    constant_twist_pose,
    example1,
    example2,
    observed_orders,
    result,
    rotation_vector,
    solve,
)

Build = Callable[..., Json]

WIDTH = 0.1
REFINEMENT = (80, 160, 320)

# Chords are shorter than the curve by (κh)²/24 of themselves and strips are flat to O(h²).
ORDER_ON_A_CYLINDER = 1.9
ROUNDING = 1e-10

cases = pytest.mark.parametrize("build", [example1, example2], ids=["example1", "example2"])
energy_model = pytest.mark.parametrize("energy", ENERGIES)


def rib_direction(equilibrium: fb.Equilibrium) -> Array:
    """ζ − βη, along the rib, of unit extent across the width.

    Shapes: (n, 3)
    """
    frame = equilibrium.frame
    return frame[:, :, 2] - equilibrium.rib_slope[:, None] * frame[:, :, 1]


def flat_surface(equilibrium: fb.Equilibrium, surface: Array) -> Array:
    """The same material points on the flat sheet: p(u) + v (ζ₀ − βη₀), v read off the deformed surface.

    Shapes: (n, m, 3) -> (n, m, 2), columns y and z
    """
    v = np.einsum("nmi,ni->nm", surface - equilibrium.position[:, None], equilibrium.frame[:, :, 2])
    y = equilibrium.u[:, None] - v * equilibrium.rib_slope[:, None]
    return np.stack([y, v], axis=2)


def distances_between_neighbouring_ribs(points: Array) -> Array:
    """From every point of a rib to every point of the next.

    Shapes: (n, m, d) -> (n - 1, m, m)
    """
    return np.asarray(np.linalg.norm(points[1:, None, :] - points[:-1, :, None], axis=3))


# ----------------------------------------------------------------------------------------------- ribs, edges


@energy_model
@cases
def test_surface_has_the_documented_shape(energy: Energy, build: Build) -> None:
    """CONTRACT: (n, n_across, 3), 9 across by default."""
    equilibrium = solve(build(energy))
    nodes = len(equilibrium.u)
    assert equilibrium.surface().shape == (nodes, 9, 3)
    assert equilibrium.surface(n_across=5).shape == (nodes, 5, 3)
    assert equilibrium.surface(n_across=2).dtype == np.float64


@energy_model
@cases
def test_ribs_are_straight_along_their_rib_angle(energy: Energy, build: Build) -> None:
    """Eq. (20), (21): x(u) + v (ζ − βη), v from −V/2 to V/2 along ζ."""
    equilibrium = solve(build(energy))
    surface = equilibrium.surface(n_across=9)
    from_spine = surface - equilibrium.position[:, None]
    across = np.einsum("nmi,ni->nm", from_spine, equilibrium.frame[:, :, 2])
    expected = across[:, :, None] * rib_direction(equilibrium)[:, None]
    assert np.max(np.abs(from_spine - expected)) < 1e-12
    assert across[:, 0] == pytest.approx(-WIDTH / 2.0, abs=1e-12)
    assert across[:, -1] == pytest.approx(WIDTH / 2.0, abs=1e-12)
    assert np.all(np.diff(across, axis=1) > 0.0)


@energy_model
@cases
def test_edges_are_the_first_and_last_columns_of_the_surface(energy: Energy, build: Build) -> None:
    """CONTRACT: `edges.minus` and `edges.plus` are the ribs' ends on the −ζ and the +ζ side."""
    equilibrium = solve(build(energy))
    surface = equilibrium.surface(n_across=9)
    edges = result(equilibrium)["edges"]
    assert np.array(edges["minus"]) == pytest.approx(surface[:, 0], abs=1e-12)
    assert np.array(edges["plus"]) == pytest.approx(surface[:, -1], abs=1e-12)


@energy_model
@cases
def test_middle_of_the_surface_is_the_spine(energy: Energy, build: Build) -> None:
    """v = 0 is the middle of an odd number of columns."""
    equilibrium = solve(build(energy))
    middle = equilibrium.surface(n_across=9)[:, 4]
    assert middle == pytest.approx(equilibrium.position, abs=1e-12)


@energy_model
@cases
def test_surface_ends_at_the_corners_of_the_clamps(energy: Energy, build: Build) -> None:
    """A square rib at both ends: corners at x ± (V/2) ζ of the prescribed poses."""
    scenario = build(energy)
    surface = solve(scenario).surface(n_across=9)
    angle = scenario["supports"][1]["rotation"][0]
    end = np.array(scenario["supports"][1]["position"])
    width_direction = np.array([0.0, -np.sin(angle), np.cos(angle)])
    for side, column in ((-1.0, 0), (1.0, -1)):
        start_corner = [0.0, 0.0, side * WIDTH / 2.0]
        end_corner = end + side * WIDTH / 2.0 * width_direction
        assert surface[0, column] == pytest.approx(start_corner, abs=1e-7)
        assert surface[-1, column] == pytest.approx(end_corner, abs=1e-7)


@energy_model
@cases
def test_ribs_do_not_cross_inside_the_width(energy: Energy, build: Build) -> None:
    """Eq. (33): |β'| ≤ 2/V, so that 1 − v β' ≥ 0 and neighbouring ribs keep their order up to both edges."""
    equilibrium = solve(build(energy))
    slope_rate = np.diff(equilibrium.rib_slope) / np.diff(equilibrium.u)
    assert np.max(np.abs(slope_rate)) <= 2.0 / WIDTH * (1.0 + 1e-9)
    flat = flat_surface(equilibrium, equilibrium.surface(n_across=9))
    assert np.min(np.diff(flat[:, :, 0], axis=0)) >= -1e-10


@energy_model
@cases
def test_rib_margin_is_the_least_distance_to_the_bound(energy: Energy, build: Build) -> None:
    """CONTRACT: `rib_margin` is the least of 2/V − |s|; on a straight belt s = β', constant in each element."""
    equilibrium = solve(build(energy))
    margin = result(equilibrium)["rib_margin"]
    slope_rate = np.abs(np.diff(equilibrium.rib_slope) / np.diff(equilibrium.u))
    assert margin["value"] >= -1e-7
    assert margin["value"] == pytest.approx(float(np.min(2.0 / WIDTH - slope_rate)), abs=1e-8)
    assert 0.0 <= margin["u"] <= 1.0


# --------------------------------------------------------------------------------------------- passes through itself


def teardrop(above: float, energy: Energy) -> Json:
    """Both ends on one line, and turned so far towards each other that the legs between them meet in their plane."""
    return clamped((-0.1, 0.0, above), (0.0, 0.0, 2.4), energy=energy)


def meeting_places(equilibrium: fb.Equilibrium) -> list[tuple[float, float]]:
    """Arc lengths at which the chords of the spine meet, seen along z."""
    ends = equilibrium.position[:, :2]
    along, u = np.diff(ends, axis=0), equilibrium.u
    found = []
    for i, j in itertools.combinations(range(len(along)), 2):
        if j > i + 1:
            shares = np.linalg.solve(np.transpose([along[i], -along[j]]), ends[j] - ends[i])
            if np.all((shares >= 0.0) & (shares < 1.0)):
                found.append((float(u[i] + shares[0] * (u[i + 1] - u[i])), float(u[j] + shares[1] * (u[j + 1] - u[j]))))
    return found


@energy_model
def test_plane_belt_crosses_itself_where_its_spine_meets_itself(energy: Energy) -> None:
    equilibrium = solve(teardrop(0.0, energy))
    assert np.ptp(equilibrium.position[:, 2]) < 1e-6
    [expected] = meeting_places(equilibrium)
    assert equilibrium.crosses_itself == pytest.approx(expected, abs=1.0 / 80.0)
    assert result(equilibrium)["crosses_itself"] == list(equilibrium.crosses_itself or ())
    [warning] = [line for line in result(equilibrium)["warnings"] if "crosses itself" in line]
    assert warning in equilibrium.warnings
    assert [float(u) for u in re.findall(r"u = (\d\.\d+)", warning)] == pytest.approx(expected, abs=1.0 / 80.0)


@energy_model
def test_belt_whose_legs_pass_above_each_other_by_more_than_the_width_does_not_cross(energy: Energy) -> None:
    """Seen along z they still meet."""
    equilibrium = solve(teardrop(0.3, energy))
    assert meeting_places(equilibrium)
    assert equilibrium.crosses_itself is None
    assert equilibrium.warnings == []


# -------------------------------------------------------------------------------------- developable, isometric


def strip_warp(equilibrium: fb.Equilibrium) -> float:
    """How far neighbouring ribs are from lying in one plane: largest |Δx · (q × q₊)|/h², q = ζ − βη from the surface
    alone.

    A ruled surface x + v q is developable where x' · (q × q') = 0; the finite difference of it vanishes with O(h²).
    """
    surface = equilibrium.surface(n_across=3)
    rib = (surface[:, 2] - surface[:, 0]) / WIDTH
    spine = surface[:, 1]
    triple = np.einsum("ni,ni->n", np.diff(spine, axis=0), np.cross(rib[:-1], rib[1:]))
    return float(np.max(np.abs(triple) / np.diff(equilibrium.u) ** 2))


def normal_turn(equilibrium: fb.Equilibrium) -> float:
    """Largest turn of the surface normal along a rib, over a quarter of the width to each side of the spine.

    It is constant along a ruling where the Gaussian curvature K is 0, and turns at the rate sqrt(−K) else. Normals are
    those of central differences, n = (x(u₊, v) − x(u₋, v)) × rib.
    """
    surface = equilibrium.surface(n_across=5)
    rib = surface[1:-1, 3] - surface[1:-1, 1]
    normals = [np.cross(surface[2:, column] - surface[:-2, column], rib, axis=1) for column in (1, 3)]
    low, high = (n / np.linalg.norm(n, axis=1, keepdims=True) for n in normals)
    return float(np.max(np.linalg.norm(np.cross(low, high), axis=1)))


def isometry_defect(equilibrium: fb.Equilibrium) -> float:
    """Largest difference of distances between neighbouring ribs, on the surface and on the flat sheet, any v to any
    v."""
    surface = equilibrium.surface(n_across=5)
    deformed = distances_between_neighbouring_ribs(surface)
    natural = distances_between_neighbouring_ribs(flat_surface(equilibrium, surface))
    return float(np.max(np.abs(deformed - natural)))


def longitudinal_defect(equilibrium: fb.Equilibrium) -> float:
    """Largest difference of the lengths of the lines v = const, edges included, on the surface and on the flat
    sheet."""
    surface = equilibrium.surface(n_across=5)
    flat = flat_surface(equilibrium, surface)
    deformed = np.sum(np.linalg.norm(np.diff(surface, axis=0), axis=2), axis=0)
    natural = np.sum(np.linalg.norm(np.diff(flat, axis=0), axis=2), axis=0)
    return float(np.max(np.abs(deformed - natural)))


# Name: what is measured, its bound at the finest mesh of the two examples, and the least mean order there. The normal
# turns
# where the bound |s| = 2/V switches on and off inside a central difference: first order only for `fishbone` and
# `sadowsky`.
MEASURES: dict[str, tuple[Callable[[fb.Equilibrium], float], float, float]] = {
    "warp of a strip": (strip_warp, 1e-5, 1.7),
    "turn of the normal along a rib": (normal_turn, 2.5e-2, 0.6),
    "distances between ribs": (isometry_defect, 1e-6, 1.7),
    "lengths of longitudinal lines": (longitudinal_defect, 5e-5, 1.7),
}
measure_name = pytest.mark.parametrize("measure", MEASURES)


@measure_name
@energy_model
@cases
def test_surface_is_developable_and_isometric_to_discretisation_error(
    energy: Energy, build: Build, measure: str
) -> None:
    """Zero Gaussian curvature and unchanged lengths: small at 320 elements, and falling as the mesh is refined."""
    function, bound, order = MEASURES[measure]
    defects = np.array([function(solve(build(energy, elements=n))) for n in REFINEMENT])
    assert defects[-1] < bound, defects
    assert np.mean(observed_orders(defects)) > order, defects


@measure_name
@energy_model
def test_wound_surface_is_developable_and_isometric_with_the_second_order(energy: Energy, measure: str) -> None:
    """The same measures on a cylinder, where the fields are constant; a vanishing defect is at rounding."""
    position, frame = constant_twist_pose(-1.5, 0.4, 1.0)
    function, bound, _ = MEASURES[measure]
    defects = np.array(
        [
            function(
                solve(
                    clamped(
                        position,
                        rotation_vector(frame),
                        square_rib=False,
                        energy=energy,
                        elements=elements,
                    )
                )
            )
            for elements in (40, 80, 160)
        ]
    )
    assert defects[-1] < bound, defects
    assert np.all(observed_orders(defects[defects > ROUNDING]) > ORDER_ON_A_CYLINDER), defects


def test_measures_notice_ribs_that_lean_the_wrong_way() -> None:
    """The measures themselves: with ζ + βη instead of ζ − βη a wound surface is warped and stretched."""
    equilibrium = _LeaningTheWrongWay()
    assert strip_warp(equilibrium) > 0.5  # type: ignore[arg-type]
    assert normal_turn(equilibrium) > 1e-2  # type: ignore[arg-type]
    assert longitudinal_defect(equilibrium) > 1e-3  # type: ignore[arg-type]


class _LeaningTheWrongWay:
    """A helix of bend −1.5 and rib slope 0.4 with its ribs drawn along ζ + βη."""

    def __init__(self) -> None:
        self.u = np.linspace(0.0, 1.0, 81)
        poses = [constant_twist_pose(-1.5, 0.4, float(u)) for u in self.u]
        self.position = np.array([position for position, _ in poses])
        self.frame = np.array([frame for _, frame in poses])
        self.rib_slope = np.full(81, -0.4)

    def surface(self, n_across: int = 9) -> Array:
        v = np.linspace(-WIDTH / 2.0, WIDTH / 2.0, n_across)
        rib = self.frame[:, :, 2] - self.rib_slope[:, None] * self.frame[:, :, 1]
        return np.asarray(self.position[:, None] + v[None, :, None] * rib[:, None])


@pytest.mark.parametrize("name", ["example1", "curved", "bent", "polystyrene"])
def test_triangles_of_the_surface_cover_it_and_face_along_the_normal(name):
    found = fb.solve(fb.load(f"scenarios/{name}.toml"))
    surface = found.surface(4)
    triangles = found.surface_triangles(4)
    assert triangles.shape == (2 * (len(found.u) - 1) * 3, 3)
    a, b, c = surface.reshape(-1, 3)[triangles].transpose(1, 0, 2)
    doubled = np.cross(b - a, c - a)
    sizes = np.linalg.norm(doubled, axis=1)
    normals = np.repeat(found.frame[:-1, :, 0], 6, axis=0)
    # Triangles between two ribs at one joint have no area.
    real = sizes > 1e-9 * sizes.max()
    assert (np.einsum("ij,ij->i", doubled[real], normals[real]) > 0.8 * sizes[real]).all()
    tables = fb.load(f"scenarios/{name}.toml").to_dict()["belt"]
    area = 0.5 * sizes.sum()
    np.testing.assert_allclose(area, tables["width"] * found.u[-1], rtol=0.05)


def test_a_tracker_has_the_surface_of_its_equilibrium():
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
    tracker.update([0.0, 0.55, 0.1], [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(tracker.surface(3), tracker.equilibrium().surface(3))


def two_shapes(name: str, *, square: bool) -> tuple[fb.Equilibrium, fb.Equilibrium]:
    """Two shapes of a board on one mesh: as in its scenario, and with the end moved and turned."""
    tables = fb.load(f"scenarios/{name}.toml").to_dict()
    supports = [support | {"square_rib": square} for support in tables["supports"]]
    tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"supports": supports, "solver": {"elements": 60}}))
    before = tracker.equilibrium()
    start, end = before.position[[0, -1]]
    rotation = np.add(supports[1]["rotation"], [0.0, 0.0, 0.8])
    assert tracker.update(end + 0.1 * (start - end), rotation).status == "converged"
    return before, tracker.equilibrium()


@pytest.mark.parametrize(("name", "square"), [("example1", True), ("bent", True), ("curved", False)])
def test_a_fixed_mesh_has_the_same_triangles_for_all_shapes_and_lies_on_the_surface(name, square):
    shapes = two_shapes(name, square=square)
    (first, triangles), (second, same) = (shape.mesh(4, fixed=True) for shape in shapes)
    np.testing.assert_array_equal(triangles, same)
    assert first.shape == second.shape == (triangles.max() + 1, 3)
    assert np.abs(second - first).max() > 0.05
    for shape, vertices in zip(shapes, (first, second), strict=True):
        rows = vertices.reshape(-1, 4, 3)
        minus, plus = shape.flat_ribs().transpose(1, 0, 2)
        inner = np.concatenate([(2.0 * minus + plus) / 3.0, (minus + 2.0 * plus) / 3.0])
        np.testing.assert_allclose(np.concatenate([rows[:, 1], rows[:, 2]]), shape.material_points(inner), atol=1e-9)
        np.testing.assert_allclose(rows[:, [0, 3]], np.stack(shape.edges, axis=1), atol=1e-12)


def test_a_mesh_of_the_whole_board_changes_with_the_shape():
    """Ribs through the end's corners, and the corners beyond the last ribs: the reason for meshes that are fixed."""
    first, second = two_shapes("curved", square=False)
    assert len(first.mesh(4)[0]) != len(second.mesh(4)[0])
