"""The search for all equilibria of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fishbone import _core
from fishbone.equilibrium import Equilibrium, core_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from fishbone.scenario import Scenario


class _Budget(NamedTuple):
    """Sizes of a search smaller than the default: it takes seconds, and misses equilibria."""

    sums: int
    """Greatest number of sums of waves among the starts."""
    perturbed: int
    """Greatest number of minima that are perturbed."""
    continued: int
    """Greatest number of equilibria that are continued in modal loads."""


def branches(scenario: Scenario, *, progress: Callable[[int, int], object] | None = None) -> list[Equilibrium]:
    """The equilibria found of a scenario, rising in energy: minima, and saddles with one or two negative modes.

    Some 300 to 4000 searches on two meshes, from waves of bend and rib slope over the length of the belt, find minima.
    Continuation in modal loads leads from the 4 lowest equilibria to saddles, and the solver goes downhill from each
    saddle to either side. Perturbations of the minima along their lowest modes lead to more minima. Equilibria that
    are unconfirmed on refinement, by a mesh twice as fine, are left out; of equilibria that the mesh does not resolve
    the lowest is kept. Of two mirror images the list has the one on the side of the scenario's `bulge`. A belt may
    pass through itself during the search: check `Equilibrium.crosses_itself`. The same scenario has the same list.
    With the energy "shell" the list has the minima next to those of "wunderlich" alone, and no saddles. Where no
    equilibrium is found the list has the failed result of `solve`, with its message.

    `progress(done, planned)` is called from the calling thread during the search; both are numbers of tasks. All cores
    are used, other threads run meanwhile, and Ctrl-C ends the search.

    Errors: `InvalidArgument` where `scenario` is no scenario; `RuntimeError` where the system gives no more threads;
    any error that `progress` raises.
    """
    return _search(scenario, None, progress)


def _search(
    scenario: Scenario, budget: _Budget | None, progress: Callable[[int, int], object] | None = None
) -> list[Equilibrium]:
    """What `branches` finds with a budget: all it can without one."""
    found = _core.branches(core_of(scenario), progress, budget)
    return [Equilibrium(scenario, inner) for inner in found]
