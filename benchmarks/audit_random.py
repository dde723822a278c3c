"""Solves random scenarios of 14 kinds, audits every result, and writes the table of docs/validation.md.

    python benchmarks/audit_random.py [--kinds link points] [--count 3200] [--seed 1] [--out records.jsonl]

All scenarios are feasible. A converged result is false where the audit, which shares no code with the solver, finds a
claim that does not hold, or where the energy on a uniform mesh of four times as many elements is farther away than is
allowed. A scenario in millimetres is solved in metres, too.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import fishbone as fb
import tables
from audit import HONESTY, LEAST_ERROR, failures
from audit_model import Board
from random_scenarios import KINDS, scaled, scenario

Json = dict[str, Any]

FINER = 4
MOST = 20_000
"""Greatest number of elements."""
ACCURACY = 1e-3
NOTHING = 1e-7
"""An energy that is nothing but rounding, in R_f/U."""
MILLIMETRE = 1e-3
TOTAL = 3200
SEED = 1


def audited(kind: str, index: int, seed: int) -> Json:
    """What becomes of one scenario."""
    made = scenario(kind, index, seed)
    found = fb.solve(fb.Scenario.from_dict(made))
    record: Json = {
        "kind": kind,
        "index": index,
        "energy_model": found.energy_model,
        "status": found.status,
        "message": found.message,
        "warnings": found.warnings,
        "stable": found.stable,
        "elements": len(found.u) - 1,
        "iterations": found.iterations,
        "milliseconds": 1e3 * found.solve_time,
    }
    if found.status == "converged":
        record["finer"] = finer(made, found)
        record["failures"] = failures(made, found.to_dict())
        if beyond(record, "accuracy"):
            record["failures"].append(f"energy on a finer mesh: {record['finer']}")
        if kind == "units":
            record["failures"] += in_metres(made, found)
    return record


def finer(made: Json, found: fb.Equilibrium) -> Json | None:
    """Change of the energy on a mesh four times as fine, and what is allowed, relative; None where none is found.

    By the estimates, the change that the errors of both meshes make is allowed. `fishbone` and `sadowsky` have minima
    next to each other that differ in where ribs turn over; for them the accuracy that was asked for is allowed, or what
    the result warns of.
    """
    fine = found.refined(min(FINER * (len(found.u) - 1), MOST))
    if fine is None or fine.error is None or found.error is None:
        return None
    board = Board(made)
    scale = max(abs(found.energy), abs(found.elastic_energy), NOTHING * board.sheet[0] / board.length)
    estimates = max(LEAST_ERROR, HONESTY * float(np.nansum([found.error.energy, fine.error.energy])))
    stated = np.nanmax([ACCURACY, *found.error])
    return {
        "change": abs(found.energy - fine.energy) / scale,
        "estimates": estimates,
        "accuracy": estimates if found.energy_model == "wunderlich" else max(estimates, stated),
    }


def beyond(record: Json, allowed: str) -> bool:
    """Whether the energy changes by more than is allowed on a finer mesh."""
    return record["finer"] is not None and record["finer"]["change"] > record["finer"][allowed]


def in_metres(made: Json, found: fb.Equilibrium) -> list[str]:
    """The same scenario in other units has the same answer, or a minimum next to it: see `finer`."""
    other = fb.solve(fb.Scenario.from_dict(scaled(made, MILLIMETRE, 1.0)))
    if other.status != found.status:
        return [f"in metres: {other.status}"]
    allowed = LEAST_ERROR if found.energy_model == "wunderlich" else ACCURACY
    if np.isclose(other.energy, MILLIMETRE * found.energy, rtol=allowed):
        return []
    return [f"in metres: {other.energy:.6g} J in place of {MILLIMETRE * found.energy:.6g} J"]


def row(records: list[Json]) -> list[str]:
    """The counts of a kind."""
    converged = [record for record in records if record["status"] == "converged"]
    times, iterations = (np.array([record[name] for record in records]) for name in ("milliseconds", "iterations"))
    return [
        str(len(records)),
        str(len(converged)),
        str(sum(record["status"] == "infeasible" for record in records)),
        str(sum(bool(record["failures"]) for record in converged)),
        str(sum(record["finer"] is not None for record in converged)),
        str(sum(beyond(record, "estimates") for record in converged)),
        f"{np.median(iterations):.0f}, {np.percentile(iterations, 99):.0f}",
        f"{np.median(times):.1f}, {np.percentile(times, 99):.0f}",
    ]


HEADER = [
    "kind",
    "scenarios",
    "converged",
    "called infeasible",
    "false",
    "with a finer mesh",
    "change beyond the estimates",
    "iterations: median, 99 %",
    "ms: median, 99 %",
]


def main() -> None:
    """One record a scenario, one line a failure, and the table where all scenarios were solved.

    Records that the file has already are kept: a run that was interrupted goes on.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--count", type=int, default=TOTAL)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=Path("out/random_scenarios.jsonl"))
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    records: list[Json] = []
    if arguments.out.exists():
        records = [json.loads(line) for line in arguments.out.read_text(encoding="utf-8").splitlines()]
    done = {(record["kind"], record["index"]) for record in records}
    with arguments.out.open("a", encoding="utf-8") as file:
        for number in range(arguments.count):
            index, at = divmod(number, len(KINDS))
            kind = list(KINDS)[at]
            if kind not in arguments.kinds or (kind, index) in done:
                continue
            record = audited(kind, index, arguments.seed)
            records.append(record)
            file.write(json.dumps(record) + "\n")
            file.flush()
            if record["status"] != "converged" or record["failures"]:
                print(kind, index, record["status"], record["message"], record.get("failures"), flush=True)
    rows = [[kind, *row([record for record in records if record["kind"] == kind])] for kind in arguments.kinds]
    rows.append(["all", *row(records)])
    print(tables.table(HEADER, rows))
    if arguments.count == TOTAL and arguments.kinds == list(KINDS):
        tables.write("random scenarios", tables.table(HEADER, rows))


if __name__ == "__main__":
    main()
