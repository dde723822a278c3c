"""The programs compared, with their settings."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from speed.problem import Energy, Rival


@dataclass(frozen=True)
class Entry:
    """A rival: its name, its constructor and its measurements."""

    name: str
    module: str
    make: str
    energies: tuple[Energy, ...] = ("fishbone", "wunderlich")
    solves_random: bool = True
    is_other_model: bool = False
    """Whether its energy is not that of the core."""
    updates: int = 0
    """Number of warm updates: fewer of a slow rival, none of a rival without a warm start."""

    def build(self, energy: Energy, elements: int) -> Rival:
        """The rival, ready to start."""
        try:
            module = import_module(f"speed.{self.module}")
        except ModuleNotFoundError as missing:
            raise SystemExit(f"{self.name} needs the package {missing.name}: run `make bench`") from missing
        return cast("Rival", getattr(module, self.make)(energy, elements))


OURS = "fishbone"
ENTRIES = (
    Entry(OURS, "ours", "Intrinsic", updates=10_000),
    Entry("fishbone, finite thickness", "ours", "Thick", energies=("shell",), is_other_model=True, updates=10_000),
    Entry("CasADi + fatrop, compiled", "nlp", "fatrop_compiled", updates=1000),
    Entry("CasADi + IPOPT, compiled", "nlp", "ipopt_compiled", updates=500),
    Entry("CasADi + IPOPT, interpreted", "nlp", "ipopt_interpreted", updates=100),
    Entry("SciPy SLSQP", "slsqp", "Slsqp", updates=20),
    Entry("MuJoCo, chain of links", "chain", "Chain", energies=("fishbone",), is_other_model=True, updates=500),
    Entry("the source's method", "ours", "Ritz", energies=("fishbone",), solves_random=False),
)
