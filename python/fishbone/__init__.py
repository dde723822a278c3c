"""Equilibrium shapes of thin belts by the fishbone model.

import fishbone as fb

equilibrium = fb.solve(fb.load("scenarios/example1.toml"))
"""

import importlib
from types import ModuleType

from fishbone._core import __version__
from fishbone.branches import branches
from fishbone.equilibrium import (
    AreaRadii,
    AreaStrains,
    BendRadii,
    BendRadius,
    Edges,
    Equilibrium,
    HighestPoint,
    Internal,
    MeshError,
    Mode,
    Outline,
    PointStrain,
    Reaction,
    Residuals,
    RibMargin,
    SnapMargin,
    SpineRadius,
    Strain,
    StrainExtremes,
    solve,
    solve_many,
)
from fishbone.errors import (
    FishboneError,
    InvalidArgument,
    InvalidScenario,
    MissingPackage,
    NoBranch,
    NoMargin,
    NoModes,
    NoPath,
    NoSensitivity,
    NoSupport,
    NotConverged,
    NoTracker,
)
from fishbone.follow import Branch, Diagram, Event, Origin, Poses, follow
from fishbone.pose import Pose
from fishbone.scenario import Scenario, load
from fishbone.sensitivity import Change, Gradient, Sensitivity
from fishbone.sweep import Sweep, sweep
from fishbone.tracker import LowestEigenvalue, Tracker, Update, Updates

__all__ = [
    "AreaRadii",
    "AreaStrains",
    "BendRadii",
    "BendRadius",
    "Branch",
    "Change",
    "Diagram",
    "Edges",
    "Equilibrium",
    "Event",
    "FishboneError",
    "Gradient",
    "HighestPoint",
    "Internal",
    "InvalidArgument",
    "InvalidScenario",
    "LowestEigenvalue",
    "MeshError",
    "MissingPackage",
    "Mode",
    "NoBranch",
    "NoMargin",
    "NoModes",
    "NoPath",
    "NoSensitivity",
    "NoSupport",
    "NoTracker",
    "NotConverged",
    "Origin",
    "Outline",
    "PointStrain",
    "Pose",
    "Poses",
    "Reaction",
    "Residuals",
    "RibMargin",
    "Scenario",
    "Sensitivity",
    "SnapMargin",
    "SpineRadius",
    "Strain",
    "StrainExtremes",
    "Sweep",
    "Tracker",
    "Update",
    "Updates",
    "__version__",
    "branches",
    "follow",
    "load",
    "solve",
    "solve_many",
    "sweep",
]


def __getattr__(name: str) -> ModuleType:
    """`plot` and `export`, imported at first use: they need extra packages, which take long to import."""
    if name in {"plot", "export"}:
        return importlib.import_module(f"fishbone.{name}")
    raise AttributeError(f"module 'fishbone' has no attribute {name!r}")
