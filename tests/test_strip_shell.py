"""The strip of finite thickness, `energy = "shell"`: against thin shells, closed forms and its limits.

The shells are an independent finite-element computation (data/README.md).
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import expm

import fishbone as fb
from helpers import (
    ORIGIN,
    Array,
    board,
    clamped,
    example1,
    example2,
    rms_distance,
    rotation_vector,
    shell,
    skew,
    solve,
    spine_at,
    straight,
    support,
    thick,
    thick_shell_scenario,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from helpers import Json

DISTANCES = {
    "example1": 0.2e-3,
    "example1_h2": 0.2e-3,
    "example1_h4": 0.15e-3,
    "example1_narrow": 0.12e-3,
    "example2": 0.6e-3,
    "offset05": 0.1e-3,
    "offset10_far": 0.12e-3,
    "planar": 0.06e-3,
    "example1_2h": 0.2e-3,
    "example2_2h": 0.8e-3,
    "example2_h2": 0.4e-3,
    "example2_h4": 0.25e-3,
    "curved": 0.3e-3,
    "curved_h8": 0.2e-3,
    "rounded_corner": 0.5e-3,
    "rounded_corner_h8": 0.2e-3,
}
"""Largest RMS distance of the centre line to the shell's, in U."""

shells = pytest.mark.parametrize("name", DISTANCES)


def distance(name: str) -> float:
    data = shell(name)
    return rms_distance(spine_at(solve(thick_shell_scenario(name)), data["u"]), np.array(data["position"]))


@shells
def test_centre_line_is_that_of_the_shell(name: str) -> None:
    assert distance(name) <= DISTANCES[name]


def test_centre_lines_are_a_quarter_of_a_thousandth_off_on_average() -> None:
    assert np.mean([distance(name) for name in ("example1", "example2", "offset05", "offset10_far")]) <= 0.25e-3


@shells
def test_energy_is_that_of_the_shell(name: str) -> None:
    """Within 0.6 %; the energy of the inextensible belt is 1 to 11 % higher."""
    assert solve(thick_shell_scenario(name)).energy == pytest.approx(shell(name)["energy"], rel=6e-3)


@shells
def test_equilibrium_is_no_saddle_and_its_error_is_small(name: str) -> None:
    found = solve(thick_shell_scenario(name))
    assert found.stable is not False
    assert found.error is not None
    assert found.error.energy <= 1e-3
    assert found.error.position <= 1e-3


@pytest.mark.parametrize("name", ["example1", "example2_h4", "offset05"])
def test_edges_are_those_of_the_shell(name: str) -> None:
    """Material points of both edges: the ribs are curved, and the whole surface is that of the shell to 2e-3 U."""
    data = shell(name)
    found = solve(thick_shell_scenario(name))
    for edge, v in (("edge_minus", -0.5 * data["width"]), ("edge_plus", 0.5 * data["width"])):
        flat = np.column_stack([data["u"], np.full(len(data["u"]), v)])
        assert rms_distance(found.material_points(flat), np.array(data[edge])) <= 2e-3


@pytest.mark.parametrize("name", ["example1", "example2_h4", "offset10_far"])
def test_meshes_of_80_and_320_elements_agree(name: str) -> None:
    coarse, fine = (solve({**thick_shell_scenario(name), "solver": {"elements": n}}) for n in (80, 320))
    assert coarse.energy == pytest.approx(fine.energy, rel=1e-3)
    places = np.linspace(0.0, 1.0, 41)
    assert rms_distance(spine_at(coarse, places), spine_at(fine, places)) <= 1e-4


def test_ribs_of_a_thick_strip_do_not_sway() -> None:
    """At a thickness of a fiftieth of the width the slopes of ribs rise and fall by as much on any mesh."""
    coarse, fine = (solve(thick(example2(elements=n), 2e-3)) for n in (80, 320))
    assert coarse.energy == pytest.approx(fine.energy, rel=1e-3)
    ways = [np.abs(np.diff(belt.rib_slope)).sum() for belt in (coarse, fine)]
    assert ways[0] == pytest.approx(ways[1], rel=0.05)


def test_reactions_are_derivatives_of_the_energy() -> None:
    """By central differences of the least energy, with other poses of the end."""
    step = 1e-4

    def energy(position: Array, turn: Array) -> float:
        belt = thick(clamped(position, turn, elements=80))
        return solve({**belt, "solver": {**belt["solver"], "tolerance": 1e-10}}).energy

    place, turn = np.array([0.02, 0.6, 0.05]), np.array([0.3, 0.1, -0.2])
    found = solve(thick(clamped(place, turn, elements=80))).reaction("end")
    force = [(energy(place + d, turn) - energy(place - d, turn)) / (2.0 * step) for d in step * np.eye(3)]
    np.testing.assert_allclose(found.force, force, rtol=1e-6)


def test_thin_strips_tend_to_the_inextensible_belt() -> None:
    """Example 2: the distance falls with every half of the thickness, about by its square root."""
    inextensible = solve(example2("wunderlich"))
    places = np.linspace(0.0, 1.0, 101)
    there = spine_at(inextensible, places)
    thicknesses = [1.4e-3, 7e-4, 3.5e-4, 1.75e-4]
    belts = [solve(thick(example2(), h)) for h in thicknesses]
    distances = [rms_distance(spine_at(belt, places), there) for belt in belts]
    assert all(0.6 * thicker <= thinner <= 0.8 * thicker for thicker, thinner in itertools.pairwise(distances)), (
        distances
    )
    energies = [belt.energy for belt in belts]
    assert energies == sorted(energies)
    assert energies[-1] < inextensible.energy


def test_narrow_flat_strip_twists_as_a_rod() -> None:
    """De Saint-Venant's torsion: the moment 2 (1 − ν) R_f θ/U of a strip that is free to shorten; clamps stiffen it a
    little."""
    angle, poisson = 0.1, 0.3
    scenario = thick(clamped((0.0, 1.0, 0.0), width=0.02), 2e-3, poisson)
    scenario["supports"][1] = {"at": "end", "position": [0.0, "free", 0.0], "rotation": [0.0, angle, 0.0]}
    found = solve(scenario)
    exact = 2.0 * (1.0 - poisson) * angle
    moment = found.reaction("end").moment[1]
    assert exact <= moment <= 1.02 * exact
    assert found.energy == pytest.approx(0.5 * moment * angle, rel=1e-3)


def test_rolled_strip_is_bent_into_another_helix() -> None:
    """A strip of the natural curvature 6, clamped at the end of a uniform helix k = 5, τ = 2: an independent
    implementation of the same density gives these energies."""
    rates = np.zeros((4, 4))
    rates[:3, :3] = skew(np.array([0.0, 2.0, -5.0]))
    rates[1, 3] = 1.0
    end = expm(rates)
    start = (np.full(2, -5.0), np.full(2, 0.4))
    for thickness, energy in ((1.4e-3, 3.374198), (7e-4, 3.388388), (1.75e-4, 3.403895)):
        scenario = thick(clamped(end[:3, 3], rotation_vector(end[:3, :3]), elements=100), thickness)
        scenario["belt"]["natural_bend"] = -6.0
        found = fb.solve(fb.Scenario.from_dict(scenario), start=start, strict=True)
        assert found.energy == pytest.approx(energy, rel=1e-3)


def test_thickness_of_material_and_layers_is_known() -> None:
    """A sheet, the same sheet as two layers, and its rigidity with its thickness are one belt."""
    young, poisson, thickness, width = 3.2e9, 0.34, 140e-6, 0.02
    rigidity = young * thickness**3 * width / (12.0 * (1.0 - poisson**2))
    sheet = {"preset": "polystyrene", "thickness": thickness}
    layers = [{"material": "polystyrene", "thickness": 60e-6}, {"material": "polystyrene", "thickness": 80e-6}]
    boards = [
        {"material": sheet},
        {"layers": layers},
        {"rigidity": rigidity, "thickness": thickness, "poisson": poisson},
    ]
    scenario = clamped((0.0, 0.1, 0.02), rigidity=None, length=0.2, width=width, elements=80)
    belts = [solve({**scenario, "energy": "shell", "belt": {**scenario["belt"], **kind}}) for kind in boards]
    assert belts[1].energy == pytest.approx(belts[0].energy, rel=1e-9)
    assert belts[2].energy == pytest.approx(belts[0].energy, rel=1e-9)


def test_belt_over_a_corner_and_a_stiffener_is_stiffer_without_stretching() -> None:
    """The thin strip is below the inextensible belt and within a few per cent of it."""
    segments = [
        straight(0.5),
        {"kind": "corner", "angle": 0.4},
        straight(0.3),
        {"kind": "rigid", "length": 0.1},
        straight(0.3),
    ]
    supports = [support("start", ORIGIN, ORIGIN), support("end", (0.1, 0.85, 0.3), (0.5, 0.2, 0.1))]
    bent = board(segments, supports)
    inextensible, thin = solve(bent), solve(thick(bent, 1e-4))
    assert 0.9 * inextensible.energy < thin.energy < inextensible.energy


def test_modes_are_those_of_the_inextensible_belt_for_thin_strips() -> None:
    """A planar arch is the same curve in both; its lowest mode is out of its plane, by torsion that stretching hardly
    changes."""
    belt = clamped((0.0, 0.6, 0.0), elements=80)
    modes = [solve(scenario).modes(2) for scenario in (belt, thick(belt, 1e-4))]
    for a, b in zip(*modes, strict=True):
        assert a.eigenvalue > 0.0
        assert b.eigenvalue == pytest.approx(a.eigenvalue, rel=0.15)


def test_thickness_is_needed_and_given_once() -> None:
    with pytest.raises(fb.InvalidScenario, match=r'^energy: found "shell" of a belt without a thickness, must be'):
        fb.Scenario.from_dict(example1("shell"))
    twice = thick(clamped((0.0, 0.1, 0.02), rigidity=None, length=0.2, width=0.02))
    twice["belt"]["material"] = {"preset": "PET", "thickness": 1e-4}
    with pytest.raises(fb.InvalidScenario, match=r"^belt\.thickness: found a thickness beside a material or layers"):
        fb.Scenario.from_dict(twice)


def test_strip_between_pins_hangs_in_its_plane_without_losing_its_stability() -> None:
    """At its free ends the slopes of the ribs may change and leave the surface as it is: no motion that counts.

    One of its modes is such a change of the description, and its energy falls.
    """
    pins = [{"at": "start", "position": list(ORIGIN)}, {"at": "end", "position": [-0.675, 0.241, 0.103]}]
    belt = board([straight(1.0)], pins, width=0.159, elements=80, gravity=(0.741, 0.562, 0.057), density=1.0)
    found = solve(thick(belt, 2.8e-3))
    assert np.abs(found.torsion).max() < 1e-6
    assert found.modes(1)[0].eigenvalue < -1e5
    assert solve(belt).stable
    assert found.stable


def test_coarse_mesh_is_warned_of() -> None:
    """A fixed mesh of elements longer than V/8, and one whose error is above the accuracy."""
    long = solve(thick(example1(elements=40)))
    assert any(warning.startswith("elements of 0.25 V may settle") for warning in long.warnings)
    belt = thick(example1(elements=80))
    fine = solve({**belt, "solver": {**belt["solver"], "accuracy": 1e-6}})
    assert any("is above solver.accuracy, 1e-6" in warning for warning in fine.warnings)


def ribbon_density(bend: Array, torsion: Array, thickness: float, width: float, poisson: float) -> Array:
    """Energy per length of Audoly and Neukirch's ribbon over D V."""
    size = (3.0 * (1.0 - poisson**2)) ** 0.25 * np.sqrt(np.abs(bend) / thickness) * width
    edges = 2.0 / size * (np.cosh(size) - np.cos(size)) / (np.sinh(size) + np.sin(size))
    across = torsion**2 / bend
    return np.asarray(0.5 * ((bend + across) ** 2 - (poisson * bend + across) ** 2 * edges))


@pytest.mark.parametrize("make", [example1, example2])
def test_the_narrow_limit_is_the_ribbon_of_audoly_and_neukirch(make: Callable[..., Json]) -> None:
    """V to 0 with V²/h as it is: gradients along the spine vanish, the curl of the edges stays."""
    off = []
    for narrower in (0.4, 0.2, 0.1, 0.05):
        tables = thick(make(elements=320), 7e-4 * narrower**2, 0.34)
        tables["belt"]["width"] *= narrower
        found = solve(tables)
        middles = [0.5 * (field[1:] + field[:-1]) for field in (found.bend, found.torsion)]
        density = ribbon_density(*middles, 7e-4 * narrower**2, 0.1 * narrower, 0.34)
        off.append(float(density @ np.diff(found.u)) / found.elastic_energy - 1.0)
    assert abs(off[3]) < 3e-3
    assert abs(off[3]) < abs(off[2]) < abs(off[1]) < abs(off[0])


@pytest.mark.parametrize("half_turns", [0, 2])
@pytest.mark.parametrize("width", [0.03, 0.2])
@pytest.mark.parametrize("share", [0.002, 0.02])
def test_a_ring_has_the_energy_of_a_cylinder_with_curled_edges(half_turns: int, width: float, share: float) -> None:
    """Of two half turns it lies on itself, and is wound twice as tight."""
    tables = board([straight(1.0)], [], closed=True, half_turns=half_turns, width=width)
    ring = solve(thick(tables, share * width, 0.3))
    bend = np.array(2.0 * np.pi * (1 if half_turns == 0 else 2))
    density = ribbon_density(bend, np.array(0.0), share * width, width, 0.3)
    assert ring.energy == pytest.approx(float(density), rel=2e-3 if half_turns else 1e-12)
    assert ring.stable


@pytest.mark.parametrize(("width", "share"), [(0.1, 0.0036), (0.12, 0.0065), (0.11, 0.018), (1.0 / 30.0, 0.002)])
def test_moebius_bands_are_minima_on_every_mesh(width: float, share: float) -> None:
    """Sliding along itself is a symmetry beside the six motions as a whole, though a mesh hardly has it."""
    tables = board([straight(1.0)], [], closed=True, half_turns=1, width=width)
    bands = [solve(thick(with_elements(tables, count), share * width, 0.3)) for count in (None, 80, 160, 320)]
    for band in bands:
        assert band.stable
        assert (band.negative_modes, band.zero_modes, band.half_turns) == (0, 7, 1)
        assert band.energy == pytest.approx(bands[-1].energy, rel=3e-4)
    assert bands[-1].energy < solve(tables).energy


def with_elements(tables: Json, count: int | None) -> Json:
    """The same belt on a uniform mesh, or on the default one."""
    return tables if count is None else tables | {"solver": {"elements": count}}
