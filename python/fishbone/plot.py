"""Pictures of an equilibrium; needs `pip install "fishbone[plot]"`."""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fishbone.errors import InvalidArgument, MissingPackage
from fishbone.files import write_whole

try:
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator, MultipleLocator
except ImportError:
    raise MissingPackage("matplotlib", "plot") from None

if TYPE_CHECKING:
    import os

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from fishbone.equilibrium import Equilibrium, Floats

SUFFIXES = (".png", ".pdf", ".svg")
RIBS = 80
"""Ribs drawn at most: more of them would print as a grey area."""

_STYLE: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "savefig.dpi": 300.0,
    # The same picture gives the same file.
    "svg.hashsalt": "fishbone",
}
# Matplotlib's own entries of these kinds hold its version or the time of writing.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}
_X, _Y, _Z = 0, 1, 2
_AXES = "xyz"
# Lightness alone tells things apart, so that the picture survives a monochrome printer.
_LIGHT, _DARK = "0.95", "0.72"
_RIB: dict[str, Any] = {"edgecolor": "0.35", "linewidth": 0.35}
_EDGE: dict[str, Any] = {"color": "black", "linewidth": 0.8}
_SPINE: dict[str, Any] = {"color": "black", "linewidth": 1.4}
_START: dict[str, Any] = {"color": "black", "marker": "o", "markersize": 4.0, "linestyle": ""}
_HIGHEST: dict[str, Any] = {
    "color": "black",
    "marker": "^",
    "markersize": 5.0,
    "markerfacecolor": "white",
    "linestyle": "",
}
_WIDTH, _DECORATION, _GRAPHS = 7.0, 0.6, 2.2
"""Page width, and heights of what surrounds the views and of the graphs [in]."""


class _View(NamedTuple):
    """Where to look from: which world axis goes right on the page, which up, and which sign points at the viewer."""

    title: str
    right: int
    up: int
    depth: int
    sign: float


# Third-angle projection: the top view stands over the front view, the view from the right stands right of it.
_TOP = _View("Top view (from +x)", _Y, _Z, _X, 1.0)
_FRONT = _View("Front view (from −z)", _Y, _X, _Z, -1.0)
_SIDE = _View("Side view (from +y)", _Z, _X, _Y, 1.0)


def views(equilibrium: Equilibrium) -> Figure:
    """Top, front and side view with the ribs, and the rib angle and the bend along the spine.

    The three views have one scale. The belt is light where its ξ side faces the viewer, darker where the other does.

    Errors: `InvalidArgument` where the solve left no shape to draw.
    """
    if not np.isfinite(equilibrium.position).all():
        raise InvalidArgument(f"equilibrium: found no shape ({equilibrium.status}), allowed a finite one")
    with mpl.rc_context(_STYLE):
        return _draw(equilibrium)


def encode(equilibrium: Equilibrium, suffix: str) -> bytes:
    """The picture's file content, by the suffix of its name; equal for equal shapes as PNG and PDF.

    Errors: `InvalidArgument` where the suffix is none of `SUFFIXES`.
    """
    suffix = suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidArgument(f"figure: found {suffix or 'no suffix'}, allowed {', '.join(SUFFIXES)}")
    content = io.BytesIO()
    figure = views(equilibrium)
    with mpl.rc_context(_STYLE):
        figure.savefig(content, format=suffix[1:], metadata=_METADATA[suffix])
    return content.getvalue()


def save(equilibrium: Equilibrium, path: str | os.PathLike[str]) -> None:
    """Writes the picture to a file, .png, .pdf or .svg.

    Errors: `InvalidArgument` for another suffix, `OSError`.
    """
    path = Path(path)
    write_whole(path, encode(equilibrium, path.suffix))


def _draw(equilibrium: Equilibrium) -> Figure:
    low, high = _box(equilibrium)
    size = high - low
    views_height = _WIDTH * (size[_Z] + size[_X]) / (size[_Y] + size[_Z]) + _DECORATION
    figure = Figure(figsize=(_WIDTH, views_height + _GRAPHS), layout="constrained")
    figure.suptitle(_title(equilibrium), fontsize=10.0, parse_math=False)
    upper, lower = figure.subfigures(2, 1, height_ratios=(views_height, _GRAPHS), squeeze=False).flat
    _draw_views(upper, equilibrium, low, high)
    _draw_graphs(lower, equilibrium)
    return figure


def _title(equilibrium: Equilibrium) -> str:
    name = equilibrium.scenario.to_dict().get("name") or "belt"
    status = "" if equilibrium.status == "converged" else f", {equilibrium.status.replace('_', ' ')}"
    return f"{name}: {equilibrium.energy_model} energy {equilibrium.energy:.5g}{status}"


def _box(equilibrium: Equilibrium) -> tuple[Floats, Floats]:
    """The corners of the box to draw: around the belt, and nowhere so thin that an axis could not be read."""
    points = np.concatenate(equilibrium.edges)
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = (low + high) / 2.0, high - low
    size = 1.06 * np.maximum(size, 0.3 * size.max())
    return middle - size / 2.0, middle + size / 2.0


def _draw_views(figure: SubFigure, equilibrium: Equilibrium, low: Floats, high: Floats) -> None:
    size = high - low
    top, corner, front, side = figure.subplots(
        2, 2, sharex="col", sharey="row", width_ratios=size[[_Y, _Z]].tolist(), height_ratios=size[[_Z, _X]].tolist()
    ).flat
    corner.set_axis_off()
    strips = _strips(equilibrium)
    step = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(0.0, size.max())[1]
    for axes, view in ((top, _TOP), (front, _FRONT), (side, _SIDE)):
        _draw_view(axes, equilibrium, strips, view)
        axes.set(xlim=(low[view.right], high[view.right]), ylim=(low[view.up], high[view.up]))
        axes.xaxis.set_major_locator(MultipleLocator(step))
        axes.yaxis.set_major_locator(MultipleLocator(step))
    _draw_key(corner)


def _draw_view(axes: Axes, equilibrium: Equilibrium, strips: list[_Strip], view: _View) -> None:
    page = [view.right, view.up]
    # The painter's algorithm: what is near hides what is far.
    for strip in sorted(strips, key=lambda strip: view.sign * strip.middle[view.depth]):
        color = _LIGHT if view.sign * strip.normal[view.depth] > 0.0 else _DARK
        axes.fill(*strip.outline[:, page].T, facecolor=color, zorder=2, **_RIB)
        for line, style in strip.lines:
            axes.plot(*line[:, page].T, zorder=2, **style)
    axes.plot(*equilibrium.position[0, page], zorder=3, **_START)
    axes.plot(*equilibrium.highest_point.position[page], zorder=3, **_HIGHEST)
    axes.set(
        aspect="equal", title=view.title, xlabel=f"{_AXES[view.right]} [length]", ylabel=f"{_AXES[view.up]} [length]"
    )
    axes.label_outer()


class _Strip(NamedTuple):
    """The belt between two drawn ribs: its outline, the lines on it, and its means for sorting and shading."""

    outline: Floats
    lines: list[tuple[Floats, dict[str, Any]]]
    middle: Floats
    normal: Floats


def _strips(equilibrium: Equilibrium) -> list[_Strip]:
    strips = [_strip(equilibrium, slice(first, last + 1)) for first, last in pairwise(_drawn_ribs(equilibrium.u))]
    # The two ends belong to the outer strips, so that they are hidden where these are.
    for strip, end in ((strips[0], 0), (strips[-1], -1)):
        strip.lines.append((np.stack([edge[end] for edge in equilibrium.edges]), _EDGE))
    return strips


def _strip(equilibrium: Equilibrium, part: slice) -> _Strip:
    minus, plus = (edge[part] for edge in equilibrium.edges)
    spine, normal = equilibrium.position[part], equilibrium.frame[part, :, 0]
    return _Strip(
        np.concatenate((minus, plus[::-1])),
        [(minus, _EDGE), (plus, _EDGE), (spine, _SPINE)],
        spine.mean(axis=0),
        normal.mean(axis=0),
    )


def _drawn_ribs(u: Floats) -> list[int]:
    """Nodes whose ribs are drawn, equally spaced along the spine where there are more than enough."""
    wanted = np.linspace(u[0], u[-1], min(RIBS, len(u) - 1) + 1)
    nearest = np.abs(u[:, None] - wanted).argmin(axis=0)
    return sorted({0, len(u) - 1, *nearest.tolist()})


def _draw_key(axes: Axes) -> None:
    handles = [
        Line2D([], [], label="spine", **_SPINE),
        Line2D([], [], label="edges", **_EDGE),
        Line2D([], [], label="ribs", color=_RIB["edgecolor"], linewidth=_RIB["linewidth"]),
        Patch(label="+ξ side", facecolor=_LIGHT, **_RIB),
        Patch(label="−ξ side", facecolor=_DARK, **_RIB),
        Line2D([], [], label="start, u = 0", **_START),
        Line2D([], [], label="highest point", **_HIGHEST),
    ]
    axes.legend(handles=handles, loc="center", frameon=False)


def _draw_graphs(figure: SubFigure, equilibrium: Equilibrium) -> None:
    angle, bend = figure.subplots(1, 2)
    _draw_graph(angle, equilibrium.u, np.degrees(equilibrium.rib_angle), "Rib angle", "α [degrees]")
    _draw_graph(bend, equilibrium.u, equilibrium.bend, "Bend", "$ω_ζ$ [1/length]")


def _draw_graph(axes: Axes, u: Floats, values: Floats, title: str, label: str) -> None:
    axes.axhline(0.0, color="0.6", linewidth=0.5)
    axes.plot(u, values, color="black", linewidth=1.0)
    axes.set(xlim=(u[0], u[-1]), xlabel="u [length]", ylabel=label, title=title)
    axes.grid(visible=True, color="0.9", linewidth=0.5)
