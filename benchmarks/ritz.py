"""Results of the source's own method: the tables "ritz …" of docs/validation.md.

The violations are measured on the reported shape and not taken from the solver: ω_ξ = η' · ζ by Eq. (14) from a spline
through the frames, ω_η + ω_ζ β by Eq. (32) from the reported rates.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

import fishbone as fb
from tables import ROOT, number, scientific, table, vector, write

if TYPE_CHECKING:
    from numpy.typing import NDArray

PENALTIES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
UPDATES = (1, 3, 10)
UPDATED_PENALTY = 1e2
POINTS = 16
NODES_PER_INTERVAL = 200
"""Nodes from one collocation point to the next, so that every point is a node too."""

PRINTED = {"example1": "height 0.35", "example2": "peak (0.3, 0.4, −0.01)"}


BASES = (10, 12, 14, 20)
BASIS_PENALTY = 1e4
END_PENALTIES = (1e1, 1e2, 1e3, 1e4)


class Misses(NamedTuple):
    """Largest violations of Eq. (25) and (32) [rad/U], at the collocation points and along the belt."""

    geodesic: float
    geodesic_along: float
    rib_slope: float
    rib_slope_along: float


@functools.cache
def solve(example: str, *, tilt: float = 0.0, **settings: float) -> fb.Equilibrium:
    """The source's method on a shipped scenario, its end tilted about x [rad]."""
    tables = fb.load(ROOT / "scenarios" / f"{example}.toml").to_dict()
    tables["supports"][1]["rotation"][0] += tilt
    elements = (POINTS - 1) * NODES_PER_INTERVAL
    tables["solver"] |= {"method": "ritz", "elements": elements, "ritz": {"points": POINTS, **settings}}
    return fb.solve(fb.Scenario.from_dict(tables))


def geodesic(shape: fb.Equilibrium) -> NDArray[np.float64]:
    """ω_ξ at the nodes, Eq. (14)."""
    tangent = CubicSpline(shape.u, shape.frame[:, :, 1])
    return np.einsum("ni,ni->n", tangent(shape.u, 1), shape.frame[:, :, 2])


def misses(shape: fb.Equilibrium) -> Misses:
    """The violations of Eq. (25) and (32) by a shape."""
    fields = (np.abs(geodesic(shape)), np.abs(shape.torsion + shape.bend * shape.rib_slope))
    return Misses(*(float(np.max(field[::step])) for field in fields for step in (NODES_PER_INTERVAL, 1)))


def power(penalty: float) -> str:
    """1e4."""
    return f"{penalty:.0e}".replace("e+0", "e")


def row(example: str, penalty: float, updates: int) -> list[str]:
    """One line of a table."""
    shape = solve(example, penalty=penalty, updates=updates)
    missed = misses(shape)
    return [
        power(penalty),
        str(updates),
        number(shape.energy, 2),
        vector(shape.highest_point.position, 3),
        *(scientific(value) for value in missed),
    ]


def basis_row(basis: int) -> list[str]:
    """Example 1 with another number of basis functions."""
    shape = solve("example1", penalty=BASIS_PENALTY, updates=0, basis=basis)
    position = vector(shape.highest_point.position, 3)
    missed = (scientific(value) for value in misses(shape))
    return [str(basis), str(4 * basis), number(shape.energy, 2), position, *missed]


def end_row(penalty: float) -> list[str]:
    """Example 1 with φ = θ = ψ = 0 at the end, and with the frame alone.

    The package gives the method a frame that is not the natural one as a frame: 1e-9 rad suffice.
    """
    angles, frame = (solve("example1", tilt=tilt, penalty=penalty, updates=0) for tilt in (0.0, 1e-9))
    heights = (number(shape.highest_point.position[0], 3) for shape in (angles, frame))
    return [power(penalty), number(angles.energy, 2), number(frame.energy, 2), *heights]


def reference(example: str) -> list[str]:
    """The line of the intrinsic method."""
    shape = fb.solve(fb.load(ROOT / "scenarios" / f"{example}.toml"))
    position = vector(shape.highest_point.position, 3)
    return ["intrinsic method", "", number(shape.energy, 2), position, "0", "0", "0", "0"]


def main() -> None:
    """Writes both tables."""
    measured = ["energy", "highest point [U]", "(25) at points", "(25) along", "(32) at points", "(32) along"]
    runs = [(penalty, 0) for penalty in PENALTIES] + [(UPDATED_PENALTY, updates) for updates in UPDATES]
    for example, printed in PRINTED.items():
        source = ["the source prints", "", "", printed, "", "", "", ""]
        rows = [row(example, *run) for run in runs]
        write(f"ritz {example}", table(["penalty", "updates", *measured], [*rows, source, reference(example)]))
    write("ritz basis", table(["basis n", "coefficients", *measured], map(basis_row, BASES)))
    header = ["penalty", "energy, angles", "energy, frame", "height [U], angles", "height [U], frame"]
    write("ritz end", table(header, map(end_row, END_PENALTIES)))


if __name__ == "__main__":
    main()
