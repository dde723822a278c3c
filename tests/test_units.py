"""Numbers that people read have units where the scenario says them, and rounding is no result."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rich.console import Console

import fishbone as fb
from conftest import ROOT
from fishbone import chart, cli, plot, report

if TYPE_CHECKING:
    from pathlib import Path


def printed(subject: Any) -> str:
    console = Console(width=160, highlight=False)
    with console.capture() as capture:
        console.print(subject)
    return capture.get()


@pytest.fixture(scope="module")
def cantilever() -> fb.Equilibrium:
    return fb.solve(fb.load(ROOT / "scenarios" / "cantilever.toml"), strict=True)


@pytest.fixture(scope="module")
def planar() -> fb.Equilibrium:
    return fb.solve(fb.load(ROOT / "scenarios" / "planar.toml"), strict=True)


def test_the_table_has_the_units_of_a_material_in_si_units(cantilever: fb.Equilibrium) -> None:
    out = printed(report.report(cantilever))
    for pattern in (
        r"energy +-5\.23\d*e-05 +J",
        r"least bend radius, on the spine +[\d.]+ +m, at u = ",
        r"highest point, u = [\d.]+ \[m\]",
        r"free end \[m\]",
        r"gravity \[m/s²\]",
        r"force on the belt, start \[N\]",
        r"moment on the belt, start \[N m\]",
    ):
        assert re.search(pattern, out), pattern
    several = printed(report.report_all([cantilever, cantilever]))
    for unit in ("[J]", "[m]", "[N]"):
        assert unit in several


def test_the_table_has_no_units_where_the_scenario_does_not_say_them(planar: fb.Equilibrium) -> None:
    for out in (printed(report.report(planar)), printed(report.report_all([planar]))):
        assert "[" not in out
        assert not re.search(r"\d +(J|m)\b", out)


def test_pictures_have_the_units_on_their_axes(cantilever: fb.Equilibrium, planar: fb.Equilibrium) -> None:
    def labels(shape: fb.Equilibrium) -> str:
        figure = plot.views(shape)
        return " ".join(f"{axes.get_xlabel()} {axes.get_ylabel()}" for part in figure.subfigs for axes in part.axes)

    assert {"u [m]", "y [m]", "[1/m]"} <= set(re.findall(r"[uy] \[m\]|\[1/m\]", labels(cantilever)))
    assert "[m]" not in labels(planar)
    assert "u [length]" in labels(planar)
    path = fb.follow(cantilever, {"loads.gravity[0]": -9.0}, branches=1, states=5)
    found = [axes.get_ylabel() for axes in plot.diagram(path).axes]
    assert found == [
        "energy [J]",
        "height [m]",
        "|force| of supports[0] [N]",
        "tightest bend\n[1/m]",
        "rib margin\n[1/m]",
    ]
    assert "energy [J]" in printed(report.report_diagram(path))


def test_rounding_is_printed_as_zero(planar: fb.Equilibrium) -> None:
    """The moments of a planar shape in its plane, and all of a flat strip."""
    assert report.row(np.array([-1e-17, 6.6e-128, -0.0]), size=1.0) == ["0.0000", "0.0000", "0.0000"]
    assert report.row(np.array([-0.0, 3e-7, 1e-25])) == ["0", "3.0000e-07", "0"]
    tables = planar.scenario.to_dict()
    tables["supports"] = [tables["supports"][0]]
    flat = fb.solve(fb.Scenario.from_dict(tables))
    for shape in (planar, flat):
        numbers = re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?", printed(report.report(shape)).split("world axes")[1])
        assert all(float(number) == 0.0 or abs(float(number)) > 1e-12 for number in numbers), numbers
        assert not [number for number in numbers if number.startswith("-") and float(number) == 0.0]


def test_rounding_is_drawn_as_a_line() -> None:
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict()
    tables["supports"] = [tables["supports"][0]]
    flat = fb.solve(fb.Scenario.from_dict(tables))
    angle, bend = plot.views(flat).subfigs[2].axes
    assert np.ptp(angle.get_ylim()) >= 1e-6
    assert np.ptp(bend.get_ylim()) >= chart.NOISE
    path = fb.follow(fb.load(ROOT / "scenarios" / "planar.toml"), {"supports[1].position[1]": 0.65}, branches=1)
    [margin] = [axes for axes in plot.diagram(path).axes if axes.get_ylabel().startswith("rib margin")]
    # 2/V in every state.
    assert np.ptp(path.branches[0].rib_margin) < 1e-9
    assert np.ptp(margin.get_ylim()) >= chart.NOISE


def test_a_range_that_begins_at_zero_is_printed_as_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict()
    tables["solver"]["snap_size"] = 20.0
    path = tmp_path / "a.json"
    path.write_text(json.dumps(tables), "utf-8")
    assert cli.main(["solve", str(path)]) == 2
    assert "from 0 to 10" in capsys.readouterr().err
