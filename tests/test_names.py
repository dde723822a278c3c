"""Words are the same in Python, in the core and in files."""

import json
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

import fishbone as fb
import helpers
from conftest import ROOT
from fishbone import _core, chart, names, report

NAMES = _core.names()
WORDS = [list_ for list_ in NAMES if hasattr(names, list_)]
REASONS = [list_ for list_ in NAMES if hasattr(fb, list_)]
NEVER_SEEN = {"interrupted"}
"""Words of the core that no result has: an interrupted solve returns no result."""


def schema() -> helpers.Json:
    return json.loads((ROOT / "scenarios" / "scenario.schema.json").read_text("utf-8"))["$defs"]


def literals(of: object) -> set[str]:
    """The words among what a type allows."""
    if get_origin(of) is Literal:
        return set(get_args(of))
    return set().union(*(literals(one) for one in get_args(of)))


def test_every_list_of_the_core_has_its_type():
    assert sorted([*WORDS, *REASONS]) == sorted(NAMES)


@pytest.mark.parametrize("list_", WORDS)
def test_words_are_those_of_the_core(list_):
    assert [*get_args(getattr(names, list_)), *NEVER_SEEN] == [*NAMES[list_], *NEVER_SEEN - set(NAMES[list_])]


@pytest.mark.parametrize("list_", REASONS)
def test_reasons_are_those_of_the_core(list_):
    assert literals(get_type_hints(getattr(fb, list_))["reason"]) == set(NAMES[list_])


@pytest.mark.parametrize("list_", ["EnergyModel", "Method", "Axis"])
def test_the_schema_of_scenarios_has_the_same_words(list_):
    assert [word["const"] for word in schema()[list_]["oneOf"]] == list(NAMES[list_])


def test_the_ends_of_a_belt_are_those_of_the_schema():
    assert literals(names.Place) == set(schema()["Place"]["anyOf"][0]["enum"])


def test_every_word_that_is_drawn_or_printed_is_a_word_of_the_core():
    assert set(chart.MARKERS) == set(NAMES["Kind"])
    # The table has other words for a branch that meets another or reaches the end of the path.
    assert set(report.ENDS) == set(NAMES["End"]) - NEVER_SEEN - {"range", "event"}


def test_the_tests_know_the_same_energies():
    assert NAMES["EnergyModel"] == (*helpers.ENERGIES, "shell")


def test_the_core_knows_no_other_motions(arch):
    with pytest.raises(ValueError, match="motion"):
        _core.Path.poses(arch._inner, 1, [([0.0, 0.7, 0.0], [0.0, 0.0, 0.0])], "arc")
