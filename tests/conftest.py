"""Fixtures: the first example, solved once; the planar arch, searched with a small budget, and wholly behind a mark."""

from __future__ import annotations

import functools
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

import fishbone as fb
from fishbone.branches import _Budget, _search

ROOT = Path(__file__).parent.parent
FEW = _Budget(sums=40, perturbed=4, continued=2)
"""Enough for the planar arch: its lowest equilibria, a saddle, and one that passes through itself."""


@pytest.fixture(scope="session", autouse=True)
def control_c() -> None:
    """Ctrl-C as on a terminal: jobs that a shell starts in the background ignore it, and so do their children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def example_file() -> Path:
    return ROOT / "scenarios" / "example1.toml"


@pytest.fixture(scope="session")
def example(example_file: Path) -> fb.Scenario:
    return fb.load(example_file)


@pytest.fixture(scope="session")
def equilibrium(example: fb.Scenario) -> fb.Equilibrium:
    return fb.solve(example)


@pytest.fixture(scope="session")
def out_of_reach(example: fb.Scenario) -> fb.Scenario:
    """Supports farther apart than the belt is long."""
    tables = example.to_dict()
    tables["supports"][1]["position"] = [0.0, 2.0, 0.0]
    return fb.Scenario.from_dict(tables)


@pytest.fixture(scope="session")
def turned() -> fb.Diagram:
    """A planar arch whose end is turned against it: a fold, and a snap."""
    return fb.follow(fb.load(ROOT / "scenarios" / "planar.toml"), {"supports[1].rotation[2]": -1.5})


@pytest.fixture(scope="session")
def arch() -> fb.Scenario:
    """Clamps in line at 0.6 lengths: Euler's elastica is the lowest equilibrium."""
    return fb.load(ROOT / "scenarios" / "planar.toml")


@pytest.fixture(
    scope="session",
    params=[
        pytest.param(functools.partial(_search, budget=FEW), id="few"),
        pytest.param(fb.branches, id="whole", marks=pytest.mark.full),
    ],
)
def search(request: pytest.FixtureRequest) -> Callable[..., list[fb.Equilibrium]]:
    """A search with a small budget, and `fb.branches`: what needs one is tested with both."""
    return request.param


@pytest.fixture(scope="session")
def arches(arch: fb.Scenario, search: Callable[..., list[fb.Equilibrium]]) -> list[fb.Equilibrium]:
    """Its equilibria: a search of some seconds, and one of half a minute."""
    return search(arch)


@pytest.fixture(scope="session")
def mirrored(arch: fb.Scenario) -> fb.Scenario:
    """The same to the other side, on a mesh that is half as fine and takes a third of the time."""
    tables = arch.to_dict()
    tables["solver"] |= {"bulge": [-1.0, 0.0, 0.0], "elements": 40}
    return fb.Scenario.from_dict(tables)


@pytest.fixture(scope="session")
def mirrored_arches(mirrored: fb.Scenario, search: Callable[..., list[fb.Equilibrium]]) -> list[fb.Equilibrium]:
    """Its equilibria."""
    return search(mirrored)
