"""Random scenarios that some shape of the belt meets, by kind; seeds fixed.

    python benchmarks/random_scenarios.py [--kinds link points] [--count 200] [--seed 1]

Each is read off a random developable strip: bend and rib slope are smooth random functions of the arc length, the ribs
at both ends are square, and the supports and links hold the places of that strip. So every scenario is feasible, and a
solve that does not converge has failed. The strip is integrated here, and shares no code with the solver.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

import fishbone as fb

if TYPE_CHECKING:
    from collections.abc import Callable

Array = npt.NDArray[np.float64]
Json = dict[str, Any]

ENERGIES = ("fishbone", "sadowsky", "wunderlich")
STEPS = 2000
WAVES = 3
# Largest |β'| V/2 of a strip: ribs cross at 1.
STEEPEST = 0.6


@dataclass(frozen=True)
class Strip:
    """A developable strip of length 1: arc lengths, positions and frames (columns ξ, η, ζ)."""

    width: float
    u: Array
    position: Array
    frame: Array

    def at(self, u: float) -> int:
        """Number of the node nearest to an arc length."""
        return int(np.abs(self.u - u).argmin())


def random_strip(rng: np.random.Generator, geodesic: float = 0.0, bent: float = 1.0) -> Strip:
    """A strip of constant in-plane curvature with random smooth bend, `bent` times as large, and rib slope.

    Its rates of rotation are (κ_g, −β ω_ζ, ω_ζ).
    """
    width = rng.uniform(0.02, 0.2)
    u = np.linspace(0.0, 1.0, STEPS + 1)
    orders = np.arange(WAVES + 1)[:, None]
    bend = bent * (rng.normal(0.0, 3.0, WAVES + 1) / (1.0 + 0.5 * orders[:, 0])) @ np.cos(np.pi * orders * u)
    slope = rng.normal(0.0, 1.0, WAVES) @ np.sin(np.pi * orders[1:] * u)
    rate = np.abs(np.gradient(slope, u)).max()
    slope *= min(1.0 / np.abs(slope).max(), STEEPEST * 2.0 / width / rate) * rng.uniform(0.0, 1.0)
    middle = 0.5 * (u[1:] + u[:-1])
    bend, slope = np.interp(middle, u, bend), np.interp(middle, u, slope)
    rates = np.stack([np.full_like(bend, geodesic), -slope * bend, bend], axis=1)
    turns, halves = (Rotation.from_rotvec(rates / STEPS / parts).as_matrix() for parts in (1.0, 2.0))
    frame, position = np.empty((STEPS + 1, 3, 3)), np.zeros((STEPS + 1, 3))
    frame[0] = np.eye(3)
    for k in range(STEPS):
        position[k + 1] = position[k] + (frame[k] @ halves[k])[:, 1] / STEPS
        frame[k + 1] = frame[k] @ turns[k]
    return Strip(width, u, position, frame)


def held(strip: Strip, node: int, *, with_frame: bool) -> Json:
    """A support that holds a node of the strip where it is."""
    place = {0: "start", STEPS: "end"}.get(node, float(strip.u[node]))
    support: Json = {"at": place, "position": strip.position[node].tolist()}
    if with_frame:
        support["rotation"] = Rotation.from_matrix(strip.frame[node]).as_rotvec().tolist()
    return support


def tables(strip: Strip, energy: str, **parts: list[Json]) -> Json:
    """The tables of a scenario of a strip."""
    belt = {"width": strip.width, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    return {"energy": energy, "belt": belt, **parts}


def link(rng: np.random.Generator, energy: str) -> Json:
    """Two clamps and a link."""
    strip = random_strip(rng)
    ends = [held(strip, node, with_frame=True) for node in (0, STEPS)]
    a, b = (strip.at(u) for u in np.sort(rng.uniform(0.05, 0.95, 2)) + np.array([-0.03, 0.03]))
    offset = (strip.position[b] - strip.position[a]).tolist()
    tie = {"from": float(strip.u[a]), "to": float(strip.u[b]), "offset": offset}
    return tables(strip, energy, supports=ends, links=[tie])


def points(rng: np.random.Generator, energy: str) -> Json:
    """Two ends, each clamped or pinned, and one to six points held in between."""
    strip = random_strip(rng)
    count = int(rng.integers(1, 7))
    inner = (np.arange(count) + rng.uniform(0.2, 0.8, count)) / count
    start, end = (held(strip, node, with_frame=bool(rng.integers(0, 2))) for node in (0, STEPS))
    between = [held(strip, strip.at(u), with_frame=False) for u in inner]
    return tables(strip, energy, supports=[start, *between, end])


KINDS: dict[str, Callable[[np.random.Generator, str], Json]] = {"link": link, "points": points}


def scenarios(kind: str, count: int, seed: int) -> list[Json]:
    """The tables of random scenarios of a kind."""
    rng = np.random.default_rng([seed, sorted(KINDS).index(kind)])
    return [KINDS[kind](rng, ENERGIES[index % len(ENERGIES)]) for index in range(count)]


def main() -> None:
    """One line a kind, and one a failure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=sorted(KINDS), default=sorted(KINDS))
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    for kind in arguments.kinds:
        found = [fb.solve(fb.Scenario.from_dict(one)) for one in scenarios(kind, arguments.count, arguments.seed)]
        for index, equilibrium in enumerate(found):
            if equilibrium.status != "converged":
                print(f"  {kind} {index}: {equilibrium.message}")
        milliseconds = 1e3 * np.array([equilibrium.solve_time for equilibrium in found])
        iterations = [equilibrium.iterations for equilibrium in found]
        print(
            f"{kind}: {dict(Counter(equilibrium.status for equilibrium in found))}, "
            f"iterations {np.median(iterations):.0f} (99 %: {np.percentile(iterations, 99):.0f}), "
            f"ms {np.median(milliseconds):.1f} (99 %: {np.percentile(milliseconds, 99):.0f})"
        )


if __name__ == "__main__":
    main()
