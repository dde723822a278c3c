"""Names of supports: an end, an arc length or an index."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fishbone.errors import InvalidArgument, NoSupport
from fishbone.pose import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fishbone.names import Place

SAME_PLACE = 1e-9
"""Distance over the length of the belt up to which two arc lengths are one."""


def support_index(support: Place, places: Sequence[float], length: float) -> int:
    """The index of a support that is named by an end, its arc length or its index.

    An integer in the range of the indices is an index. So is a whole number of another type, but where it is the arc
    length of another support: there it is refused.

    Units: `places`, the arc lengths of the supports, and `length`, that of the belt, in the same.
    Errors: `NoSupport`.
    """
    at = {"start": 0.0, "end": length}.get(support, math.nan) if isinstance(support, str) else _number(support)
    there = next((index for index, place in enumerate(places) if abs(place - at) <= SAME_PLACE * length), None)
    if isinstance(support, str) or not at.is_integer() or not -len(places) <= at < len(places):
        if there is None:
            ends = '"start", "end"'
            raise _no_support(support, f"found supports at u = {list(places)}, allowed one of them, {ends} or an index")
        return there
    index = range(len(places))[int(at)]
    if there not in {None, index} and not isinstance(support, int | np.integer):
        found = f"found an index and the arc length of supports[{there}]"
        raise _no_support(support, f"{found}, allowed {there} for this one")
    return index


def _number(support: Any) -> float:  # noqa: ANN401 - whatever a caller brings
    """The number that names a support; NaN of what is no number."""
    try:
        return float(support if isinstance(support, int | float) else numbers_of("support", support, ()))
    except (InvalidArgument, OverflowError):
        return math.nan


def _no_support(support: Place, text: str) -> NoSupport:
    error = NoSupport(f"support {support!r}: {text}")
    error.support = support
    return error
