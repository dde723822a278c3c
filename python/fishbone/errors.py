"""The errors of fishbone.

The core makes most of them, with their data as attributes, which are None where they do not apply. All can be pickled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from fishbone.equilibrium import Equilibrium
    from fishbone.names import Place, Status


class FishboneError(Exception):
    """The root of all errors of this package."""


class InvalidScenario(FishboneError, ValueError):  # noqa: N818 - a scenario is invalid, or it is not
    """A scenario is invalid: a field is unknown or has an invalid value; raised before any solve."""

    reason: Literal["syntax", "unknown_field", "unknown_choice", "invalid"] | None = None
    """The kind of error: the text is neither TOML nor JSON, the field or the word is unknown, or a value is invalid."""
    field: str | None = None
    """Path of the invalid field, such as "supports[1].position"; for a file as a whole its invalid property."""
    found: str | None = None
    """The value found."""
    allowed: str | None = None
    """The values allowed, in words."""
    choices: tuple[str, ...] = ()
    """The allowed fields or words, where they are few."""
    nearest: str | None = None
    """The allowed field or word closest to the one found."""
    line: int | None = None
    """Line of the syntax error in the text, from 1."""
    column: int | None = None
    """Column of the syntax error, from 1."""
    file: str | None = None
    """The file, where the scenario came from a file."""


class InvalidArgument(FishboneError, ValueError):  # noqa: N818
    """An argument of a function is invalid."""


class NoSupport(FishboneError, LookupError):  # noqa: N818
    """There is no support at the given index or place."""

    support: Place | None = None
    """The index or place given."""


class NoSensitivity(FishboneError):  # noqa: N818
    """A shape has no derivatives: it is no equilibrium, no minimum, or not determined by its supports."""

    reason: Literal["no_multipliers", "not_converged", "marginal", "flat", "saddle", "redundant", "no_slack"] | None = (
        None
    )
    """The reason: the source's method has no multipliers; the solve has not converged; the belt moves at no cost of
    energy; a part of the belt is flat under load; the equilibrium is a saddle; supports and links are redundant
    constraints; or the supports leave no slack."""
    redundant: str | None = None
    """The supports and links that are redundant constraints."""
    solve_message: str | None = None
    """The message of the solve that has not converged."""


class NoMargin(FishboneError):  # noqa: N818
    """A shape is not stable, or its support cannot be moved."""

    reason: (
        Literal[
            "no_multipliers",
            "not_converged",
            "no_slack",
            "flat",
            "singular",
            "not_stable",
            "not_clamped",
            "lost",
            "no_number",
            "nothing",
            "no_pose",
            "invalid",
            "unreadable",
        ]
        | None
    ) = None
    """The reason: no equilibrium to follow, as in `NoBranch`; the equilibrium is not stable; the support does not hold
    a whole pose; the equilibrium could be followed only a part of the way; the last five as in `NoPath`."""
    support: int | None = None
    """Index of the support that does not hold a whole pose."""
    share: float | None = None
    """Share of the reach along which the equilibrium could be followed, stable."""
    solve_message: str | None = None
    """The message of the solve that has not converged."""


class NoModes(FishboneError):  # noqa: N818
    """A shape has no modes, because it is no equilibrium."""

    reason: Literal["no_multipliers", "not_converged", "singular"] | None = None
    """The reason: the source's method has no multipliers; the solve has not converged; or the second variation is
    singular."""
    solve_message: str | None = None
    """The message of the solve that has not converged."""


class NoTracker(FishboneError):  # noqa: N818
    """There is no equilibrium to track, or its support cannot be moved."""

    reason: Literal["no_multipliers", "not_converged", "not_held", "no_support", "no_minimum"] | None = None
    """The reason: the source's method has no multipliers; the solve has not converged; the support does not
    hold a whole pose; there is no such support; or the equilibrium is no minimum."""
    support: int | None = None
    """Index of the support that does not hold a whole pose, or does not exist."""
    solve_message: str | None = None
    """The message of the solve that has not converged."""


class NoPath(FishboneError, ValueError):  # noqa: N818
    """A scenario cannot be changed along the given path."""

    reason: Literal["no_number", "nothing", "not_clamped", "no_pose", "invalid", "unreadable"] | None = None
    """The reason: the scenario has no such number; the path changes nothing; the support does not hold a whole pose;
    one of the poses is invalid; the scenario at the end of the path is invalid; or a number there has the wrong
    type."""
    field: str | None = None
    """Path of the field that has no number, or that is invalid at the end of the path."""
    found: str | None = None
    """The value found."""
    allowed: str | None = None
    """The values allowed, where the field is invalid at the end of the path."""
    support: int | None = None
    """Index of the support that does not hold a whole pose."""


class NoBranch(FishboneError):  # noqa: N818
    """There is no equilibrium to follow, or more than one branch continues it."""

    reason: Literal["no_multipliers", "not_converged", "no_slack", "flat", "singular"] | None = None
    """The reason: the source's method has no multipliers; the solve has not converged; the supports leave no
    slack; the belt is flat and may leave its plane in many ways; or the equilibrium is singular, so that no single
    branch continues it."""
    solve_message: str | None = None
    """The message of the solve that has not converged."""


class MissingPackage(FishboneError, ImportError):  # noqa: N818
    """An optional package is not installed; the message has the command that installs it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f'{package} is not installed: pip install "fishbone[{extra}]"', name=package)
        self.package = package
        """The package that is missing."""
        self.extra = extra
        """The extra of fishbone that installs the package."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.package, self.extra), self.__dict__


class NotConverged(FishboneError):  # noqa: N818
    """A strict solve has not converged; `equilibrium` is its result."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        super().__init__(f"{equilibrium.status}: {equilibrium.message}")
        self.status: Status = equilibrium.status
        """How the solve ended."""
        self.solve_message = equilibrium.message
        """The reason, and what to try."""
        self.equilibrium = equilibrium
        """The result of the solve."""
        self.scenario = equilibrium.scenario
        """The scenario of the solve."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.equilibrium,), self.__dict__
