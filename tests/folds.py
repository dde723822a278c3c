"""The folds of the planar elastica between two clamps, as tests/planar.py finds them."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

import planar
from helpers import Array
from planar import TURN, Planar


@dataclass(frozen=True)
class Expected:
    """The nth fold along a path, and in-plane negative modes before and after it.

    From the arch (mode 1) or the S (mode 2) at (0, d), the end first turned, then moved.
    """

    name: str
    distance: float
    mode: int
    turned: float
    direction: tuple[float, float, float]
    nth: int
    parameter: float
    energy: float
    bend: float
    height: float
    modes: tuple[int, int]

    @property
    def along(self) -> Array:
        return np.array(self.direction)

    @functools.cached_property
    def start(self) -> Planar:
        return turned(self.distance, self.mode, self.turned)

    @functools.cached_property
    def fold(self) -> planar.Fold:
        return next(itertools.islice(planar.folds(self.start, self.along), self.nth, None))

    @property
    def component(self) -> int:
        """Index of the component of the pose that varies."""
        return int(np.flatnonzero(self.direction)[0])


@functools.cache
def turned(distance: float, mode: int, angle: float) -> Planar:
    start = planar.buckled(distance, mode)
    return planar.at_parameter(start, math.copysign(1.0, angle) * TURN, abs(angle)) if angle else start


FORTH, BACK = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
LEFT, RIGHT = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
FOLDS: list[Expected] = [
    Expected(
        "arch 0.6 turned back", 0.6, 1, 0.0, RIGHT, 0, -1.1230897421, 26.34425543, -10.43716776, 0.243420483, (0, 1)
    ),
    Expected(
        "arch 0.6 turned back and on",
        0.6,
        1,
        0.0,
        RIGHT,
        1,
        1.5263226099,
        52.84649202,
        -14.77111455,
        0.171523494,
        (1, 2),
    ),
    Expected(
        "arch 0.8 turned back", 0.8, 1, 0.0, RIGHT, 0, -0.7995539543, 12.52151194, -7.09918455, 0.186340917, (0, 1)
    ),
    Expected(
        "arch 0.8 turned back and on",
        0.8,
        1,
        0.0,
        RIGHT,
        1,
        1.0296537611,
        25.01096663,
        -10.03298125,
        0.131945789,
        (1, 2),
    ),
    Expected(
        "arch 0.9 turned back", 0.9, 1, 0.0, RIGHT, 0, -0.5648470832, 6.11099070, -4.92841126, 0.136461031, (0, 1)
    ),
    Expected(
        "arch 0.9 turned back and on",
        0.9,
        1,
        0.0,
        RIGHT,
        1,
        0.7143550089,
        12.18881404,
        -6.96137505,
        0.096756418,
        (1, 2),
    ),
    Expected(
        "arch 0.6 at −0.5 forth", 0.6, 1, -0.5, FORTH, 0, 0.5592130313, 9.61812728, -1.01880138, 0.559213031, (0, 1)
    ),
    Expected(
        "arch 0.6 at −0.5 back", 0.6, 1, -0.5, BACK, 0, -0.3278973941, 16.30012588, -6.91843994, 0.093287006, (0, 1)
    ),
    Expected(
        "arch 0.8 at −0.5 forth", 0.8, 1, -0.5, FORTH, 0, 0.4494499890, 4.96074186, -0.70597035, 0.449449989, (0, 1)
    ),
    Expected(
        "arch 0.8 at −0.5 back", 0.8, 1, -0.5, BACK, 0, -0.1975830830, 9.43424223, -5.75279293, 0.103887200, (0, 1)
    ),
    Expected(
        "arch 0.9 at −0.5 forth", 0.9, 1, -0.5, FORTH, 0, 0.3387686428, 2.75220074, -0.51665622, 0.338768643, (0, 1)
    ),
    Expected(
        "arch 0.9 at −0.5 back", 0.9, 1, -0.5, BACK, 0, -0.0519346299, 5.73765739, -4.72920650, 0.116350658, (0, 1)
    ),
    Expected(
        "arch 0.6 at −1 forth", 0.6, 1, -1.0, FORTH, 0, 0.5702059023, 12.35662416, -1.12844212, 0.570205902, (0, 1)
    ),
    Expected(
        "arch 0.6 at −1 back", 0.6, 1, -1.0, BACK, 0, -0.0682497576, 24.89991685, -10.00481165, 0.214312386, (0, 1)
    ),
    Expected("S 0.6 forth", 0.6, 2, 0.0, FORTH, 0, 0.6120219281, 23.47175389, -2.57422293, 0.612021928, (1, 2)),
    Expected("S 0.8 forth", 0.8, 2, 0.0, FORTH, 0, 0.4796143271, 10.82315051, -1.71595989, 0.479614327, (1, 2)),
    Expected("S 0.9 forth", 0.9, 2, 0.0, FORTH, 0, 0.3544092719, 5.22157306, -1.18295899, 0.354409272, (1, 2)),
]
