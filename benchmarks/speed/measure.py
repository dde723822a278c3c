"""The measurements. Every section is a list of plain records, or one record, as in results/speed.json."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import subprocess
import sys
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.progress import track

import fishbone as fb
import random_poses
from cases import off_shell, shell
from speed.problem import ENERGIES, EXAMPLES, Answer, Pose, end_pose, path, scenario
from speed.rivals import ENTRIES, OURS, Entry
from speed.stopwatch import timed
from tables import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from speed.problem import Energy, Rival

    Record = dict[str, Any]

COLD_ELEMENTS, WARM_ELEMENTS = 80, 64
REPETITIONS = (3, 201)
"""Fewest and most solves of a case."""
SECONDS = 4.0
"""A case is solved again until this much time has passed."""
RANDOM_POSES = 40
PATIENCE = 60.0
"""A rival solves random poses for so many seconds at most."""
PATH = 10_000
"""Poses of the path; a rival of fewer updates solves stretches of the path, in the same steps."""
STRETCH = 20
PASSES = 3
"""Passes along the whole path; the least time of each update counts, free of the load of the machine."""
FINER = 10
"""Steps of the check of a branch for one step along the path."""
MESHES = (100, 1000, 10_000)
BATCH = 10_000
ENERGY: Energy = "fishbone"
"""Seed of the paths."""
RANDOM_ENERGY: Energy = "wunderlich"
MORE_SOLVES, MORE_UPDATES = 6, 101
"""Numbers of solves and updates whose instructions are counted; more reduce the share of the start of the process."""
SAME_COUNT = {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Environment of equal counts: else strings hash differently, and waiting threads of BLAS count."""
HERE = ROOT / "benchmarks"
SAME = 1e-6
"""Relative difference of energies up to which two shapes count as the same."""


def _progress(items: Sequence[Any], title: str) -> Iterable[Any]:
    return track(items, title, console=Console(stderr=True), transient=True)


def percentiles(seconds: Sequence[float], *percents: float) -> list[float]:
    """Percentiles in seconds."""
    return [float(value) for value in np.percentile(seconds, percents)]


# ------------------------------------------------------------------------------------------------------------- cold


def cold() -> list[Record]:
    """Both examples from each rival's own guess."""
    cases = [(entry, energy) for entry in ENTRIES for energy in entry.energies]
    records = []
    for entry, energy in _progress(cases, "cold"):
        rival = entry.build(energy, COLD_ELEMENTS)
        records += [_cold(entry, energy, rival, example) for example in EXAMPLES]
    return records


def _cold(entry: Entry, energy: Energy, rival: Rival, example: str) -> Record:
    pose = end_pose(example)
    answers = _repeated(lambda: rival.cold(pose))
    seconds = [answer.seconds for answer in answers]
    first = answers[0]
    return {
        "rival": entry.name,
        "energy_model": energy,
        "example": example,
        "converged": first.converged,
        "energy": first.energy,
        "iterations": first.iterations,
        "repetitions": len(answers),
        "p50": percentiles(seconds, 50)[0],
        "min": min(seconds),
        "distance": distance(rival, example),
    }


def _repeated(solve: Callable[[], Answer]) -> list[Answer]:
    fewest, most = REPETITIONS
    answers: list[Answer] = []
    start = perf_counter()
    while len(answers) < fewest or (len(answers) < most and perf_counter() - start < SECONDS):
        answers.append(solve())
    return answers


def distance(rival: Rival, example: str) -> float:
    """RMS distance of the rival's last centre line from the shell's."""
    data = shell(example)
    position, tangent = rival.curve()
    return off_shell(np.linspace(0.0, data["length"], len(position)), position, tangent, data)


# ----------------------------------------------------------------------------------------------------- random poses


def random() -> list[Record]:
    """Random poses, of which each rival solves as many as its time allows; its shapes are compared with fishbone's."""
    rng = np.random.default_rng(1)
    poses = [Pose(*random_poses.pose(rng)) for _ in range(RANDOM_POSES)]
    energies: list[float] = []
    records = []
    for entry in _progress([entry for entry in ENTRIES if entry.solves_random], "random poses"):
        rival = entry.build(RANDOM_ENERGY, COLD_ELEMENTS)
        answers = list(_patiently(rival, poses))
        if entry.name == OURS:
            energies = [answer.energy for answer in answers]
        records.append(
            {
                "rival": entry.name,
                "poses": len(answers),
                "converged": sum(answer.converged for answer in answers),
                "shapes": None if entry.is_other_model else _compared(answers, energies),
                "p50": percentiles([answer.seconds for answer in answers], 50)[0],
            }
        )
    return records


def _compared(answers: Sequence[Answer], energies: Sequence[float]) -> dict[str, int]:
    """Numbers of converged shapes with fishbone's energy, with less and with more."""
    pairs = zip(answers, energies, strict=False)
    apart = np.array([answer.energy / energy - 1.0 for answer, energy in pairs if answer.converged])
    lower, higher = int(np.sum(apart < -SAME)), int(np.sum(apart > SAME))
    return {"same": len(apart) - lower - higher, "lower": lower, "higher": higher}


def _patiently(rival: Rival, poses: Sequence[Pose]) -> Iterator[Answer]:
    start = perf_counter()
    for pose in poses:
        if perf_counter() - start > PATIENCE:
            return
        yield rival.cold(pose)


# ------------------------------------------------------------------------------------------------------------- warm


def warm() -> list[Record]:
    """Updates along the path, each from the shape before."""
    cases = [(entry, example) for entry in ENTRIES if entry.updates for example in EXAMPLES]
    return [_warm(entry, example) for entry, example in _progress(cases, "warm")]


def _warm(entry: Entry, example: str) -> Record:
    rival = entry.build(ENERGY, WARM_ELEMENTS)
    poses = list(path(example, PATH + 1))
    passes = [_pass(rival, poses, entry.updates) for _ in range(PASSES if entry.updates >= PATH else 1)]
    answers = passes[0]
    seconds = [min(same) for same in zip(*([answer.seconds for answer in way] for way in passes), strict=True)]
    half, most, nearly_all = percentiles(seconds, 50, 99, 99.9)
    return {
        "rival": entry.name,
        "example": example,
        "updates": len(answers),
        "failures": sum(not answer.converged for answer in answers),
        "iterations": float(np.mean([answer.iterations for answer in answers])),
        "p50": half,
        "p99": most,
        "p99.9": nearly_all,
    }


def _pass(rival: Rival, poses: Sequence[Pose], updates: int) -> list[Answer]:
    answers: list[Answer] = []
    for stretch in stretches(PATH, updates):
        rival.cold(poses[stretch.start])
        for at in stretch[1:]:
            answers.append(rival.warm(poses[at]))
            if not answers[-1].converged:
                rival.cold(poses[at])
    return answers


def stretches(count: int, updates: int) -> list[range]:
    """So many updates on a path of `count`: all of it, or stretches at equal distances, each with its start."""
    if updates >= count:
        return [range(count + 1)]
    parts = max(1, updates // STRETCH)
    return [range(part * count // parts, part * count // parts + updates // parts + 1) for part in range(parts)]


def branches() -> list[Record]:
    """Whether the tracker keeps to its branch: the energies along the path against those in ten times finer steps."""
    cases = [(energy, example) for energy in ENERGIES for example in EXAMPLES]
    return [_branch(energy, example) for energy, example in _progress(cases, "branches")]


def _branch(energy: Energy, example: str) -> Record:
    pose = end_pose(example)
    coarse, fine = (fb.Tracker(scenario(energy, WARM_ELEMENTS, pose)) for _ in range(2))
    apart, snaps = 0, 0
    for at, pose in enumerate(path(example, FINER * PATH + 1)):
        update = fine.update(pose.position, pose.rotation)
        if at % FINER == 0:
            followed = coarse.update(pose.position, pose.rotation)
            apart += abs(followed.energy / update.energy - 1.0) > SAME
            snaps += followed.snapped
    return {"energy_model": energy, "example": example, "updates": PATH + 1, "apart": apart, "snaps": snaps}


def derivatives() -> list[Record]:
    """Times of factorisation and products of a sensitivity, and of an iteration of the solve."""
    return [_derivatives(example) for example in _progress(EXAMPLES, "derivatives")]


def _derivatives(example: str) -> Record:
    given = scenario(ENERGY, COLD_ELEMENTS, end_pose(example))
    belt = fb.solve(given, strict=True)
    system = belt.sensitivity()
    motion = np.zeros((2, 6))
    motion[1, 1] = 1.0
    weights = np.ones_like(belt.position)
    solve = _least(lambda: fb.solve(given))
    return {
        "example": example,
        "iteration": solve / belt.iterations,
        "factorise": _least(lambda: fb.solve(given).sensitivity()) - solve,
        "forward": _least(lambda: system.forward(supports=motion)),
        "adjoint": _least(lambda: system.adjoint(position=weights)),
        "jacobian": _least(lambda: system.jacobian(1)),
    }


def _least(action: Callable[[], object]) -> float:
    return min(timed(action)[0] for _ in range(REPETITIONS[1]))


# ------------------------------------------------------------------------------- meshes, batches and instructions


def scaling() -> list[Record]:
    """Time of an iteration and memory of fishbone by mesh, each in a process of its own."""
    return [_in_process("mesh", str(elements)) for elements in _progress(MESHES, "meshes")]


def batch() -> list[Record]:
    """`solve_many` on random poses, on one thread and on two."""
    return [_in_process("batch", str(BATCH), RAYON_NUM_THREADS=str(threads)) for threads in _progress((1, 2), "batch")]


def _in_process(*arguments: str, **environment: str) -> Record:
    command = [sys.executable, "-m", "speed.process", *arguments]
    run = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | environment)
    record: Record = json.loads(run.stdout)
    return record


def instructions() -> list[Record]:
    """Instructions of one cold solve."""
    if shutil.which("valgrind") is None:
        return []
    examples = _progress(EXAMPLES, "instructions")
    return [{"example": example, "instructions": cold_instructions(example)} for example in examples]


def cold_instructions(example: str, python: str = sys.executable) -> int:
    """Instructions of one solve of a shipped example, by the fishbone of this Python."""
    return _instructions(python, "solve", example, MORE_SOLVES)


def warm_instructions(example: str, python: str = sys.executable) -> int:
    """Instructions of one update on the path, the mean over the first updates."""
    poses = itertools.islice(path(example, PATH + 1), MORE_UPDATES)
    given = json.dumps([[pose.position.tolist(), pose.rotation.tolist()] for pose in poses])
    return _instructions(python, "update", example, MORE_UPDATES, given)


def _instructions(python: str, task: str, example: str, more: int, given: str = "") -> int:
    """Instructions of a task, by callgrind: those of `more` tasks in a process less those of one, per task."""
    once, often = (_counted([python, "-m", "speed.process", task, example, str(times)], given) for times in (1, more))
    return round((often - once) / (more - 1))


def _counted(command: list[str], given: str) -> int:
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *command]
    run = subprocess.run(
        command, check=True, capture_output=True, text=True, input=given, cwd=HERE, env=os.environ | SAME_COUNT
    )
    found = re.search(r"Collected : (\d+)", run.stderr)
    assert found is not None
    return int(found[1])


SECTIONS: dict[str, Callable[[], list[Record]]] = {
    "cold": cold,
    "random": random,
    "warm": warm,
    "branches": branches,
    "derivatives": derivatives,
    "scaling": scaling,
    "batch": batch,
    "instructions": instructions,
}
