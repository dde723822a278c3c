"""Pictures of an equilibrium; needs `pip install "fishbone[plot]"`."""

from __future__ import annotations

import io
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fishbone.errors import InvalidArgument, MissingPackage
from fishbone.files import write_whole

try:
    import matplotlib as mpl
    from matplotlib.collections import LineCollection, PathCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.path import Path as Outline
    from matplotlib.ticker import MaxNLocator, MultipleLocator
except ImportError:
    raise MissingPackage("matplotlib", "plot") from None

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure
    from numpy.typing import ArrayLike, NDArray

    from fishbone.equilibrium import Equilibrium, Floats

    Style = dict[str, Any]

SUFFIXES = (".png", ".pdf", ".svg")
RIBS = 80
"""Ribs drawn at most: more of them would print as a grey area."""
VIEWER = (0.38, 0.6, -0.7)
"""From where the oblique view looks, in world axes, unless told otherwise; the world's x is up on the page."""

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
_LIGHT, _DARK = 0.95, 0.72
_RIGID = 0.3
"""By how much a stiffener is darker."""
_LAMP = np.array([0.8, 0.5, 0.1]) / np.linalg.norm([0.8, 0.5, 0.1])
_RIB: Style = {"color": "0.35", "linewidth": 0.35}
_EDGE: Style = {"color": "black", "linewidth": 0.8}
_SPINE: Style = {"color": "black", "linewidth": 1.4}
_START: Style = {"color": "black", "marker": "o", "markersize": 4.0, "linestyle": ""}
_HIGHEST: Style = {"color": "black", "marker": "^", "markersize": 5.0, "markerfacecolor": "white", "linestyle": ""}
_CLAMP: Style = {"color": "black", "linewidth": 2.6, "solid_capstyle": "butt"}
_PIN: Style = {"color": "black", "marker": "D", "markersize": 5.0, "markerfacecolor": "white", "linestyle": ""}
_HINGE: Style = {"color": "black", "linewidth": 1.2, "linestyle": "-.", "marker": ""}
_LINK: Style = {"color": "black", "linewidth": 0.9, "linestyle": ":", "marker": "s", "markersize": 3.0}
_ARROW: Style = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.1, "shrinkA": 0.0, "shrinkB": 0.0}
_GRAVITY: Style = _ARROW | {"color": "0.45"}
_WIDTH, _DECORATION, _GRAPHS, _KEY = 7.0, 0.6, 2.0, 0.55
"""Page width, and heights of what surrounds the views, of the graphs and of the key [in]."""
_MARGIN, _THINNEST, _ARROW_SHARE, _HIDDEN_SHARE = 1.06, 0.3, 0.2, 0.02
_FLAT_HEIGHTS = (0.35, 2.4)


class _View(NamedTuple):
    """Which way to look: what goes right on the page, what up, and what points at the viewer, in world axes."""

    title: str
    right: Floats
    up: Floats
    toward: Floats

    def page(self, points: ArrayLike) -> Floats:
        """World points on the page."""
        return np.asarray(points) @ np.stack((self.right, self.up), axis=-1)


# Third-angle projection: the top view stands over the front view, the view from the right stands right of it.
_UNIT = np.eye(3)
_TOP = _View("Top view (from +x)", _UNIT[_Y], _UNIT[_Z], _UNIT[_X])
_FRONT = _View("Front view (from −z)", _UNIT[_Y], _UNIT[_X], -_UNIT[_Z])
_SIDE = _View("Side view (from +y)", _UNIT[_Z], _UNIT[_X], _UNIT[_Y])


def views(equilibrium: Equilibrium) -> Figure:
    """Top, front and side view, an oblique one, the flat board with its ribs, rib angle and bend along the spine.

    The three views have one scale. The belt is light where its ξ side faces the viewer, darker where the other does,
    and darker still where it is rigid.

    Errors: `InvalidArgument` where the solve left no shape to draw.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        return _draw(equilibrium)


def flat(equilibrium: Equilibrium) -> Figure:
    """The flat board: its outline, its spine, its stiffeners, and the ribs along which it will not bend.

    Errors: `InvalidArgument` where the solve left no shape to draw.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _flat_height(equilibrium) + _DECORATION), layout="constrained")
        draw_flat(figure.subplots(), equilibrium)
        return figure


def oblique(equilibrium: Equilibrium, viewer: ArrayLike = VIEWER) -> Figure:
    """The belt in parallel projection, seen from the direction `viewer`, the world's x upwards.

    Shapes: viewer (3,), not along x.
    Errors: `InvalidArgument` where the solve left no shape to draw.
    """
    _check(equilibrium)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _WIDTH), layout="constrained")
        draw_oblique(figure.subplots(), equilibrium, viewer)
        return figure


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


def _check(equilibrium: Equilibrium) -> None:
    if not np.isfinite(equilibrium.position).all():
        raise InvalidArgument(f"equilibrium: found no shape ({equilibrium.status}), allowed a finite one")


# ------------------------------------------------------------------------------------------------------- the page


def _draw(equilibrium: Equilibrium) -> Figure:
    scene = _Scene(equilibrium)
    size = scene.high - scene.low
    views_height = _WIDTH * (size[_Z] + size[_X]) / (size[_Y] + size[_Z]) + _DECORATION
    heights = [views_height, _flat_height(equilibrium) + _DECORATION, _GRAPHS, _KEY]
    figure = Figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
    figure.suptitle(_title(equilibrium), fontsize=10.0, parse_math=False)
    upper, middle, lower, key = figure.subfigures(4, 1, height_ratios=heights, squeeze=False).flat
    _draw_views(upper, scene)
    draw_flat(middle.subplots(), equilibrium)
    _draw_graphs(lower, equilibrium)
    key.legend(handles=list(_key(equilibrium)), loc="center", ncols=6, frameon=False)
    return figure


def _title(equilibrium: Equilibrium) -> str:
    name = equilibrium.scenario.to_dict().get("name") or "belt"
    status = "" if equilibrium.status == "converged" else f", {equilibrium.status.replace('_', ' ')}"
    return f"{name}: {equilibrium.energy_model} energy {equilibrium.energy:.5g}{status}"


def _draw_views(figure: SubFigure, scene: _Scene) -> None:
    low, high = scene.low, scene.high
    size = high - low
    top, corner, front, side = figure.subplots(
        2, 2, width_ratios=size[[_Y, _Z]].tolist(), height_ratios=size[[_Z, _X]].tolist()
    ).flat
    step = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(0.0, size.max())[1]
    for axes, view, right, up in ((top, _TOP, _Y, _Z), (front, _FRONT, _Y, _X), (side, _SIDE, _Z, _X)):
        _draw_scene(axes, scene, view)
        axes.set(xlim=(low[right], high[right]), ylim=(low[up], high[up]), aspect="equal", title=view.title)
        axes.xaxis.set_major_locator(MultipleLocator(step))
        axes.yaxis.set_major_locator(MultipleLocator(step))
        axes.set(xlabel=f"{_AXES[right]} [length]" if axes is not top else "")
        axes.set(ylabel=f"{_AXES[up]} [length]" if axes is not side else "")
    top.tick_params(labelbottom=False)
    side.tick_params(labelleft=False)
    _draw_oblique(corner, scene, VIEWER)


def _draw_graphs(figure: SubFigure, equilibrium: Equilibrium) -> None:
    angle, bend = figure.subplots(1, 2)
    _draw_graph(angle, equilibrium, np.degrees(equilibrium.rib_angle), "Rib angle", "α [degrees]")
    _draw_graph(bend, equilibrium, equilibrium.bend, "Bend", "$ω_ζ$ [1/length]")


def _draw_graph(axes: Axes, equilibrium: Equilibrium, values: Floats, title: str, label: str) -> None:
    u = equilibrium.u
    for first, last in equilibrium.stiffeners:
        axes.axvspan(first, last, color=str(_LIGHT - 0.5 * _RIGID), linewidth=0.0)
    axes.axhline(0.0, color="0.6", linewidth=0.5)
    axes.plot(u, values, color="black", linewidth=1.0)
    axes.set(xlim=(u[0], u[-1]), xlabel="u [length]", ylabel=label, title=title)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.grid(visible=True, color="0.9", linewidth=0.5)


def _key(equilibrium: Equilibrium) -> Iterator[Line2D | Patch]:
    """What the symbols mean, of those that the picture has."""
    tables = equilibrium.scenario.to_dict()
    loads = tables.get("loads", {})
    kinds = {_support_kind(support) for support in tables["supports"]}
    yield Line2D([], [], label="spine", **_SPINE)
    yield Line2D([], [], label="edges", **_EDGE)
    yield Line2D([], [], label="ribs", **_RIB)
    for label, shade in (("+ξ side", _LIGHT), ("−ξ side", _DARK)):
        yield Patch(label=label, facecolor=str(shade), edgecolor="0.35", linewidth=0.35)
    if equilibrium.stiffeners:
        yield Patch(label="rigid", facecolor=str(_LIGHT - _RIGID), edgecolor="0.35", linewidth=0.35)
    yield Line2D([], [], label="start, u = 0", **_START)
    yield Line2D([], [], label="highest point", **_HIGHEST)
    for kind, label, style in (
        ("frame", "held frame", _CLAMP),
        ("hinge", "hinge axis", _HINGE),
        ("place", "held place", _PIN),
    ):
        if kind in kinds:
            yield Line2D([], [], label=label, **style)
    if tables.get("links"):
        yield Line2D([], [], label="link", **_LINK)
    arrow: Style = {"linestyle": "", "marker": "$→$", "markersize": 9.0}
    if loads.get("points"):
        yield Line2D([], [], label="force", color=_ARROW["color"], **arrow)
    if _gravity(tables).any():
        yield Line2D([], [], label="gravity", color=_GRAVITY["color"], **arrow)


# ------------------------------------------------------------------------------------------------- the flat board


def draw_flat(axes: Axes, equilibrium: Equilibrium) -> None:
    """Draws the flat board into axes: outline, spine, stiffeners, ribs; coordinates (y, z) of the start."""
    vertices, triangles = equilibrium.flat_mesh(2)
    faces = vertices[triangles]
    shades = np.where(_is_rigid(equilibrium, _feet(equilibrium)), _LIGHT - _RIGID, _LIGHT)
    colors = [str(shade) for shade in shades]
    axes.add_collection(PolyCollection(list(faces), facecolors=colors, edgecolors=colors, linewidths=0.3, zorder=2))
    ribs = equilibrium.flat_ribs()[_drawn_ribs(equilibrium.u)]
    axes.add_collection(LineCollection(list(ribs), zorder=2, colors=_RIB["color"], linewidths=_RIB["linewidth"]))
    for line in equilibrium.outline().loops:
        axes.plot(*line.T, zorder=2, **_EDGE)
    spine = equilibrium.flat_spine()
    axes.plot(*spine.T, zorder=2, **_SPINE)
    axes.plot(*spine[0], zorder=3, **_START)
    axes.set(aspect="equal", title="Flat board", xlabel="y [length]", ylabel="z [length]")
    axes.autoscale_view()
    # A narrow board has little room for numbers.
    axes.xaxis.set_major_locator(MaxNLocator(6 if np.ptp(axes.get_xlim()) > np.ptp(axes.get_ylim()) else 4))
    axes.yaxis.set_major_locator(MaxNLocator(3 if np.ptp(axes.get_ylim()) < 0.3 * np.ptp(axes.get_xlim()) else 6))


def _flat_height(equilibrium: Equilibrium) -> float:
    """Height of a picture of the flat board that fills the page's width [in], within reason."""
    width, height = np.ptp(np.concatenate(equilibrium.outline().loops), axis=0)
    least, most = _FLAT_HEIGHTS
    return float(np.clip(_WIDTH * height / width, least, most))


def _feet(equilibrium: Equilibrium) -> Floats:
    """Arc length of the rib through the middle of every triangle of the mesh."""
    vertices, triangles = equilibrium.flat_mesh(2)
    return np.nan_to_num(equilibrium.rib_feet(vertices[triangles].mean(axis=1)))


def _is_rigid(equilibrium: Equilibrium, feet: Floats) -> NDArray[np.bool_]:
    rigid = np.zeros(feet.shape, dtype=np.bool_)
    for first, last in equilibrium.stiffeners:
        rigid |= (first <= feet) & (feet < last)
    return rigid


# -------------------------------------------------------------------------------------------------- the bent belt


def draw_oblique(axes: Axes, equilibrium: Equilibrium, viewer: ArrayLike = VIEWER) -> None:
    """Draws the belt into axes, in parallel projection from the direction `viewer`, the world's x upwards."""
    _draw_oblique(axes, _Scene(equilibrium), viewer)


def _draw_oblique(axes: Axes, scene: _Scene, viewer: ArrayLike) -> None:
    toward = np.asarray(viewer, dtype=np.float64) / np.linalg.norm(viewer)
    right = np.cross(_UNIT[_X], toward)
    if not np.any(right):
        raise InvalidArgument(f"viewer: found {toward.tolist()}, allowed a direction that is not along x")
    right /= np.linalg.norm(right)
    view = _View("", right, np.cross(toward, right), toward)
    _draw_scene(axes, scene, view, lit=True)
    _draw_triad(axes, scene, view)
    axes.set(aspect="equal")
    axes.set_axis_off()


def _draw_triad(axes: Axes, scene: _Scene, view: _View) -> None:
    """The world's axes, left below the belt."""
    points = view.page(scene.points)
    length = 0.12 * float(np.ptp(points, axis=0).max())
    tips = view.page(length * _UNIT)
    origin = points.min(axis=0) - np.minimum(tips.min(axis=0), 0.0) - 0.06 * np.ptp(points, axis=0).max()
    for name, tip in zip(_AXES, tips, strict=True):
        _draw_arrow(axes, origin, tip, {"arrowstyle": "-|>", "color": "0.3", "linewidth": 0.7}, length)
        axes.annotate(name, _xy(origin + 1.35 * tip), color="0.2", ha="center", va="center", fontstyle="italic")
    # Annotations alone do not widen the axes.
    axes.plot(*(origin + 1.5 * tips).T, linestyle="")
    axes.plot(*points.T, linestyle="")


class _Arrow(NamedTuple):
    """A force, or the direction of gravity, as it is drawn."""

    at: Floats
    reach: Floats
    style: Style


class _Strip(NamedTuple):
    """The belt between two ribs: triangles, whether they are rigid, lines on them, and the middle for sorting."""

    faces: Floats
    rigid: bool
    lines: list[tuple[Floats, Style]]
    middle: Floats


class _Scene:
    """All that a view of a bent belt shows, and the box around it."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        self.equilibrium = equilibrium
        self.strips = list(_strips(equilibrium))
        points = np.concatenate([strip.faces.reshape(-1, 3) for strip in self.strips])
        self.size = float(np.ptp(points, axis=0).max())
        self.arrows = list(_forces(equilibrium, _ARROW_SHARE * self.size))
        ends = [[arrow.at, arrow.at + arrow.reach] for arrow in self.arrows]
        self.points = np.concatenate([points, *ends])
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        middle, size = (low + high) / 2.0, high - low
        # Nowhere so thin that an axis could not be read.
        size = _MARGIN * np.maximum(size, _THINNEST * size.max())
        self.low, self.high = middle - size / 2.0, middle + size / 2.0
        self.gravity = _gravity(equilibrium.scenario.to_dict())


def _draw_scene(axes: Axes, scene: _Scene, view: _View, *, lit: bool = False) -> None:
    _draw_strips(axes, scene.strips, view, lit=lit)
    _draw_holds(axes, scene.equilibrium, view)
    for arrow in scene.arrows:
        _draw_arrow(axes, view.page(arrow.at), view.page(arrow.reach), arrow.style, scene.size)
    if scene.gravity.any():
        _draw_gravity(axes, scene, view)
    axes.plot(*view.page(scene.equilibrium.position[0]), zorder=3, **_START)
    if not lit:
        axes.plot(*view.page(scene.equilibrium.highest_point.position), zorder=3, **_HIGHEST)


def _draw_strips(axes: Axes, strips: list[_Strip], view: _View, *, lit: bool) -> None:
    paths: list[Outline] = []
    fills: list[str] = []
    strokes: list[str] = []
    widths: list[float] = []
    # The painter's algorithm: what is near hides what is far.
    for strip in sorted(strips, key=lambda strip: float(strip.middle @ view.toward)):
        for face in strip.faces:
            shade = str(_shade(face, view, rigid=strip.rigid, lit=lit))
            paths.append(Outline(view.page(face), closed=False))
            fills.append(shade)
            strokes.append(shade)
            widths.append(0.3)
        for line, style in strip.lines:
            paths.append(Outline(view.page(line)))
            fills.append("none")
            strokes.append(style["color"])
            widths.append(style["linewidth"])
    axes.add_collection(
        PathCollection(paths, facecolors=fills, edgecolors=strokes, linewidths=widths, capstyle="round", zorder=2)
    )


def _shade(face: Floats, view: _View, *, rigid: bool, lit: bool) -> float:
    normal = np.cross(face[1] - face[0], face[2] - face[0])
    normal /= max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
    shade = _LIGHT if normal @ view.toward > 0.0 else _DARK
    if lit:
        shade -= 0.22 * (1.0 - abs(float(normal @ _LAMP)))
    return shade - _RIGID * rigid


def _strips(equilibrium: Equilibrium) -> Iterator[_Strip]:
    vertices, triangles = equilibrium.mesh(2)
    feet, u = _feet(equilibrium), equilibrium.u
    rigid = _is_rigid(equilibrium, feet)
    owner = np.clip(np.searchsorted(u, feet, side="right") - 1, 0, len(u) - 2)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=-1)
    count = Counter(map(tuple, sides.reshape(-1, 2).tolist()))
    ribs, drawn = np.stack(equilibrium.edges, axis=1), set(_drawn_ribs(u))
    for element in np.unique(owner).tolist():
        own = owner == element
        edges = [side for side in sides[own].reshape(-1, 2).tolist() if count[tuple(side)] == 1]
        lines = [(ribs[node], _RIB) for node in (element, element + 1) if node in drawn]
        lines += [(vertices[edge], _EDGE) for edge in edges]
        lines.append((equilibrium.position[element : element + 2], _SPINE))
        yield _Strip(
            vertices[triangles[own]], bool(rigid[own].any()), lines, vertices[triangles[own]].mean(axis=(0, 1))
        )


def _drawn_ribs(u: Floats) -> list[int]:
    """Nodes whose ribs are drawn, equally spaced along the spine where there are more than enough."""
    wanted = np.linspace(u[0], u[-1], min(RIBS, len(u) - 1) + 1)
    nearest = np.abs(u[:, None] - wanted).argmin(axis=0)
    return sorted({0, len(u) - 1, *nearest.tolist()})


# ---------------------------------------------------------------------------------------- supports, links and loads


def _node(equilibrium: Equilibrium, at: float | str) -> int:
    """The node at a place; at a corner the one before it."""
    ends = {"start": 0, "end": len(equilibrium.u) - 1}
    return ends[at] if isinstance(at, str) else int(np.abs(equilibrium.u - at).argmin())


def _support_kind(support: dict[str, Any]) -> str:
    if support.get("hinge") is not None:
        return "hinge"
    is_turned = any(support.get(key) is not None for key in ("rotation", "euler", "quaternion"))
    return "frame" if is_turned else "place"


def _draw_holds(axes: Axes, equilibrium: Equilibrium, view: _View) -> None:
    tables = equilibrium.scenario.to_dict()
    reach = 0.7 * tables["belt"]["width"]
    for support in tables["supports"]:
        node = _node(equilibrium, support["at"])
        place, frame = equilibrium.position[node], equilibrium.frame[node]
        kind = _support_kind(support)
        if kind == "place":
            axes.plot(*view.page(place), zorder=4, **_PIN)
            continue
        column = ("xi", "eta", "zeta").index(support["hinge"] if kind == "hinge" else "zeta")
        bar = place + np.outer([-reach, reach], frame[:, column])
        axes.plot(*view.page(bar).T, zorder=4, **(_HINGE if kind == "hinge" else _CLAMP))
    for link in tables.get("links", []):
        ends = [equilibrium.position[_node(equilibrium, link[end])] for end in ("from", "to")]
        axes.plot(*view.page(ends).T, zorder=4, **_LINK)


def _forces(equilibrium: Equilibrium, length: float) -> Iterator[_Arrow]:
    """The point loads, the largest as long as told."""
    loads = equilibrium.scenario.to_dict().get("loads", {}).get("points", [])
    largest = max((float(np.linalg.norm(load["force"])) for load in loads), default=0.0)
    for load in loads:
        node = _node(equilibrium, load["at"])
        at = equilibrium.position[node] + equilibrium.frame[node] @ np.array(load["lever"])
        if largest > 0.0:
            yield _Arrow(at, length * np.array(load["force"]) / largest, _ARROW)


def _gravity(tables: dict[str, Any]) -> Floats:
    gravity = tables.get("loads", {}).get("gravity")
    return np.zeros(3) if gravity is None else np.array(gravity, dtype=np.float64)


def _draw_gravity(axes: Axes, scene: _Scene, view: _View) -> None:
    """An arrow in the upper right corner."""
    reach = view.page(_ARROW_SHARE * scene.size * scene.gravity / np.linalg.norm(scene.gravity))
    corners = view.page(np.stack((scene.low, scene.high)))
    room = np.abs(corners[1] - corners[0])
    if view.title:
        high = corners.max(axis=0)
    else:
        points = view.page(scene.points)
        high, room = points.max(axis=0), np.ptp(points, axis=0)
    reach *= min(1.0, 0.6 * float(room.min()) / max(float(np.linalg.norm(reach)), np.finfo(float).tiny))
    if np.linalg.norm(reach) < _HIDDEN_SHARE * scene.size:
        return  # along the line of sight: the other views show it
    at = high - 0.08 * room - np.maximum(reach, 0.0)
    _draw_arrow(axes, at, reach, _GRAVITY, scene.size)
    axes.annotate(
        "g", _xy(at + 0.5 * reach), xytext=(-8, 0), textcoords="offset points", color="0.3", fontstyle="italic"
    )


def _draw_arrow(axes: Axes, at: Floats, reach: Floats, style: Style, size: float) -> None:
    """An arrow on the page; a ring where it points out of it or into it."""
    if np.linalg.norm(reach) < _HIDDEN_SHARE * size:
        axes.plot(*at, zorder=5, color=style["color"], marker="o", markersize=6.0, fillstyle="none", linestyle="")
        return
    axes.annotate("", _xy(at + reach), _xy(at), arrowprops=style, zorder=5)


def _xy(point: Floats) -> tuple[float, float]:
    return float(point[0]), float(point[1])
