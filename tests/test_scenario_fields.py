"""Every field of a scenario: valid values are solved, invalid values are refused by the name of the field.

CONTRACT, "Scenario file". A field that is read and has no effect is as wrong as one that is not read: the last
tests say what some of them must do.
"""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from changes import Change, drop, put, several
from helpers import (
    ORIGIN,
    Json,
    arc,
    belt,
    board,
    corner,
    example1,
    result,
    rigid,
    rotation_matrix,
    solve,
    straight,
    support,
)

ELEMENTS = 80
NAN = math.nan
START, END = support("start", ORIGIN, ORIGIN), support("end", (0.06, 0.62, 0.08), (0.3, 0.2, -0.25))
SHEET = {"young": 3.2e9, "poisson": 0.34, "thickness": 140e-6, "density": 1050.0}


def base() -> Json:
    """Two strips, clamped at both ends."""
    segments = [straight(0.5), straight(0.5)]
    return copy.deepcopy(board(segments, [START, END], elements=ELEMENTS, bulge=(1.0, 0.0, 0.0)))


def small(board_fields: Json, **loads: Any) -> Json:
    """20 mm × 200 mm in SI units, one end clamped."""
    scenario = belt([START], length=0.2, width=0.02, rigidity=None, elements=ELEMENTS)
    scenario["belt"].update(board_fields)
    if loads:
        scenario["loads"] = loads
    return scenario


def inner(**fields: Any) -> Change:
    """A support in the middle."""

    def change(scenario: Json) -> None:
        scenario["supports"].insert(1, {"at": 0.5, **fields})

    return change


def changed(change: Change) -> Json:
    scenario = base()
    change(scenario)
    return scenario


TABLE = {"u": [0.0, 0.2, 0.5], "value": [1.0, 2.0, 1.5]}
LINK = {"from": 0.3, "to": 0.7, "offset": [0.0, 0.24, 0.03]}
POINT = {"at": 0.5, "force": [0.5, 0.0, -1.0], "lever": [0.0, 0.0, 0.05]}
NO_RIGIDITY = drop("belt.rigidity")
RING = several(put("belt.closed", True), put("belt.half_turns", 0), put("supports", [START]))

GOOD: dict[str, Change] = {
    "name": put("name", "a belt"),
    "energy fishbone": put("energy", "fishbone"),
    "energy sadowsky": put("energy", "sadowsky"),
    "energy left out": drop("energy"),
    "belt.width": put("belt.width", 0.05),
    "belt.rigidity": put("belt.rigidity", 3.0),
    "belt.material": several(NO_RIGIDITY, put("belt.material", SHEET)),
    "belt.material.preset": several(NO_RIGIDITY, put("belt.material", {"preset": "polyimide", "thickness": 1e-4})),
    "belt.layers": several(NO_RIGIDITY, put("belt.layers", [{"material": "polyimide", "thickness": 25e-6}])),
    "belt.poisson": put("belt.poisson", 0.45),
    "belt.natural_bend": several(put("belt.natural_bend", 1.0), put("belt.poisson", 0.2)),
    "belt.density": put("belt.density", 2.0),
    "belt.closed": RING,
    "belt.half_turns left out": several(RING, drop("belt.half_turns")),
    "straight.natural_bend": put("belt.segments.1.natural_bend", -1.0),
    "straight.rigidity": put("belt.segments.1.rigidity", 2.0),
    "straight.rigidity table": put("belt.segments.1.rigidity", TABLE),
    "arc": put("belt.segments.1", arc(0.5, 0.5)),
    "arc the other way": put("belt.segments.1", arc(0.5, -0.5)),
    "arc.natural_bend": put("belt.segments.1", arc(0.5, 0.5, natural_bend=1.0)),
    "arc.rigidity": put("belt.segments.1", arc(0.5, 0.5, rigidity=2.0)),
    "arc.rigidity table": put("belt.segments.1", arc(0.5, 0.5, rigidity=TABLE)),
    "corner": put("belt.segments", [straight(0.5), corner(0.3), straight(0.5)]),
    "corner the other way": put("belt.segments", [straight(0.5), corner(-0.3), straight(0.5)]),
    "rigid": put("belt.segments", [straight(0.5), rigid(0.1), straight(0.4)]),
    "rigid at the end": put("belt.segments", [straight(0.9), rigid(0.1)]),
    "supports.at": inner(position=[0.25, 0.33, 0.02]),
    "supports.position left out": drop("supports.1.position"),
    "supports.position free": put("supports.1.position", [0.06, "free", 0.08]),
    "supports.position free inside": inner(position=["free", "free", 0.02]),
    "supports.rotation left out": drop("supports.1.rotation"),
    "supports.rotation inside": inner(rotation=[0.1, 0.2, 0.1]),
    "supports.euler": several(drop("supports.1.rotation"), put("supports.1.euler", [0.3, 0.2, -0.4])),
    "supports.quaternion": several(drop("supports.1.rotation"), put("supports.1.quaternion", [0.8, 0.0, 0.0, 0.6])),
    "supports.hinge xi": put("supports.1.hinge", "xi"),
    "supports.hinge eta": put("supports.1.hinge", "eta"),
    "supports.hinge zeta": put("supports.1.hinge", "zeta"),
    "supports.moment": several(put("supports.1.hinge", "zeta"), put("supports.1.moment", 0.4)),
    "supports.hinge inside": inner(rotation=[0.1, 0.2, 0.1], hinge="zeta"),
    "supports.square_rib": put("supports.1.square_rib", False),
    "supports.square_rib inside": inner(square_rib=True),
    "supports, only one": drop("supports.1"),
    "links": put("links", [LINK]),
    "links from the start": put("links", [{**LINK, "from": "start", "to": 0.5}]),
    "links, two": put("links", [{**LINK, "from": 0.1, "to": 0.3, "offset": [0.1, 0.15, 0.0]}, LINK]),
    "loads.gravity": several(put("belt.density", 2.0), put("loads", {"gravity": [0.0, 0.0, -1.0]})),
    "loads.points": put("loads", {"points": [POINT]}),
    "loads.points without a lever": put("loads", {"points": [{"at": "end", "force": [1.0, 0.0, 0.0]}]}),
    "solver.method": put("solver.method", "intrinsic"),
    "solver.elements": put("solver.elements", 60),
    "solver.tolerance": put("solver.tolerance", 1e-7),
    "solver.bulge": put("solver.bulge", [-1.0, 0.0, 0.0]),
}

# Each with the words of its message, letter case aside.
BAD: dict[str, tuple[Change, tuple[str, ...]]] = {
    "energy": (put("energy", "elastic"), ("energy", "elastic")),
    "belt.width": (put("belt.width", -0.1), ("width", "-0.1")),
    "belt.rigidity": (put("belt.rigidity", 0.0), ("rigidity",)),
    "belt.rigidity and material": (put("belt.material", SHEET), ("rigidity", "material")),
    "belt.rigidity and layers": (
        put("belt.layers", [{"material": "polyimide", "thickness": 25e-6}]),
        ("rigidity", "layers"),
    ),
    "belt.material and layers": (
        several(
            NO_RIGIDITY,
            put("belt.material", SHEET),
            put("belt.layers", [{"material": "polyimide", "thickness": 25e-6}]),
        ),
        ("material", "layers"),
    ),
    "belt.material.young": (several(NO_RIGIDITY, put("belt.material", {**SHEET, "young": -1.0})), ("young", "-1")),
    "belt.material.young left out": (
        several(NO_RIGIDITY, put("belt.material", {"thickness": 1e-4, "poisson": 0.3})),
        ("young",),
    ),
    "belt.material.poisson": (several(NO_RIGIDITY, put("belt.material", {**SHEET, "poisson": 0.5})), ("poisson",)),
    "belt.material.thickness": (
        several(NO_RIGIDITY, put("belt.material", {**SHEET, "thickness": 0.0})),
        ("thickness",),
    ),
    "belt.material.density": (several(NO_RIGIDITY, put("belt.material", {**SHEET, "density": -1.0})), ("density",)),
    "belt.material.preset": (
        several(NO_RIGIDITY, put("belt.material", {"preset": "moonstone", "thickness": 1e-4})),
        ("preset", "moonstone", "polyimide"),
    ),
    "belt.layers, none": (several(NO_RIGIDITY, put("belt.layers", [])), ("layers",)),
    "belt.layers.material": (
        several(NO_RIGIDITY, put("belt.layers", [{"material": "moonstone", "thickness": 25e-6}])),
        ("layers", "moonstone", "polyimide"),
    ),
    "belt.layers.thickness": (
        several(NO_RIGIDITY, put("belt.layers", [{"material": "polyimide", "thickness": 0.0}])),
        ("layers", "thickness"),
    ),
    "belt.poisson": (several(put("belt.natural_bend", 1.0), put("belt.poisson", 0.6)), ("poisson", "0.6")),
    "belt.natural_bend": (put("belt.natural_bend", NAN), ("natural_bend", "nan")),
    "belt.density": (put("belt.density", -2.0), ("density", "-2")),
    "belt.closed": (put("belt.closed", "yes"), ("closed",)),
    "supports.moment": (put("supports.1.moment", 0.4), ("moment", "hinge")),
    "belt.half_turns": (several(RING, put("belt.half_turns", 0.5)), ("half_turns",)),
    "segments.kind": (put("belt.segments.1.kind", "spiral"), ("spiral", "straight")),
    "straight.length": (put("belt.segments.1.length", 0.0), ("length",)),
    "straight.curvature": (put("belt.segments.1.curvature", 1.0), ("curvature",)),
    "straight.natural_bend": (put("belt.segments.1.natural_bend", NAN), ("natural_bend", "nan")),
    "straight.rigidity": (put("belt.segments.1.rigidity", -2.0), ("rigidity", "-2")),
    "table.value": (put("belt.segments.1.rigidity", {**TABLE, "value": [1.0, 0.0, 1.0]}), ("rigidity", "value")),
    "table.u not rising": (put("belt.segments.1.rigidity", {**TABLE, "u": [0.0, 0.5, 0.2]}), ("rigidity", "u")),
    "table of two lengths": (put("belt.segments.1.rigidity", {**TABLE, "u": [0.0, 0.5]}), ("rigidity", "2", "3")),
    "arc.curvature": (put("belt.segments.1", arc(0.5, NAN)), ("curvature", "nan")),
    "arc.curvature left out": (put("belt.segments.1", {"kind": "arc", "length": 0.5}), ("curvature",)),
    "arc.length": (put("belt.segments.1", arc(-0.5, 1.0)), ("length", "-0.5")),
    "arc.angle": (put("belt.segments.1", {**arc(0.5, 1.0), "angle": 1.0}), ("angle",)),
    "corner.angle": (put("belt.segments", [straight(0.5), corner(NAN), straight(0.5)]), ("angle", "nan")),
    "corner.angle left out": (put("belt.segments", [straight(0.5), {"kind": "corner"}, straight(0.5)]), ("angle",)),
    "corner.length": (
        put("belt.segments", [straight(0.5), {**corner(0.3), "length": 0.1}, straight(0.5)]),
        ("length",),
    ),
    "rigid.length": (put("belt.segments", [straight(0.9), rigid(-0.1)]), ("length", "-0.1")),
    "rigid.rigidity": (put("belt.segments", [straight(0.9), {**rigid(0.1), "rigidity": 2.0}]), ("rigidity",)),
    "supports.at": (inner(position=[0.2, 0.3, 0.0], at=1.5), ("at", "1.5")),
    "supports out of order": (inner(position=[0.2, 0.3, 0.0], at="start"), ("supports", "start")),
    "supports.position": (inner(position=[0.2, "loose", 0.0]), ("position", "loose", "free")),
    "supports.rotation": (inner(rotation=[0.2, NAN, 0.0]), ("rotation", "nan")),
    "supports.rotation free": (inner(rotation=[0.2, "free", 0.0]), ("rotation",)),
    "supports.euler": (inner(euler=[0.2, 0.1]), ("euler",)),
    "supports.quaternion": (inner(quaternion=[2.0, 0.0, 0.0, 0.0]), ("quaternion",)),
    "supports of two orientations": (inner(rotation=[0.0] * 3, euler=[0.0] * 3), ("rotation", "euler")),
    "supports.hinge": (put("supports.1.hinge", "theta"), ("hinge", "theta", "zeta")),
    "supports.hinge without a rotation": (
        several(drop("supports.1.rotation"), put("supports.1.hinge", "zeta")),
        ("hinge", "rotation"),
    ),
    "supports.square_rib": (inner(square_rib=1), ("square_rib",)),
    "links.from": (put("links", [{**LINK, "from": -0.1}]), ("from", "-0.1")),
    "links.to": (put("links", [{**LINK, "to": 1.5}]), ("to", "1.5")),
    "links from a point to itself": (put("links", [{**LINK, "to": 0.3}]), ("links",)),
    "links.offset": (put("links", [{**LINK, "offset": [0.0, NAN, 0.0]}]), ("offset", "nan")),
    "links.offset of two": (put("links", [{**LINK, "offset": [0.0, 0.2]}]), ("offset",)),
    "links.offset left out": (put("links", [{"from": 0.3, "to": 0.7}]), ("offset",)),
    "loads.gravity": (put("loads", {"gravity": [0.0, 0.0, NAN]}), ("gravity", "nan")),
    "loads.gravity a number": (put("loads", {"gravity": -9.81}), ("gravity",)),
    "loads.wind": (put("loads", {"wind": [1.0, 0.0, 0.0]}), ("wind",)),
    "loads.points.at": (put("loads", {"points": [{**POINT, "at": 1.5}]}), ("at", "1.5")),
    "loads.points.force": (put("loads", {"points": [{**POINT, "force": [0.0, NAN, 0.0]}]}), ("force", "nan")),
    "loads.points.force left out": (put("loads", {"points": [{"at": 0.5}]}), ("force",)),
    "loads.points.lever": (put("loads", {"points": [{**POINT, "lever": [0.0, 0.1]}]}), ("lever",)),
    "loads.points.moment": (put("loads", {"points": [{**POINT, "moment": [0.0] * 3}]}), ("moment",)),
    "solver.method": (put("solver.method", "newton"), ("method", "newton")),
    "solver.elements": (put("solver.elements", 3), ("elements", "3")),
    "solver.tolerance": (put("solver.tolerance", -1.0), ("tolerance", "-1")),
    "solver.bulge": (put("solver.bulge", [0.0, 0.0, 0.0]), ("bulge",)),
}


@pytest.mark.parametrize("name", GOOD)
def test_good_field_is_read_and_solves(name: str) -> None:
    equilibrium = solve(changed(GOOD[name]))
    assert np.all(np.isfinite(equilibrium.position))
    assert math.isfinite(equilibrium.energy)


@pytest.mark.parametrize("name", BAD)
def test_bad_field_is_refused_by_name(name: str) -> None:
    """`InvalidScenario`: one line with the field, what was found and, for a choice, what is allowed."""
    change, words = BAD[name]
    with pytest.raises(fb.InvalidScenario) as caught:
        fb.solve(fb.Scenario.from_dict(changed(change)))
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    for word in words:
        assert word.lower() in message.lower(), message


@pytest.mark.parametrize("name", GOOD)
def test_good_scenario_comes_back_in_the_result(name: str) -> None:
    """`scenario` is the input, normalised: solved again it gives the same."""
    equilibrium = solve(changed(GOOD[name]))
    again = solve(result(equilibrium)["scenario"])
    assert again.energy == pytest.approx(equilibrium.energy, rel=1e-9, abs=1e-12)


# ------------------------------------------------------------------------------------- fields that must have effect


def test_ritz_method_is_tried_on_the_sources_first_example() -> None:
    """The source's programme is over-determined (MODEL §5), so it need not converge; its peak is where it prints it."""
    scenario = example1("fishbone")
    scenario["solver"] = {"method": "ritz", "ritz": {"basis": 10, "points": 16, "penalty": 100.0, "updates": 1}}
    equilibrium = fb.solve(fb.Scenario.from_dict(scenario))
    assert float(np.max(equilibrium.position[:, 0])) == pytest.approx(0.35, abs=0.03)


def test_width_changes_the_energy() -> None:
    assert solve(changed(put("belt.width", 0.05))).energy < solve(base()).energy


def test_euler_angles_are_those_of_the_source() -> None:
    """ZYZ, Eq. (1)."""
    equilibrium = solve(changed(GOOD["supports.euler"]))
    expected = rotation_matrix([0.0, 0.0, 0.3]) @ rotation_matrix([0.0, 0.2, 0.0]) @ rotation_matrix([0.0, 0.0, -0.4])
    assert np.max(np.abs(equilibrium.frame[-1] - expected)) < 1e-7


def test_quaternion_is_scalar_first() -> None:
    """[w, x, y, z]."""
    equilibrium = solve(changed(GOOD["supports.quaternion"]))
    expected = rotation_matrix([0.0, 0.0, 2.0 * math.atan2(0.6, 0.8)])
    assert np.max(np.abs(equilibrium.frame[-1] - expected)) < 1e-7


def test_material_has_the_rigidity_of_a_plate() -> None:
    """R_f = E t³ V / (12 (1 − ν²)), twice the thickness eight times that."""
    load = [{"at": "end", "force": [-1e-5, 0.0, 0.0]}]
    plate = 3.2e9 * 140e-6**3 * 0.02 / (12.0 * (1.0 - 0.34**2))
    sheet = solve(small({"material": SHEET}, points=load) | {"energy": "wunderlich"})
    known = solve(small({"rigidity": plate}, points=load))
    assert sheet.energy == pytest.approx(known.energy, rel=1e-9)


def test_material_has_the_weight_of_a_plate() -> None:
    """Density · V · t · U · g on the clamp; `belt.density` does not matter where the material has one."""
    weight = 1050.0 * 0.02 * 140e-6 * 0.2 * 9.81
    for fields in ({"material": SHEET}, {"material": SHEET, "density": 5.0}):
        force, _ = solve(small(fields, gravity=[-9.81, 0.0, 0.0])).reaction("start")
        assert force == pytest.approx([weight, 0.0, 0.0], rel=1e-6, abs=1e-6 * weight)


def test_density_of_the_belt_is_used_where_the_material_has_none() -> None:
    bare = {key: value for key, value in SHEET.items() if key != "density"}
    force, _ = solve(small({"material": bare, "density": 3e-3}, gravity=[-9.81, 0.0, 0.0])).reaction("start")
    assert force == pytest.approx([3e-3 * 0.2 * 9.81, 0.0, 0.0], rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.2, 0.3, 0.5)])
def test_layers_of_one_material_are_one_sheet(shares: tuple[float, ...]) -> None:
    """As stiff and as heavy as the preset of their thickness in all."""
    loads = {"gravity": [-9.81, 0.0, 0.0]}
    thickness = 100e-6
    sheet = solve(small({"material": {"preset": "polyimide", "thickness": thickness}}, **loads))
    layers = [{"material": "polyimide", "thickness": share * thickness} for share in shares]
    laminate = solve(small({"layers": layers}, **loads))
    assert laminate.energy == pytest.approx(sheet.energy, rel=1e-8)
    assert np.max(np.abs(laminate.position - sheet.position)) < 1e-8


def test_poissons_ratio_of_the_material_wins() -> None:
    """`belt.poisson` has no effect beside a material that has its own."""
    supports = [START, support("end", (-0.08, 0.14, 0.02), (0.4, 0.3, 1.2))]
    energies = []
    for poisson in (0.0, 0.45):
        scenario = belt(supports, length=0.2, width=0.02, rigidity=None, elements=ELEMENTS)
        scenario["belt"].update(material=SHEET, natural_bend=10.0, poisson=poisson)
        energies.append(solve(scenario).energy)
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)


def test_straight_belt_takes_a_point_load_anywhere() -> None:
    """At the start, inside and at the end, in words and in numbers."""
    for at, same in (("start", 0.0), ("end", 1.0)):
        one, other = (solve(changed(put("loads", {"points": [{**POINT, "at": a}]}))) for a in (at, same))
        assert one.energy == pytest.approx(other.energy, rel=1e-12)


def test_closed_belt_is_closed_without_supports() -> None:
    equilibrium = solve(changed(several(RING, drop("supports"))))
    assert equilibrium.position[-1] == pytest.approx(equilibrium.position[0], abs=1e-8)
