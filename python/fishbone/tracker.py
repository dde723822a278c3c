"""Following an equilibrium while one of its supports moves, at the rate of a robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fishbone import _core
from fishbone.equilibrium import Equilibrium, Reaction, solve
from fishbone.errors import InvalidArgument
from fishbone.scenario import Scenario

if TYPE_CHECKING:
    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone.names import Place, Status

    Floats = NDArray[np.float64]


class Update(NamedTuple):
    """What became of the belt as its support moved."""

    status: Status
    """Unless "converged", no equilibrium was found under the new pose, and the tracker stays where it was."""
    snapped: bool
    """Whether the equilibrium that was followed ceased to exist or to be stable on the way, and this is another one."""
    energy: float
    """Total potential, in the unit of the scenario."""
    iterations: int
    """Steps of Newton's method."""
    residual: float
    """Largest residual, lengths in U and energy in mean R_f/U."""


class Tracker:
    """A belt whose support moves: every update starts from the shape before, and keeps to its branch.

    `fb.Tracker(scenario)` solves the scenario first; `support` is named as for `Equilibrium.reaction`, and must hold a
    position and a rotation. Everything is as of the last update that converged.

    Errors: `NoTracker` where the scenario has no equilibrium to begin with; `NoSupport`.
    """

    def __init__(self, scenario: Scenario, support: Place = "end") -> None:
        self._start = solve(scenario)
        # The source's method knows no reactions, and cannot be followed wherever the support is.
        inner = self._start._inner  # noqa: SLF001 - of this package
        self._inner = _core.Tracker(inner, self._index_of(support) if inner.reactions else 0)

    def update(self, position: npt.ArrayLike, rotation: npt.ArrayLike) -> Update:
        """Moves the support to a position and a rotation vector, world axes, and the belt with it.

        Shapes: (3,) each.
        Units: those of the scenario; rad.
        Errors: `InvalidArgument` for other shapes and for what is not finite.
        """
        return Update(*self._inner.update(triple("position", position), triple("rotation", rotation)))

    @property
    def energy(self) -> float:
        """Total potential."""
        return self._inner.energy

    @property
    def u(self) -> Floats:
        """Arc length at the nodes, shape (n,)."""
        return self._start.u

    @property
    def position(self) -> Floats:
        """Spine positions at the nodes, shape (n, 3)."""
        return self._inner.position

    @property
    def frame(self) -> Floats:
        """Frames at the nodes, columns ξ, η, ζ, shape (n, 3, 3)."""
        return self._inner.frame

    @property
    def bend(self) -> Floats:
        """Bend ω_ζ at the nodes, shape (n,)."""
        return self._inner.bend

    @property
    def rib_slope(self) -> Floats:
        """Rib slope β at the nodes, shape (n,)."""
        return self._inner.rib_slope

    def reaction(self, support: Place) -> Reaction:
        """What a support does to the belt, named as for `Equilibrium.reaction`; it takes no solve.

        Errors: `NoSupport`.
        """
        force, moment = self._inner.reaction(self._index_of(support))
        return Reaction(np.array(force), np.array(moment))

    def equilibrium(self) -> Equilibrium:
        """Everything about the present shape."""
        scenario, found = self._inner.equilibrium()
        return Equilibrium(Scenario._wrap(scenario), found)  # noqa: SLF001 - of this package

    def _index_of(self, support: Place) -> int:
        return self._start._support_index(support)  # noqa: SLF001 - of this package


def triple(name: str, values: npt.ArrayLike) -> list[float]:
    """Three finite numbers, as a list.

    Errors: `InvalidArgument`, which names them.
    """
    try:
        vector = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidArgument(f"{name}: found {values!r}, allowed three numbers") from None
    if vector.shape != (3,):
        raise InvalidArgument(f"{name}: found shape {vector.shape}, allowed (3,)")
    x, y, z = vector.tolist()
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise InvalidArgument(f"{name}: found {[x, y, z]}, allowed finite numbers")
    return [x, y, z]
