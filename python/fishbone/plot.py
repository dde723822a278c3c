"""Pictures of an equilibrium, of several, of a diagram and of a sweep; needs `pip install "fishbone[plot]"`."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fishbone.errors import InvalidArgument, MissingPackage
from fishbone.files import write_whole

try:
    import matplotlib as mpl
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator, MultipleLocator
except ImportError:
    raise MissingPackage("matplotlib", "plot") from None

from fishbone import chart
from fishbone.equilibrium import Equilibrium
from fishbone.follow import Diagram
from fishbone.scene import (
    ARROW,
    AXES,
    CLAMP,
    DARK,
    EDGE,
    GRAVITY,
    HIGHEST,
    HINGE,
    LIGHT,
    LINK,
    PIN,
    RIB,
    RIGID,
    SPINE,
    START,
    UNIT,
    Scene,
    View,
    draw_lit,
    draw_scene,
    drawn_ribs,
    feet_of,
    gravity_of,
    is_rigid,
    support_kind,
)
from fishbone.sweep import Sweep
from fishbone.sweep.picture import draw as draw_sweep
from fishbone.text import shown_name
from fishbone.units import scale, unit, without_rounding

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure
    from numpy.typing import ArrayLike

    from fishbone.equilibrium import Floats
    from fishbone.names import Place

    Style = dict[str, Any]
    Subject = Equilibrium | Sequence[Equilibrium] | Diagram | Sweep

SUFFIXES = (".png", ".pdf", ".svg")
VIEWER = (0.38, 0.6, -0.7)
"""Default direction to the viewer of the oblique view, in world axes; the world's x is up on the page."""

_STYLE: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "savefig.dpi": 300.0,
    # Equal pictures have equal files.
    "svg.hashsalt": "fishbone",
}
# By default these entries hold Matplotlib's version or the time of writing.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}
_X, _Y, _Z = 0, 1, 2
_WIDTH, _DECORATION, _GRAPHS, _KEY = 7.0, 0.6, 2.0, 0.55
"""Page width, and heights of titles and labels, of the graphs and of the key [in]."""
_PANEL = 1.4
"""Height of a panel of a diagram [in]."""
_FLAT_HEIGHTS = (0.35, 2.4)
_LEAST_ANGLE = 1e-6
"""Extent of the shortest axis of rib angles [degrees]."""
SHOWN = 12
"""Greatest number of equilibria on one page."""
_COLUMNS, _PANEL_TITLE = 3, 0.25
"""Number of equilibria side by side, and height of a title [in]."""

# Third-angle projection: the top view stands over the front view, the view from the right stands right of it.
_TOP = View("Top view (from +x)", UNIT[_Y], UNIT[_Z], UNIT[_X])
_FRONT = View("Front view (from −z)", UNIT[_Y], UNIT[_X], -UNIT[_Z])
_SIDE = View("Side view (from +y)", UNIT[_Z], UNIT[_X], UNIT[_Y])


def views(equilibrium: Equilibrium) -> Figure:
    """Top, front, side and oblique view, the flat board with its ribs, rib angle and bend along the spine.

    Top, front and side view have one scale. The belt is light where its +ξ side faces the viewer, darker where its −ξ
    side does, and darker still where it is rigid.

    Errors: `InvalidArgument` where the result of the solve has no shape.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        return _draw(equilibrium)


def flat(equilibrium: Equilibrium) -> Figure:
    """The flat board: its outline, its spine, its stiffeners, and its ribs, along which the belt is straight.

    Errors: `InvalidArgument` where the result of the solve has no shape.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _flat_height(equilibrium) + _DECORATION), layout="constrained")
        draw_flat(figure.subplots(), equilibrium)
        return figure


def oblique(equilibrium: Equilibrium, viewer: ArrayLike = VIEWER) -> Figure:
    """The belt in parallel projection, seen from the direction `viewer`, the world's x upwards.

    Shapes: viewer (3,), not along x.
    Errors: `InvalidArgument` where the result of the solve has no shape.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _WIDTH), layout="constrained")
        draw_oblique(figure.subplots(), equilibrium, viewer)
        return figure


def overview(equilibria: Sequence[Equilibrium], viewer: ArrayLike = VIEWER) -> Figure:
    """Equilibria of a belt side by side, such as those of `branches`, with their energies and stability.

    All are in parallel projection on one scale, seen from the direction `viewer`, the world's x upwards. Of more than
    12 equilibria the first 12 are drawn.

    Shapes: viewer (3,), not along x.
    Errors: `InvalidArgument` where there is no equilibrium, or an equilibrium has no shape.
    """
    if not equilibria:
        raise InvalidArgument("equilibria: found none, allowed one or more")
    for equilibrium in equilibria:
        _check(equilibrium)
    with mpl.rc_context(_STYLE):
        return _draw_overview(equilibria, viewer)


def diagram(diagram: Diagram, support: Place | None = None, *, radius_limit: float | None = None) -> Figure:
    """Energy, height, force of a support, tightest bend and rib margin over the parameter.

    Along poses that turn about one axis the parameter is the angle in degrees, and the tightest bend is shown as the
    least radius; `radius_limit` draws a line at a radius. Events that a finer mesh does not confirm are left out.

    Lines are solid for stable states, dashed for unstable and dotted for undecided states. Markers are the events;
    arrows lead from the loss of stability to the minimum after the snap. `support` is named as for
    `Equilibrium.reaction`; None is the support that the path moves, or else the last support. Without supports the
    force is left out.

    Errors: `NoSupport`.
    """
    with mpl.rc_context(_STYLE):
        return _draw_diagram(diagram, support, radius_limit)


def sweep(sweep: Sweep, *, limit: str | None = None) -> Figure:
    """Figures of a sweep over its field, or a map of one figure over two fields, as they are in its table.

    Over one field these are the energy, the least bend radius on the spine, the one exceeded on 99 % of the area, and
    the figure of the limit. A map is of the figure of the limit, else of the radius on 99 % of the area. Crosses are
    points that have not converged, circles points of a sample that are beyond the limit. The title has the yield with a
    `limit`, which is given as for `Sweep.passes` and drawn as a line.

    Errors: `InvalidArgument` where there are more than two fields, or the limit is invalid.
    """
    with mpl.rc_context(_STYLE):
        return draw_sweep(sweep, limit)


def encode(subject: Subject, suffix: str, *, radius_limit: float | None = None, limit: str | None = None) -> bytes:
    """The content of a picture file in the format of the suffix; equal for equal shapes as PNG and PDF.

    The picture is that of `views` for an equilibrium, of `overview` for several, of `diagram` for a diagram, and of
    `sweep` for a sweep.

    Errors: `InvalidArgument` where the suffix is not in `SUFFIXES`, or there is no shape, and those of `sweep`.
    """
    suffix = suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidArgument(f"figure: found {suffix or 'no suffix'}, allowed {', '.join(SUFFIXES)}")
    content = io.BytesIO()
    figure = _figure_of(subject, radius_limit, limit)
    with mpl.rc_context(_STYLE):
        figure.savefig(content, format=suffix[1:], metadata=_METADATA[suffix])
    return content.getvalue()


def _figure_of(subject: Subject, radius_limit: float | None, limit: str | None) -> Figure:
    if isinstance(subject, Diagram):
        return diagram(subject, radius_limit=radius_limit)
    if isinstance(subject, Sweep):
        return sweep(subject, limit=limit)
    return views(subject) if isinstance(subject, Equilibrium) else overview(subject)


def save(subject: Subject, path: str | os.PathLike[str]) -> None:
    """Writes the picture of `encode` to a file, .png, .pdf or .svg.

    Errors: `InvalidArgument` for another suffix or where there is no shape, `OSError`.
    """
    path = Path(path)
    write_whole(path, encode(subject, path.suffix))


def _check(equilibrium: Equilibrium) -> None:
    if not np.isfinite(equilibrium.position).all():
        raise InvalidArgument(f"equilibrium: found no shape ({equilibrium.status}), allowed a finite one")


# ------------------------------------------------------------------------------------------------------- the page


def _draw(equilibrium: Equilibrium) -> Figure:
    scene = Scene(equilibrium)
    size = scene.high - scene.low
    views_height = _WIDTH * (size[_Z] + size[_X]) / (size[_Y] + size[_Z]) + _DECORATION
    heights = [views_height, _flat_height(equilibrium) + _DECORATION, _GRAPHS, _KEY]
    figure = Figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
    figure.suptitle(_title(equilibrium), fontsize=10.0, parse_math=False)
    parts = figure.subfigures(4, 1, height_ratios=heights, squeeze=False).ravel()
    for part in parts:
        part.patch.set_visible(False)  # its lower edge would be at 0 or at −0, as the arrays are in memory
    upper, middle, lower, key = parts
    _draw_views(upper, scene, _length(equilibrium))
    draw_flat(middle.subplots(), equilibrium)
    _draw_graphs(lower, equilibrium)
    key.legend(handles=list(_key(equilibrium)), loc="center", ncols=6, frameon=False)
    return figure


def _title(equilibrium: Equilibrium) -> str:
    status = "" if equilibrium.status == "converged" else f", {equilibrium.status.replace('_', ' ')}"
    return f"{shown_name(equilibrium.scenario)}: {equilibrium.energy_model} energy {_energy(equilibrium)}{status}"


def _energy(equilibrium: Equilibrium) -> str:
    """The energy with its unit, 0 where it is rounding."""
    energy = without_rounding(np.array(equilibrium.energy), scale(equilibrium, "energy"))
    joule = unit(equilibrium.scenario, "energy")
    return f"{float(energy):.5g}" + ("" if joule is None else f" {joule}")


def _draw_views(figure: SubFigure, scene: Scene, length: str) -> None:
    low, high = scene.low, scene.high
    size = high - low
    top, corner, front, side = figure.subplots(
        2, 2, width_ratios=size[[_Y, _Z]].tolist(), height_ratios=size[[_Z, _X]].tolist()
    ).flat
    step = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(0.0, size.max())[1]
    for axes, view, right, up in ((top, _TOP, _Y, _Z), (front, _FRONT, _Y, _X), (side, _SIDE, _Z, _X)):
        draw_scene(axes, scene, view)
        axes.set(xlim=(low[right], high[right]), ylim=(low[up], high[up]), aspect="equal", title=view.title)
        axes.xaxis.set_major_locator(MultipleLocator(step))
        axes.yaxis.set_major_locator(MultipleLocator(step))
        axes.set(xlabel=f"{AXES[right]} [{length}]" if axes is not top else "")
        axes.set(ylabel=f"{AXES[up]} [{length}]" if axes is not side else "")
    top.tick_params(labelbottom=False)
    side.tick_params(labelleft=False)
    draw_lit(corner, scene, VIEWER)


def _draw_graphs(figure: SubFigure, equilibrium: Equilibrium) -> None:
    angle, bend = figure.subplots(1, 2)
    _draw_graph(angle, equilibrium, np.degrees(equilibrium.rib_angle), "Rib angle", "α [degrees]")
    _draw_graph(bend, equilibrium, equilibrium.bend, "Bend", f"$ω_ζ$ [1/{_length(equilibrium)}]")
    chart.widen(angle, _LEAST_ANGLE)
    chart.widen(bend, chart.NOISE * scale(equilibrium, "curvature"))


def _length(equilibrium: Equilibrium) -> str:
    """The unit of length, or the word where it is not known."""
    return unit(equilibrium.scenario, "length") or "length"


def _draw_graph(axes: Axes, equilibrium: Equilibrium, values: Floats, title: str, label: str) -> None:
    u = equilibrium.u
    for first, last in equilibrium.stiffeners:
        axes.axvspan(first, last, color=str(LIGHT - 0.5 * RIGID), linewidth=0.0)
    axes.axhline(0.0, color="0.6", linewidth=0.5)
    axes.plot(u, values, color="black", linewidth=1.0)
    axes.set(xlim=(u[0], u[-1]), xlabel=f"u [{_length(equilibrium)}]", ylabel=label, title=title)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.grid(visible=True, color="0.9", linewidth=0.5)


def _key(equilibrium: Equilibrium) -> Iterator[Line2D | Patch]:
    """The key of the symbols in the picture."""
    tables = equilibrium.scenario.to_dict()
    loads = tables.get("loads", {})
    kinds = {support_kind(support) for support in tables["supports"]}
    yield Line2D([], [], label="spine", **SPINE)
    yield Line2D([], [], label="edges", **EDGE)
    yield Line2D([], [], label="ribs", **RIB)
    for label, shade in (("+ξ side", LIGHT), ("−ξ side", DARK)):
        yield Patch(label=label, facecolor=str(shade), edgecolor="0.35", linewidth=0.35)
    if equilibrium.stiffeners:
        yield Patch(label="rigid", facecolor=str(LIGHT - RIGID), edgecolor="0.35", linewidth=0.35)
    yield Line2D([], [], label="start, u = 0", **START)
    yield Line2D([], [], label="highest point", **HIGHEST)
    for kind, label, style in (
        ("frame", "held frame", CLAMP),
        ("hinge", "hinge axis", HINGE),
        ("place", "held place", PIN),
    ):
        if kind in kinds:
            yield Line2D([], [], label=label, **style)
    if tables.get("links"):
        yield Line2D([], [], label="link", **LINK)
    arrow: Style = {"linestyle": "", "marker": "$→$", "markersize": 9.0}
    if loads.get("points"):
        yield Line2D([], [], label="force", color=ARROW["color"], **arrow)
    if gravity_of(tables).any():
        yield Line2D([], [], label="gravity", color=GRAVITY["color"], **arrow)


# -------------------------------------------------------------------------------------------------- several shapes


def _draw_overview(equilibria: Sequence[Equilibrium], viewer: ArrayLike) -> Figure:
    shown = equilibria[:SHOWN]
    columns = min(_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    side = _WIDTH / _COLUMNS
    figure = Figure(figsize=(side * columns, side * rows), layout="constrained")
    first = equilibria[0]
    more = len(equilibria) - len(shown)
    rest = f"; {more} more not shown" if more else ""
    figure.suptitle(f"{shown_name(first.scenario)}: {first.energy_model} energy{rest}", fontsize=10.0, parse_math=False)
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for index, (axes, equilibrium) in enumerate(zip(panels, shown, strict=False)):
        draw_oblique(axes, equilibrium, viewer)
        crossing = "" if equilibrium.crosses_itself is None else "\npasses through itself"
        axes.set_title(f"{index}: {_energy(equilibrium)}, {stability(equilibrium)}{crossing}")
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    height = side * _set_one_scale(panels[: len(shown)])
    figure.set_figheight(rows * (height + _PANEL_TITLE) + _DECORATION)
    return figure


def stability(equilibrium: Equilibrium) -> str:
    """The stability of an equilibrium in words."""
    if equilibrium.stable is None:
        return "stability not known"
    if equilibrium.stable:
        return "stable"
    return "1 negative mode" if equilibrium.negative_modes == 1 else f"{equilibrium.negative_modes} negative modes"


def _set_one_scale(panels: Sequence[Axes]) -> float:
    """Gives all panels the same extent, each about its own middle; returns the height over the width."""
    limits = np.array([(axes.get_xlim(), axes.get_ylim()) for axes in panels])
    half = np.ptp(limits, axis=-1).max(axis=0) / 2.0
    for axes, middle in zip(panels, limits.mean(axis=-1), strict=True):
        (left, bottom), (right, top) = middle - half, middle + half
        axes.set(xlim=(left, right), ylim=(bottom, top))
    return float(half[1] / half[0])


# --------------------------------------------------------------------------------------------------- the diagram


def _draw_diagram(diagram: Diagram, support: Place | None, limit: float | None) -> Figure:
    panels = list(chart.panels(diagram, support, limit))
    figure = Figure(figsize=(_WIDTH, _PANEL * len(panels) + _DECORATION + _KEY), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    snaps = [chart.draw(part, diagram, panel) for part, panel in zip(axes, panels, strict=True)]
    has_angle = diagram.angle(0.0) is not None
    name = f"angle of supports[{diagram.support}] [degrees]" if has_angle else diagram.parameter_name
    axes[-1].set_xlabel(name, parse_math=False)
    figure.align_ylabels(axes)
    figure.suptitle(shown_name(diagram.scenario), fontsize=10.0, parse_math=False)
    figure.legend(
        handles=list(chart.key(diagram, snaps=any(snaps), limit=limit is not None)),
        loc="outside lower center",
        ncols=6,
        frameon=False,
    )
    return figure


# ------------------------------------------------------------------------------------------------- the flat board


def draw_flat(axes: Axes, equilibrium: Equilibrium) -> None:
    """Draws the flat board into axes: outline, spine, stiffeners, ribs; coordinates (y, z) of the start."""
    vertices, triangles = equilibrium.flat_mesh(2)
    faces = vertices[triangles]
    shades = np.where(is_rigid(equilibrium, feet_of(equilibrium)), LIGHT - RIGID, LIGHT)
    colors = [str(shade) for shade in shades]
    axes.add_collection(PolyCollection(list(faces), facecolors=colors, edgecolors=colors, linewidths=0.6, zorder=2))
    ribs = equilibrium.flat_ribs()[drawn_ribs(equilibrium.u)]
    axes.add_collection(LineCollection(list(ribs), zorder=2, colors=RIB["color"], linewidths=RIB["linewidth"]))
    for line in equilibrium.outline().loops:
        axes.plot(*line.T, zorder=2, **EDGE)
    spine = equilibrium.flat_spine()
    axes.plot(*spine.T, zorder=2, **SPINE)
    axes.plot(*spine[0], zorder=3, **START)
    length = _length(equilibrium)
    axes.set(aspect="equal", title="Flat board", xlabel=f"y [{length}]", ylabel=f"z [{length}]")
    axes.autoscale_view()
    # Along the width of a narrow board there is little room for numbers.
    axes.xaxis.set_major_locator(MaxNLocator(6 if np.ptp(axes.get_xlim()) > np.ptp(axes.get_ylim()) else 4))
    axes.yaxis.set_major_locator(MaxNLocator(3 if np.ptp(axes.get_ylim()) < 0.3 * np.ptp(axes.get_xlim()) else 6))


def _flat_height(equilibrium: Equilibrium) -> float:
    """Height [in] of a picture of the flat board that fills the page's width, within `_FLAT_HEIGHTS`."""
    width, height = np.ptp(np.concatenate(equilibrium.outline().loops), axis=0)
    least, most = _FLAT_HEIGHTS
    return float(np.clip(_WIDTH * height / width, least, most))


def draw_oblique(axes: Axes, equilibrium: Equilibrium, viewer: ArrayLike = VIEWER) -> None:
    """Draws the belt into axes, in parallel projection from the direction `viewer`, the world's x upwards."""
    draw_lit(axes, Scene(equilibrium), viewer)
