"""fishbone itself: `fb.solve` and `fb.Tracker`, as a user calls them; and the source's own method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import fishbone as fb
from speed.problem import Answer, Energy, Pose, scenario
from speed.stopwatch import timed

if TYPE_CHECKING:
    from speed.problem import Floats


class Intrinsic:
    """The default method; guess, reactions, stability and tightest bend are within the time."""

    def __init__(self, energy: Energy, elements: int) -> None:
        self.energy: Energy = energy
        self.elements = elements

    def cold(self, pose: Pose) -> Answer:
        """One `fb.solve`, and a tracker for the updates that follow."""
        given = scenario(self.energy, self.elements, pose)
        seconds, self.belt = timed(fb.solve, given)
        self.tracker: fb.Tracker | None = None
        return Answer(self.belt.status == "converged", seconds, self.belt.iterations, self.belt.energy)

    def warm(self, pose: Pose) -> Answer:
        """One update of the tracker."""
        if self.tracker is None:
            self.tracker = fb.Tracker(self.belt.scenario)
        seconds, update = timed(self.tracker.update, pose.position, pose.rotation)
        return Answer(update.status == "converged", seconds, update.iterations, update.energy)

    def curve(self) -> tuple[Floats, Floats]:
        """Positions and tangents of the last cold answer."""
        return self.belt.position, self.belt.frame[:, :, 1]


class Thick(Intrinsic):
    """The strip of finite thickness, whatever the energy of the others."""

    def __init__(self, energy: Energy, elements: int) -> None:
        del energy
        super().__init__("shell", elements)


class Ritz(Intrinsic):
    """The source's own method: 40 coefficients, whatever the mesh; it has no warm start here."""

    def cold(self, pose: Pose) -> Answer:
        """One `fb.solve`."""
        tables = scenario(self.energy, self.elements, pose).to_dict()
        tables["solver"] = {"method": "ritz"}
        seconds, self.belt = timed(fb.solve, fb.Scenario.from_dict(tables))
        return Answer(self.belt.status == "converged", seconds, self.belt.iterations, self.belt.energy)

    def warm(self, pose: Pose) -> Answer:
        """A cold solve."""
        return self.cold(pose)
