"""Drawing of a bent belt: its surface, its supports and its loads; needs matplotlib."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np
from matplotlib.collections import PathCollection
from matplotlib.path import Path

from fishbone.errors import InvalidArgument
from fishbone.names import Axis

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from fishbone.equilibrium import Equilibrium, Floats

    Style = dict[str, Any]

RIBS = 80
"""Greatest number of ribs drawn: more ribs would print as a grey area."""
AXES = "xyz"
# Parts differ in lightness only, so that they can be distinguished on a monochrome print.
LIGHT, DARK = 0.95, 0.72
RIGID = 0.3
"""Lightness by which a stiffener is darker."""
_LAMP = np.array([0.8, 0.5, 0.1]) / np.linalg.norm([0.8, 0.5, 0.1])
RIB: Style = {"color": "0.35", "linewidth": 0.35}
EDGE: Style = {"color": "black", "linewidth": 0.8}
SPINE: Style = {"color": "black", "linewidth": 1.4}
START: Style = {"color": "black", "marker": "o", "markersize": 4.0, "linestyle": ""}
HIGHEST: Style = {"color": "black", "marker": "^", "markersize": 5.0, "markerfacecolor": "white", "linestyle": ""}
CLAMP: Style = {"color": "black", "linewidth": 2.6, "solid_capstyle": "butt"}
PIN: Style = {"color": "black", "marker": "D", "markersize": 5.0, "markerfacecolor": "white", "linestyle": ""}
HINGE: Style = {"color": "black", "linewidth": 1.2, "linestyle": "-.", "marker": ""}
LINK: Style = {"color": "black", "linewidth": 0.9, "linestyle": ":", "marker": "s", "markersize": 3.0}
ARROW: Style = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.1, "shrinkA": 0.0, "shrinkB": 0.0}
GRAVITY: Style = ARROW | {"color": "0.45"}
_MARGIN, _THINNEST, _ARROW_SHARE, _HIDDEN_SHARE = 1.06, 0.3, 0.2, 0.02


class View(NamedTuple):
    """A direction of view: the world directions to the right of the page, up the page, and to the viewer."""

    title: str
    right: Floats
    up: Floats
    toward: Floats

    def page(self, points: ArrayLike) -> Floats:
        """World points on the page."""
        # No matrix product: its last digit depends on where the arrays are in memory, and so would the file.
        axes = np.stack((self.right, self.up), axis=-1)
        page: Floats = np.sum(np.asarray(points)[..., np.newaxis] * axes, axis=-2)
        return page


UNIT = np.eye(3)


def draw_lit(axes: Axes, scene: Scene, viewer: ArrayLike) -> None:
    """Draws a belt under a lamp, seen from a direction with the world's x upwards, and the world's axes."""
    toward = np.asarray(viewer, dtype=np.float64)
    right = np.cross(UNIT[0], toward)
    if not np.linalg.norm(right) > 0.0:
        raise InvalidArgument(f"viewer: found {toward.tolist()}, allowed a direction that is not along x")
    toward, right = toward / np.linalg.norm(toward), right / np.linalg.norm(right)
    view = View("", right, np.cross(toward, right), toward)
    draw_scene(axes, scene, view, lit=True)
    _draw_triad(axes, scene, view)
    axes.set(aspect="equal")
    axes.set_axis_off()


def _draw_triad(axes: Axes, scene: Scene, view: View) -> None:
    """Draws the world's axes, to the left of the belt and no lower."""
    points = view.page(scene.points)
    size = float(np.ptp(points, axis=0).max())
    length = 0.12 * size
    tips = view.page(length * UNIT)
    left, low = points.min(axis=0)
    right_of_it, below_it = 1.5 * np.maximum(tips[:, 0].max(), 0.0), 1.5 * np.minimum(tips[:, 1].min(), 0.0)
    origin = np.array([left - right_of_it - 0.06 * size, low - below_it])
    for name, tip in zip(AXES, tips, strict=True):
        _draw_arrow(axes, origin, tip, {"arrowstyle": "-|>", "color": "0.3", "linewidth": 0.7}, length)
        axes.annotate(name, _xy(origin + 1.35 * tip), color="0.2", ha="center", va="center", fontstyle="italic")
    # Annotations do not widen the limits of the axes; invisible lines do.
    axes.plot(*(origin + 1.5 * tips).T, linestyle="")
    axes.plot(*points.T, linestyle="")


class Arrow(NamedTuple):
    """The arrow of a force or of gravity."""

    at: Floats
    reach: Floats
    style: Style


class Strip(NamedTuple):
    """The belt between two ribs: its triangles, its lines, and its middle, by which strips are sorted."""

    faces: Floats
    rigid: bool
    lines: list[tuple[Floats, Style]]
    middle: Floats


class Scene:
    """The strips and arrows of a view of a bent belt, and the box around them."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        self.equilibrium = equilibrium
        self.strips = list(strips_of(equilibrium))
        points = np.concatenate([strip.faces.reshape(-1, 3) for strip in self.strips])
        self.size = float(np.ptp(points, axis=0).max())
        self.arrows = list(_forces(equilibrium, _ARROW_SHARE * self.size))
        ends = [[arrow.at, arrow.at + arrow.reach] for arrow in self.arrows]
        self.points = np.concatenate([points, *ends])
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        middle, size = (low + high) / 2.0, high - low
        # The box is nowhere so thin that the numbers of an axis overlap.
        size = _MARGIN * np.maximum(size, _THINNEST * size.max())
        self.low, self.high = middle - size / 2.0, middle + size / 2.0
        self.gravity = gravity_of(equilibrium.scenario.to_dict())


def draw_scene(axes: Axes, scene: Scene, view: View, *, lit: bool = False) -> None:
    """Draws a scene into axes."""
    _draw_strips(axes, scene.strips, view, lit=lit)
    _draw_holds(axes, scene.equilibrium, view)
    for arrow in scene.arrows:
        _draw_arrow(axes, view.page(arrow.at), view.page(arrow.reach), arrow.style, scene.size)
    if scene.gravity.any():
        _draw_gravity(axes, scene, view)
    axes.plot(*view.page(scene.equilibrium.position[0]), zorder=3, **START)
    if not lit:
        axes.plot(*view.page(scene.equilibrium.highest_point.position), zorder=3, **HIGHEST)


def _draw_strips(axes: Axes, strips: list[Strip], view: View, *, lit: bool) -> None:
    paths: list[Path] = []
    fills: list[str] = []
    strokes: list[str] = []
    widths: list[float] = []
    # The painter's algorithm: near strips hide far strips.
    for strip in sorted(strips, key=lambda strip: float(np.sum(strip.middle * view.toward))):
        for face in strip.faces:
            shade = str(_shade(face, view, rigid=strip.rigid, lit=lit))
            paths.append(Path(view.page(face), closed=False))
            fills.append(shade)
            strokes.append(shade)
            widths.append(0.6)
        for line, style in strip.lines:
            paths.append(Path(view.page(line)))
            fills.append("none")
            strokes.append(style["color"])
            widths.append(style["linewidth"])
    axes.add_collection(
        PathCollection(paths, facecolors=fills, edgecolors=strokes, linewidths=widths, capstyle="round", zorder=2)
    )


def _shade(face: Floats, view: View, *, rigid: bool, lit: bool) -> float:
    normal = np.cross(face[1] - face[0], face[2] - face[0])
    normal /= max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
    shade = LIGHT if np.sum(normal * view.toward) > 0.0 else DARK
    if lit:
        shade -= 0.22 * (1.0 - abs(float(np.sum(normal * _LAMP))))
    return shade - RIGID * rigid


def strips_of(equilibrium: Equilibrium) -> Iterator[Strip]:
    """The strips of the belt, one an element; flat corners at the ends belong to the outermost elements."""
    vertices, triangles = equilibrium.mesh(2)
    feet, u = feet_of(equilibrium), equilibrium.u
    rigid = is_rigid(equilibrium, feet)
    owner = np.clip(np.searchsorted(u, feet, side="right") - 1, 0, len(u) - 2)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=-1)
    count = Counter(map(tuple, sides.reshape(-1, 2).tolist()))
    ribs, drawn = np.stack(equilibrium.edges, axis=1), set(drawn_ribs(u))
    for element in np.unique(owner).tolist():
        own = owner == element
        edges = [side for side in sides[own].reshape(-1, 2).tolist() if count[tuple(side)] == 1]
        lines = [(ribs[node], RIB) for node in (element, element + 1) if node in drawn]
        lines += [(vertices[edge], EDGE) for edge in edges]
        lines.append((equilibrium.position[element : element + 2], SPINE))
        yield Strip(vertices[triangles[own]], bool(rigid[own].any()), lines, vertices[triangles[own]].mean(axis=(0, 1)))


def drawn_ribs(u: Floats) -> list[int]:
    """Nodes whose ribs are drawn: at most `RIBS`, equally spaced along the spine."""
    wanted = np.linspace(u[0], u[-1], min(RIBS, len(u) - 1) + 1)
    nearest = np.abs(u[:, None] - wanted).argmin(axis=0)
    return sorted({0, len(u) - 1, *nearest.tolist()})


def feet_of(equilibrium: Equilibrium) -> Floats:
    """Arc length of the rib through the middle of every triangle of the mesh."""
    vertices, triangles = equilibrium.flat_mesh(2)
    return np.nan_to_num(equilibrium.rib_feet(vertices[triangles].mean(axis=1)))


def is_rigid(equilibrium: Equilibrium, feet: Floats) -> NDArray[np.bool_]:
    """Whether ribs with these feet are in a stiffener."""
    rigid = np.zeros(feet.shape, dtype=np.bool_)
    for first, last in equilibrium.stiffeners:
        rigid |= (first <= feet) & (feet < last)
    return rigid


# ---------------------------------------------------------------------------------------- supports, links and loads


def _node(equilibrium: Equilibrium, at: float | str) -> int:
    """The node at a place; at a corner the node before it."""
    ends = {"start": 0, "end": len(equilibrium.u) - 1}
    return ends[at] if isinstance(at, str) else int(np.abs(equilibrium.u - at).argmin())


def support_kind(support: dict[str, Any]) -> str:
    """The symbol of a support: "frame" for a held frame, "hinge" for a held axis, "place" for a held position only."""
    if support.get("hinge") is not None:
        return "hinge"
    is_turned = any(support.get(key) is not None for key in ("rotation", "euler", "quaternion"))
    return "frame" if is_turned else "place"


def _draw_holds(axes: Axes, equilibrium: Equilibrium, view: View) -> None:
    tables = equilibrium.scenario.to_dict()
    reach = 0.7 * tables["belt"]["width"]
    for support in tables["supports"]:
        node = _node(equilibrium, support["at"])
        place, frame = equilibrium.position[node], equilibrium.frame[node]
        kind = support_kind(support)
        if kind == "place":
            axes.plot(*view.page(place), zorder=4, **PIN)
            continue
        column = get_args(Axis).index(support["hinge"] if kind == "hinge" else "zeta")
        bar = place + np.outer([-reach, reach], frame[:, column])
        axes.plot(*view.page(bar).T, zorder=4, **(HINGE if kind == "hinge" else CLAMP))
    for link in tables.get("links", []):
        ends = [equilibrium.position[_node(equilibrium, link[end])] for end in ("from", "to")]
        axes.plot(*view.page(ends).T, zorder=4, **LINK)


def _forces(equilibrium: Equilibrium, length: float) -> Iterator[Arrow]:
    """Arrows of the point loads; the largest is `length` long."""
    loads = equilibrium.scenario.to_dict().get("loads", {}).get("points", [])
    largest = max((float(np.linalg.norm(load["force"])) for load in loads), default=0.0)
    for load in loads:
        node = _node(equilibrium, load["at"])
        at = equilibrium.position[node] + equilibrium.frame[node] @ np.array(load["lever"])
        if largest > 0.0:
            yield Arrow(at, length * np.array(load["force"]) / largest, ARROW)


def gravity_of(tables: dict[str, Any]) -> Floats:
    """The acceleration of gravity, 0 if the scenario has none."""
    gravity = tables.get("loads", {}).get("gravity")
    return np.zeros(3) if gravity is None else np.array(gravity, dtype=np.float64)


def _draw_gravity(axes: Axes, scene: Scene, view: View) -> None:
    """Draws the arrow of gravity in the upper right corner."""
    reach = view.page(_ARROW_SHARE * scene.size * scene.gravity / np.linalg.norm(scene.gravity))
    corners = view.page(np.stack((scene.low, scene.high)))
    room = np.abs(corners[1] - corners[0])
    if view.title:
        high = corners.max(axis=0)
    else:
        points = view.page(scene.points)
        high, room = points.max(axis=0), np.ptp(points, axis=0)
    length = float(np.linalg.norm(reach))
    if length >= _HIDDEN_SHARE * scene.size:
        reach *= min(1.0, 0.6 * float(room.min()) / length)
    if np.linalg.norm(reach) < _HIDDEN_SHARE * scene.size:
        return  # along the line of sight: the other views show it
    at = high - 0.08 * room - np.maximum(reach, 0.0)
    _draw_arrow(axes, at, reach, GRAVITY, scene.size)
    axes.annotate(
        "g", _xy(at + 0.5 * reach), xytext=(-8, 0), textcoords="offset points", color="0.3", fontstyle="italic"
    )


def _draw_arrow(axes: Axes, at: Floats, reach: Floats, style: Style, size: float) -> None:
    """Draws an arrow on the page; a ring where the arrow points out of the page or into it."""
    if np.linalg.norm(reach) < _HIDDEN_SHARE * size:
        axes.plot(*at, zorder=5, color=style["color"], marker="o", markersize=6.0, fillstyle="none", linestyle="")
        return
    axes.annotate("", _xy(at + reach), _xy(at), arrowprops=style, zorder=5)


def _xy(point: Floats) -> tuple[float, float]:
    return float(point[0]), float(point[1])
