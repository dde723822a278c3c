"""Errors: their class, their one line, and their data as attributes."""

import copy
import os
import pickle

import numpy as np
import pytest

import fishbone as fb
from cases import on_one_mesh
from conftest import ROOT
from fishbone import _core

ORIGIN = [0.0, 0.0, 0.0]
BELT = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
START = {"at": "start", "position": ORIGIN, "rotation": ORIGIN}
END = {"at": "end", "position": [0.0, 0.6, 0.1], "rotation": ORIGIN}
SLIDE = {"at": "end", "position": [0.0, 0.8, "free"]}
PIN = {"at": "end", "position": [0.0, 0.6, 0.1]}
NO_SLACK = END | {"position": [0.0, 1.0, 0.0]}
TOO_FAR = END | {"position": [0.0, 2.0, 0.0]}
TURN = "supports[1].rotation[2]"
AWAY = fb.Poses([([0.0, 0.7, 0.0], ORIGIN)])


def scenario(*supports, **tables):
    return fb.Scenario(belt=BELT, supports=supports or (START, END), **tables)


def ritz():
    return scenario(energy="fishbone", solver={"method": "ritz"})


def solved(*supports, **tables):
    return fb.solve(scenario(*supports, **tables))


def bent():
    tables = fb.load(ROOT / "scenarios" / "bent.toml").to_dict()
    return fb.solve(fb.Scenario.from_dict(on_one_mesh(tables)))


def apart():
    """The message of a solve whose supports are too far apart."""
    return solved(START, TOO_FAR).message


def strut(thrust):
    """A straight belt under thrust: no minimum, where that is large."""
    free = END | {"position": [0.0, "free", 0.0]}
    flat = (np.zeros(81), np.zeros(81))
    tables = {"loads": {"points": [{"at": "end", "force": [0.0, -thrust, 0.0]}]}}
    return fb.solve(scenario(START, free, **tables), start=flat)


def stiffened():
    """A belt whose stiffener is clamped at both of its ends."""
    held = [{"at": u, "position": [0.1, u - 0.1, 0.0], "rotation": ORIGIN} for u in (0.4, 0.6)]
    lengths = {"straight": 0.4, "rigid": 0.2}
    segments = [{"kind": kind, "length": lengths[kind]} for kind in ("straight", "rigid", "straight")]
    end = {"at": "end", "position": [0.2, 0.75, 0.1]}
    return fb.solve(fb.Scenario(belt=BELT | {"segments": segments}, supports=[START, *held, end]))


def read(text):
    return fb._core.Scenario.from_toml(text)


# Class of the error, a call that raises it, and all its data.
CASES = {
    "syntax": (
        fb.InvalidScenario,
        lambda: read("name = 'a'\nbelt = {\n"),
        {"reason": "syntax", "field": None, "line": 2, "column": 9, "file": None},
    ),
    "unknown field": (
        fb.InvalidScenario,
        lambda: scenario(START, {"at": "end", "positon": ORIGIN}),
        {
            "reason": "unknown_field",
            "field": "supports[1].positon",
            "allowed": "at, position, rotation, euler, quaternion, hinge, moment, square_rib",
            "choices": ("at", "position", "rotation", "euler", "quaternion", "hinge", "moment", "square_rib"),
            "nearest": "position",
            "file": None,
        },
    ),
    "unknown word": (
        fb.InvalidScenario,
        lambda: scenario(energy="sadovsky"),
        {
            "reason": "unknown_choice",
            "field": "energy",
            "found": "sadovsky",
            "allowed": "fishbone, sadowsky, wunderlich, shell",
            "choices": ("fishbone", "sadowsky", "wunderlich", "shell"),
            "nearest": "sadowsky",
            "file": None,
        },
    ),
    "value": (
        fb.InvalidScenario,
        lambda: fb.Scenario(belt=BELT | {"width": -0.1}),
        {
            "reason": "invalid",
            "field": "belt.width",
            "found": "-0.1",
            "allowed": "a positive finite number",
            "file": None,
        },
    ),
    "value that the core never sees": (
        fb.InvalidScenario,
        lambda: fb.Scenario(belt=BELT | {"width": float("nan")}),
        {"reason": "invalid", "field": "belt.width", "found": "nan", "allowed": "a finite number", "file": None},
    ),
    "file": (
        fb.InvalidScenario,
        lambda: fb.load("missing.toml"),
        {
            "reason": "invalid",
            "field": "file",
            "found": "no such file or directory",
            "allowed": "a readable file",
            "file": "missing.toml",
        },
    ),
    "argument": (fb.InvalidArgument, lambda: solved().modes(0), {}),
    "support": (fb.NoSupport, lambda: solved().reaction(0.25), {"support": 0.25}),
    "support by index": (fb.NoSupport, lambda: solved().reaction(7), {"support": 7}),
    "sensitivity of no solution": (
        fb.NoSensitivity,
        lambda: solved(START, TOO_FAR).sensitivity(),
        {"reason": "not_converged", "solve_message": apart},
    ),
    "sensitivity of the source's method": (
        fb.NoSensitivity,
        lambda: fb.solve(ritz()).sensitivity(),
        {"reason": "no_multipliers"},
    ),
    "sensitivity of no minimum": (fb.NoSensitivity, lambda: strut(90.0).sensitivity(), {"reason": "saddle"}),
    "sensitivity without slack": (
        fb.NoSensitivity,
        lambda: solved(START, NO_SLACK).sensitivity().jacobian(1),
        {"reason": "no_slack"},
    ),
    "sensitivity of redundant supports": (
        fb.NoSensitivity,
        lambda: stiffened().sensitivity(),
        {"reason": "redundant", "redundant": "supports[1] and supports[2]"},
    ),
    "modes": (fb.NoModes, lambda: fb.solve(ritz()).modes(1), {"reason": "no_multipliers"}),
    "margin of no minimum": (fb.NoMargin, lambda: strut(90.0).snap_margin(), {"reason": "not_stable"}),
    "margin of a pin": (
        fb.NoMargin,
        lambda: solved(START, END | {"hinge": "zeta"}).snap_margin(direction=[0, 0, 1, 0, 0, 0]),
        {"reason": "not_clamped", "support": 1},
    ),
    "margin of no solution": (
        fb.NoMargin,
        lambda: solved(START, TOO_FAR).snap_margin(),
        {"reason": "not_converged", "solve_message": apart},
    ),
    "margin beyond what can be followed": (
        fb.NoMargin,
        lambda: bent().snap_margin(direction=[0, -1, 0, 0, 0, 0]),
        {"reason": "lost", "share": pytest.approx(0.672, abs=5e-4)},
    ),
    "tracker of no solution": (
        fb.NoTracker,
        lambda: fb.Tracker(scenario(START, TOO_FAR)),
        {"reason": "not_converged", "solve_message": apart},
    ),
    "tracker of a slide": (
        fb.NoTracker,
        lambda: fb.Tracker(scenario(START, SLIDE)),
        {"reason": "not_held", "support": 1},
    ),
    "tracker of no support": (
        fb.NoTracker,
        lambda: _core.Tracker(solved()._inner, [7]),
        {"reason": "no_support", "support": 7},
    ),
    "path of no number": (
        fb.NoPath,
        lambda: fb.follow(scenario(), {"solver.method": 1.0}),
        {"reason": "no_number", "field": "solver.method", "found": '"intrinsic"'},
    ),
    "path to where it is": (fb.NoPath, lambda: fb.follow(scenario(), {TURN: 0.0}), {"reason": "nothing"}),
    "path of a pin": (
        fb.NoPath,
        lambda: fb.follow(scenario(START, PIN), AWAY),
        {"reason": "not_clamped", "support": 1},
    ),
    "path to no scenario": (
        fb.NoPath,
        lambda: fb.follow(scenario(), {"belt.width": -1.0}),
        {"reason": "invalid", "field": "belt.width", "found": "-1.0", "allowed": "a positive finite number"},
    ),
    "path of a count": (
        fb.NoPath,
        lambda: fb.follow(scenario(solver={"elements": 80}), {"solver.elements": 90.5}),
        {"reason": "unreadable"},
    ),
    "branch of no solution": (
        fb.NoBranch,
        lambda: fb.follow(scenario(START, TOO_FAR), {TURN: 0.5}),
        {"reason": "not_converged", "solve_message": apart},
    ),
    "branch of the source's method": (
        fb.NoBranch,
        lambda: fb.follow(ritz(), {TURN: 0.5}),
        {"reason": "no_multipliers"},
    ),
}


@pytest.fixture(params=CASES)
def case(request, monkeypatch, tmp_path):
    """An exception, its class, and its expected data."""
    monkeypatch.chdir(tmp_path)
    kind, raising, data = CASES[request.param]
    with pytest.raises(fb.FishboneError) as raised:
        raising()
    return raised.value, kind, {name: value() if callable(value) else value for name, value in data.items()}


def test_an_exception_has_its_data_is_one_line_and_survives_a_pickle(case):
    error, kind, data = case
    assert type(error) is kind
    assert vars(error) == data
    assert all(hasattr(kind, name) for name in data)
    assert error.args == (str(error),)
    assert "\n" not in str(error)
    assert error.__cause__ is None
    copies = [pickle.loads(pickle.dumps(error, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)]  # noqa: S301
    for other in [*copies, copy.copy(error), copy.deepcopy(error)]:
        assert (type(other), str(other), vars(other)) == (kind, str(error), vars(error))


def test_of_data_that_do_not_apply_there_are_none():
    error = fb.InvalidScenario("mine")
    assert (error.reason, error.field, error.line, error.choices) == (None, None, None, ())
    assert pickle.loads(pickle.dumps(error)).args == ("mine",)  # noqa: S301


def test_an_error_in_a_file_names_the_file(tmp_path):
    path = tmp_path / "wide.toml"
    path.write_text('belt = { width = "wide" }', "utf-8")
    with pytest.raises(fb.InvalidScenario) as refusal:
        fb.load(path)
    error = refusal.value
    assert (error.file, error.field, error.found) == (str(path), "belt.width", '"wide"')
    assert str(error) == f'{path}: belt.width: found "wide", must be a number'


def test_the_name_of_a_file_need_not_be_unicode(tmp_path):
    path = tmp_path / os.fsdecode(b"gr\xfcn.toml")
    path.write_text("belt = 1", "utf-8")
    with pytest.raises(fb.InvalidScenario, match=r": belt: found 1, must be a table$") as refusal:
        fb.load(path)
    assert refusal.value.file == str(path)


@pytest.mark.parametrize("name", ["nul\0.toml", "\ud800.toml"])
def test_a_name_that_no_file_can_have_is_refused(name):
    with pytest.raises(fb.InvalidScenario, match="file: found a name that no file can have"):
        fb.load(name)


@pytest.mark.parametrize("digits", [400, 5000])
def test_an_integer_that_no_float_can_hold_is_refused_by_its_field(digits):
    with pytest.raises(fb.InvalidScenario, match=r"^belt\.width: found an integer larger than all finite numbers"):
        fb.Scenario(belt=BELT | {"width": 10**digits})


def test_a_strict_failure_survives_a_pickle_with_its_result():
    with pytest.raises(fb.NotConverged) as raised:
        fb.solve(scenario(START, TOO_FAR), strict=True)
    error = raised.value
    for other in [pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)]:  # noqa: S301
        assert (str(other), other.status) == (str(error), "infeasible")
        assert other.solve_message == error.solve_message == error.equilibrium.message
        assert other.scenario == error.equilibrium.scenario
        assert other.equilibrium.to_dict() == error.equilibrium.to_dict()


def test_a_missing_package_survives_a_pickle():
    error = fb.MissingPackage("matplotlib", "plot")
    for other in [pickle.loads(pickle.dumps(error)), copy.copy(error)]:  # noqa: S301
        assert (other.package, other.extra, other.name) == ("matplotlib", "plot", "matplotlib")
        assert str(other) == str(error) == 'matplotlib is not installed: pip install "fishbone[plot]"'


def test_what_progress_raises_is_passed_on_as_it_is():
    class MineError(ValueError):
        pass

    mine = MineError("mine")

    def stop(*_):
        raise mine

    with pytest.raises(MineError) as raised:
        fb.follow(scenario(solver={"elements": 400}), {TURN: 0.5}, progress=stop)
    assert raised.value is mine
