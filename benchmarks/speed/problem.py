"""Input and output of every rival; the poses of the warm updates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias, cast, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fishbone as fb
from fishbone.names import EnergyModel
from tables import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

Floats = NDArray[np.float64]
Energy: TypeAlias = EnergyModel

EXAMPLES = ("example1", "example2")
TRACKED = (*EXAMPLES, "curved")
"""Scenarios whose end goes along a path: straight boards, and one that is an arc."""
ENERGIES: tuple[Energy, ...] = get_args(EnergyModel)
LENGTH, WIDTH = 1.0, 0.1
SHEET = {"thickness": 7e-4, "poisson": 0.34}
"""What only `shell` asks for: the source's sheet."""
TOLERANCE = 1e-8
WAVES = 3
"""Harmonics of the path."""
TRANSLATION, ROTATION = 0.05, 0.2
"""Largest distance of the path from the example's end pose: U, rad."""


@dataclass(frozen=True)
class Pose:
    """Where the belt ends: position [U] and rotation vector [rad], (3,) each; it starts at the natural pose."""

    position: Floats
    rotation: Floats


@dataclass(frozen=True)
class Answer:
    """The answer of a rival: whether it converged, its time, its iterations and the energy of its shape."""

    converged: bool
    seconds: float
    iterations: int
    energy: float


class Rival(Protocol):
    """A way of solving for the belt between two clamps, made for one energy and one mesh before the clock starts."""

    def cold(self, pose: Pose) -> Answer:
        """From the rival's own guess, which the clock leaves out where it is not part of the solver."""

    def warm(self, pose: Pose) -> Answer:
        """From the last answer of the rival."""

    def curve(self) -> tuple[Floats, Floats]:
        """Positions and tangents of the last cold answer, (n, 3) each, at equal distances from the start to the end."""


def scenario(energy: Energy, elements: int, pose: Pose) -> fb.Scenario:
    """The belt of the examples with its end at a pose."""
    end = {"at": "end", "position": pose.position.tolist(), "rotation": pose.rotation.tolist()}
    return fb.Scenario(
        energy=energy,
        belt={"width": WIDTH, "rigidity": 1.0, "segments": [{"kind": "straight", "length": LENGTH}]} | SHEET,
        supports=[{"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}, end],
        solver={"elements": elements, "tolerance": TOLERANCE},
    )


def end_pose(example: str) -> Pose:
    """The end pose of a shipped example."""
    end = fb.load(ROOT / "scenarios" / f"{example}.toml").to_dict()["supports"][1]
    return Pose(np.array(end["position"]), np.array(end["rotation"]))


def path(example: str, count: int) -> Iterator[Pose]:
    """A smooth closed path of end poses around that of a scenario, through it at first and at last; always the same.

    Each component is a sum of a few sines of falling amplitude, which starts and ends at 0.
    """
    rng = np.random.default_rng(TRACKED.index(example))
    waves = np.arange(1, WAVES + 1)
    amplitudes = rng.uniform(-1.0, 1.0, (6, WAVES)) / waves
    phases = rng.uniform(0.0, 2.0 * np.pi, (6, WAVES))
    turns = 2.0 * np.pi * np.linspace(0.0, 1.0, count)[:, None, None]
    strayed = np.sum(amplitudes * (np.sin(waves * turns + phases) - np.sin(phases)), axis=2)
    shifts, vectors = np.split(strayed, 2, axis=1)
    base = end_pose(example)
    frame = Rotation.from_rotvec(base.rotation)
    for shift, vector in zip(_up_to(TRANSLATION, shifts), _up_to(ROTATION, vectors), strict=True):
        turned = Rotation.from_rotvec(vector) * frame
        yield Pose(base.position + shift, cast("Floats", turned.as_rotvec()))


def _up_to(most: float, vectors: Floats) -> Floats:
    """Vectors scaled alike, the longest to the length given."""
    return np.asarray(vectors * (most / np.max(np.linalg.norm(vectors, axis=1))))
