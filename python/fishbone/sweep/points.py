"""The points of a sweep: each a number for every field that is swept."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from fishbone import _core
from fishbone.equilibrium import core_of
from fishbone.errors import InvalidArgument, NoPath
from fishbone.pose import numbers_of
from fishbone.sweep.extra import extra

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from fishbone.scenario import Scenario

    Floats = NDArray[np.float64]

MAX_POINTS = 10_000_000
"""Greatest number of points of a grid, and of numbers drawn for a sample."""
LARGEST = 1e300
"""Greatest number of a range, of a tolerance and of a limit: their differences and pictures do not overflow."""
_GRID, _RANGE = 3, 2
"""Numbers of an axis of a grid, start:stop:n, and of a range of a sample, start:stop."""


class Number(NamedTuple):
    """A number of a scenario."""

    keys: tuple[str | int, ...]
    """The way to it in `Scenario.to_dict()`, such as ("supports", 1, "position", 2)."""
    value: float
    """Its value in the scenario."""
    is_whole: bool
    """Whether the scenario has it as a whole number, as it has counts."""

    def put(self, tables: dict[str, Any], value: float) -> None:
        """Sets the number in the tables of a scenario."""
        table: Any = tables
        for key in self.keys[:-1]:
            table = table[key]
        table[self.keys[-1]] = int(value) if self.is_whole and value.is_integer() else value


class Grid(NamedTuple):
    """All combinations of equally spaced numbers; the last field changes fastest."""

    fields: tuple[str, ...]
    axes: tuple[tuple[float, float, int], ...]
    """First number, last number and count of each field."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of values of each field."""
        return tuple(count for _, _, count in self.axes)

    @property
    def total(self) -> int:
        """Number of points."""
        return math.prod(self.counts)

    @property
    def design(self) -> dict[str, Any]:
        """All that determines the points, as plain data."""
        return {"fields": list(self.fields), "axes": [list(axis) for axis in self.axes]}

    def values(self, first: int, last: int) -> Floats:
        """The points from number `first` to before number `last`, or to the end.

        Shapes: (points, fields).
        """
        places = np.unravel_index(np.arange(first, min(last, self.total)), self.counts)
        return np.column_stack([_along(axis, place) for axis, place in zip(self.axes, places, strict=True)])


class Sample(NamedTuple):
    """Points drawn at random."""

    fields: tuple[str, ...]
    drawn: Floats
    """The numbers of the points, shape (count, fields)."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of points, alone."""
        return self.drawn.shape[:1]

    @property
    def total(self) -> int:
        """Number of points."""
        return len(self.drawn)

    @property
    def design(self) -> dict[str, Any]:
        """All that determines the points, as plain data: a digest, which the random generator's version is part of."""
        digest = hashlib.sha256(np.ascontiguousarray(self.drawn, dtype="<f8").tobytes())
        return {"fields": list(self.fields), "count": self.total, "sha256": digest.hexdigest()}

    def values(self, first: int, last: int) -> Floats:
        """The points from number `first` to before number `last`, or to the end.

        Shapes: (points, fields).
        """
        return self.drawn[first:last]


Points: TypeAlias = Grid | Sample


def points_of(
    scenario: Scenario,
    ranges: Mapping[str, Sequence[float]],
    tolerances: Mapping[str, float],
    sample: int | None,
    seed: int,
) -> Points:
    """The points of the arguments of `sweep`.

    Errors: `NoPath` where the scenario has no such number; `InvalidArgument`.
    """
    _check_fields("ranges", ranges)
    _check_fields("tolerances", tolerances)
    if not ranges and not tolerances:
        raise InvalidArgument("sweep: found no field, allowed one or more")
    fields = (*ranges, *tolerances)
    ways = [number_of(scenario, field).keys for field in fields]
    for way, field in zip(ways, fields, strict=True):
        if ways.count(way) > 1:
            raise InvalidArgument(f"{field}: found twice in the sweep, allowed once")
    if sample is not None:
        return _sample(scenario, ranges, tolerances, sample, seed)
    if tolerances:
        raise InvalidArgument("tolerances: found no number of points, allowed with a sample of so many")
    return _grid(ranges)


def number_of(scenario: Scenario, field: str) -> Number:
    """The number that a field names, as in `supports[1].position[2]`.

    Errors: `NoPath` where the scenario has no such number.
    """
    try:
        # The core knows which fields hold numbers. That other values of the field are invalid is no matter here.
        _core.Path.numbers(core_of(scenario), [(field, 0.0)])
    except NoPath as error:
        if error.reason == "no_number":
            raise
    parts = (part for part in re.split(r"[.\[\]]", field) if part)
    keys = tuple(int(part) if part.isdecimal() else part for part in parts)
    value: Any = scenario.to_dict()
    for key in keys:
        value = value[key]
    return Number(keys, float(value), isinstance(value, int))


def _check_fields(name: str, numbers: object) -> None:
    if not (isinstance(numbers, Mapping) and all(isinstance(field, str) for field in numbers)):
        raise InvalidArgument(f'{name}: found {numbers!r}, allowed numbers by field, as in {{"belt.width": …}}')


def _along(axis: tuple[float, float, int], place: NDArray[np.intp]) -> Floats:
    """The numbers at places of an axis, those of `numpy.linspace`."""
    start, stop, count = axis
    last = max(count - 1, 1)
    return np.where(place == last, stop, place * ((stop - start) / last) + start)


def _grid(ranges: Mapping[str, Sequence[float]]) -> Grid:
    axes = []
    for field, numbers in ranges.items():
        start, stop, count = _numbers(field, numbers, _GRID)
        if not (count >= 1 and float(count).is_integer()):
            raise InvalidArgument(f"{field}: found {count:g} values, allowed a whole number from 1")
        axes.append((start, stop, int(count)))
    grid = Grid(tuple(ranges), tuple(axes))
    if grid.total > MAX_POINTS:
        raise InvalidArgument(f"sweep: found {grid.total} points, allowed up to {MAX_POINTS}")
    return grid


def _sample(
    scenario: Scenario,
    ranges: Mapping[str, Sequence[float]],
    tolerances: Mapping[str, float],
    count: int,
    seed: int,
) -> Sample:
    """A Latin hypercube over the ranges, and uniform draws around the scenario's own numbers."""
    size = len(ranges) + len(tolerances)
    if not (_is_whole(count) and 1 <= count <= MAX_POINTS // size):
        raise InvalidArgument(f"sample: found {count!r}, allowed 1 to {MAX_POINTS // size} with {size} fields")
    if not (_is_whole(seed) and seed >= 0):
        raise InvalidArgument(f"seed: found {seed!r}, allowed a whole number from 0")
    spans = [_numbers(field, numbers, _RANGE) for field, numbers in ranges.items()]
    for field, tolerance in tolerances.items():
        distance = float(numbers_of(field, tolerance, ()))
        if not 0.0 < distance <= LARGEST:
            found = f"found the tolerance {distance:g}"
            raise InvalidArgument(f"{field}: {found}, allowed a positive number up to {LARGEST:g}")
        middle = number_of(scenario, field).value
        spans.append([middle - distance, middle + distance])
    random = np.random.default_rng(seed)
    shares = np.column_stack([_latin(len(ranges), count, random), random.random((count, len(tolerances)))])
    start, stop = np.array(spans).T
    return Sample((*ranges, *tolerances), start * (1.0 - shares) + stop * shares)


def _latin(size: int, count: int, random: np.random.Generator) -> Floats:
    """A Latin hypercube: every one of `count` equal slices of a field has one point.

    Shapes: (count, size).
    """
    if size == 0:
        return np.empty((count, 0))
    drawn: Floats = extra("scipy.stats.qmc").LatinHypercube(size, rng=random).random(count)
    return drawn


def _numbers(field: str, numbers: Sequence[float], count: int) -> list[float]:
    """The numbers of a field, checked."""
    found: list[float] = numbers_of(field, numbers, (None,)).tolist()
    text = ":".join(f"{number:g}" for number in found)
    if len(found) != count:
        raise InvalidArgument(f"{field}: found {text}, allowed start:stop:n in a grid, start:stop in a sample")
    if max(map(abs, found)) > LARGEST:
        raise InvalidArgument(f"{field}: found {text}, allowed numbers up to {LARGEST:g}")
    return found


def _is_whole(number: object) -> bool:
    return isinstance(number, int | np.integer) and not isinstance(number, bool)
