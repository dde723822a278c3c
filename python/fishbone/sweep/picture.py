"""Pictures of a sweep: figures over one field, or a map over two; needs Matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fishbone import chart
from fishbone.errors import InvalidArgument
from fishbone.sweep.limit import describe_yield, limit_of, numbers_in, quantity_of
from fishbone.units import labelled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

    from fishbone.sweep import Sweep
    from fishbone.sweep.limit import Limit
    from fishbone.sweep.points import Floats

    Style = dict[str, Any]

PANELS = ("energy", "bend_radius.spine.value", "bend_radius.area.p99")
"""The figures drawn over one field, besides that of a limit."""
MAPPED = "bend_radius.area.p99"
"""The figure drawn over two fields where there is no limit."""
MOST_FIELDS = 2
_WIDTH, _PANEL, _MAP, _DECORATION = 7.0, 1.6, 5.0, 0.8
"""Page width, height of a panel, of a map, and of titles and labels [in]."""
_FAILED: Style = {"linestyle": "", "marker": "x", "markersize": 4.0, "color": "firebrick", "clip_on": False}
_BEYOND: Style = {"linestyle": "", "marker": "o", "markersize": 6.0, "color": "firebrick", "fillstyle": "none"}
_DOTS: Style = {"linestyle": "", "marker": ".", "markersize": 3.0, "color": "black"}
_LINE: Style = {"linestyle": "-", "marker": ".", "markersize": 3.0, "linewidth": 1.0, "color": "black"}


def check_fields(fields: Sequence[str]) -> None:
    """Refuses a picture of more fields than a page has directions.

    Errors: `InvalidArgument`.
    """
    if len(fields) > MOST_FIELDS:
        raise InvalidArgument(f"figure: found {len(fields)} fields, allowed 1 or 2")


def draw(found: Sweep, limit: str | None) -> Figure:
    """The picture that `fishbone.plot.sweep` describes."""
    check_fields(found.fields)
    checked = None if limit is None else limit_of(found.scenario, limit)
    figure = _draw_lines(found, checked) if len(found.fields) == 1 else _draw_map(found, checked)
    name = found.scenario.to_dict().get("name") or "belt"
    outcome = (
        f"{found.statuses.get('converged', 0)} of {len(found)} points converged"
        if limit is None
        else describe_yield(found.passes(limit), limit)
    )
    figure.suptitle(f"{name}\n{outcome}", fontsize=10.0, parse_math=False)
    return figure


def _draw_lines(found: Sweep, limit: Limit | None) -> Figure:
    """Figures over one field; crosses on the lowest axis are points without an equilibrium."""
    panels = dict.fromkeys(PANELS if limit is None else (*PANELS, limit.column))
    columns = [column for column in panels if column in found.names]
    height = max(len(columns), 1)
    figure = Figure(figsize=(_WIDTH, _PANEL * height + _DECORATION), layout="constrained")
    rows = figure.subplots(height, 1, sharex=True, squeeze=False)[:, 0]
    [field] = found.fields
    places = found.column(field)
    for axes, column in zip(rows, columns, strict=False):
        values = _converged(found, column)
        axes.plot(places, values, **(_LINE if found.is_grid else _DOTS))
        if limit is not None and column == limit.column:
            axes.axhline(limit.value, **chart.LIMIT)
        axes.set_title(_label(found, column), loc="left", fontsize=9.0, parse_math=False)
        axes.grid(visible=True, color="0.9", linewidth=0.5)
    failed = places[found.column("status") != "converged"]
    on_axis = {**_FAILED, "transform": rows[-1].get_xaxis_transform()}
    _draw_points(rows[-1], failed, np.zeros(len(failed)), on_axis)
    rows[-1].set_xlabel(_label(found, field), parse_math=False)
    _add_key(figure, len(failed), 0)
    return figure


def _draw_map(found: Sweep, limit: Limit | None) -> Figure:
    """A figure over two fields, with crosses where there is no equilibrium, and a line at the limit.

    Of a sample the points beyond the limit have circles.
    """
    column = MAPPED if limit is None else limit.column
    figure = Figure(figsize=(_WIDTH, _MAP + _DECORATION), layout="constrained")
    axes = figure.subplots()
    x, y = (found.column(field) for field in found.fields)
    values = _converged(found, column) if column in found.names else np.full(len(found), np.nan)
    name, _, _ = chart.COLORS
    drawn: ScalarMappable
    beyond = np.zeros(len(found), dtype=bool)
    if found.is_grid:
        grid = [array.reshape(found.counts) for array in (x, y, values)]
        drawn = axes.pcolormesh(*grid, cmap=name, shading="nearest")
        _draw_limit(axes, grid, limit)
    else:
        drawn = axes.scatter(x, y, c=values, cmap=name, s=8.0, plotnonfinite=False)
        beyond |= np.isfinite(values) & (False if limit is None else ~limit.passes(values))
    failed = found.column("status") != "converged"
    _draw_points(axes, x[failed], y[failed], _FAILED)
    _draw_points(axes, x[beyond], y[beyond], _BEYOND)
    axes.grid(visible=False)
    bar = figure.colorbar(drawn, label=_label(found, column))
    if limit is not None and np.nanmin(values, initial=np.inf) <= limit.value <= np.nanmax(values, initial=-np.inf):
        bar.ax.axhline(limit.value, **chart.LIMIT)
    for direction, field in zip("xy", found.fields, strict=True):
        axes.set(**{f"{direction}label": _label(found, field)})
    _add_key(figure, int(failed.sum()), int(beyond.sum()))
    return figure


def _draw_points(axes: Axes, x: Floats, y: Floats, style: Style) -> None:
    """Points, if there are any: none would still take their room on the page."""
    if len(x):
        axes.plot(x, y, **style)


def _add_key(figure: Figure, failed: int, beyond: int) -> None:
    """What crosses and circles are, below the axes, where there are some."""
    marks = [(failed, "no equilibrium", _FAILED), (beyond, "beyond the limit", _BEYOND)]
    drawn = [Line2D([], [], label=label, **style) for count, label, style in marks if count]
    if drawn:
        figure.legend(handles=drawn, loc="outside lower right", ncols=len(drawn), fontsize=8.0, frameon=False)


def _draw_limit(axes: Axes, grid: list[Floats], limit: Limit | None) -> None:
    """The line on a map at which the figure is at its limit, where it passes through the map."""
    values = grid[-1]
    is_plane = min(values.shape) > 1
    if limit is not None and is_plane and np.any(values < limit.value) and np.any(values > limit.value):
        axes.contour(*grid, levels=[limit.value], colors=chart.LIMIT["color"], linestyles=chart.LIMIT["linestyle"])


def _converged(found: Sweep, column: str) -> Floats:
    """The finite figures of the points that have converged, NaN at the others."""
    values = numbers_in(column, found.column(column))
    figures: Floats = np.where((found.column("status") == "converged") & np.isfinite(values), values, np.nan)
    return figures


def _label(found: Sweep, column: str) -> str:
    quantity = quantity_of(column)
    return column if quantity is None else labelled(found.scenario, column, quantity)
