"""Curvature and strain of the strip of finite thickness over its board: against thin shells, closed forms and scales.

The shells are an independent finite-element computation (data/edge/README.md).
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import fishbone as fb
from helpers import (
    ENERGIES,
    ORIGIN,
    SHELL_DATA,
    Energy,
    Json,
    board,
    clamped,
    constant_twist_pose,
    example1,
    example2,
    result,
    rigid,
    rotation_vector,
    solve,
    straight,
    support,
    thick,
    thick_shell_scenario,
)

SHELLS: dict[str, Json] = json.loads((SHELL_DATA.parent / "edge" / "boards.json").read_text("utf-8"))
shells = pytest.mark.parametrize("name", SHELLS)


def strain_of(equilibrium: fb.Equilibrium) -> fb.Strain:
    assert equilibrium.strain is not None
    return equilibrium.strain


def faces_of(equilibrium: fb.Equilibrium) -> fb.StrainExtremes:
    """The strain of a plain sheet."""
    [faces] = strain_of(equilibrium).layers
    return faces


def least_radius(equilibrium: fb.Equilibrium) -> fb.BendRadius:
    assert equilibrium.least_bend_radius is not None
    return equilibrium.least_bend_radius


def at(equilibrium: fb.Equilibrium, u: float, v: float) -> fb.PointStrain:
    found = equilibrium.strain_at([[u, v]])
    assert found is not None
    return found


@shells
def test_radii_over_the_area_are_those_of_the_shell(name: str) -> None:
    area = solve(thick_shell_scenario(name)).bend_radius.area
    shell = [1.0 / curvature for curvature in SHELLS[name]["shell"]["curvature_quantiles"]]
    assert area.p999 == pytest.approx(shell[0], rel=0.05)
    assert (area.p99, area.p95) == pytest.approx(shell[1:], rel=0.015)


@shells
def test_least_radius_away_from_clamps_is_that_of_the_shell(name: str) -> None:
    least = least_radius(solve(thick_shell_scenario(name)))
    assert 1.0 / least.value == pytest.approx(SHELLS[name]["shell"]["curvature"], rel=0.025)
    assert 0.02 <= least.u <= 0.98
    assert abs(least.v) <= 0.05


@shells
def test_strain_of_the_faces_is_that_of_the_shell(name: str) -> None:
    faces, shell = faces_of(solve(thick_shell_scenario(name))), SHELLS[name]["shell"]
    assert faces.value == pytest.approx(shell["face"], rel=0.05)
    assert faces.area.p999 == pytest.approx(shell["face_quantiles"][0], rel=0.05)
    assert faces.area[1:] == pytest.approx(shell["face_quantiles"][1:], rel=0.015)


@shells
def test_strain_of_the_middle_plane_is_that_of_the_shell_to_a_quarter(name: str) -> None:
    membrane, shell = strain_of(solve(thick_shell_scenario(name))).membrane, SHELLS[name]["shell"]["membrane"]
    assert 0.95 * shell <= membrane.value <= 1.25 * shell


@pytest.mark.parametrize("name", ["example1", "example2"])
def test_radii_and_strains_do_not_depend_on_the_mesh(name: str) -> None:
    """From 80 to 640 elements they change by less than 2 %."""
    scenario = thick_shell_scenario(name)
    belts = [solve({**scenario, "solver": {**scenario["solver"], "elements": n}}) for n in (80, 160, 640)]
    finest = belts[-1]
    for coarse in belts[:-1]:
        assert coarse.bend_radius.area == pytest.approx(finest.bend_radius.area, rel=0.02)
        assert faces_of(coarse).area[1:] == pytest.approx(faces_of(finest).area[1:], rel=0.02)
        assert faces_of(coarse).area.p999 == pytest.approx(faces_of(finest).area.p999, rel=0.025)
        assert least_radius(coarse).value == pytest.approx(least_radius(finest).value, rel=0.02)
        assert faces_of(coarse).value == pytest.approx(faces_of(finest).value, rel=0.02)


def test_planar_arch_is_strained_by_its_bend_and_by_the_curl_of_its_edges() -> None:
    """Without a Poisson effect h/(2 R), R of the elastica; with it the edges curl, and are stretched by
    ν h/(2 R √(3 (1 − ν²))) more."""
    thickness, u = 2e-4, 0.5
    plain, curled = (solve(thick(clamped((0.0, 0.6, 0.0)), thickness, poisson)) for poisson in (0.0, 0.3))
    bend = float(np.interp(u, plain.u, plain.bend))
    there = at(plain, u, 0.03)
    assert there.layers[0, 0] == pytest.approx(0.5 * thickness * bend, rel=1e-3)
    np.testing.assert_allclose(there.curvature[0], [[-bend, 0.0], [0.0, 0.0]], atol=1e-3 * bend)
    np.testing.assert_allclose(there.membrane[0], 0.0, atol=1e-3 * thickness * bend)

    bend = float(np.interp(u, curled.u, curled.bend))
    edge, inside = (at(curled, u, v) for v in (0.05, 0.0))
    np.testing.assert_allclose(edge.curvature[0], bend * np.diag([-1.0, 0.3]), atol=0.02 * bend)
    np.testing.assert_allclose(inside.curvature[0], bend * np.diag([-1.0, 0.0]), atol=0.02 * bend)
    stretched = 0.5 * thickness * bend * 0.3 / math.sqrt(3.0 * (1.0 - 0.3**2))
    assert edge.membrane[0, 0, 0] == pytest.approx(stretched, rel=0.02)
    assert edge.layers[0, 0] == pytest.approx(0.5 * thickness * bend + stretched, rel=0.02)


def test_rolled_strip_has_the_radius_and_the_strain_of_its_cylinder() -> None:
    """Without a Poisson effect one radius all over, and h/2 times the difference of bend to the natural one."""
    bend, thickness, natural = 4.0, 1e-3, 1.5
    position, frame = constant_twist_pose(bend, 0.0, 1.0)
    scenario = thick(clamped(position, rotation_vector(frame), elements=80), thickness, 0.0)
    scenario["belt"]["natural_bend"] = natural
    found = solve(scenario)
    assert least_radius(found).value == pytest.approx(1.0 / bend, rel=1e-6)
    assert found.bend_radius.area == pytest.approx([1.0 / bend] * 3, rel=1e-6)
    strain = 0.5 * thickness * (bend - natural)
    assert faces_of(found).value == pytest.approx(strain, rel=1e-6)
    assert faces_of(found).area == pytest.approx([strain] * 3, rel=1e-6)
    assert strain_of(found).membrane.value < 1e-6 * strain


def test_segments_are_strained_from_their_own_natural_bend() -> None:
    thickness = 1e-3
    supports = [support("start", ORIGIN, ORIGIN), support("end", (0.0, 0.9, 0.0), ORIGIN)]
    found = solve(thick(board([straight(0.5, natural_bend=3.0), straight(0.5)], supports), thickness, 0.0))
    there = found.strain_at([[0.25, 0.0], [0.75, 0.0]])
    assert there is not None
    bend = -there.curvature[:, 0, 0]
    assert there.layers[:, 0] == pytest.approx(0.5 * thickness * np.abs(bend - [3.0, 0.0]), rel=5e-3)


def test_layers_are_strained_by_their_heights() -> None:
    """Two layers of one material are one sheet cut at a height: each has the strain of its outer face."""
    thickness, width, cut = 140e-6, 0.02, 50e-6
    scenario = clamped((0.0, 0.1, 0.0), rigidity=None, length=0.2, width=width, elements=80)
    layers = [{"material": "polystyrene", "thickness": h} for h in (cut, thickness - cut)]
    kinds = [{"material": {"preset": "polystyrene", "thickness": thickness}}, {"layers": layers}]
    whole, parts = (solve({**scenario, "energy": "shell", "belt": {**scenario["belt"], **kind}}) for kind in kinds)
    [sheet] = strain_of(whole).layers
    both = strain_of(parts).layers
    assert max(layer.value for layer in both) == pytest.approx(sheet.value, rel=1e-6)
    assert strain_of(parts).membrane.area == pytest.approx(strain_of(whole).membrane.area, rel=1e-6, abs=1e-12)

    # Off the edges, where the middle plane is not strained, strains are heights times bend.
    there = at(parts, 0.1, 0.0)
    bend = -there.curvature[0, 0, 0]
    heights = [0.5 * thickness, 0.5 * thickness]
    assert there.layers[0] == pytest.approx(np.multiply(heights, abs(bend)), rel=0.02)
    inner = cut - 0.5 * thickness
    faces = [np.abs(np.linalg.eigvalsh(there.membrane[0] - xi * there.curvature[0])).max() for xi in (-70e-6, inner)]
    assert there.layers[0, 0] == pytest.approx(max(faces))


def test_stiff_layer_near_the_neutral_surface_is_strained_less() -> None:
    """A thin copper foil on a thick film: the neutral surface is in between, each layer has a strain of its own."""
    scenario = clamped((0.0, 0.1, 0.0), rigidity=None, length=0.2, width=0.02, elements=80)
    layers = [{"material": "rolled copper", "thickness": 18e-6}, {"material": "polyimide", "thickness": 75e-6}]
    found = solve({**scenario, "energy": "shell", "belt": {**scenario["belt"], "layers": layers}})
    young = np.array([117e9, 2.5e9])
    thickness = np.array([18e-6, 75e-6])
    neutral = float(young @ (thickness * [9e-6, 55.5e-6]) / (young @ thickness))
    there = at(found, 0.1, 0.0)
    bend = abs(there.curvature[0, 0, 0])
    assert there.layers[0] == pytest.approx([bend * neutral, bend * (93e-6 - neutral)], rel=0.02)
    copper, film = strain_of(found).layers
    assert copper.value < film.value


def test_stiffeners_have_no_strain_and_extremes_keep_away_from_them() -> None:
    segments = [straight(0.4), rigid(0.2), straight(0.4)]
    scenario = board(segments, [support("start", ORIGIN, ORIGIN), support("end", (0.0, 0.7, 0.1), ORIGIN)])
    found = solve(thick(scenario))
    inside = at(found, 0.5, 0.02)
    for values in inside:
        assert not values.any()
    for place in (least_radius(found).u, faces_of(found).u, strain_of(found).membrane.u):
        assert min(abs(place - end) for end in (0.0, 0.4, 0.6, 1.0)) >= 0.02 - 1e-9


def test_board_shorter_than_what_is_left_out_has_quantiles_alone() -> None:
    scenario = clamped((0.0, 0.034, 0.0), length=0.035, width=0.1)
    found = solve(thick(scenario))
    assert found.least_bend_radius is None
    faces = faces_of(found)
    assert math.isnan(faces.value)
    assert faces.area.p95 > 0.0
    assert result(found)["strain"]["layers"][0]["value"] is None
    assert result(found)["least_bend_radius"] == {"value": None, "u": None, "v": None}


def test_strain_does_not_depend_on_the_unit_of_length() -> None:
    def scaled(unit: float) -> fb.Equilibrium:
        scenario = clamped((0.0, 0.7 * unit, 0.0), (0.5, 0.0, 0.0), length=unit, width=0.1 * unit, elements=80)
        return solve(thick(scenario, 7e-4 * unit))

    one, thousand = scaled(1.0), scaled(1e3)
    assert least_radius(thousand).value == pytest.approx(1e3 * least_radius(one).value, rel=1e-6)
    assert faces_of(thousand).value == pytest.approx(faces_of(one).value, rel=1e-6)
    assert strain_of(thousand).membrane.area == pytest.approx(strain_of(one).membrane.area, rel=1e-6)
    assert at(thousand, 300.0, 20.0).layers == pytest.approx(at(one, 0.3, 0.02).layers, rel=1e-6)


def test_area_below_a_radius_exceeded_on_a_share_is_the_rest() -> None:
    found = solve(thick(example2(elements=80)))
    for radius, share in zip(found.bend_radius.area, (0.001, 0.01, 0.05), strict=True):
        assert found.area_below(radius) == pytest.approx(share, rel=1e-6)


def test_places_off_the_board_have_no_strain() -> None:
    found = solve(thick(example1(elements=80)))
    off = found.strain_at([[0.5, 0.0501], [-0.001, 0.0], [1.001, 0.0], [math.nan, 0.0]])
    on = found.strain_at([[0.0, -0.05], [1.0, 0.05]])
    assert off is not None
    assert on is not None
    assert (off.curvature.shape, off.membrane.shape, off.layers.shape) == ((4, 2, 2), (4, 2, 2), (4, 1))
    assert np.isnan(off.curvature).all()
    assert np.isnan(off.layers).all()
    assert np.isfinite(on.curvature).all()
    none = found.strain_at(np.empty((0, 2)))
    assert none is not None
    assert none.layers.shape[0] == 0
    with pytest.raises(fb.InvalidArgument, match=r"^places: found an array of shape"):
        found.strain_at([0.5, 0.0])


@pytest.mark.parametrize("energy", ENERGIES)
def test_inextensible_belts_have_no_strain(energy: Energy) -> None:
    found = solve(example1(energy, elements=80))
    assert found.strain is None
    assert found.strain_at([[0.5, 0.0]]) is None
    assert result(found)["strain"] is None


def test_result_has_the_strain_of_the_attribute() -> None:
    found = solve(thick(example1(elements=80)))
    strain = strain_of(found)

    def plain(extremes: fb.StrainExtremes) -> Json:
        return extremes._asdict() | {"area": extremes.area._asdict()}

    expected = {"membrane": plain(strain.membrane), "layers": [plain(layer) for layer in strain.layers]}
    assert result(found)["strain"] == expected
