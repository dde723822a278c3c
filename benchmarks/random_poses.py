"""Random clamped poses: convergence from the automatic guess, iterations and times.

    python benchmarks/random_poses.py [--count 1000] [--seeds 1 2 3 4 5]

Distance uniform in 0.3–0.9 U, direction uniform in a cone of 60° about +y, rotation axis uniform on the sphere, angle
uniform in 0–70°, V = 0.1 U, the three energies in turn. No pose is discarded.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import fishbone as fb
import tables
from cases import ENERGIES

TOLERANCE = 1e-8


def unit(cosine: float, azimuth: float) -> np.ndarray:
    """The unit vector at an angle, given by its cosine, from +y."""
    sine = np.sqrt(1.0 - cosine**2)
    return np.array([sine * np.cos(azimuth), cosine, sine * np.sin(azimuth)])


def pose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation vector of the end."""
    distance = rng.uniform(0.3, 0.9)
    direction = unit(rng.uniform(np.cos(np.radians(60.0)), 1.0), rng.uniform(0.0, 2.0 * np.pi))
    axis = unit(rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2.0 * np.pi))
    return distance * direction, np.radians(rng.uniform(0.0, 70.0)) * axis


def scenario(energy: str, position: np.ndarray, rotation: np.ndarray) -> fb.Scenario:
    """The belt of the source's examples with its end at a pose."""
    end = {"at": "end", "position": position.tolist(), "rotation": rotation.tolist()}
    start = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
    belt = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
    return fb.Scenario.from_dict({"energy": energy, "belt": belt, "supports": [start, end]})


def solve_all(count: int, seed: int) -> list[dict[str, Any]]:
    """One record a pose."""
    rng = np.random.default_rng(seed)
    records = []
    for index in range(count):
        energy = ENERGIES[index % len(ENERGIES)]
        position, rotation = pose(rng)
        equilibrium = fb.solve(scenario(energy, position, rotation))
        records.append(
            {
                "index": index,
                "energy_model": energy,
                "status": equilibrium.status,
                "residual": max(equilibrium.residuals),
                "stable": equilibrium.stable,
                "energy": equilibrium.energy,
                "iterations": equilibrium.iterations,
                "milliseconds": 1e3 * equilibrium.solve_time,
            }
        )
    return records


def summary(records: list[dict[str, Any]]) -> dict[str, str]:
    """Counts of all, and medians and tails of the converged."""
    converged = [r for r in records if r["status"] == "converged"]
    iterations, milliseconds = (np.array([r[key] for r in converged]) for key in ("iterations", "milliseconds"))
    return {
        "poses": str(len(records)),
        "converged, all residuals ≤ 1e−8": str(sum(r["residual"] <= TOLERANCE for r in converged)),
        "not converged": str(len(records) - len(converged)),
        "local minimum": str(sum(r["stable"] is True for r in converged)),
        "iterations: median, 99 %, most": ", ".join(
            f"{value:.0f}" for value in (np.median(iterations), np.percentile(iterations, 99), iterations.max())
        ),
        "time [ms]: median, 99 %": ", ".join(
            f"{value:.1f}" for value in (np.median(milliseconds), np.percentile(milliseconds, 99))
        ),
    }


def main() -> None:
    """Solves and writes the table of docs/validation.md; one line for each pose that did not converge."""
    parser = argparse.ArgumentParser(description="Random clamped poses.")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    arguments = parser.parse_args()
    columns = {}
    for seed in arguments.seeds:
        records = solve_all(arguments.count, seed)
        columns[f"seed {seed}"] = summary(records)
        for record in records:
            if record["status"] != "converged":
                print("not converged:", record)
    names = next(iter(columns.values()))
    rows = [[name, *(column[name] for column in columns.values())] for name in names]
    tables.write("random poses", tables.table(["", *columns], rows))


if __name__ == "__main__":
    main()
