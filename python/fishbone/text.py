"""Text of the user as it is shown."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fishbone.scenario import Scenario

# The controls C0, DEL and C1; separators of lines; marks that reverse the order of the text; bytes that are no UTF-8.
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def shown(text: str) -> str:
    r"""The text with control characters as escapes, so that it is shown and controls no terminal.

    >>> print(shown("\x1b[31mred\n\u202e"))
    \x1b[31mred\n\u202e
    """
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def shown_name(scenario: Scenario) -> str:
    """The name of a scenario as it is shown; "belt" where it has none."""
    return shown(scenario.to_dict().get("name") or "belt")
