"""The start of the core's own search (its equilibrium/guess.rs) for a straight belt between two clamps, in NumPy.

A plane arch over a uniform turn from frame to frame, of the height at which its ends are nearest to the clamps. It is
found on a fine grid here and by a search in the core, so that the two starts differ by less than 1e-3.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from speed.problem import Floats, Pose

SAMPLES = 64
HEIGHTS = np.linspace(0.0, 2.4, 2401)
MISS = 10.0 * (2.0 * np.pi) ** 2
BULGE = 100.0


def bends(pose: Pose, u: Floats) -> Floats:
    """The bend ω_ζ of the arch at arc lengths in U, bulging to +x; its rib slope is 0."""
    turn, amplitude = min(_ways(pose))[1:]
    return np.asarray(turn - 2.0 * np.pi * amplitude * np.cos(2.0 * np.pi * u))


def _ways(pose: Pose) -> list[tuple[float, float, float]]:
    """Cost, turn and amplitude of the arches to either side, by the shorter and the longer way round."""
    angle = float(np.linalg.norm(pose.rotation))
    gaps = [pose.rotation]
    if angle > np.pi / 2.0:
        gaps.append(pose.rotation * (1.0 - 2.0 * np.pi / angle))
    ways = []
    for gap, side in product(gaps, (1.0, -1.0)):
        towards = side * Rotation.from_rotvec(0.5 * gap).as_matrix()[0, 0]
        if towards < -0.5:
            continue
        misses = _misses(gap[2], side * HEIGHTS, pose.position)
        best = int(np.argmin(misses))
        bent = gap[2] ** 2 + 0.5 * (2.0 * np.pi * HEIGHTS[best]) ** 2
        ways.append((bent + MISS * misses[best] - BULGE * towards, gap[2], side * HEIGHTS[best]))
    return ways


def _misses(turn: float, amplitudes: Floats, chord: Floats) -> Floats:
    """Distances of the arches' ends from the clamp."""
    u = (np.arange(SAMPLES) + 0.5) / SAMPLES
    angles = turn * u - amplitudes[:, None] * np.sin(2.0 * np.pi * u)
    reach = np.stack([-np.sin(angles).mean(axis=1), np.cos(angles).mean(axis=1), 0.0 * amplitudes], axis=1)
    return np.asarray(np.linalg.norm(reach - chord, axis=1))
