"""Bifurcation diagrams: quantities along the branches of a diagram, drawn into axes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.lines import Line2D

from fishbone.units import labelled, scale, unit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy.typing as npt
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from fishbone.equilibrium import Equilibrium
    from fishbone.follow import Branch, Diagram, Event
    from fishbone.names import Kind, Place
    from fishbone.units import Quantity

    Floats = NDArray[np.float64]
    Style = dict[str, Any]

LINES: dict[bool | None, tuple[str, Style]] = {
    True: ("stable", {"linestyle": "-", "linewidth": 1.3}),
    False: ("unstable", {"linestyle": (0, (3.0, 1.8)), "linewidth": 0.9}),
    None: ("undecided", {"linestyle": ":", "linewidth": 1.3}),
}
"""Label and style of a stretch of a branch, by `stable`."""
_MARKER: Style = {"linestyle": "", "markersize": 5.0, "markeredgecolor": "black", "markeredgewidth": 0.8, "zorder": 4}
MARKERS: dict[Kind, Style] = {
    "fold": {"marker": "o", "markerfacecolor": "white", **_MARKER},
    "pitchfork": {"marker": "^", "markerfacecolor": "black", **_MARKER},
    "transcritical": {"marker": "X", "markerfacecolor": "0.6", **_MARKER},
    "bifurcation": {"marker": "s", "markerfacecolor": "0.6", **_MARKER},
    "edges": {"marker": "|", **_MARKER},
}
SNAP: Style = {
    "arrowstyle": "-|>",
    "color": "0.35",
    "linewidth": 0.6,
    "mutation_scale": 7.0,
    "shrinkA": 3.0,
    "shrinkB": 0.0,
}
SHORTEST_SNAP = 0.02
"""Length, as a share of an axis, below which an arrow is not drawn: there another branch continues without a jump."""
LIMIT: Style = {"color": "firebrick", "linestyle": "-.", "linewidth": 0.9}
LANDED: Style = {"linestyle": "", "marker": ".", "markersize": 4.0, "color": "0.35", "zorder": 3}
NOISE = 1e-7
"""Extent of the shortest axis over the scale of its quantity: differences below are hardly more than residuals."""
MAX_NAMED = 10
"""Greatest number of branches in the key: the colours of more branches are not distinguishable."""
COLORS = ("viridis", 0.1, 0.8)
"""A colour map of monotonic lightness, for prints in grey, and the lowest and highest value used."""


class Panel(NamedTuple):
    """A quantity drawn over the parameter, or over the angle along poses that have one."""

    label: str
    along: Callable[[Branch], Floats]
    """The values of the quantity in the states of a branch."""
    at: Callable[[Equilibrium], float]
    """The value of the quantity in an equilibrium."""
    least_extent: float
    """Extent below which differences of the quantity are rounding: no axis is shorter."""
    limit: float | None = None
    """A value at which a line is drawn."""


def places(diagram: Diagram, parameter: npt.ArrayLike) -> Floats:
    """The places on the axis of a diagram: the angle in degrees where the path has one, else the parameter."""
    angle = diagram.angle(parameter)
    return np.asarray(parameter) if angle is None else angle


def panels(diagram: Diagram, support: Place | None, limit: float | None) -> Iterator[Panel]:
    """Panels of energy, height, the force of a support if there is one, tightest bend on the spine, and rib margin.

    The tightest bend is shown as its radius along an angle, and where the radius has a limit, else as its inverse,
    which is 0 where the belt is flat.

    Errors: `NoSupport`.
    """
    bulge = np.array(diagram.scenario.to_dict()["solver"]["bulge"])
    bulge /= np.linalg.norm(bulge)
    scenario, start = diagram.scenario, diagram.start
    length = unit(scenario, "length") or "length"

    def floor(quantity: Quantity) -> float:
        return NOISE * scale(start, quantity)

    yield Panel(
        labelled(scenario, "energy", "energy"),
        lambda branch: branch.energy,
        lambda shape: shape.energy,
        floor("energy"),
    )
    yield Panel(
        f"height [{length}]",
        lambda branch: branch.height,
        lambda shape: float(shape.highest_point.position @ bulge),
        floor("length"),
    )
    index = diagram.support if support is None else diagram.start._support_index(support)  # noqa: SLF001
    if index is not None:
        yield Panel(
            labelled(scenario, f"|force| of supports[{index}]", "force"),
            lambda branch: np.linalg.norm(branch.reaction(index).force, axis=1),
            lambda shape: float(np.linalg.norm(shape.reaction(index).force)),
            floor("force"),
        )
    yield (
        Panel(
            f"least radius\n[{length}]",
            lambda branch: branch.least_spine_radius,
            lambda shape: np.nan if shape.least_spine_radius is None else shape.least_spine_radius.value,
            floor("length"),
            limit,
        )
        if limit is not None or diagram.angle(0.0) is not None
        else Panel(
            f"tightest bend\n[1/{length}]",
            lambda branch: np.nan_to_num(1.0 / branch.least_spine_radius),
            lambda shape: 0.0 if shape.least_spine_radius is None else 1.0 / shape.least_spine_radius.value,
            floor("curvature"),
        )
    )
    yield Panel(
        f"rib margin\n[1/{length}]",
        lambda branch: branch.rib_margin,
        lambda shape: float(shape.rib_margin.value),
        floor("curvature"),
    )


def draw(axes: Axes, diagram: Diagram, panel: Panel) -> bool:
    """Draws a quantity over the parameter: branches, events and snaps; returns whether an arrow of a snap is drawn."""
    curves = [np.column_stack([places(diagram, branch.parameter), panel.along(branch)]) for branch in diagram.branches]
    for branch, curve, color in zip(diagram.branches, curves, colors(diagram), strict=True):
        for states, is_stable in runs(branch):
            axes.plot(*curve[states].T, color=color, **LINES[is_stable][1])
        if branch.origin is not None:
            # A line joins the event with the first state, which is a little off it.
            event = diagram.branches[branch.origin.branch].events[branch.origin.event]
            root = np.array([curves[branch.origin.branch][event.state], curve[0]])
            axes.plot(*root.T, color=color, **LINES[branch.stable[0]][1])
        for event in filter(_is_drawn, branch.events):
            axes.plot(*curve[event.state], **MARKERS[event.kind])
    if panel.limit is not None:
        axes.axhline(panel.limit, **LIMIT)
    axes.set(ylabel=panel.label)
    axes.grid(visible=True, color="0.9", linewidth=0.5)
    snaps = list(_snaps(diagram, panel, curves))
    if snaps:
        axes.update_datalim([end for _, end in snaps])
        axes.autoscale_view()
    widen(axes, panel.least_extent)
    shortest = SHORTEST_SNAP * np.ptp(axes.get_ylim())
    seen = [(start, end) for start, end in snaps if abs(end[1] - start[1]) > shortest]
    for start, end in seen:
        axes.plot(*end, **LANDED)
        axes.annotate("", end, start, arrowprops=SNAP)
    return bool(seen)


def widen(axes: Axes, least_extent: float) -> None:
    """Makes the vertical axis at least as long as an extent, about its middle, so that rounding is drawn as a line."""
    low, high = axes.get_ylim()
    if high - low < least_extent:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * least_extent, middle + 0.5 * least_extent)


def runs(branch: Branch) -> Iterator[tuple[slice, bool | None]]:
    """The stretches of a branch that are stable, unstable or undecided throughout, as slices of its states.

    Rounding decides `stable` in the state of an event: the stretches before and after it have its numbers of modes.
    """
    behind, ahead = branch.negative_modes, branch.negative_modes
    for event in branch.events:
        behind[event.state], ahead[event.state] = event.negative_modes
    falls = (ahead[:-1] > 0) | (behind[1:] > 0)
    states = itertools.pairwise(branch.stable)
    verdicts = [None if pair == (None, None) else not bool(down) for pair, down in zip(states, falls, strict=True)]
    first = 0
    for verdict, stretch in itertools.groupby(verdicts):
        last = first + len(list(stretch))
        yield slice(first, last + 1), verdict
        first = last


def colors(diagram: Diagram) -> list[Any]:
    """A colour for each branch; black if there is only one."""
    if len(diagram.branches) == 1:
        return ["black"]
    name, darkest, lightest = COLORS
    return list(mpl.colormaps[name](np.linspace(darkest, lightest, len(diagram.branches))))


def key(diagram: Diagram, *, snaps: bool, limit: bool) -> Iterator[Line2D]:
    """The key of the lines, markers and arrows in the picture."""
    stretches = {is_stable for branch in diagram.branches for _, is_stable in runs(branch)}
    kinds = {event.kind for branch in diagram.branches for event in filter(_is_drawn, branch.events)}
    for is_stable, (label, style) in LINES.items():
        if is_stable in stretches:
            yield Line2D([], [], label=label, color="black", **style)
    for kind, style in MARKERS.items():
        if kind in kinds:
            yield Line2D([], [], label=kind, **style)
    if limit:
        yield Line2D([], [], label="limit", **LIMIT)
    if snaps:
        yield Line2D([], [], label="snap", color=SNAP["color"], linestyle="", marker="$→$", markersize=9.0)
    if 1 < len(diagram.branches) <= MAX_NAMED:
        for index, color in enumerate(colors(diagram)):
            yield Line2D([], [], label=f"branch {index}", color=color, linewidth=2.5)


def _snaps(
    diagram: Diagram, panel: Panel, curves: list[Floats]
) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """The points before and after each snap."""
    for branch, curve in zip(diagram.branches, curves, strict=True):
        for event in branch.events:
            if _is_drawn(event) and event.snapped is not None and event.snapped_parameter is not None:
                place, before = curve[event.state].tolist()
                yield (place, before), (float(places(diagram, event.snapped_parameter)), panel.at(event.snapped))


def _is_drawn(event: Event) -> bool:
    """Whether an event is one of the belt, as far as a finer mesh tells."""
    return event.confirmed
