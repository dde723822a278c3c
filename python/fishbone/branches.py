"""All equilibria of a scenario that can be found."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fishbone import _core
from fishbone.equilibrium import Equilibrium, core_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from fishbone.scenario import Scenario


class _Budget(NamedTuple):
    """How much is searched, where that is to be less than usual: a search of seconds, which misses some."""

    sums: int
    """Sums of waves among the starts, a number."""
    perturbed: int
    """Minima that are perturbed, the largest number."""
    continued: int
    """Equilibria that are continued in modal loads, the largest number."""


def branches(scenario: Scenario, *, progress: Callable[[int, int], object] | None = None) -> list[Equilibrium]:
    """The equilibria of a scenario, rising in energy: minima, and saddles with one or two negative modes.

    More than 4100 searches, from waves of bend and rib slope over the length of the belt, find minima, and displaced
    along their lowest modes these lead to more. The 16 lowest of what is found are pushed along their lowest modes,
    which leads on to saddles, and from these it is downhill to either side. What a mesh twice as fine does not have is
    left out, and of what the mesh does not tell apart the lowest is kept. Of shapes that are mirror images
    of each other the one is given that bulges as the scenario asks. No belt is kept from passing through itself on
    the way: `Equilibrium.crosses_itself` tells which end so. The same scenario gives the same equilibria. Where there
    are none, the one outcome of `solve` says why.

    `progress(done, planned)` is called now and then from the calling thread, in tasks. All cores are used, other
    threads run meanwhile, and Ctrl-C ends the search.

    Errors: `InvalidArgument` where `scenario` is none; whatever `progress` raises.
    """
    return _search(scenario, None, progress)


def _search(
    scenario: Scenario, budget: _Budget | None, progress: Callable[[int, int], object] | None = None
) -> list[Equilibrium]:
    """What `branches` finds with a budget: all it can without one."""
    found = _core.branches(core_of(scenario), progress, budget)
    return [Equilibrium(scenario, inner) for inner in found]
