"""What fishbone raises."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fishbone.equilibrium import Equilibrium


class FishboneError(Exception):
    """The root of all errors of this package."""


class InvalidScenario(FishboneError, ValueError):  # noqa: N818 - a scenario is invalid, or it is not
    """A scenario that says something it may not say; raised before any solve."""


class InvalidArgument(FishboneError, ValueError):  # noqa: N818
    """An argument outside what a function takes."""


class NoSupport(FishboneError, LookupError):  # noqa: N818
    """There is no support where one was asked for."""


class NoSensitivity(FishboneError):  # noqa: N818
    """A shape has no derivatives: it is no equilibrium, no minimum, or not determined by its supports."""


class NoMargin(FishboneError):  # noqa: N818
    """A shape has no stability to lose, or nothing that could be moved."""


class NoModes(FishboneError):  # noqa: N818
    """A shape has no modes of its own: it is no equilibrium."""


class NoTracker(FishboneError):  # noqa: N818
    """There is no equilibrium to follow, or nothing to move it by."""


class NoPath(FishboneError, ValueError):  # noqa: N818
    """A scenario does not lead along the path that was asked for."""


class NoBranch(FishboneError):  # noqa: N818
    """There is no equilibrium to follow, or it has no single continuation."""


class MissingPackage(FishboneError, ImportError):  # noqa: N818
    """An optional package is not installed; the message says how to get it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f'{package} is not installed: pip install "fishbone[{extra}]"')


class NotConverged(FishboneError):  # noqa: N818
    """A strict solve ended without an equilibrium; what it ended with is `equilibrium`."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        super().__init__(f"{equilibrium.status}: {equilibrium.message}")
        self.equilibrium = equilibrium
