"""What is a value can be copied and pickled, exact to the bit, with the version that has pickled it."""

import copy
import json
import multiprocessing
import pickle

import numpy as np
import pytest

import fishbone as fb
from fishbone import examples
from fishbone.branches import _Budget, _search

WAYS = {
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
    **{
        f"pickle {protocol}": lambda value, protocol=protocol: pickle.loads(pickle.dumps(value, protocol))  # noqa: S301
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1)
    },
}


@pytest.fixture(params=WAYS)
def copied(request):
    """A way to copy a value."""
    return WAYS[request.param]


def example(name, **changes):
    return fb.Scenario.from_dict(fb.load(f"scenarios/{name}.toml").to_dict() | changes)


def without_times(result):
    """A result, or a list of some, without the times of solves."""
    if isinstance(result, dict):
        return {key: without_times(value) for key, value in result.items() if key != "solve_time"}
    return [without_times(entry) for entry in result] if isinstance(result, list) else result


def numbers(found):
    """All that an equilibrium or a diagram holds but times, NaN included, as text."""
    return json.dumps(without_times(found.to_dict()))


def shape(tracker):
    return [getattr(tracker, name).tobytes() for name in ("u", "position", "frame", "bend", "rib_slope")]


def held(name):
    """Position and rotation vector of the last support of an example."""
    support = fb.load(f"scenarios/{name}.toml").to_dict()["supports"][-1]
    return np.array(support["position"]), support["rotation"]


@pytest.mark.parametrize("name", examples.names())
def test_a_result_of_every_example_is_the_same_after_a_pickle(name):
    found = fb.solve(example(name))
    other = pickle.loads(pickle.dumps(found))  # noqa: S301
    assert numbers(other) == numbers(found)
    assert other.scenario == found.scenario
    assert numbers(other.refined(60)) == numbers(found.refined(60))


def test_a_scenario_is_copied_in_every_way(copied):
    scenario = example("example1")
    assert copied(scenario) == scenario


@pytest.mark.parametrize("energy", ["fishbone", "shell"])
def test_a_result_is_copied_in_every_way(copied, energy):
    found = fb.solve(example("hinge", energy=energy))
    assert numbers(copied(found)) == numbers(found)


def test_a_failed_result_is_copied_in_every_way(copied):
    tables = example("example1").to_dict()
    tables["supports"][1]["position"] = [0.0, 2.0, 0.0]
    found = fb.solve(fb.Scenario.from_dict(tables))
    assert found.status == "infeasible"
    assert numbers(copied(found)) == numbers(found)


def test_a_result_of_the_source_s_method_is_copied_in_every_way(copied):
    found = fb.solve(example("example1", solver={"method": "ritz"}))
    assert numbers(copied(found)) == numbers(found)


def test_all_equilibria_are_copied():
    found = _search(example("example1", solver={"elements": 40}), _Budget(sums=4, perturbed=0, continued=1))
    assert len(found) > 1
    for other in (copy.deepcopy(found), pickle.loads(pickle.dumps(found))):  # noqa: S301
        assert [numbers(one) for one in other] == [numbers(one) for one in found]


PATHS = {
    "numbers": {"supports[1].position[1]": 0.55, "supports[1].position[2]": 0.1},
    "poses": fb.Poses([([0.0, 0.5, 0.1], [0.0, 0.0, 0.0]), ([0.1, 0.5, 0.1], [0.0, 0.4, 0.0])], motion="screw"),
}


@pytest.fixture(params=PATHS, scope="module")
def diagram(request):
    return fb.follow(example("example1", solver={"elements": 40}), PATHS[request.param], branches=2)


def test_a_diagram_is_copied_in_every_way(copied, diagram):
    other = copied(diagram)
    assert numbers(other) == numbers(diagram)
    one, same = (of.branches[0].equilibrium(len(of.branches[0]) - 1) for of in (diagram, other))
    assert numbers(one) == numbers(same)


def test_sensitivities_are_copied_in_every_way(copied):
    found = fb.solve(example("example1", solver={"elements": 40}))
    np.testing.assert_array_equal(copied(found.sensitivity()).jacobian(1), found.jacobian("end"))


@pytest.mark.parametrize("name", ["example1", "polystyrene"])
def test_a_tracker_is_copied_in_every_way_and_moves_by_itself(copied, name):
    tracker = fb.Tracker(example(name, solver={"elements": 40}))
    position, rotation = held(name)
    tracker.update(0.99 * position, rotation)
    other = copied(tracker)
    before = shape(tracker)
    assert shape(other) == before
    other.update(0.98 * position, rotation)
    assert shape(tracker) == before != shape(other)


@pytest.mark.parametrize("name", ["example1", "hinge", "curved", "bent"])
def test_trackers_in_one_state_make_the_same_updates(name):
    tracker = fb.Tracker(example(name))
    position, rotation = held(name)
    step = 0.005 * tracker.u[-1] * np.array([0.0, -1.0, 1.0])
    tracker.update(position + step, rotation)
    others = [tracker.copy(), fb.Tracker.restore(tracker.state()), pickle.loads(pickle.dumps(tracker))]  # noqa: S301
    for steps in range(4):
        position = position + steps * step
        updates = [repr(one.update(position, rotation)) for one in (tracker, *others)]
        assert updates == updates[:1] * 4
        assert [shape(one) for one in others] == [shape(tracker)] * 3


def test_a_tracker_starts_at_the_equilibrium_it_is_given():
    saddle_side = fb.solve(example("example1", solver={"bulge": [-1.0, 0.0, 0.0]}))
    tracker = fb.Tracker(saddle_side, "end")
    np.testing.assert_array_equal(tracker.position, saddle_side.position)
    tracker.update([0.0, 0.5, 0.1], [0.0, 0.0, 0.0])
    assert np.sign(tracker.equilibrium().side) == np.sign(saddle_side.side)


def test_a_tracker_in_a_state_has_its_reactions():
    tracker = fb.Tracker(example("example1"))
    other = fb.Tracker(tracker.state())
    for place in ("start", "end", 0, 1.0):
        np.testing.assert_array_equal(other.reaction(place), tracker.reaction(place))


def refusal(content):
    with pytest.raises(fb.InvalidArgument) as raised:
        fb.Tracker.restore(content)
    return str(raised.value)


def test_a_state_of_another_version_is_refused():
    state = fb.Tracker(example("example1", solver={"elements": 20})).state()
    version = fb.__version__.encode()
    assert version in state[:60]
    text = refusal(state.replace(version, b"9.8.7", 1))
    assert text == f"state: found a tracker of version 9.8.7, allowed one of version {fb.__version__}"


def test_bytes_that_are_no_state_are_refused():
    tracker = fb.Tracker(example("example1", solver={"elements": 20}))
    state = tracker.state()
    damaged = bytearray(state)
    damaged[len(state) // 2] ^= 1
    _, (of_a_result, _) = tracker.equilibrium()._inner.__reduce__()
    for content in (b"", b"fishbone", state[:-1], state[:40], state + b"0", bytes(damaged), of_a_result, b"\xff" * 400):
        assert refusal(content) == "state: found bytes that hold no tracker, allowed those of a stored one"


def test_a_scenario_pickled_by_another_version_names_it_where_it_is_invalid():
    restore, (tables, version) = example("example1").__reduce__()
    assert version == fb.__version__
    assert restore(tables, "9.8.7") == example("example1")
    with pytest.raises(fb.InvalidScenario, match=r"^pickled by version 9\.8\.7 of fishbone: belt\.width: found -1"):
        restore(tables | {"belt": tables["belt"] | {"width": -1.0}}, "9.8.7")


def solve_strictly(length):
    tables = fb.load("scenarios/example1.toml").to_dict()
    tables["supports"][1]["position"] = [0.0, length, 0.0]
    return fb.solve(fb.Scenario.from_dict(tables), strict=True)


def test_results_and_errors_come_back_from_other_processes():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert numbers(pool.apply(solve_strictly, (0.5,))) == numbers(solve_strictly(0.5))
        with pytest.raises(fb.NotConverged, match=r"^infeasible") as raised:
            pool.apply(solve_strictly, (2.0,))
    assert raised.value.equilibrium.status == "infeasible"
