"""Limits to the figures of a sweep, and the units in which they may be given."""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fishbone.errors import InvalidArgument
from fishbone.sweep.points import LARGEST
from fishbone.sweep.rows import ALONG, WORDS

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    from fishbone.scenario import Scenario
    from fishbone.sweep.points import Floats
    from fishbone.units import Quantity

UNITS: dict[Quantity, dict[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "curvature": {"1/m": 1.0, "1/mm": 1e3},
    "force": {"N": 1.0, "mN": 1e-3},
    "moment": {"N m": 1.0, "N mm": 1e-3, "mN m": 1e-3},
    "energy": {"J": 1.0, "mJ": 1e-3},
}
"""The units of a limit, each in that of `fishbone.units.SI`."""
_FORM = "allowed a figure, < or > and a number, as in bend_radius.area.p99>0.002"
_LIMIT = re.compile(r"\s*([^<>\s]+)\s*([<>])\s*([-+.\deE]+)\s*(.*?)\s*")


class Limit(NamedTuple):
    """A limit that a figure must be above or below."""

    column: str
    """Name of the figure."""
    sign: Literal["<", ">"]
    value: float
    """The limit, in the unit of the scenario."""

    def passes(self, figures: Floats) -> NDArray[np.bool_]:
        """Whether figures are within the limit; those that are NaN are not.

        Shapes: that of `figures`.
        """
        return figures < self.value if self.sign == "<" else figures > self.value

    def __str__(self) -> str:
        return f"{self.column} {self.sign} {self.value:g}"


def limit_of(scenario: Scenario, text: str) -> Limit:
    """The limit of a text such as "bend_radius.area.p99 > 2 mm".

    Errors: `InvalidArgument` where the text is no limit, its column never has numbers, or its unit is not one of the
    figure.
    """
    found = _LIMIT.fullmatch(str(text))
    try:
        column, sign, number, unit = found.groups() if found is not None else ("", "", "", "")
        value = float(number)
    except ValueError:
        raise InvalidArgument(f"limit: found {text!r}, {_FORM}") from None
    if abs(value) > LARGEST:
        raise InvalidArgument(f"limit: found {number}, allowed a number up to {LARGEST:g}")
    if column in WORDS or column.partition(".")[0] in ALONG:
        raise _no_numbers(column)
    return Limit(column, "<" if sign == "<" else ">", value * _factor(scenario, column, unit))


def check_column(name: str, names: Collection[str]) -> None:
    """Refuses a column that is not one of a table.

    Errors: `InvalidArgument`, with the nearest of the names.
    """
    if name not in names:
        [nearest] = difflib.get_close_matches(str(name), names, n=1, cutoff=0.0)
        raise InvalidArgument(f"{name}: found no such column, allowed those of the table, as {nearest}")


def numbers_in(column: str, values: NDArray[Any]) -> Floats:
    """The values of a column as numbers, NaN where there is none.

    Shapes: that of `values`.
    Errors: `InvalidArgument` where they are no numbers.
    """
    is_empty = values.dtype == object and all(value is None for value in values)
    if not (is_empty or np.issubdtype(values.dtype, np.number)):
        raise _no_numbers(column)
    return values.astype(np.float64)


def _no_numbers(column: str) -> InvalidArgument:
    return InvalidArgument(f"limit: found the column {column}, allowed one of numbers")


def describe_yield(passing: NDArray[np.bool_], limit: str) -> str:
    """The share of the points that are within a limit, in words."""
    return f"yield {passing.mean():.2%}, {passing.sum()} of {len(passing)} points converged with {limit}"


def quantity_of(column: str) -> Quantity | None:
    """The kind of quantity of a figure; None of a figure without a unit, and of one whose unit is not known."""
    name = re.sub(r"\[\d+\]", "", column)
    patterns: dict[Quantity, str] = {
        "length": r"(bend_radius|least_bend_radius|least_spine_radius|highest_point)\..*|.*\.u|supports\.(at|position)"
        r"|belt\.(width|thickness|segments\.length|material\.thickness|layers\.thickness)",
        "curvature": r"rib_margin\.value",
        "force": r"(supports|links)\.force\..*",
        "moment": r"supports\.moment\..*",
        "energy": r"energy|elastic_energy",
    }
    return next((quantity for quantity, pattern in patterns.items() if re.fullmatch(pattern, name)), None)


def _factor(scenario: Scenario, column: str, unit: str) -> float:
    """The size of a unit in the unit of the scenario."""
    if not unit:
        return 1.0
    if not scenario._inner.is_in_si_units:  # noqa: SLF001 - of this package
        raise InvalidArgument(f"limit: found the unit {unit!r}, allowed none: the scenario does not say in which it is")
    quantity = quantity_of(column)
    units = {} if quantity is None else UNITS[quantity]
    if unit not in units:
        raise InvalidArgument(f"limit: found the unit {unit!r} of {column}, allowed {', '.join(units) or 'none'}")
    return units[unit]
