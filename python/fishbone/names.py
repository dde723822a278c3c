"""The words of scenarios and results, as types.

The core defines the words; a test compares them with `_core.names()`.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

Status: TypeAlias = Literal["converged", "infeasible", "not_converged"]
"""How a solve ended."""
EnergyModel: TypeAlias = Literal["fishbone", "sadowsky", "wunderlich", "shell"]
"""The energy minimised."""
Method: TypeAlias = Literal["intrinsic", "ritz"]
"""The method of solution."""
Axis: TypeAlias = Literal["xi", "eta", "zeta"]
"""A body axis: the columns of a frame."""
Place: TypeAlias = Literal["start", "end"] | float
"""A support: by its index (int) or its place, an end of the belt or an arc length (float)."""
Motion: TypeAlias = Literal["straight", "screw"]
"""The motion of a support from one pose to the next."""
Kind: TypeAlias = Literal["fold", "pitchfork", "transcritical", "bifurcation", "edges"]
"""The kind of an event on a branch."""
End: TypeAlias = Literal["range", "event", "closed", "unstable", "budget", "lost", "edges", "no_slack"]
"""The reason of the end of a branch; "no_slack": the belt is held straight and has none left."""
