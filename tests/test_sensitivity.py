"""Derivatives of equilibria against differences of equilibria that are solved afresh."""

from __future__ import annotations

import copy
import dataclasses
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
    arc,
    belt,
    board,
    clamped,
    corner,
    example1,
    example2,
    rigid,
    rotation_matrix,
    rotation_vector,
    skew,
    solve_any,
    straight,
    support,
)

TOLERANCE = 1e-12
"""Tolerance of the solves, the smallest that the solver takes: differences over STEP lose five digits."""
STEP = 1e-5
ERROR = 1e-6
"""Relative error in the norm; the errors found are 1e-8 to 1e-11."""
TRANSPOSE_ERROR = 1e-10

energy_model = pytest.mark.parametrize("energy", ENERGIES)

CLAMP = support("start", ORIGIN, ORIGIN)
END = support("end", (0.05, 0.6, 0.1), (0.3, -0.2, 0.4))
AWAY = [support("start", (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)), support("end", (1.05, 2.6, 3.1), (0.3, -0.2, 0.4))]
TABLE = {"u": [0.0, 0.3, 0.5, 1.0], "value": [1.0, 1.5, 0.7, 1.2]}

CASES: dict[str, Json] = {
    "example 1": example1(elements=80),
    "example 2": example2(elements=80),
    "in other units": clamped(
        (150.0, 1200.0, 180.0), (0.5, 0.1, -0.3), length=2000.0, width=150.0, rigidity=7e6, elements=120
    ),
    "pinned": board([straight(1.0)], [CLAMP, support("end", (0.05, 0.6, 0.1))], elements=80),
    "support that slides": board(
        [straight(1.0)], [CLAMP, {"at": 0.45, "position": [0.25, "free", 0.03]}, END], elements=80
    ),
    "hinge on a slide": board(
        [straight(1.0)],
        [CLAMP, {"at": 0.45, "position": ["free", "free", 0.06], "rotation": [0.1, 0.2, 0.3], "hinge": "zeta"}, END],
        elements=80,
    ),
    "hinge": board([straight(1.0)], [CLAMP, END | {"hinge": "zeta"}], elements=80),
    "link": board(
        [straight(1.0)], [CLAMP, END], links=[{"from": 0.25, "to": 0.75, "offset": [0.02, 0.3, 0.05]}], elements=80
    ),
    "arc": board(
        [straight(0.3), arc(0.4, 1.4), straight(0.3)],
        [CLAMP, support("end", (0.2, 0.5, 0.3), (0.5, 0.1, 0.2))],
        elements=80,
    ),
    "corner": board(
        [straight(0.5), corner(0.6), straight(0.5)],
        [CLAMP, support("end", (0.1, 0.6, 0.25), (0.6, 0.1, 0.2))],
        elements=80,
    ),
    "stiffener": board([straight(0.4), rigid(0.2), straight(0.4)], [CLAMP, END], elements=80),
    "rigidity by a table": board([straight(1.0, rigidity=TABLE)], [CLAMP, END], elements=80),
    "curled": board(
        [straight(0.5, natural_bend=2.0), straight(0.5, natural_bend=-1.0)], [CLAMP, END], elements=80, poisson=0.3
    ),
    "weight and a force": board(
        [straight(1.0)],
        AWAY,
        elements=80,
        gravity=(0.3, -0.5, -1.0),
        density=3.0,
        points=[{"at": 0.4, "force": [1.0, 2.0, -1.0], "lever": [0.02, 0.01, 0.05]}],
    ),
    "closed": board([straight(1.0)], [], elements=80, closed=True, half_turns=1),
}
"""A scenario with every kind of parameter."""

scenarios = pytest.mark.parametrize("name", CASES)


def of(name: str, energy: Energy) -> Json:
    scenario = copy.deepcopy(CASES[name]) | {"energy": energy}
    scenario["solver"]["tolerance"] = TOLERANCE
    return scenario


def solve(scenario: Json) -> fb.Equilibrium:
    equilibrium = solve_any(scenario)
    assert equilibrium.status == "converged", equilibrium.message
    return equilibrium


def count_of_supports(scenario: Json) -> int:
    return len(scenario["supports"])


def changed(scenario: Json, direction: Json, step: float) -> Json:
    """The scenario, changed by a step along a direction as `Sensitivity.forward` takes it."""
    scenario = copy.deepcopy(scenario)
    board = scenario["belt"]
    for entry, motion in zip(scenario["supports"], direction.get("supports", []), strict=False):
        if "position" in entry:
            moved = zip(entry["position"], motion[:3], strict=True)
            entry["position"] = [x if x == "free" else x + step * float(by) for x, by in moved]
        if "rotation" in entry:
            turned = rotation_matrix(step * motion[3:]) @ rotation_matrix(entry["rotation"])
            entry["rotation"] = rotation_vector(turned).tolist()
    start = 0.0
    for i, segment in enumerate(board["segments"]):
        if segment["kind"] in {"straight", "arc"} and "natural_bend" in direction:
            natural_bend = segment.get("natural_bend", board.get("natural_bend", 0.0))
            segment["natural_bend"] = natural_bend + step * float(direction["natural_bend"][i])
        if "rigidity" in direction:
            table = segment["rigidity"]
            change = np.interp(start + np.array(table["u"]), direction["u"], direction["rigidity"])
            segment["rigidity"] = {"u": table["u"], "value": (table["value"] + step * change).tolist()}
        start += segment.get("length", 0.0)
    board["width"] += step * direction.get("width", 0.0)
    if "gravity" in direction:
        scenario["loads"]["gravity"] = (np.array(scenario["loads"]["gravity"]) + step * direction["gravity"]).tolist()
    return scenario


def state(equilibrium: fb.Equilibrium, frames: Array, supports: int) -> dict[str, Array]:
    """The quantities of a `Change`, rotations from given frames."""
    turns = zip(equilibrium.frame, frames, strict=True)
    wrenches = [np.concatenate(equilibrium.reaction(i)) for i in range(supports)]
    return {
        "position": equilibrium.position,
        "rotation": np.array([rotation_vector(frame @ before.T) for frame, before in turns]),
        "bend": equilibrium.bend,
        "rib_slope": equilibrium.rib_slope,
        "reactions": np.array(wrenches).reshape(-1, 6),
        "energy": np.array(equilibrium.energy),
    }


def touching(scenario: Json) -> set[int]:
    """The elements whose ribs touch on an edge, but for the 1e-5 that the bound keeps them apart."""
    equilibrium = solve(scenario)
    length = np.diff(equilibrium.u)
    rise = np.diff(equilibrium.rib_slope) / np.where(length > 0.0, length, math.inf)
    return set(np.flatnonzero(0.5 * scenario["belt"]["width"] * np.abs(rise) > 1.0 - 2e-5).tolist())


def differences(scenario: Json, direction: Json, step: float) -> dict[str, Array]:
    """Derivatives by central differences of fourth order, of equilibria with the same ribs touching."""
    frames, supports = solve(scenario).frame, count_of_supports(scenario)
    near = {k: changed(scenario, direction, k * step) for k in (-2, -1, 1, 2)}
    assert all(touching(moved) == touching(scenario) for moved in near.values())
    found = {k: solve(moved) for k, moved in near.items()}
    at = {k: state(moved, frames, supports) for k, moved in found.items()}
    return {name: (8.0 * (at[1][name] - at[-1][name]) - (at[2][name] - at[-2][name])) / (12.0 * step) for name in at[1]}


def errors(change: fb.Change, expected: dict[str, Array], floor: float = 1e-3) -> dict[str, float]:
    """Errors in the norm, relative to the change or to a floor."""
    return {
        name: float(np.linalg.norm(getattr(change, name) - value) / max(float(np.linalg.norm(value)), floor))
        for name, value in expected.items()
    }


def check(scenario: Json, direction: Json, step: float = STEP) -> None:
    asked = {name: value for name, value in direction.items() if name != "u"}
    change = solve(scenario).sensitivity().forward(**asked)
    found = errors(change, differences(scenario, direction, step))
    assert max(found.values()) < ERROR, found


def random(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape)


def of_the_length(motions: Array, scenario: Json) -> Array:
    """Translations times the length of the belt, which need not be 1."""
    length = sum(segment.get("length", 0.0) for segment in scenario["belt"]["segments"])
    return motions * ([length] * 3 + [1.0] * 3)


# ------------------------------------------------------------------------------------------------ forward


@energy_model
@pytest.mark.parametrize("name", [name for name in CASES if name != "closed"])
def test_change_by_the_supports_is_that_of_equilibria_solved_afresh(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    motions = of_the_length(random(count_of_supports(scenario), 6, seed=3), scenario)
    check(scenario, {"supports": motions})


@energy_model
@pytest.mark.parametrize("example", ["example 1", "example 2"])
@pytest.mark.parametrize("at", ["start", "end"])
def test_jacobian_is_that_of_equilibria_solved_afresh(energy: Energy, example: str, at: str) -> None:
    scenario = of(example, energy)
    equilibrium = solve(scenario)
    jacobian = equilibrium.jacobian(at)
    assert jacobian.shape == (len(equilibrium.u), 3, 6)
    expected = np.zeros_like(jacobian)
    for column in range(6):
        motions = np.zeros((2, 6))
        motions[["start", "end"].index(at), column] = 1.0
        expected[:, :, column] = differences(scenario, {"supports": motions}, STEP)["position"]
    assert np.linalg.norm(jacobian - expected) < ERROR * np.linalg.norm(expected)


@energy_model
@pytest.mark.parametrize("name", [name for name in CASES if name != "closed"])
def test_change_by_the_width_is_that_of_equilibria_solved_afresh(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    check(scenario, {"width": 10.0 * scenario["belt"]["width"]})


def test_change_of_a_mobius_band_by_its_width_is_that_of_bands_solved_afresh() -> None:
    """`wunderlich` only: with the other energies ribs that nearly touch begin to touch within any step."""
    check(of("closed", "wunderlich"), {"width": 1.0})


@energy_model
@pytest.mark.parametrize("name", ["example 1", "example 2", "link", "stiffener", "curled"])
def test_change_by_natural_bend_is_that_of_equilibria_solved_afresh(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    segments = scenario["belt"]["segments"]
    goes_on = name == "stiffener"
    check(scenario, {"natural_bend": np.ones(len(segments)) if goes_on else random(len(segments))}, 1e-4)


@energy_model
def test_change_by_the_rigidity_of_a_table_is_that_of_equilibria_solved_afresh(energy: Energy) -> None:
    scenario = of("rigidity by a table", energy)
    nodes = solve(scenario).u
    change = np.interp(nodes, TABLE["u"], [0.3, -0.2, 0.5, 0.1])
    check(scenario, {"rigidity": change, "u": nodes}, 1e-4)


@energy_model
def test_change_by_the_rigidity_at_each_node_is_that_of_equilibria_solved_afresh(energy: Energy) -> None:
    nodes = np.linspace(0.0, 1.0, 81)
    table = {"u": nodes.tolist(), "value": (1.0 + 0.3 * np.sin(5.0 * nodes)).tolist()}
    scenario = board([straight(1.0, rigidity=table)], [CLAMP, END], energy=energy, elements=80)
    scenario["solver"]["tolerance"] = TOLERANCE
    assert np.allclose(solve(scenario).u, nodes, atol=1e-12)
    check(scenario, {"rigidity": random(81), "u": nodes}, 1e-4)


@energy_model
def test_change_by_gravity_is_that_of_equilibria_solved_afresh(energy: Energy) -> None:
    scenario = of("weight and a force", energy)
    check(scenario, {"gravity": np.array([0.7, 0.3, -0.4])})


def test_cantilever_under_its_weight_has_derivatives_where_it_bends() -> None:
    """Where nothing bends, at its free end, the slope of the ribs costs nothing and is not determined."""
    scenario = board(
        [straight(1.0)],
        [support("start", ORIGIN, (0.1, 0.2, 0.3))],
        elements=80,
        gravity=(0.3, -0.5, -1.0),
        density=8.0,
    )
    scenario["solver"]["tolerance"] = TOLERANCE
    change = solve(scenario).sensitivity().forward(supports=random(1, 6), gravity=[1.0, 0.5, 0.2])
    expected = differences(scenario, {"supports": random(1, 6), "gravity": np.array([1.0, 0.5, 0.2])}, STEP)
    expected["rib_slope"] = change.rib_slope
    assert max(errors(change, expected).values()) < ERROR


@energy_model
@pytest.mark.parametrize(
    ("segments", "end"),
    [
        ([straight(0.4), arc(0.2, 6.0), straight(0.4)], support("end", (0.2, 0.45, 0.2), (1.2, 0.5, -0.8))),
        ([arc(1.0, -4.0)], support("end", (0.2, 0.1, -0.35), (-4.0, 0.0, 0.0))),
    ],
    ids=["into an arc", "tight arc"],
)
def test_change_by_the_width_counts_edges_beside_a_bend(energy: Energy, segments: list[Json], end: Json) -> None:
    scenario = board(segments, [CLAMP, end], energy=energy, width=0.06, elements=120)
    scenario["solver"]["tolerance"] = TOLERANCE
    check(scenario, {"width": 1.0})


def test_belt_of_a_material_changes_with_its_width_by_rigidity_and_mass_too() -> None:
    scenario = belt([CLAMP, END], rigidity=None, elements=80)
    scenario["belt"]["material"] = {"young": 2.0, "poisson": 0.3, "thickness": 0.01, "density": 1e-5}
    scenario["loads"] = {"gravity": [0.1, -0.2, -1.0]}
    scenario["solver"]["tolerance"] = TOLERANCE
    equilibrium = solve(scenario)
    rigidity = 2.0 * 0.01**3 / (12.0 * (1.0 - 0.3**2)) * np.ones(len(equilibrium.u))
    change = equilibrium.sensitivity().forward(width=1.0, rigidity=rigidity, gravity=np.array([0.1, -0.2, -1.0]) / 0.1)
    expected = differences(scenario, {"width": 1.0}, STEP)
    assert max(errors(change, expected, 1e-9).values()) < ERROR


def test_ribs_that_touch_in_example_1_keep_touching() -> None:
    """12 % of the elements are at the bound with `fishbone`: their slope rises by 2/V, whatever the supports do."""
    scenario = of("example 1", "fishbone")
    equilibrium = solve(scenario)
    elements = sorted(touching(scenario))
    assert len(elements) > 8
    slope = equilibrium.sensitivity().forward(supports=random(2, 6)).rib_slope
    rise = np.diff(slope)
    assert np.max(np.abs(rise[elements])) < 1e-9 * np.max(np.abs(rise))


# ------------------------------------------------------------------------------------------------ structure


@energy_model
@scenarios
def test_adjoint_is_the_transpose_of_forward(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    equilibrium = solve(scenario)
    m, n, segments = count_of_supports(scenario), len(equilibrium.u), len(scenario["belt"]["segments"])
    parameters: Json = {
        "supports": random(m, 6, seed=1),
        "rigidity": random(n, seed=2),
        "natural_bend": random(segments, seed=3),
        "width": 0.7,
        "gravity": random(3, seed=4),
    }
    outputs: Json = {
        "position": random(n, 3, seed=5),
        "rotation": random(n, 3, seed=6),
        "bend": random(n, seed=7),
        "rib_slope": random(n, seed=8),
        "reactions": random(m, 6, seed=9),
        "energy": 1.3,
    }
    sensitivity = equilibrium.sensitivity()
    for parameter, direction in parameters.items():
        change = sensitivity.forward(**{parameter: direction})
        for output, weights in outputs.items():
            along = getattr(change, output)
            gradient = getattr(sensitivity.adjoint(**{output: weights}), parameter)
            scale = np.linalg.norm(along) * np.linalg.norm(weights)
            scale = max(scale, float(np.linalg.norm(gradient) * np.linalg.norm(direction)), 1e-3)
            assert abs(np.sum(along * weights) - np.sum(gradient * direction)) < TRANSPOSE_ERROR * scale


@energy_model
@scenarios
def test_products_are_linear(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    equilibrium = solve(scenario)
    sensitivity, n = equilibrium.sensitivity(), len(equilibrium.u)
    parts = [{"supports": random(count_of_supports(scenario), 6)}, {"width": 0.3}, {"rigidity": random(n)}]
    together = sensitivity.forward(**{name: 2.0 * part[name] for part in parts for name in part})
    one_by_one = [sensitivity.forward(**part) for part in parts]
    for field in dataclasses.fields(together):
        total = 2.0 * sum(getattr(change, field.name) for change in one_by_one)
        assert np.allclose(
            getattr(together, field.name),
            total,
            rtol=0.0,
            atol=1e-9 * max(1.0, float(np.max(np.abs(total), initial=0.0))),
        )


@energy_model
@pytest.mark.parametrize("name", ["example 1", "example 2", "pinned", "hinge", "link", "arc", "corner", "stiffener"])
def test_supports_that_move_together_move_all_rigidly(energy: Energy, name: str) -> None:
    """A link's offset and a slide are of fixed axes: these only keep up with translations."""
    scenario = of(name, energy)
    equilibrium = solve(scenario)
    translation, rotation = np.array([0.3, -0.7, 0.2]), np.array([0.5, 0.4, -0.9])
    if name == "link":
        rotation = np.zeros(3)
    supports = scenario["supports"]
    motions = [np.concatenate([translation + np.cross(rotation, s["position"]), rotation]) for s in supports]
    change = equilibrium.sensitivity().forward(supports=motions)
    assert np.allclose(change.position, translation + np.cross(rotation, equilibrium.position), atol=1e-8)
    assert np.allclose(change.rotation, rotation, atol=1e-8)
    assert np.allclose(change.bend, 0.0, atol=1e-6)
    assert np.allclose(change.rib_slope, 0.0, atol=1e-6)
    assert abs(change.energy) < 1e-8 * equilibrium.energy
    for i, reaction in enumerate(change.reactions):
        force, moment = equilibrium.reaction(i)
        expected = np.concatenate([np.cross(rotation, force), np.cross(rotation, moment)])
        assert np.allclose(reaction, expected, atol=1e-6 * np.linalg.norm(force))


@energy_model
@pytest.mark.parametrize("name", ["example 1", "example 2", "support that slides", "corner", "weight and a force"])
def test_reactions_by_the_supports_are_the_second_derivative_of_the_least_energy(energy: Energy, name: str) -> None:
    """Symmetric but for rotations, which do not commute: of two about one point the difference is ½ of M by [a, b]."""
    scenario = of(name, energy)
    equilibrium = solve(scenario)
    sensitivity, m = equilibrium.sensitivity(), count_of_supports(scenario)
    unit = np.eye(6 * m).reshape(-1, m, 6)
    by = np.array([sensitivity.forward(supports=motions).reactions.ravel() for motions in unit]).T
    for i in range(m):
        turn = slice(6 * i + 3, 6 * i + 6)
        by[turn, turn] -= 0.5 * skew(-equilibrium.reaction(i).moment)
    assert np.max(np.abs(by - by.T)) < 1e-9 * np.max(np.abs(by))


@energy_model
@scenarios
def test_energy_by_the_supports_is_their_reaction(energy: Energy, name: str) -> None:
    scenario = of(name, energy)
    equilibrium = solve(scenario)
    reactions = [np.concatenate(equilibrium.reaction(i)) for i in range(count_of_supports(scenario))]
    gradient = equilibrium.sensitivity().adjoint(energy=1.0)
    assert np.allclose(gradient.supports, np.array(reactions).reshape(-1, 6), rtol=1e-12, atol=1e-12)


@energy_model
def test_free_components_of_a_support_move_nothing(energy: Energy) -> None:
    for name, support_index, component in [("support that slides", 1, 1), ("hinge on a slide", 1, 0), ("pinned", 1, 4)]:
        equilibrium = solve(of(name, energy))
        jacobian = equilibrium.jacobian(support_index)
        assert np.max(np.abs(jacobian[:, :, component])) == 0.0
        assert np.max(np.abs(jacobian[:, :, 2])) > 0.1


@energy_model
def test_turning_a_hinge_about_its_axis_moves_nothing(energy: Energy) -> None:
    equilibrium = solve(of("hinge", energy))
    axis = equilibrium.frame[-1][:, 2]
    change = equilibrium.sensitivity().forward(supports=[np.zeros(6), [0.0, 0.0, 0.0, *axis]])
    scale = np.linalg.norm(equilibrium.reaction("end").moment)
    assert np.max(np.abs(change.position)) < 1e-9
    assert np.max(np.abs(change.reactions)) < 1e-9 * scale


def test_supports_of_a_mobius_band_move_it() -> None:
    """The start as it is; half way along a pin that holds the band where it is, a little aside."""
    free = board([straight(1.0)], [support("start", ORIGIN, ORIGIN, square_rib=False)], elements=80, closed=True)
    free["belt"]["half_turns"] = 1
    free["solver"]["tolerance"] = TOLERANCE
    band = solve(free)
    change = band.sensitivity().forward(supports=[[0.1, 0.2, 0.3, 0.5, -0.2, 0.4]])
    rigid_motion = np.array([0.1, 0.2, 0.3]) + np.cross([0.5, -0.2, 0.4], band.position)
    assert np.allclose(change.position, rigid_motion, atol=1e-8)
    aside = band.position[40] + np.array([0.01, -0.005, 0.008])
    held = copy.deepcopy(free)
    held["supports"].append({"at": 0.5, "position": aside.tolist()})
    check(held, {"supports": random(2, 6)})


def test_change_predicts_the_equilibrium_to_second_order() -> None:
    """The end of example 1, moved by 1e-3 U: the error is of the order of the square."""
    scenario = of("example 1", "wunderlich")
    motions = np.array([[0.0] * 6, [0.3, 0.5, -0.2, 0.1, 0.2, 0.4]])
    predicted = solve(scenario).position + 1e-3 * solve(scenario).sensitivity().forward(supports=motions).position
    found = solve(changed(scenario, {"supports": motions}, 1e-3)).position
    assert np.max(np.abs(found - predicted)) < 1e-5


# ------------------------------------------------------------------------------------------------ interface


def test_supports_are_named_as_for_reactions(equilibrium: fb.Equilibrium) -> None:
    for names in [(0, "start", 0.0, -2), (1, "end", 1.0, -1)]:
        first, *others = [equilibrium.jacobian(name) for name in names]
        assert all(np.array_equal(first, other) for other in others)
    for name in (2, "middle", 0.3):
        with pytest.raises(fb.NoSupport):
            equilibrium.jacobian(name)  # type: ignore[arg-type]


def test_the_system_is_factorised_once(equilibrium: fb.Equilibrium) -> None:
    assert equilibrium.sensitivity() is equilibrium.sensitivity()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"supports": np.zeros((3, 6))}, r"supports: found an array of shape \(3, 6\), allowed \(2, 6\)"),
        ({"rigidity": 1.0}, r"rigidity: found an array of shape \(\), allowed \(\d+,\)"),
        ({"natural_bend": [1.0, 2.0]}, r"natural_bend: found an array of shape \(2,\), allowed \(1,\)"),
        ({"width": [1.0]}, r"width: found an array of shape \(1,\), allowed \(\)"),
        ({"gravity": "down"}, "gravity: found str"),
        ({"gravity": [0.0, 0.0, math.nan]}, "gravity: found a number that is not finite"),
    ],
)
def test_directions_of_another_shape_are_refused(equilibrium: fb.Equilibrium, arguments: Json, message: str) -> None:
    with pytest.raises(fb.InvalidArgument, match=message):
        equilibrium.sensitivity().forward(**arguments)


def test_weights_of_another_shape_are_refused(equilibrium: fb.Equilibrium) -> None:
    with pytest.raises(fb.InvalidArgument, match=r"position: found an array of shape \(3,\), allowed \(\d+, 3\)"):
        equilibrium.sensitivity().adjoint(position=[0.0, 0.0, 1.0])


def refusal(scenario: Json) -> str:
    with pytest.raises(fb.NoSensitivity) as raised:
        solve_any(scenario).sensitivity().forward(supports=random(count_of_supports(scenario), 6))
    message = str(raised.value)
    assert "\n" not in message
    return message


def test_what_has_not_converged_has_no_derivatives(out_of_reach: fb.Scenario) -> None:
    assert "not converged" in refusal(out_of_reach.to_dict())


def test_the_method_of_the_source_has_no_derivatives() -> None:
    assert "multipliers" in refusal(example1("fishbone") | {"solver": {"method": "ritz"}})


@energy_model
def test_belt_between_two_pins_swings_and_has_no_derivatives(energy: Energy) -> None:
    pins = [support("start", ORIGIN), support("end", (0.0, 0.7, 0.1))]
    assert "no cost of energy" in refusal(belt(pins, energy=energy, elements=80))


@energy_model
def test_belt_without_slack_has_no_derivatives(energy: Energy) -> None:
    assert "no slack" in refusal(clamped((0.0, 1.0, 0.0), energy=energy, elements=80))


def test_what_is_held_twice_has_no_derivatives() -> None:
    frame = rotation_matrix((0.0, 0.0, -0.3))
    first = np.array([0.2, 0.3, 0.0])
    held = [support("start", ORIGIN, ORIGIN), support("end", (0.3, 0.75, 0.1))]
    for u, point in ((0.4, first), (0.6, first + 0.2 * frame[:, 1])):
        held.insert(-1, {"at": u, "position": point.tolist(), "rotation": [0.0, 0.0, -0.3]})
    scenario = board([straight(0.4), rigid(0.2), straight(0.4)], held, elements=80)
    assert "supports[1] and supports[2] hold the same twice over" in refusal(scenario)


def test_loaded_belt_that_has_stayed_flat_has_no_derivatives() -> None:
    scenario = board([straight(1.0)], [CLAMP], elements=80, gravity=(0.0, 0.0, -1.0), density=15.0)
    assert "flat" in refusal(scenario)


def test_flat_belt_moves_with_its_clamp() -> None:
    equilibrium = solve_any(belt([support("start", (0.1, 0.2, 0.3), (0.4, 0.9, -0.3))], elements=80))
    change = equilibrium.sensitivity().forward(supports=[[0.1, 0.2, 0.3, 0.5, -0.2, 0.4]])
    lever = equilibrium.position - equilibrium.position[0]
    assert np.allclose(change.position, np.array([0.1, 0.2, 0.3]) + np.cross([0.5, -0.2, 0.4], lever), atol=1e-9)
