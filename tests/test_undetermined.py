"""Forces that the shape does not determine are NaN, with a warning; those that it determines are numbers.

Expected values: Euler's load of a belt between clamps, 4π² R_f/U², and the balance of forces.
"""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

import fishbone as fb
from fishbone.report import report
from helpers import Json, belt, clamped, result, solve, support

ORIGIN = (0.0, 0.0, 0.0)
NAN = float("nan")


def sliding(force: tuple[float, float, float], at: float | str = "end", width: float = 0.1) -> Json:
    """A flat belt between a clamp and a clamp that slides along y, under a dead force."""
    scenario = belt([support("start", ORIGIN, ORIGIN)], width=width)
    scenario["supports"].append({"at": "end", "position": [0.0, "free", 0.0], "rotation": list(ORIGIN)})
    return scenario | {"loads": {"points": [{"at": at, "force": list(force)}]}}


def test_reactions_of_a_taut_belt_are_not_determined() -> None:
    """Along the belt, and in its plane, any force does; across it and about its axis there is none."""
    equilibrium = solve(clamped((0.0, 1.0, 0.0)))
    assert equilibrium.status == "converged"
    for place in ("start", "end"):
        force, moment = equilibrium.reaction(place)
        assert force == pytest.approx([0.0, NAN, NAN], abs=1e-9, nan_ok=True)
        assert moment == pytest.approx([NAN, 0.0, 0.0], abs=1e-9, nan_ok=True)
    [warning] = equilibrium.warnings
    for words in ("supports[0] and supports[1]", "not determined"):
        assert words in warning
    internal = equilibrium.internal
    assert np.isnan(internal.force[:, 1:]).all()
    assert np.isnan(internal.moment[:, 0]).all()
    assert np.abs(internal.force[:, 0]).max() < 1e-9


def test_undetermined_forces_are_null_in_results_and_named_in_the_table() -> None:
    equilibrium = solve(clamped((0.0, 1.0, 0.0)))
    for reaction in result(equilibrium)["supports"]:
        assert [value is None for value in reaction["force"]] == [False, True, True]
        assert [value is None for value in reaction["moment"]] == [True, False, False]
    text = io.StringIO()
    Console(file=text, width=200).print(report(equilibrium))
    assert "not determined" in text.getvalue()
    assert "nan" not in text.getvalue()


@pytest.mark.parametrize("slack", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_nearly_taut_belt_bears_eulers_load(slack: float) -> None:
    """An arch of whatever small height has the reaction 4π²."""
    equilibrium = solve(clamped((0.0, 1.0 - slack, 0.0)))
    force, moment = equilibrium.reaction("end")
    assert force == pytest.approx([0.0, -4.0 * np.pi**2, 0.0], rel=2e-3, abs=1e-2)
    assert np.isfinite(moment).all()
    assert equilibrium.warnings == []


def test_nearly_taut_and_twisted_belt_has_all_its_reactions() -> None:
    """The gradient of its energy by differences of equilibria."""
    scenario = clamped((0.0, 0.999, 0.0), (0.0, 0.1, 0.0))
    scenario["solver"] = {"elements": 80}
    force, moment = solve(scenario).reaction("end")
    assert np.isfinite([force, moment]).all()
    energies = []
    for step in (-1e-6, 1e-6):
        scenario["supports"][1]["position"] = [0.0, 0.999 + step, 0.0]
        energies.append(solve(scenario).energy)
    assert force[1] == pytest.approx((energies[1] - energies[0]) / 2e-6, rel=1e-3)


def test_shares_of_two_clamps_in_a_load_in_the_plane_are_not_determined() -> None:
    """The belt is rigid in its plane; the pull along it is borne by the clamp at the start alone."""
    equilibrium = solve(sliding((0.0, 3.0, 0.0)))
    start, end = (equilibrium.reaction(place) for place in ("start", "end"))
    assert start.force == pytest.approx([0.0, -3.0, NAN], abs=1e-9, nan_ok=True)
    assert start.moment == pytest.approx([NAN, 0.0, 0.0], abs=1e-9, nan_ok=True)
    assert end.force == pytest.approx([0.0, 0.0, NAN], abs=1e-9, nan_ok=True)
    assert equilibrium.internal.force[:-1, 1] == pytest.approx(3.0)


def test_one_clamp_bears_a_load_in_the_plane_by_balance() -> None:
    scenario = belt([support("start", ORIGIN, ORIGIN)])
    equilibrium = solve(scenario | {"loads": {"points": [{"at": "end", "force": [0.0, 0.0, -1.0]}]}})
    force, moment = equilibrium.reaction("start")
    assert np.abs(equilibrium.bend).max() < 1e-9
    assert force == pytest.approx([0.0, 0.0, 1.0], abs=1e-7)
    assert moment == pytest.approx([1.0, 0.0, 0.0], abs=1e-7)
    assert equilibrium.warnings == []


def test_clamps_of_a_bent_belt_have_all_their_reactions() -> None:
    """Bent by a push to the side, the same belt is determined."""
    equilibrium = solve(sliding((1.0, 3.0, 0.0), at=0.5))
    start, end = (equilibrium.reaction(place) for place in ("start", "end"))
    assert np.isfinite([*start, *end]).all()
    assert start.force + end.force == pytest.approx([-1.0, -3.0, 0.0], abs=1e-6)


def test_belt_turned_in_space_has_no_component_that_is_determined_by_chance() -> None:
    """A direction along the belt that is not an axis: no component of the force is known."""
    turn = np.array([0.3, -0.4, 0.5])
    frame = fb.solve(fb.Scenario.from_dict(belt([support("start", ORIGIN, tuple(turn))]))).frame[0]
    end = frame[:, 1]
    equilibrium = solve(belt([support("start", ORIGIN, tuple(turn)), support("end", tuple(end), tuple(turn))]))
    force, moment = equilibrium.reaction("end")
    assert np.isnan(force).all()
    assert np.isnan(moment).all()


def test_tracker_eased_to_its_limit_has_eulers_load_or_no_reaction() -> None:
    """It stops within the tolerance of the limit, with an arch that determines its reaction, or at it."""
    tracker = fb.Tracker(fb.Scenario.from_dict(clamped((0.0, 0.9, 0.0))))
    assert tracker.update([0.0, 0.9999, 0.0], ORIGIN).status == "converged"
    assert tracker.reaction("end").force[1] == pytest.approx(-4.0 * np.pi**2, rel=1e-3)
    assert tracker.update([0.0, 1.0, 0.0], ORIGIN).status == "converged"
    along = tracker.reaction("end").force[1]
    assert np.isnan(along) or along == pytest.approx(-4.0 * np.pi**2, rel=1e-2)
