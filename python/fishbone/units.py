"""Units of printed numbers, and the size below which they are rounding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from fishbone.equilibrium import Equilibrium, Floats
    from fishbone.scenario import Scenario

Quantity: TypeAlias = Literal["length", "curvature", "force", "moment", "energy", "acceleration"]
"""A kind of quantity with a unit."""
SI: dict[Quantity, str] = {
    "length": "m",
    "curvature": "1/m",
    "force": "N",
    "moment": "N m",
    "energy": "J",
    "acceleration": "m/s²",
}
"""The units of a scenario whose material is given in SI units."""
ROUNDING = 1e-14
"""Rounding of a number over its scale: of a length over U, of an energy over R_f/U, of a force over R_f/U²."""


def unit(scenario: Scenario, quantity: Quantity) -> str | None:
    """The unit of a quantity; None where the scenario does not say in which units it is."""
    return SI[quantity] if scenario._inner.is_in_si_units else None  # noqa: SLF001 - of this package


def labelled(scenario: Scenario, words: str, quantity: Quantity) -> str:
    """Words with the unit of a quantity, if the scenario says it."""
    name = unit(scenario, quantity)
    return words if name is None else f"{words} [{name}]"


def scale(equilibrium: Equilibrium, quantity: Quantity) -> float:
    """The scale of a quantity: U, and what R_f and U give."""
    length, energy = equilibrium._inner.scales  # noqa: SLF001 - of this package
    scales: dict[Quantity, float] = {
        "length": length,
        "curvature": 1.0 / length,
        "force": energy / length,
        "moment": energy,
        "energy": energy,
        "acceleration": 0.0,
    }
    return scales[quantity]


def without_rounding(values: Floats, size: float) -> Floats:
    """Numbers with 0 in place of those that are rounding of a size."""
    return np.where(np.abs(values) < ROUNDING * size, 0.0, values)
