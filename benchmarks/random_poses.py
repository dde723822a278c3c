"""Random clamped poses: how many converge from the automatic guess, in how many iterations and how long.

    python benchmarks/random_poses.py [--count 1000] [--seed 1] [--out benchmarks/results/random_poses.json]

Distance uniform in 0.3–0.9 U, direction uniform in a cone of 60° about +y, rotation axis uniform on the sphere, angle
uniform in 0–70°, V = 0.1 U, the three energies in turn. No pose is discarded.
"""

from __future__ import annotations

import argparse
import json
import platform
from pathlib import Path
from typing import Any

import numpy as np

import fishbone as fb

ENERGIES = ("fishbone", "sadowsky", "wunderlich")
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


def summary(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts, and medians and tails of the converged."""
    converged = [r for r in records if r["status"] == "converged"]
    iterations = np.array([r["iterations"] for r in converged])
    milliseconds = np.array([r["milliseconds"] for r in converged])
    return {
        "poses": len(records),
        "converged": len(converged),
        "converged within 1e-8": sum(r["residual"] <= TOLERANCE for r in converged),
        "local minimum": sum(r["stable"] is True for r in converged),
        "largest residual": max(r["residual"] for r in converged),
        "iterations, median": float(np.median(iterations)),
        "iterations, 99 %": float(np.percentile(iterations, 99)),
        "iterations, most": int(iterations.max()),
        "milliseconds, median": round(float(np.median(milliseconds)), 2),
        "milliseconds, 99 %": round(float(np.percentile(milliseconds, 99)), 2),
    }


def main() -> None:
    """Solves, prints the summary and writes both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    records = solve_all(arguments.count, arguments.seed)
    result = summary(records)
    for name, value in result.items():
        print(f"{name:24} {value}")
    for record in records:
        if record["status"] != "converged":
            print("not converged:", record)
    if arguments.out is not None:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        machine = {"machine": platform.machine(), "system": platform.system(), "threads": 1, "seed": arguments.seed}
        arguments.out.write_text(json.dumps(machine | result, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
