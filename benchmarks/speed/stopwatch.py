"""The clock of all rivals."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def timed(
    function: Callable[Arguments, Result], *arguments: Arguments.args, **options: Arguments.kwargs
) -> tuple[float, Result]:
    """Seconds that a call took, and what it returned."""
    start = perf_counter()
    result = function(*arguments, **options)
    return perf_counter() - start, result
