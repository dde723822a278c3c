"""Measures how far other models of a strip are from the shell, and how long they take: docs/validation.md.

Needs MuJoCo, which `make bench` installs.
"""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

import fishbone as fb
from cases import clamped, off_shell, shell
from tables import VALIDATION, number, table, write
from validation import processor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Line = tuple[Floats, Floats, Floats, float]
    """Arc lengths [U], positions and tangents of a centre line, and the seconds that it took."""

POSES = ("example1", "example2", "offset05", "offset10_far")
ELEMENTS, REPETITIONS = 80, 11
NARROWER = 0.1
"""Factor on the width, and its square on the thickness, for the limit without gradients along the spine."""


def strip(energy: str, narrower: float = 1.0) -> Callable[[str], Line]:
    """A belt of ours between the clamps of a shell, of its rigidity.

    Of a narrower strip V²/h stays as it is: the free edges curl as before, while gradients along the spine, of order
    V/U, vanish. The limit is the ribbon of Audoly and Neukirch.
    """

    def line(name: str) -> Line:
        data = shell(name)
        sheet = {"width": narrower * data["width"], "thickness": narrower**2 * data["thickness"]}
        turn = Rotation.from_matrix(data["end_rotation_matrix"]).as_rotvec()
        tables = clamped(data["end_position"], turn, length=data["length"], poisson=data["poisson"], **sheet)
        tables |= {"energy": energy, "solver": {"elements": ELEMENTS}}
        belt = fb.solve(fb.Scenario.from_dict(tables), strict=True)
        return belt.u, belt.position, belt.frame[:, :, 1], belt.solve_time

    return line


def links(name: str) -> Line:
    """The chain of MuJoCo: a rod of two rigidities, that knows of no ribs."""
    from speed import chain  # noqa: PLC0415 - the other rows need no MuJoCo
    from speed.problem import Pose  # noqa: PLC0415

    data = shell(name)
    turn = Rotation.from_matrix(data["end_rotation_matrix"]).as_rotvec()
    rival = chain.Chain("sadowsky", ELEMENTS)
    answer = rival.cold(Pose(np.array(data["end_position"]), turn))
    assert answer.converged
    position, tangent = rival.curve()
    return np.linspace(0.0, 1.0, len(position)), position, tangent, answer.seconds


PEERS: dict[str, Callable[[str], Line]] = {
    "strip of finite thickness, `shell`": strip("shell"),
    "developable plate, `wunderlich`": strip("wunderlich"),
    "narrow developable plate, `sadowsky`": strip("sadowsky"),
    "the source's energy, `fishbone`": strip("fishbone"),
    "ribbon of Audoly and Neukirch: `shell` of a tenth of the width": strip("shell", NARROWER),
    "rod of bending and torsion: a chain of MuJoCo": links,
}


def off(line: Line, data: dict[str, Any]) -> float:
    """RMS distance from the centre line of a shell, over its 101 points, in 1e-3 U."""
    u, position, tangent, _ = line
    return 1e3 * off_shell(u, position, tangent, data)


def rows() -> Iterator[list[str]]:
    """Every model at the four poses, and the median of its times for the first two."""
    for title, solve in PEERS.items():
        distances = [number(off(solve(name), shell(name)), 2) for name in POSES]
        times = [statistics.median(solve(name)[3] for _ in range(REPETITIONS)) for name in POSES[:2]]
        yield [title, *distances, *(f"{1e3 * seconds:.3g}" for seconds in times)]


def main() -> None:
    """Writes the table."""
    header = ["model", *(f"`{name}`" for name in POSES), *(f"`{name}` [ms]" for name in POSES[:2])]
    machine = f"{processor()}, one thread, medians of {REPETITIONS} solves on {ELEMENTS} elements."
    write("peers", f"{table(header, rows())}\n\n{machine}", VALIDATION)


if __name__ == "__main__":
    main()
