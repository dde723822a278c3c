"""Names of supports: ends, arc lengths, indices."""

import numpy as np
import pytest

import fishbone as fb
from fishbone.places import support_index

PLACES = [0.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("name", "index"),
    [("start", 0), ("end", 3), (0, 0), (3, 3), (-1, 3), (-4, 0), (0.0, 0), (1, 1), (1.0, 1), (3.0000000001, 2), (4, 3)],
)
def test_a_support_is_named_by_its_end_its_index_or_its_arc_length(name, index):
    assert support_index(name, PLACES, 4.0) == index


@pytest.mark.parametrize("name", [2, np.int64(2)])
def test_an_integer_is_an_index_where_it_is_also_the_arc_length_of_another_support(name):
    assert support_index(name, PLACES, 4.0) == 2


@pytest.mark.parametrize("name", [2.0, np.float64(2.0)])
def test_a_whole_number_that_may_mean_two_supports_is_refused(name):
    with pytest.raises(fb.NoSupport, match=r"an index and the arc length of supports\[1\], allowed 1 for this one$"):
        support_index(name, PLACES, 4.0)


@pytest.mark.parametrize(
    "name", ["middle", 7, 7.0, -5, 0.5, float("nan"), float("inf"), None, ("end",), b"1", 1j, 10**400]
)
def test_a_support_that_does_not_exist_is_refused(name):
    with pytest.raises(fb.NoSupport, match=r"found supports at u = \[0\.0, 2\.0, 3\.0, 4\.0\]") as raised:
        support_index(name, PLACES, 4.0)
    assert raised.value.support is name


def test_one_and_one_point_zero_name_the_same_support_of_a_belt_of_length_one():
    tracker = fb.Tracker(fb.load("scenarios/example1.toml"))
    for one, other in zip(tracker.reaction(1), tracker.reaction(1.0), strict=True):
        np.testing.assert_array_equal(one, other)
