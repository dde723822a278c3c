"""Fixtures: the first example, solved once."""

from pathlib import Path

import pytest

import fishbone as fb

ROOT = Path(__file__).parent.parent


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
