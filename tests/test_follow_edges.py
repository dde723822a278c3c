"""Paths of a board with bends: ribs that come to other edges, events of belt and mesh, the size of a snap."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fishbone as fb
from conftest import ROOT
from fishbone import plot

AXIS = 0.016
"""Distance of the hinge's axis from the start, along y [m]."""
SNAP, JUMP, RELEASED = 52.5, 1.76e-3, 4.4e-6
"""Angle of the snap on opening [degrees], displacement [m] and energy released [J], by 400 and 800 elements."""


def pose(degrees: float) -> tuple[list[float], list[float]]:
    """The end on a lid that has turned about the hinge."""
    angle = math.radians(degrees)
    return [AXIS * math.sin(angle), AXIS + AXIS * math.cos(angle), 0.034], [0.0, 0.0, -angle]


def hinge(elements: int | None = 200) -> fb.Scenario:
    """The shipped hinge, flat and inextensible; with a mesh that follows the error where no elements are given."""
    tables = fb.load(ROOT / "scenarios" / "hinge.toml").to_dict() | {"energy": "wunderlich"}
    position, rotation = pose(0.0)
    tables["supports"][1] |= {"position": position, "rotation": rotation}
    del tables["solver"]["elements"]
    if elements is not None:
        tables["solver"]["elements"] = elements
    return fb.Scenario.from_dict(tables)


@pytest.fixture(scope="module")
def opening() -> fb.Diagram:
    """The branch of the flat hinge, past its snap on opening."""
    return fb.follow(hinge(), fb.Poses([pose(130.0)], motion="screw"), branches=1, states=250)


def test_a_branch_goes_on_where_ribs_come_to_other_edges(opening):
    [branch] = opening.branches
    [switch] = [event for event in branch.events if event.kind == "edges"]
    assert 0 < switch.state < len(branch) - 1
    assert switch.confirmed
    before, after = branch.position[[switch.state - 1, switch.state]]
    assert np.abs(after - before).max() < 1e-3 * branch.equilibrium(0).u[-1]
    assert set(branch.status) == {"converged"}
    assert branch.residual.max() <= 1e-8


def test_only_the_snap_of_the_belt_is_confirmed(opening):
    [branch] = opening.branches
    confirmed = [event for event in branch.events if event.confirmed and event.kind != "edges"]
    assert [event.negative_modes for event in confirmed] == [(0, 1)]
    [snap] = confirmed
    assert opening.angle(snap.parameter) == pytest.approx(SNAP, abs=0.3)
    assert snap.jump == pytest.approx(JUMP, rel=0.02)
    assert snap.released == pytest.approx(RELEASED, rel=0.1)
    assert False not in branch.stable[: snap.state]
    # Where ribs turn over from element to element the mesh has folds of its own.
    assert sum(event.kind == "fold" for event in branch.events) > 1


def test_a_path_on_a_mesh_that_follows_the_error_goes_to_its_end():
    """Beside a fold no mesh is fine enough for the estimate: the mesh stays there, or it would be refined on and on."""
    diagram = fb.follow(hinge(None), fb.Poses([pose(130.0)], motion="screw"), snaps=True)
    assert diagram.is_complete
    assert sum(len(branch) for branch in diagram.branches) < 300
    [snap] = [event for branch in diagram.branches for event in branch.events if event.snapped is not None]
    assert snap.confirmed
    assert diagram.angle(snap.parameter) == pytest.approx(SNAP, abs=0.4)
    assert snap.jump == pytest.approx(JUMP, rel=0.02)


def test_a_jump_below_the_snap_size_is_no_snap(opening):
    least = 0.01 * 0.004
    snaps = [event for event in opening.branches[0].events if event.snapped is not None]
    assert snaps
    assert all(event.jump >= least for event in snaps)


@pytest.mark.parametrize("step", [2.0, 5.0])
def test_a_tracker_snaps_once_on_opening_whatever_its_step(step):
    tracker = fb.Tracker(hinge())
    updates = [tracker.update(*pose(angle)) for angle in np.arange(step, 100.1, step)]
    assert {update.status for update in updates} == {"converged"}
    [snap] = [update for update in updates if update.snapped]
    assert snap.jump == pytest.approx(JUMP, rel=0.03)
    assert snap.released == pytest.approx(RELEASED, rel=0.1)
    assert all(update.jump == 0.0 for update in updates if update is not snap)


def test_the_angle_is_that_of_the_lid(opening):
    np.testing.assert_allclose(opening.angle([0.0, 0.5, 1.0]), [0.0, 65.0, 130.0], atol=1e-9)
    table = opening.table()
    np.testing.assert_allclose(table["angle"], 130.0 * table["parameter"], atol=1e-9)
    assert set(table["status"]) == {"converged"}


def test_a_picture_along_an_angle_shows_radius_and_limit(opening):
    figure = plot.diagram(opening, radius_limit=0.01)
    assert figure.axes[-1].get_xlabel() == "angle of supports[1] [degrees]"
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == "least radius\n[m]"]
    assert any(np.all(np.asarray(line.get_ydata()) == 0.01) for line in axes.lines)


def test_a_path_of_numbers_has_no_angle(turned):
    assert turned.angle(0.0) is None
    assert "angle" not in turned.table()


def test_a_start_without_slack_is_refused_in_words_of_the_scenario():
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict()
    tables["supports"][1]["position"] = [0.0, 1.0, 0.0]
    with pytest.raises(fb.NoBranch, match="without slack") as caught:
        fb.follow(fb.Scenario.from_dict(tables), {"supports[1].position[1]": 0.9})
    assert caught.value.reason == "no_slack"
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def there_and_back() -> fb.Diagram:
    """The hinge opened from flat to 130° and closed again, as one path."""
    return fb.follow(hinge(), fb.Poses([pose(130.0), pose(0.0)], motion="screw"), snaps=True)


@pytest.mark.full
def test_the_hinge_goes_there_and_back_as_one_path(there_and_back):
    branches = there_and_back.branches
    assert [branch.end for branch in branches] == ["unstable"] * 3 + ["range"]
    assert [branch.origin and branch.origin.branch for branch in branches] == [None, 0, 1, 2]
    snaps = [event for branch in branches for event in branch.events if event.snapped is not None]
    assert all(event.confirmed for event in snaps)
    places = [float(there_and_back.angle(event.parameter)) for event in snaps]
    np.testing.assert_allclose(places, [52.6, 2.8, 0.8], atol=0.3)
    np.testing.assert_allclose([event.jump for event in snaps], [1.76e-3, 0.13e-3, 1.9e-3], rtol=0.08)
    np.testing.assert_allclose([event.released for event in snaps], [4.6e-6, 1.15e-6, 2.5e-6], rtol=0.06)
    assert branches[-1].parameter[-1] == pytest.approx(2.0, abs=1e-9)
    assert branches[-1].energy[-1] == pytest.approx(branches[0].energy[0], rel=1e-6)
    radius = np.concatenate([branch.least_spine_radius for branch in branches])
    place = np.concatenate([branch.parameter for branch in branches])
    assert radius.min() == pytest.approx(10.26e-3, rel=1e-3)
    assert place[radius.argmin()] == pytest.approx(1.0, abs=0.02)
    assert {status for branch in branches for status in branch.status} == {"converged"}


@pytest.mark.parametrize("elements", [200, None])
def test_a_tracker_snaps_twice_on_closing(elements):
    tracker = fb.Tracker(hinge(elements))
    tracker.update(*pose(60.0))
    tracker.update(*pose(130.0))
    updates = [tracker.update(*pose(angle)) for angle in np.arange(129.0, -0.1, -1.0)]
    assert {update.status for update in updates} == {"converged"}
    small, large = [update for update in updates if update.snapped]
    assert small.jump == pytest.approx(0.125e-3, rel=0.08)
    assert small.released == pytest.approx(1.15e-6, rel=0.06)
    assert large.jump == pytest.approx(1.9e-3, rel=0.06)
    assert large.released == pytest.approx(2.5e-6, rel=0.06)
