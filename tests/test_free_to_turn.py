"""Belts under load that may turn about a line, or that buckle along slanted ribs, are decided."""

from __future__ import annotations

import math
from typing import Any

import pytest

import fishbone as fb
from helpers import ORIGIN, Json, belt, numbers, solve, support

PIN: Json = {"at": "end", "position": [0.0, "free", 0.0]}
EULER = math.pi**2


def loaded(supports: list[Json], *, force: float = 0.0, weight: Any = None, **options: Any) -> fb.Equilibrium:
    """A strip along y with a force along it at its end, or with a weight."""
    tables = belt(supports, **options)
    if force:
        tables["loads"] = {"points": [{"at": "end", "force": [0.0, force, 0.0]}]}
    if weight is not None:
        tables["belt"]["density"] = 1.0
        tables["loads"] = {"gravity": numbers(weight)}
    return solve(tables)


@pytest.mark.parametrize("force", [5.0, -0.9 * EULER, -1.1 * EULER])
def test_strut_between_pins_is_decided_though_it_may_turn_about_its_chord(force: float) -> None:
    """Euler: it buckles at π²; the lowest mode but for the turning is ω² = k² (k² + force) with k = π."""
    found = loaded([support("start", ORIGIN), dict(PIN)], force=force)
    assert found.stable
    modes = [mode.eigenvalue for mode in found.modes(2)]
    assert modes[0] == 0.0
    if force > -EULER:
        assert abs(found.bend).max() < 1e-9
        assert modes[1] == pytest.approx(EULER * (EULER + force), rel=2e-3)
    else:
        assert abs(found.bend).max() > 0.5


@pytest.mark.parametrize("weight", [9.0, -9.0])
def test_weight_along_the_chord_of_pins_is_decided(weight: float) -> None:
    """Compressed by its own weight a strut between pins buckles at 18.57."""
    found = loaded([support("start", ORIGIN), dict(PIN)], weight=(0.0, weight, 0.0))
    assert found.stable
    assert found.modes(1)[0].eigenvalue == 0.0


@pytest.mark.parametrize("weight", [22.0, 23.0])
def test_strip_on_edge_beyond_buckling_leaves_its_flat_shape(weight: float) -> None:
    """Narrow strips on edge buckle at 21.491; at 21 the flat shape is stable."""
    clamp = [support("start", ORIGIN, ORIGIN)]
    assert abs(loaded(clamp, weight=(0.0, 0.0, -21.0), width=0.02).bend).max() < 1e-9
    found = loaded(clamp, weight=(0.0, 0.0, -weight), width=0.02)
    assert found.stable
    assert found.energy < -1e-5
    assert abs(found.bend).max() > 1e-2
