"""Changes to a scenario, field by field: `put("belt.width", 0.1)`; numbers in a path are list indices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from helpers import Json

Change = Callable[[Json], None]


def table_of(scenario: Json, path: str) -> tuple[Any, Any]:
    """The table that holds a field, made where it is missing, and the field's key."""
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    table: Any = scenario
    for key in parents:
        table = table.setdefault(key, {}) if isinstance(table, dict) else table[key]
    return table, last


def put(path: str, value: Any) -> Change:
    """Sets a field."""

    def change(scenario: Json) -> None:
        table, key = table_of(scenario, path)
        table[key] = value

    return change


def rename(path: str, new: str) -> Change:
    """Misspells a key."""

    def change(scenario: Json) -> None:
        table, key = table_of(scenario, path)
        table[new] = table.pop(key)

    return change


def drop(path: str) -> Change:
    """Leaves a field out."""

    def change(scenario: Json) -> None:
        table, key = table_of(scenario, path)
        del table[key]

    return change


def several(*changes: Change) -> Change:
    """Several changes, one after the other."""

    def change(scenario: Json) -> None:
        for one in changes:
            one(scenario)

    return change
