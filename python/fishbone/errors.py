"""What fishbone raises.

Most are made by the core, with their data as attributes, which are None where they do not apply. All survive pickling.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from fishbone.equilibrium import Equilibrium
    from fishbone.names import Place, Status


class FishboneError(Exception):
    """The root of all errors of this package."""


class InvalidScenario(FishboneError, ValueError):  # noqa: N818 - a scenario is invalid, or it is not
    """A scenario that says something it may not say; raised before any solve."""

    reason: Literal["syntax", "unknown_field", "unknown_choice", "invalid"] | None = None
    """What is wrong: the text is neither TOML nor JSON, there is no such field or word, or a value may not be this."""
    field: str | None = None
    """Path of the field at fault, such as "supports[1].position"; of a file itself, what of it is."""
    found: str | None = None
    """What was found there."""
    allowed: str | None = None
    """What may stand there, in words."""
    choices: tuple[str, ...] = ()
    """The fields or words of which one may stand there, where they are few."""
    nearest: str | None = None
    """Which of them was probably meant."""
    line: int | None = None
    """Line of the text, from 1, where that could not be read."""
    column: int | None = None
    """Column in that line, from 1."""
    file: str | None = None
    """The file, where it was one."""


class InvalidArgument(FishboneError, ValueError):  # noqa: N818
    """An argument outside what a function takes."""


class NoSupport(FishboneError, LookupError):  # noqa: N818
    """There is no support where one was asked for."""

    support: Place | None = None
    """The support that was asked for."""


class NoSensitivity(FishboneError):  # noqa: N818
    """A shape has no derivatives: it is no equilibrium, no minimum, or not determined by its supports."""

    reason: Literal["no_multipliers", "not_converged", "marginal", "flat", "saddle", "redundant", "no_slack"] | None = (
        None
    )
    """Why: the source's method knows no multipliers; the solve has not converged; the belt moves at no cost of energy;
    a part of it is flat under load; the energy is no minimum; supports hold the same twice over, or leave no slack."""
    redundant: str | None = None
    """The supports and links that hold the same twice over."""
    solve_message: str | None = None
    """What the solve said that has not converged."""


class NoMargin(FishboneError):  # noqa: N818
    """A shape has no stability to lose, or nothing that could be moved."""

    reason: (
        Literal[
            "no_multipliers",
            "not_converged",
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
    """Why: there is nothing to follow, as of `NoBranch`; it is not stable; the support holds no whole pose; or it could
    be followed only a part of the way; the last five as of `NoPath`."""
    support: int | None = None
    """Index of the support that holds no whole pose."""
    share: float | None = None
    """Which share of the reach it could be followed, stable until there."""
    solve_message: str | None = None
    """What the solve said that has not converged."""


class NoModes(FishboneError):  # noqa: N818
    """A shape has no modes of its own: it is no equilibrium."""

    reason: Literal["no_multipliers", "not_converged", "singular"] | None = None
    """Why: the source's method knows no multipliers; the solve has not converged; the second variation is singular."""
    solve_message: str | None = None
    """What the solve said that has not converged."""


class NoTracker(FishboneError):  # noqa: N818
    """There is no equilibrium to follow, or nothing to move it by."""

    reason: Literal["no_multipliers", "not_converged", "not_clamped", "no_support", "marginal"] | None = None
    """Why: the source's method knows no multipliers; the solve has not converged; the support holds no whole pose, or
    there is none; or the equilibrium is no strict minimum."""
    support: int | None = None
    """Index of the support that holds no whole pose, or is not there."""
    solve_message: str | None = None
    """What the solve said that has not converged."""


class NoPath(FishboneError, ValueError):  # noqa: N818
    """A scenario does not lead along the path that was asked for."""

    reason: Literal["no_number", "nothing", "not_clamped", "no_pose", "invalid", "unreadable"] | None = None
    """Why: the scenario gives no such number; nothing changes; the support holds no whole pose, or may not be held at
    one of the poses; the scenario at the end of the path is not valid, or a number there is not of the kind that its
    field takes."""
    field: str | None = None
    """Path of the field that gives no number, or that is not valid at the end."""
    found: str | None = None
    """What was found there."""
    allowed: str | None = None
    """What may stand there, where it is not valid at the end."""
    support: int | None = None
    """Index of the support that holds no whole pose."""


class NoBranch(FishboneError):  # noqa: N818
    """There is no equilibrium to follow, or it has no single continuation."""

    reason: Literal["no_multipliers", "not_converged", "singular"] | None = None
    """Why: the source's method knows no multipliers; the solve has not converged; or no single branch leads on."""
    solve_message: str | None = None
    """What the solve said that has not converged."""


class MissingPackage(FishboneError, ImportError):  # noqa: N818
    """An optional package is not installed; the message says how to get it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f'{package} is not installed: pip install "fishbone[{extra}]"', name=package)
        self.package = package
        """The package that is missing."""
        self.extra = extra
        """The extra of fishbone that brings it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.package, self.extra), self.__dict__


class NotConverged(FishboneError):  # noqa: N818
    """A strict solve ended without an equilibrium; what it ended with is `equilibrium`."""

    def __init__(self, equilibrium: Equilibrium, start: tuple[list[float], list[float]] | None = None) -> None:
        super().__init__(f"{equilibrium.status}: {equilibrium.message}")
        self.status: Status = equilibrium.status
        """How the solve ended."""
        self.solve_message = equilibrium.message
        """Why, and what to try."""
        self.scenario = equilibrium.scenario
        """What was to be solved."""
        self._start = start
        self._equilibrium: Equilibrium | None = equilibrium

    @property
    def equilibrium(self) -> Equilibrium:
        """What the solve ended with; what comes from a pickle, or is a copy, solves for it again when first asked."""
        if self._equilibrium is None:
            from fishbone.equilibrium import solve  # noqa: PLC0415 - it raises this

            self._equilibrium = solve(self.scenario, start=self._start)
        return self._equilibrium

    def __reduce__(self) -> tuple[Any, ...]:
        # The core's shapes cannot be pickled; the same scenario leads to the same one.
        return _revived, (type(self), self.args), self.__dict__ | {"_equilibrium": None}


def _revived(kind: type[NotConverged], args: tuple[Any, ...]) -> NotConverged:
    """One without what its constructor takes, which is set hereafter."""
    return kind.__new__(kind, *args)
