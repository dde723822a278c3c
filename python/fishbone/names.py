"""The words of scenarios and results, as types.

They are the core's: a test holds them equal to `_core.names()`.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

Status: TypeAlias = Literal["converged", "infeasible", "not_converged"]
"""How a solve ended."""
EnergyModel: TypeAlias = Literal["fishbone", "sadowsky", "wunderlich"]
"""The energy minimised."""
Method: TypeAlias = Literal["intrinsic", "ritz"]
"""The method of solution."""
Axis: TypeAlias = Literal["xi", "eta", "zeta"]
"""A body axis: the columns of a frame."""
Place: TypeAlias = Literal["start", "end"] | float
"""A support: by its index (int) or its place, an end of the belt or an arc length (float)."""
Motion: TypeAlias = Literal["straight", "screw"]
"""How a support goes from one pose to the next."""
Kind: TypeAlias = Literal["fold", "pitchfork", "transcritical", "bifurcation"]
"""What happens at an event of a branch."""
End: TypeAlias = Literal["range", "event", "closed", "budget", "lost", "edges", "taut"]
"""Why a branch ends."""
