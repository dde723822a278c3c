"""Results agree with the saved ones as far as processors agree; a comparison names the differences."""

from __future__ import annotations

import copy

import pytest

import golden

POSES = 60
SAME_ENERGY = 1e-6
"""Relative difference between processors: a solve ends where its residuals are within 1e-8."""


@pytest.fixture(scope="module")
def saved() -> dict[str, golden.Cases]:
    return golden.read(golden.FILE)["groups"]


@pytest.fixture(scope="module")
def found() -> dict[str, golden.Cases]:
    return {"scenarios": golden.scenarios(), "poses": golden.poses(POSES)}


@pytest.mark.parametrize(("group", "count"), [("scenarios", 11), ("poses", POSES)])
def test_results_are_those_that_were_saved(saved, found, group, count):
    differences = [
        golden.difference(name, saved[group][name], case) for name, case in found[group].items() if name in saved[group]
    ]
    assert len(differences) >= count
    assert {case.name: case.status for case in differences if case.status} == {}
    assert {case.name: apart for case in differences if (apart := case.values["energy"]) > SAME_ENERGY} == {}


def test_a_run_does_not_differ_from_itself(found):
    assert golden.wrong(golden.compare(found, found), 0.0) == []


def test_what_differs_is_named_other_statuses_first(found):
    changed = copy.deepcopy(found)
    one, another, third = list(changed["scenarios"])[:3]
    changed["scenarios"][one]["energy"][0] *= 1.0 + 1e-6
    changed["scenarios"][another]["status"][0] = "not_converged"
    del changed["scenarios"][third]
    lines = golden.wrong(golden.compare(found, changed), 1e-9)
    assert lines == [
        f"scenarios: {another}: saved converged, found not_converged",
        f"scenarios: {third}: not computed",
        f"scenarios: {one}: energy 1.0e-06",
    ]
    assert golden.wrong(golden.compare(found, changed), 1e-3) == lines[:2]


def test_a_difference_in_iterations_alone_is_reported_and_is_no_error(found):
    changed = copy.deepcopy(found)
    name = next(iter(changed["poses"]))
    changed["poses"][name]["iterations"] = [1000]
    differences = golden.compare(found, changed)
    assert golden.wrong(differences, 0.0) == []
    assert [case.name for case in differences["poses"] if case.iterations] == [name]


def test_numbers_that_cannot_be_compared_differ_by_all_there_is(found):
    case = found["poses"]["0, fishbone"]
    for energy in ([1.0], [1.0, float("nan")], []):
        assert golden.relative("energy", case, case | {"energy": energy}) == float("inf")


def test_the_same_table_is_the_same_bytes(tmp_path, found):
    table = golden.about() | {"groups": found}
    files = [tmp_path / "one.json.gz", tmp_path / "other.json.gz"]
    for file in files:
        golden.write(file, table)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert golden.read(files[0]) == table
