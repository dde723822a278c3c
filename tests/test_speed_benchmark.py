"""The speed benchmark, as far as it needs none of its rivals: its poses, its counts, the page written from them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fishbone as fb
from cases import on_one_mesh
from conftest import ROOT
from speed import guess, measure, report
from speed.problem import EXAMPLES, ROTATION, TRANSLATION, Answer, end_pose, path
from speed.rivals import ENTRIES, OURS
from speed.slsqp import Slsqp

COLD_FIELDS = {
    "rival",
    "energy_model",
    "example",
    "converged",
    "energy",
    "iterations",
    "repetitions",
    "p50",
    "min",
    "distance",
}

examples = pytest.mark.parametrize("example", EXAMPLES)


def turn(a, b):
    """Angle between two poses."""
    return (Rotation.from_rotvec(a.rotation).inv() * Rotation.from_rotvec(b.rotation)).magnitude()


@examples
def test_path_is_closed_and_its_distance_from_the_end_pose_is_the_documented_one(example):
    base, poses = end_pose(example), list(path(example, 501))
    for end in (poses[0], poses[-1]):
        assert np.allclose(end.position, base.position, atol=1e-12)
        assert turn(end, base) < 1e-7
    assert max(np.linalg.norm(pose.position - base.position) for pose in poses) == pytest.approx(TRANSLATION)
    assert max(turn(pose, base) for pose in poses) == pytest.approx(ROTATION)


@examples
def test_path_is_always_the_same_and_has_no_jumps(example):
    poses, again = (list(path(example, 1001)) for _ in range(2))
    assert all(np.array_equal(a.position, b.position) for a, b in zip(poses, again, strict=True))
    steps = np.linalg.norm(np.diff([pose.position for pose in poses], axis=0), axis=1)
    assert steps.max() < 10.0 * TRANSLATION / 1000.0 * 2.0 * np.pi


@pytest.mark.parametrize("updates", [20, 100, 1000, 10_000])
def test_stretches_hold_as_many_updates_as_asked_for_within_the_path(updates):
    stretches = measure.stretches(measure.PATH, updates)
    assert sum(len(stretch) - 1 for stretch in stretches) == updates
    assert all(stretch[-1] <= measure.PATH for stretch in stretches)


def test_only_converged_shapes_are_compared():
    answers = [Answer(converged, 0.0, 1, energy) for converged, energy in ((True, 2.0), (True, 1.0), (False, 3.0))]
    assert measure._compared(answers, [2.0, 2.0, 2.0]) == {"same": 1, "lower": 1, "higher": 0}


def test_percentiles_of_a_ramp():
    assert measure.percentiles(np.linspace(0.0, 1.0, 1001).tolist(), 50, 99, 99.9) == pytest.approx([0.5, 0.99, 0.999])


def test_numbers_have_three_digits_and_no_powers_of_ten():
    assert [report.significant(value) for value in (0.0012345, 1.2345, 123.45, 12345.0)] == [
        "0.00123",
        "1.23",
        "123",
        "12345",
    ]
    assert (report.ratio(3.0, 2.0), report.ratio(3.0, None)) == ("1.5 ×", "")


def test_a_section_without_records_says_that_it_was_not_measured():
    assert report.text(["a", "b"], []) == "Not measured."


def test_slsqp_has_the_transcription_of_the_core(example):
    equilibrium = fb.solve(fb.Scenario.from_dict(on_one_mesh(example.to_dict())))
    rival = Slsqp("fishbone", 80)
    fields = np.stack([equilibrium.bend, equilibrium.rib_slope], axis=1).ravel()
    rival.found = fields[rival.unknown]
    energy, _ = rival._cost(rival.found)
    position, tangent = rival.curve()
    assert energy == pytest.approx(equilibrium.energy, rel=1e-12)
    assert np.abs(position - equilibrium.position).max() < 1e-12
    assert np.abs(tangent - equilibrium.frame[:, :, 1]).max() < 1e-12


@examples
def test_guess_meets_the_clamp_and_bulges_to_the_side_of_the_core(example):
    u = np.linspace(0.0, 1.0, 1001)
    bends = guess.bends(end_pose(example), u)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (bends[1:] + bends[:-1]) * np.diff(u))])
    assert np.trapezoid(np.cos(angle), u) == pytest.approx(end_pose(example).position[1], abs=2e-3)
    assert np.max(-np.cumsum(np.sin(angle)) / 1000.0) > 0.1


def test_saved_run_has_what_the_page_needs():
    result = report.load()
    assert set(result) == {
        *("schema", "date", "commit", "processor", "cores", "system", "threads", "versions"),
        *measure.SECTIONS,
    }
    assert {record["rival"] for record in result["cold"]} == {entry.name for entry in ENTRIES}
    assert all(set(record) == COLD_FIELDS for record in result["cold"])
    assert result["random"][0]["rival"] == OURS


def test_rivals_of_the_same_programme_found_the_energy_of_the_core():
    records = report.load()["cold"]
    ours = {(r["example"], r["energy_model"]): r["energy"] for r in records if r["rival"] == OURS}
    for record in records:
        if record["rival"].startswith(("CasADi", "SciPy")):
            assert record["energy"] == pytest.approx(ours[record["example"], record["energy_model"]], rel=1e-6)


def test_tables_of_the_page_are_those_of_the_saved_run():
    page, result = (ROOT / "docs" / "performance.md").read_text(), report.load()
    for name, header, rows in report.sections(result):
        assert f"<!-- {name} -->\n\n{report.text(header, rows)}\n\n<!-- /{name} -->" in page, name
