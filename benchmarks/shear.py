"""Thin bands, shortened and sheared: where they snap on the way out and on the way back, for docs/shear.md.

    python benchmarks/shear.py

A straight band is held between clamps 0.75 U apart along y. Its far clamp moves along z to 0.4 U and back, in steps of
a thousandth of the length of the band.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import fishbone as fb
from cases import ENERGIES, clamped
from tables import ROOT, number, table, write

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PAGE = ROOT / "docs" / "shear.md"
RATIOS = (40, 20, 12, 8, 6)
"""Length over width."""
ENDS, FARTHEST = 0.75, 0.4
"""Distance of the clamps along y, and of the far one along z where it turns back, in U."""
PER_WIDTH = 16
"""Elements on a stretch as long as the band is wide."""
STEPS = 400
FALL = 0.02
"""A fall of the energy, in R_f/U, that counts as a snap: the staircase of a mesh has smaller ones."""


class Snap(NamedTuple):
    """A place where the band snaps, and the energy released there."""

    z: float
    fall: float


class Swing(NamedTuple):
    """A band along the way out and back; k steps either way."""

    z: Floats
    """Place of the far clamp, shape (2 k + 1,)."""
    energy: Floats
    height: Floats
    """Coordinate x of the highest point."""
    lost: float
    """Energy dissipated: the work of the clamp less the change of the energy."""
    there: list[Snap]
    back: list[Snap]


def band(ratio: int, energy: str, per_width: int = PER_WIDTH) -> fb.Scenario:
    """The band before it is sheared."""
    tables = clamped((0.0, ENDS, 0.0), width=1.0 / ratio)
    return fb.Scenario.from_dict({"energy": energy, "solver": {"elements": per_width * ratio}} | tables)


def diagram(ratio: int, energy: str) -> fb.Diagram:
    """The equilibria of the band along the way out."""
    path = {"supports[1].position[2]": FARTHEST}
    return fb.follow(band(ratio, energy), path, states=1500, branches=4)


def swing(ratio: int, energy: str, per_width: int = PER_WIDTH) -> Swing:
    """The minimum that a tracker follows out and back."""
    tracker = fb.Tracker(band(ratio, energy, per_width))
    there = np.linspace(0.0, FARTHEST, STEPS + 1)
    z = np.concatenate([there, there[-2::-1]])
    states = []
    for place in z:
        tracker.update((0.0, ENDS, place), (0.0, 0.0, 0.0))
        states.append((tracker.energy, tracker.reaction("end").force[2], tracker.position[:, 0].max()))
    levels, force, height = np.array(states).T
    steps = np.diff(z)
    # Without a snap the energy changes by the work of the force.
    falls = levels[:-1] + force[:-1] * steps - levels[1:]
    snaps = [Snap(z[k + 1], falls[k]) for k in np.flatnonzero(falls > FALL)]
    turn = int(np.searchsorted(np.flatnonzero(falls > FALL), STEPS))
    work = float(np.sum(0.5 * (force[1:] + force[:-1]) * steps))
    return Swing(z, levels, height, work - (levels[-1] - levels[0]), snaps[:turn], snaps[turn:])


def largest_of(snaps: list[Snap]) -> str:
    """The largest of the snaps, and the number of smaller ones."""
    if not snaps:
        return "none"
    largest = max(snaps, key=lambda snap: snap.fall)
    more = f" and {len(snaps) - 1} smaller" if len(snaps) > 1 else ""
    return f"{number(largest.z, 3)} ({number(largest.fall, 2)}){more}"


def main() -> None:
    """Writes the table."""
    header = ["V/U", "energy", "elements", "snaps there at z", "back at z", "lost", "elements", "there", "back", "lost"]
    rows = []
    for ratio in RATIOS:
        for energy in ENERGIES:
            row = [f"1/{ratio}", f"`{energy}`"]
            for per_width in (PER_WIDTH, 2 * PER_WIDTH):
                led = swing(ratio, energy, per_width)
                row += [str(per_width * ratio), largest_of(led.there), largest_of(led.back), number(led.lost, 2)]
            rows.append(row)
            print(" ".join(row), flush=True)
    write("snaps", table(header, rows), PAGE)


if __name__ == "__main__":
    main()
