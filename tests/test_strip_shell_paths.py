"""Strips of finite thickness that are led: derivatives, trackers, paths and margins against strips solved afresh."""

from __future__ import annotations

import copy
import itertools
import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from conftest import ROOT
from helpers import (
    ORIGIN,
    Array,
    Json,
    arc,
    board,
    clamped,
    corner,
    example1,
    example2,
    rigid,
    rotation_matrix,
    rotation_vector,
    solve,
    straight,
    support,
)
from test_strip_shell import thick

CLAMP = support("start", ORIGIN, ORIGIN)
END = support("end", (0.05, 0.6, 0.1), (0.3, -0.2, 0.4))
STEP = 1e-4

BELTS: dict[str, Json] = {
    "example 1": example1(elements=40),
    "example 2": example2(elements=40),
    "in other units": clamped(
        (150.0, 1200.0, 180.0), (0.5, 0.1, -0.3), length=2000.0, width=150.0, rigidity=7e6, elements=40
    ),
    "pinned": board([straight(1.0)], [CLAMP, support("end", (0.05, 0.6, 0.1))], elements=40),
    "arc": board(
        [straight(0.3), arc(0.4, 1.4), straight(0.3)],
        [CLAMP, support("end", (0.2, 0.5, 0.3), (0.5, 0.1, 0.2))],
        elements=40,
    ),
    "corner": board(
        [straight(0.5), corner(0.6), straight(0.5)],
        [CLAMP, support("end", (0.1, 0.6, 0.25), (0.6, 0.1, 0.2))],
        elements=40,
    ),
    "stiffener": board([straight(0.4), rigid(0.2), straight(0.4)], [CLAMP, END], elements=40),
    "curled": board([straight(0.5, natural_bend=2.0), straight(0.5, natural_bend=-1.0)], [CLAMP, END], elements=40),
    "weight and a force": board(
        [straight(1.0)],
        [CLAMP, END],
        elements=40,
        gravity=(0.3, -0.5, -1.0),
        density=3.0,
        points=[{"at": 0.4, "force": [1.0, 2.0, -1.0], "lever": [0.02, 0.01, 0.05]}],
    ),
    "link": board(
        [straight(1.0)], [CLAMP, END], links=[{"from": 0.25, "to": 0.75, "offset": [0.02, 0.3, 0.05]}], elements=40
    ),
}


def of(name: str) -> Json:
    scenario = copy.deepcopy(BELTS[name])
    length = sum(segment.get("length", 0.0) for segment in scenario["belt"]["segments"])
    scenario["solver"] = {**scenario["solver"], "tolerance": 1e-10}
    return thick(scenario, 2e-3 * length)


def state(found: fb.Equilibrium, frames: Array) -> dict[str, Array]:
    turns = [rotation_vector(frame @ before.T) for frame, before in zip(found.frame, frames, strict=True)]
    supports = range(len(found.scenario.to_dict()["supports"]))
    return {
        "position": found.position,
        "rotation": np.array(turns),
        "reactions": np.array([np.concatenate(found.reaction(i)) for i in supports]),
        "energy": np.array(found.energy),
        "bend": found.bend,
    }


def moved(scenario: Json, motions: Array, step: float) -> Json:
    scenario = copy.deepcopy(scenario)
    for entry, motion in zip(scenario["supports"], step * motions, strict=True):
        entry["position"] = (np.array(entry["position"]) + motion[:3]).tolist()
        if "rotation" in entry:
            turned = rotation_matrix(motion[3:]) @ rotation_matrix(entry["rotation"])
            entry["rotation"] = rotation_vector(turned).tolist()
    return scenario


def with_number(scenario: Json, path: tuple[Any, ...], step: float) -> Json:
    scenario = copy.deepcopy(scenario)
    table: Any = scenario
    for key in path[:-1]:
        table = table[key]
    table[path[-1]] += step
    return scenario


def check(scenario: Json, asked: dict[str, Any], changed: Any, step: float = STEP) -> None:
    """Derivatives along a direction against central differences of fourth order."""
    found = solve(scenario)
    change = found.sensitivity().forward(**asked)
    near = {k: state(solve(changed(k * step)), found.frame) for k in (-2, -1, 1, 2)}
    for name in near[1]:
        by = (8.0 * (near[1][name] - near[-1][name]) - (near[2][name] - near[-2][name])) / (12.0 * step)
        size = max(float(np.linalg.norm(by)), 1e-3)
        error = float(np.linalg.norm(getattr(change, name) - by)) / size
        assert error < 2e-4, (name, error)


@pytest.mark.parametrize("name", BELTS)
def test_change_by_the_supports_is_that_of_strips_solved_afresh(name: str) -> None:
    scenario = of(name)
    length = sum(segment.get("length", 0.0) for segment in scenario["belt"]["segments"])
    motions = np.random.default_rng(1).normal(size=(len(scenario["supports"]), 6)) * ([length] * 3 + [1.0] * 3)
    check(scenario, {"supports": motions}, lambda step: moved(scenario, motions, step))


@pytest.mark.parametrize("name", ["example 1", "example 2", "in other units", "arc", "curled"])
@pytest.mark.parametrize("number", ["thickness", "poisson", "width"])
def test_change_by_the_sheet_is_that_of_strips_solved_afresh(name: str, number: str) -> None:
    scenario = of(name)
    size = {"poisson": 1.0}.get(number, scenario["belt"][number])
    check(scenario, {number: size}, lambda step: with_number(scenario, ("belt", number), step * size))


def test_change_by_natural_bend_and_gravity_is_that_of_strips_solved_afresh() -> None:
    curled = of("curled")
    place = ("belt", "segments", 0, "natural_bend")
    check(curled, {"natural_bend": [1.0, 0.0]}, lambda step: with_number(curled, place, step), 1e-3)
    heavy = of("weight and a force")
    check(heavy, {"gravity": [0.0, 0.0, 1.0]}, lambda step: with_number(heavy, ("loads", "gravity", 2), step), 1e-3)


@pytest.mark.parametrize("energy", ["fishbone", "sadowsky", "wunderlich"])
def test_inextensible_belts_change_by_poissons_ratio_where_they_are_curled_and_never_by_thickness(energy: Any) -> None:
    belt = BELTS["curled"] | {"energy": energy}
    belt["belt"] = belt["belt"] | {"poisson": 0.3, "thickness": 1e-3}
    belt["solver"] = {**belt["solver"], "tolerance": 1e-11}
    check(belt, {"poisson": 1.0}, lambda step: with_number(belt, ("belt", "poisson"), step))
    change = solve(belt).sensitivity().forward(thickness=1.0)
    assert not np.any(change.position)
    assert not np.any(change.reactions)


@pytest.mark.parametrize("name", BELTS)
def test_adjoint_is_the_transpose_of_forward(name: str) -> None:
    """For random directions and weights."""
    sensitivity = solve(of(name)).sensitivity()
    rng = np.random.default_rng(2)
    n, m = len(solve(of(name)).u), len(BELTS[name]["supports"])
    segments = len(BELTS[name]["belt"]["segments"])
    along = {
        "supports": rng.normal(size=(m, 6)),
        "rigidity": rng.normal(size=n),
        "natural_bend": rng.normal(size=segments),
        "width": 0.7,
        "thickness": -0.2,
        "poisson": 0.3,
        "gravity": rng.normal(size=3),
    }
    weights = {
        "position": rng.normal(size=(n, 3)),
        "rotation": rng.normal(size=(n, 3)),
        "bend": rng.normal(size=n),
        "rib_slope": rng.normal(size=n),
        "reactions": rng.normal(size=(m, 6)),
        "energy": 1.3,
    }
    change, gradient = sensitivity.forward(**along), sensitivity.adjoint(**weights)
    forward = [np.sum(weight * getattr(change, name)) for name, weight in weights.items()]
    back = [np.sum(by * getattr(gradient, name)) for name, by in along.items()]
    assert np.sum(back) == pytest.approx(np.sum(forward), abs=1e-8 * max(np.abs(forward).max(), np.abs(back).max()))


def test_energy_of_a_strip_changes_with_a_sheet_of_a_material_by_its_rigidity_too() -> None:
    """A twice as stiff sheet has twice the energy: rigidity goes with the cube of the thickness."""
    scenario = clamped((0.0, 0.1, 0.02), rigidity=None, length=0.2, width=0.02, elements=40)
    scenario["energy"] = "shell"
    scenario["belt"]["material"] = {"young": 3.2e9, "poisson": 0.34, "thickness": 140e-6}
    scenario["solver"] = {**scenario["solver"], "tolerance": 1e-10}
    found = solve(scenario)
    rigidity = 3.2e9 * 140e-6**3 * 0.02 / (12.0 * (1.0 - 0.34**2))
    by_rigidity = np.full(len(found.u), 3.0 * rigidity / 140e-6)
    change = found.sensitivity().forward(thickness=1.0, rigidity=by_rigidity)
    step = 1e-9
    energies = [solve(with_number(scenario, ("belt", "material", "thickness"), by)).energy for by in (-step, step)]
    assert change.energy == pytest.approx((energies[1] - energies[0]) / (2.0 * step), rel=1e-6)


def way(count: int) -> list[tuple[list[float], list[float]]]:
    """A closed way of the end of example 1."""
    turns = np.linspace(0.0, 2.0 * np.pi, count + 1)[1:]
    return [
        ([0.08 * np.sin(t), 0.5 + 0.06 * np.sin(2.0 * t), 0.1 + 0.1 * (np.cos(t) - 1.0)], [0.2 * np.sin(t), 0.0, 0.0])
        for t in turns
    ]


def test_tracker_has_the_strip_of_every_pose_and_comes_back() -> None:
    scenario = thick(example1(elements=80))
    tracker = fb.Tracker(fb.Scenario.from_dict(scenario))
    start, energy = tracker.position.copy(), tracker.energy
    for i, (position, rotation) in enumerate(way(40)):
        update = tracker.update(position, rotation)
        assert update.status == "converged"
        assert not update.snapped
        if i % 10 == 4:
            scenario["supports"][1] |= {"position": position, "rotation": rotation}
            afresh = solve(scenario)
            assert tracker.energy == pytest.approx(afresh.energy, rel=1e-9)
            assert np.abs(tracker.position - afresh.position).max() < 1e-7
            for at in range(2):
                expected = np.concatenate(afresh.reaction(at))
                assert np.concatenate(tracker.reaction(at)) == pytest.approx(
                    expected, abs=1e-4 * np.abs(expected).max()
                )
            assert tracker.equilibrium().stable
    assert tracker.energy == pytest.approx(energy, rel=1e-9)
    assert np.abs(tracker.position - start).max() < 1e-7


def test_tracker_takes_few_steps_on_a_smooth_way() -> None:
    tracker = fb.Tracker(fb.Scenario.from_dict(thick(example1(elements=80))))
    iterations = [tracker.update(position, rotation).iterations for position, rotation in way(400)]
    assert np.median(iterations) <= 4.0


def test_reactions_along_a_path_do_the_work_that_the_energy_rises_by() -> None:
    """Of one discrete belt, by Simpson's rule on a spline through the states; the end is drawn in and lifted."""
    found = fb.follow(
        fb.Scenario.from_dict(thick(example1(elements=80))), {"supports[1].position": [0.02, 0.42, 0.15]}, branches=1
    )
    [branch] = found.branches
    assert branch.end == "range"
    assert branch.parameter[-1] == pytest.approx(1.0)
    motion = np.array([0.02, -0.08, 0.05])
    force = forces(branch) @ motion
    work = np.trapezoid(force, branch.parameter)
    assert work == pytest.approx(branch.energy[-1] - branch.energy[0], rel=2e-3)


def forces(branch: fb.Branch) -> Array:
    """Force on the end at every state."""
    return np.array([branch.equilibrium(i).reaction(1)[0] for i in range(len(branch.parameter))])


def test_last_state_of_a_path_is_the_strip_solved_afresh() -> None:
    scenario = thick(example2(elements=80))
    path = {"supports[1].position": [0.02, 0.62, 0.05]}
    [branch] = fb.follow(fb.Scenario.from_dict(scenario), path, branches=1).branches
    scenario["supports"][1]["position"] = [0.02, 0.62, 0.05]
    afresh, last = solve(scenario), branch.equilibrium(len(branch.parameter) - 1)
    assert last.energy == pytest.approx(afresh.energy, rel=1e-8)
    assert np.abs(last.position - afresh.position).max() < 1e-6


def test_planar_arch_of_a_thin_strip_folds_where_the_elastica_does() -> None:
    """Its cross-section hardly curls; the fold of the elastica is at -1.1230897421."""
    scenario = thick(clamped((0.0, 0.6, 0.0), elements=80), 1e-4)
    [branch] = fb.follow(fb.Scenario.from_dict(scenario), {"supports[1].rotation[2]": -1.3}, branches=1).branches
    fold = next(event for event in branch.events if event.kind == "fold" and event.negative_modes == (0, 1))
    assert fold.confirmed
    assert fold.parameter == pytest.approx(-1.1230897421, rel=0.02)
    assert branch.equilibrium(fold.state - 2).stable
    assert branch.equilibrium(fold.state + 2).stable is False


def test_margin_of_a_planar_arch_is_its_fold() -> None:
    scenario = thick(clamped((0.0, 0.6, 0.0), elements=80), 1e-4)
    back = (0.0, 0.0, 0.0, 0.0, 0.0, -1.0)
    margin = solve(scenario).snap_margin("end", direction=back, reach=1.5)
    assert margin is not None
    assert margin.confirmed
    assert margin.distance == pytest.approx(1.1230897421, rel=0.02)


def test_tracker_snaps_where_the_path_folds() -> None:
    scenario = fb.Scenario.from_dict(thick(clamped((0.0, 0.6, 0.0), elements=80), 1e-4))
    tracker = fb.Tracker(scenario)
    angles = np.linspace(0.0, -1.3, 27)
    snapped = [tracker.update([0.0, 0.6, 0.0], [0.0, 0.0, float(angle)]).snapped for angle in angles]
    [at] = np.flatnonzero(snapped)
    assert angles[at] < -1.10
    assert angles[at - 1] > -1.18


def test_thinner_strips_are_led_as_the_inextensible_belt() -> None:
    """The reaction after a way tends to that of the belt without thickness."""
    ways = way(8)[:3]

    def reaction(scenario: Json) -> Array:
        tracker = fb.Tracker(fb.Scenario.from_dict(scenario))
        for position, rotation in ways:
            assert tracker.update(position, rotation).status == "converged"
        return np.concatenate(tracker.reaction(1))

    belt = example1(elements=80)
    limit = reaction(belt)
    off = [np.linalg.norm(reaction(thick(belt, h)) - limit) for h in (1.4e-3, 7e-4, 3.5e-4)]
    assert all(b < a for a, b in itertools.pairwise(off))


def test_belt_led_past_a_pitchfork_goes_on_along_a_minimum() -> None:
    """The board of the hinge is symmetric about its middle; opened beyond 20.7° it leans to a side."""
    tables = fb.load(ROOT / "scenarios" / "hinge.toml").to_dict() | {"energy": "shell"}
    poses = [
        ([0.016 * math.sin(a), 0.016 + 0.016 * math.cos(a), 0.034], [0.0, 0.0, -a]) for a in np.radians([19.0, 21.3])
    ]
    tables["supports"][1] |= dict(zip(("position", "rotation"), poses[0], strict=True))
    tables["solver"]["elements"] = 400
    [branch] = fb.follow(fb.Scenario.from_dict(tables), fb.Poses(poses[1:], motion="screw"), snaps=True).branches
    [event] = branch.events
    assert (event.kind, event.negative_modes, event.confirmed) == ("pitchfork", (0, 1), True)
    assert 19.0 + 2.3 * event.parameter == pytest.approx(20.7, abs=0.1)
    assert False not in branch.stable
    assert branch.stable[-1]
    bend = [branch.equilibrium(state).bend for state in (0, -1)]
    lean = [float(np.abs(b - b[::-1]).max() / np.abs(b).max()) for b in bend]
    assert lean[0] < 1e-5
    assert lean[1] > 0.1
