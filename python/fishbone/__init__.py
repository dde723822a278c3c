"""Equilibrium shapes of thin, inextensible belts by the fishbone model.

import fishbone as fb

equilibrium = fb.solve(fb.load("scenarios/example1.toml"))
"""

from fishbone._core import __version__
from fishbone.equilibrium import (
    BendRadius,
    Edges,
    Equilibrium,
    HighestPoint,
    Internal,
    Reaction,
    Residuals,
    RibMargin,
    solve,
)
from fishbone.errors import (
    FishboneError,
    InvalidArgument,
    InvalidScenario,
    MissingPackage,
    NoSupport,
    NotConverged,
)
from fishbone.scenario import Scenario, load

__all__ = [
    "BendRadius",
    "Edges",
    "Equilibrium",
    "FishboneError",
    "HighestPoint",
    "Internal",
    "InvalidArgument",
    "InvalidScenario",
    "MissingPackage",
    "NoSupport",
    "NotConverged",
    "Reaction",
    "Residuals",
    "RibMargin",
    "Scenario",
    "__version__",
    "load",
    "solve",
]
