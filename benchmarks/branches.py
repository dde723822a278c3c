"""Whether `fishbone.branches` finds every energy level of random searches, and only levels that refinement confirms.

    python benchmarks/branches.py [--count 50] [--guesses 200] [--seed 1]

The scenarios are those of random_poses.py. A random shape has a bend and a rib slope that are sums of five cosines with
random amplitudes and phases, up to the bend of a ring and slopes of a half, root mean square; it does not meet its
supports. Every shape is solved again on a mesh twice as fine. Two energies count as one level if their difference is
less than this refinement changes one of them. A level that one search alone finds is a matter of chance: further
searches of the same kind find others.
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import fishbone as fb
import random_poses
import tables

if TYPE_CHECKING:
    from fishbone import Equilibrium, Scenario

Floats = NDArray[np.float64]
POINTS = 161
SAME_LEVEL = 1e-4
"""Energies that differ by less than this share are one level in any case."""
MESH, NEAR = 2e-2, 3e-2
"""Largest changes by refinement that confirm an equilibrium: relative of the energy, and of the shape, in U."""


def smooth_field(rng: np.random.Generator, size: float) -> Floats:
    """A sum of five cosines with random amplitudes and phases, of this size, root mean square."""
    u = np.linspace(0.0, 1.0, POINTS)
    waves = (rng.normal() * np.cos(k * np.pi * u + rng.uniform(0.0, 2.0 * np.pi)) for k in range(5))
    field = np.sum(list(waves), axis=0)
    scaled: Floats = size * field / np.sqrt(np.mean(field**2))
    return scaled


def random_shape(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Bend, up to that of a ring, and rib slope, up to a half."""
    return smooth_field(rng, rng.uniform(0.0, 2.0 * np.pi)), smooth_field(rng, rng.uniform(0.0, 0.5))


class Level(NamedTuple):
    """An energy on the default mesh and on one twice as fine."""

    coarse: float
    fine: float

    def is_same(self, other: Level) -> bool:
        """Whether the two are one level."""
        known = max(abs(level.fine - level.coarse) for level in (self, other))
        return abs(self.fine - other.fine) <= max(SAME_LEVEL * abs(self.fine), known)


def level(coarse: Equilibrium) -> Level | None:
    """The level of an equilibrium; None where it is unconfirmed on refinement."""
    fine = coarse.refined(2 * (len(coarse.u) - 1))
    if fine is None or abs(fine.energy - coarse.energy) > MESH * abs(coarse.energy):
        return None
    there = np.stack([np.interp(coarse.u, fine.u, component) for component in fine.position.T], axis=1)
    apart = np.linalg.norm(there - coarse.position, axis=1)
    return None if np.max(apart) > NEAR else Level(coarse.energy, fine.energy)


def random_minima(scenario: Scenario, rng: np.random.Generator, guesses: int) -> list[tuple[Equilibrium, int]]:
    """Minima that searches from random shapes find, one of each energy, and how many of the searches end there."""
    found = [fb.solve(scenario, start=random_shape(rng)) for _ in range(guesses)]
    distinct: list[tuple[Equilibrium, int]] = []
    for minimum in sorted((e for e in found if e.status == "converged" and e.stable), key=lambda e: e.energy):
        if not distinct or minimum.energy - distinct[-1][0].energy > SAME_LEVEL * abs(minimum.energy):
            distinct.append((minimum, 1))
        else:
            lowest, times = distinct[-1]
            distinct[-1] = (lowest, times + 1)
    return distinct


def apart(levels: list[tuple[Level, int]]) -> list[tuple[Level, int]]:
    """The distinct levels, and how many searches end at each."""
    distinct: list[tuple[Level, int]] = []
    for one, times in levels:
        same = next((k for k, (other, _) in enumerate(distinct) if one.is_same(other)), None)
        if same is None:
            distinct.append((one, times))
        else:
            distinct[same] = (distinct[same][0], distinct[same][1] + times)
    return distinct


def main() -> None:
    """Prints a line for each scenario, then writes the table of docs/validation.md."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--guesses", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    total = {"levels": 0, "single": 0, "refuted": 0, "missed": 0, "often": 0, "branches": 0, "unconfirmed": 0}
    for index in range(options.count):
        scenario = random_poses.scenario(random_poses.ENERGIES[index % 3], *random_poses.pose(rng))
        began = time.perf_counter()
        branches = fb.branches(scenario)
        took = time.perf_counter() - began
        by_chance = random_minima(scenario, rng, options.guesses)
        levels = [level(b) for b in branches]
        known = [one for one in levels if one is not None]
        true = [(one, times) for one, times in ((level(e), times) for e, times in by_chance) if one is not None]
        lost = [(one.coarse, times) for one, times in true if not any(one.is_same(other) for other in known)]
        doubtful = [b.energy for b, one in zip(branches, levels, strict=True) if one is None]
        distinct = apart(true)
        total["levels"] += len(distinct)
        total["single"] += sum(times == 1 for _, times in distinct)
        total["refuted"] += len(by_chance) - len(true)
        total["missed"] += len(lost)
        total["often"] += sum(times > 1 for _, times in lost)
        total["branches"] += len(branches)
        total["unconfirmed"] += len(doubtful)
        minima = sum(b.stable is not False for b in branches)
        print(
            f"{index:3d} {scenario.to_dict()['energy']:10s} {took:5.1f} s, "
            f"{minima} minima and {len(branches) - minima} saddles; "
            f"random levels {len(distinct)}, minima {len(true)} of {len(by_chance)}, "
            f"missed (energy, searches) {[(round(energy, 3), times) for energy, times in lost]}, "
            f"unconfirmed {np.round(doubtful, 3)}",
            flush=True,
        )
    rows = [
        ["scenarios", str(options.count)],
        ["random searches of each", str(options.guesses)],
        ["levels that the random searches find", str(total["levels"])],
        ["of these found by one search alone", str(total["single"])],
        ["minima of the random searches that are unconfirmed on refinement", str(total["refuted"])],
        ["levels that `branches` misses", str(total["missed"])],
        ["of these found by more than one search", str(total["often"])],
        ["equilibria that `branches` finds", str(total["branches"])],
        ["of these unconfirmed on refinement", str(total["unconfirmed"])],
    ]
    tables.write("branches", tables.table(["", ""], rows))


if __name__ == "__main__":
    main()
