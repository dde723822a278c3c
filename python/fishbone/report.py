"""The tables that the command line prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from fishbone.follow import SNAP
from fishbone.text import shown_name
from fishbone.units import labelled, scale, unit, without_rounding

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from fishbone.equilibrium import Equilibrium, Floats
    from fishbone.follow import Branch, Diagram, Event
    from fishbone.names import End
    from fishbone.scenario import Scenario
    from fishbone.units import Quantity

DIGITS = 5
"""Significant digits, about the accuracy of the default mesh."""
ENDS: dict[End, str] = {
    "closed": "ends where it began",
    "budget": "has used up its states before the end of the path",
    "lost": "ends where no step, however short, leads on",
    "no_slack": "ends where the belt has no slack left",
    "unstable": "ends where the belt snaps",
    "edges": "ends where ribs beside a bend come to other edges of the board, and no equilibrium is found with these",
}
"""The printed reason of the end of a branch that does not end with the path."""
NOUGHT = 1e-9
"""Largest rounding error of a rib angle [degrees]."""
PER_CENT = 100.0
"""Per cent in the whole, a number."""
SIDE = {1: "along solver.bulge", 0: "neither along solver.bulge nor against it", -1: "against solver.bulge"}
"""The side to which a belt bulges."""
UNDETERMINED = "not determined"
"""The cell of a number that the shape does not determine."""
MINIMUM = {True: "yes", False: "no", None: "not known"}
"""Whether an equilibrium is a local minimum."""


def report(equilibrium: Equilibrium) -> Group:
    """The tables that the command line prints for an equilibrium."""
    title = _title(equilibrium.scenario, f"{equilibrium.energy_model} energy, {equilibrium.status}")
    return Group(title, Text(_supports(equilibrium)), _scalars(equilibrium), _vectors(equilibrium))


def report_all(equilibria: Sequence[Equilibrium]) -> Group:
    """The table that the command line prints for the equilibria of a scenario: a row each."""
    first = equilibria[0]
    count = "1 equilibrium" if len(equilibria) == 1 else f"{len(equilibria)} equilibria"
    title = _title(first.scenario, f"{first.energy_model} energy, {count}")
    return Group(title, Text(_supports(first)), _equilibria(equilibria))


def report_diagram(diagram: Diagram) -> Group:
    """The tables that the command line prints for a diagram: its branches and their events."""
    title = _title(diagram.scenario, f"equilibria along a path, parameter: {diagram.parameter_name}")
    ends = [
        Text(f"branch {index} {_ending(branch)}") for index, branch in enumerate(diagram.branches) if branch.end in ENDS
    ]
    ends += [Text(f"branch {index} turns back: {back}") for index, back in _turned_back(diagram)]
    events = [event for branch in diagram.branches for event in branch.events]
    unconfirmed = sum(not event.confirmed for event in events)
    has_events = unconfirmed < len(events)
    left_out = Text(_left_out(events))
    return Group(
        title,
        _branches(diagram),
        *ends,
        _events(diagram) if has_events else Text("no events"),
        *([left_out] if unconfirmed else []),
    )


def _title(scenario: Scenario, words: str) -> Text:
    return Text(f"{shown_name(scenario)}: {words}", style="bold")


def _left_out(events: Sequence[Event]) -> str:
    count = sum(not event.confirmed for event in events)
    return f"{count} of {len(events)} events are left out that a finer mesh does not confirm"


FAR_BEYOND = 10.0
"""Largest error by the mesh along a path, over the accuracy, that is not warned of."""


def shortfall(diagram: Diagram) -> str:
    """One line: where and why a path is not followed to its end."""
    # A belt that is led along its minima goes from branch to branch, else the others leave the first.
    index = len(diagram.branches) - 1 if diagram.branches[0].end == "unstable" else 0
    branch = diagram.branches[index]
    snaps = bool(branch.events) and branch.events[-1].snapped is not None
    remedy = {"budget": " (raise --states)", "unstable": " (raise --branches)" if snaps else ""}.get(branch.end, "")
    events = [event for branch in diagram.branches for event in branch.events]
    left_out = "" if all(event.confirmed for event in events) else f"; {_left_out(events)}"
    return (
        f"the path ({diagram.parameter_name}) is followed to {number(diagram.reached)} of {number(diagram.goal)}: "
        f"branch {index} {_ending(branch)}{remedy}{left_out}"
    )


def _ending(branch: Branch) -> str:
    """The printed reason of the end of a branch: of a loss of stability, what is known of it."""
    if branch.end != "unstable" or not branch.events:
        return ENDS[branch.end]
    last = branch.events[-1]
    lost = "ends where the belt loses its stability, and no minimum is found beyond"
    known = "" if last.confirmed else ", which a finer mesh does not confirm"
    return (lost if last.snapped is None else ENDS[branch.end]) + known


def coarse_mesh(diagram: Diagram) -> str | None:
    """One line: where along a path the mesh makes the largest error; None if it is not clearly beyond the accuracy."""
    solver = diagram.start.scenario.to_dict()["solver"]
    error = np.concatenate([branch.error for branch in diagram.branches])
    places = np.concatenate([branch.parameter for branch in diagram.branches])
    error = np.where(np.isnan(error), 0.0, error)
    worst = int(error.argmax())
    if error[worst] <= FAR_BEYOND * solver["accuracy"]:
        return None
    advice = "" if solver.get("elements") is None else "; leave out solver.elements, or give more"
    return f"warning: the error by the mesh is up to {error[worst]:.1e}, at {_along(diagram, places[worst])}{advice}"


def below_limit(diagram: Diagram, limit: float) -> str:
    """One line: where along a path the belt is bent to less than a radius on its spine, or that it is nowhere."""
    radius = np.concatenate([branch.least_spine_radius for branch in diagram.branches])
    places = np.concatenate([branch.parameter for branch in diagram.branches])
    if np.isnan(radius).all():
        return f"the belt does not bend: no radius is below the limit of {number(limit)}"
    least = int(np.nanargmin(radius))
    where = f"{number(radius[least])} at {_along(diagram, places[least])}"
    if radius[least] >= limit:
        return f"no bend on the spine is tighter than the limit of {number(limit)}: the least radius is {where}"
    broken = [place for branch in diagram.branches for place in _crossings(branch, limit)]
    first, last = (_along(diagram, place) for place in (min(broken), max(broken)))
    return (
        f"warning: the bend on the spine is tighter than the limit of {number(limit)} between {first} and {last}: "
        f"the least radius is {where}"
    )


def _crossings(branch: Branch, limit: float) -> Iterator[float]:
    """Where the least radius of a branch is below a limit, and where it crosses the limit between two states."""
    place, radius = branch.parameter, branch.least_spine_radius
    yield from place[radius < limit]
    tightness = 1.0 / radius  # linear between states: a flat state has the radius infinity
    for k in np.flatnonzero(np.diff((radius < limit).astype(int))):
        share = (1.0 / limit - tightness[k]) / (tightness[k + 1] - tightness[k])
        if np.isfinite(share):
            yield float(place[k] + share * (place[k + 1] - place[k]))


def _along(diagram: Diagram, parameter: float) -> str:
    """A place on a path, in degrees where the path has an angle."""
    angle = diagram.angle(parameter)
    return f"{number(parameter)}" + ("" if angle is None else f" ({float(angle):.1f}°)")


def number(value: float) -> str:
    """A number with five significant digits.

    >>> number(23.504123), number(0.0), number(1.25e-7)
    ('23.504', '0', '1.25e-07')
    """
    return f"{value + 0.0:.{DIGITS}g}"


def row(vector: Floats, size: float = 0.0) -> list[str]:
    """The components of a vector with equal decimals, five significant digits in the largest.

    >>> row(np.array([12.3456, -0.0000004, 1.0]))
    ['12.346', '0.000', '1.000']

    Components that are rounding, of the largest or of a size, are 0.

    >>> row(np.array([-2e-9, 1e-25, -0.0])), row(np.array([6.6e-128, 0.0, 0.0]), size=1.0)
    (['-2.0000e-09', '0', '0'], ['0.0000', '0.0000', '0.0000'])

    A component that is NaN is not determined.

    >>> row(np.array([1.0, np.nan, 0.0]))
    ['1.0000', 'not determined', '0.0000']
    """
    largest = float(np.max(np.abs(vector), initial=0.0, where=~np.isnan(vector)))
    vector = without_rounding(vector, max(largest, size))
    largest = float(np.max(np.abs(vector), initial=0.0, where=~np.isnan(vector)))
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else DIGITS - 1
    if not 0 <= decimals <= 2 * DIGITS:
        return [_component(component) for component in vector.tolist()]
    # Adding 0.0 turns a rounded −0 into 0.
    return [
        UNDETERMINED if math.isnan(component) else f"{round(component, decimals) + 0.0:.{decimals}f}"
        for component in vector.tolist()
    ]


def _component(value: float) -> str:
    """A number with an exponent."""
    if math.isnan(value):
        return UNDETERMINED
    return f"{value:.{DIGITS - 1}e}" if value else "0"


def _scalars(equilibrium: Equilibrium) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    for quantity, value, where in _quantities(equilibrium):
        table.add_row(quantity, value, where)
    return table


def _supports(equilibrium: Equilibrium) -> str:
    supports = equilibrium.scenario.to_dict()["supports"]
    places = [f"{_place(support['at'], equilibrium.u)} {_held(support)}" for support in supports]
    return ", ".join(places) or "no support, held at the start"


def _held(support: dict[str, Any]) -> str:
    """The constraint of a support in words."""
    if support.get("hinge") is not None:
        moment = support.get("moment")
        return f"hinged about {support['hinge']}" + ("" if moment is None else f" with moment {number(moment)}")
    position = support.get("position")
    turned = any(support.get(key) is not None for key in ("rotation", "euler", "quaternion"))
    if position is not None and "free" in position:
        return "sliding"
    if position is not None:
        return "clamped" if turned else "pinned"
    return "held in orientation" if turned else "square rib"


def _quantities(equilibrium: Equilibrium) -> Iterator[tuple[str, str, str]]:
    energies = {"energy": equilibrium.energy}
    if equilibrium.elastic_energy != equilibrium.energy:
        energies["elastic energy"] = equilibrium.elastic_energy
    for name, energy in energies.items():
        yield name, _number(equilibrium, energy, "energy"), unit(equilibrium.scenario, "energy") or ""
    yield from _extremes(equilibrium)
    yield "side", f"{equilibrium.side:+d}" if equilibrium.side else "0", SIDE[equilibrium.side]
    if equilibrium.half_turns is not None:
        yield "half turns", str(equilibrium.half_turns), "of a closed belt"
    yield "crosses itself", *_crossing(equilibrium.crosses_itself)
    yield "local minimum", MINIMUM[equilibrium.stable], ""
    for name, error in equilibrium.error._asdict().items() if equilibrium.error else ():
        yield f"error by the mesh, {name}", "not known" if math.isnan(error) else f"{error:.1e}", "estimated"
    for name, residual in equilibrium.residuals._asdict().items():
        yield f"residual, {name}", f"{residual:.1e}", ""
    yield "iterations", str(equilibrium.iterations), ""
    yield "time", f"{equilibrium.solve_time:.3g}", "s"


def _extremes(equilibrium: Equilibrium) -> Iterator[tuple[str, str, str]]:
    on_spine, over_area = equilibrium.bend_radius
    metre = unit(equilibrium.scenario, "length")
    length = "" if metre is None else f"{metre}, "
    if on_spine is not None:
        yield "least bend radius, on the spine", number(on_spine.value), f"{length}at u = {number(on_spine.u)}"
    if math.isfinite(over_area.p99):
        yield "bend radius, 99 % of the area", number(over_area.p99), f"{length}or more"
    yield from _strains(equilibrium, length)
    angle = np.degrees(equilibrium.rib_angle)
    angle[np.abs(angle) < NOUGHT] = 0.0
    largest = int(np.argmax(np.abs(angle)))
    yield "largest rib angle", number(abs(angle[largest])), f"degrees, at u = {number(equilibrium.u[largest])}"


def _strains(equilibrium: Equilibrium, length: str) -> Iterator[tuple[str, str, str]]:
    """Extremes of a strip of finite thickness, V/5 or more from clamps, and the strains of its layers over the area."""
    strain, least = equilibrium.strain, equilibrium.least_bend_radius
    if strain is None:
        return
    if least is not None:
        where = f"{length}at u = {number(least.u)}, v = {number(least.v)}"
        yield "least bend radius, V/5 off clamps", number(least.value), where
    count = len(strain.layers)
    for index, layer in enumerate(strain.layers, start=1):
        name = "faces" if count == 1 else f"layer {index} of {count}"
        if not math.isnan(layer.value):
            where = f"%, at u = {number(layer.u)}, v = {number(layer.v)}"
            yield f"largest strain, {name}, V/5 off clamps", number(PER_CENT * layer.value), where
        yield f"strain, {name}, 99 % of the area", number(PER_CENT * layer.area.p99), "%, or less"


def _crossing(places: tuple[float, float] | None) -> tuple[str, str]:
    if places is None:
        return "no", ""
    first, second = map(number, places)
    return "yes", f"at u = {first} and u = {second}"


def _vectors(equilibrium: Equilibrium) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("world axes")
    for axis in "xyz":
        table.add_column(axis, justify="right")
    for name, vector, quantity in _named_vectors(equilibrium):
        table.add_row(Text(labelled(equilibrium.scenario, name, quantity)), *row(vector, scale(equilibrium, quantity)))
    return table


def _number(equilibrium: Equilibrium, value: float, quantity: Quantity) -> str:
    """A number of an equilibrium; 0 where it is rounding."""
    return number(float(without_rounding(np.array(value), scale(equilibrium, quantity))))


def _named_vectors(equilibrium: Equilibrium) -> Iterable[tuple[str, Floats, Quantity]]:
    u, position = equilibrium.highest_point
    yield f"highest point, u = {number(u)}", position, "length"
    tables = equilibrium.scenario.to_dict()
    yield from _free_ends(tables, equilibrium)
    yield from _loads(tables, equilibrium.u)
    for index, support in enumerate(tables["supports"]):
        place = _place(support["at"], equilibrium.u)
        force, moment = equilibrium.reaction(index)
        yield f"force on the belt, {place}", force, "force"
        yield f"moment on the belt, {place}", moment, "moment"
    # The source's method has no forces.
    for link, force in zip(tables.get("links", []), equilibrium.links, strict=False):
        ends = [_place(link[end], equilibrium.u) for end in ("from", "to")]
        yield f"force of the link from {ends[0]}, {ends[1]}", force, "force"


def _free_ends(tables: dict[str, Any], equilibrium: Equilibrium) -> Iterator[tuple[str, Floats, Quantity]]:
    """Positions of the ends of an open belt that no support holds."""
    held = {_place(support["at"], equilibrium.u) for support in tables["supports"] if support.get("position")}
    for name, node in [("start", 0), ("end", -1)]:
        if name not in held and not tables["belt"].get("closed"):
            yield f"free {name}", equilibrium.position[node], "length"


def _loads(tables: dict[str, Any], u: Floats) -> Iterator[tuple[str, Floats, Quantity]]:
    loads = tables.get("loads", {})
    if loads.get("gravity") is not None:
        yield "gravity", np.array(loads["gravity"]), "acceleration"
    for load in loads.get("points", []):
        yield f"load, {_place(load['at'], u)}", np.array(load["force"]), "force"


def _place(at: float | str, u: Floats) -> str:
    if isinstance(at, str):
        return at
    ends = {"start": u[0], "end": u[-1]}
    for name, end in ends.items():
        if math.isclose(at, end, abs_tol=1e-9 * u[-1]):
            return name
    return f"u = {number(at)}"


# ------------------------------------------------------------------------------------------ of several equilibria


def _equilibria(equilibria: Sequence[Equilibrium]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", justify="right")
    scenario = equilibria[0].scenario
    table.add_column(_heading(scenario, "energy", "energy"), justify="right", no_wrap=True)
    table.add_column("local\nminimum")
    headings = (
        "negative\nmodes",
        _heading(scenario, "height", "length"),
        _heading(scenario, "bend\nradius\non spine", "length"),
        _heading(scenario, "largest\nforce", "force"),
        "twist",
    )
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("crosses\nitself")
    radii = [equilibrium.least_spine_radius for equilibrium in equilibria]
    columns = [
        [str(index) for index in range(len(equilibria))],
        [_number(equilibrium, equilibrium.energy, "energy") for equilibrium in equilibria],
        [MINIMUM[equilibrium.stable] for equilibrium in equilibria],
        ["" if one.negative_modes is None else str(one.negative_modes) for one in equilibria],
        _column([_height(equilibrium) for equilibrium in equilibria], scale(equilibria[0], "length")),
        _column([None if radius is None else radius.value for radius in radii]),
        _column([_largest_force(equilibrium) for equilibrium in equilibria], scale(equilibria[0], "force")),
        _column([equilibrium.twist for equilibrium in equilibria], 1.0),
        ["no" if equilibrium.crosses_itself is None else "yes" for equilibrium in equilibria],
    ]
    for cells in zip(*columns, strict=True):
        table.add_row(*cells)
    return table


def _heading(scenario: Scenario, words: str, quantity: Quantity) -> Text:
    """The heading of a column, with the unit in a line of its own."""
    name = unit(scenario, quantity)
    # As plain text, since brackets are also marks of style.
    return Text(words if name is None else f"{words}\n[{name}]")


def _column(values: Sequence[float | None], size: float = 0.0) -> list[str]:
    """Numbers with equal decimals; an empty cell for None."""
    numbers = np.array([value for value in values if value is not None])
    cells = iter(row(numbers, size) if len(numbers) else [])
    return ["" if value is None else next(cells) for value in values]


def _height(equilibrium: Equilibrium) -> float:
    """The coordinate of the highest point along the bulge."""
    bulge = np.array(equilibrium.scenario.to_dict()["solver"]["bulge"])
    return float(equilibrium.highest_point.position @ bulge / np.linalg.norm(bulge))


def _largest_force(equilibrium: Equilibrium) -> float | None:
    supports = range(len(equilibrium.scenario.to_dict()["supports"]))
    forces = [float(np.linalg.norm(equilibrium.reaction(index).force)) for index in supports]
    return max(forces, default=None)


# --------------------------------------------------------------------------------------------------- a diagram's


def _branches(diagram: Diagram) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("branch", "begins"):
        table.add_column(name)
    energy = Text(labelled(diagram.scenario, "energy", "energy"))
    for heading in (Text("stable"), Text("parameter"), energy):
        table.add_column(heading, justify="right")
    for index, branch in enumerate(diagram.branches):
        stable = f"{branch.stable.count(True)} of {len(branch)}"
        table.add_row(
            str(index),
            _beginning(diagram, branch),
            stable,
            _from_to(branch.parameter),
            _from_to(without_rounding(branch.energy, scale(diagram.start, "energy"))),
        )
    return table


def _turned_back(diagram: Diagram) -> Iterator[tuple[int, str]]:
    """The branches that return to the start of the path, with the sentence printed for them."""
    for index, branch in enumerate(diagram.branches):
        parameter = branch.parameter
        if branch.origin is None and branch.end == "range" and parameter[-1] == parameter[0]:
            farthest = parameter[np.argmax(np.abs(parameter - parameter[0]))]
            yield index, f"it gets as far as {number(farthest)} and ends where the path begins"


def _beginning(diagram: Diagram, branch: Branch) -> str:
    if branch.origin is None:
        return "with the path"
    event = diagram.branches[branch.origin.branch].events[branch.origin.event]
    return f"{event.kind} of {branch.origin.branch}"


def _from_to(values: Floats) -> str:
    return f"{number(values[0])} → {number(values[-1])}"


def _events(diagram: Diagram) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("branch", "event"):
        table.add_column(name)
    turned = [] if diagram.angle(0.0) is None else [Text("angle")]
    scenario = diagram.scenario
    headings = (
        Text("parameter"),
        *turned,
        Text("negative"),
        _heading(scenario, "energy", "energy"),
        _heading(scenario, "moves by", "length"),
        _heading(scenario, "releases", "energy"),
    )
    for heading in headings:
        table.add_column(heading, justify="right")
    for index, branch in enumerate(diagram.branches):
        energy = branch.energy
        for event in filter(lambda event: event.confirmed, branch.events):
            angle = diagram.angle(event.parameter)
            angles = [] if angle is None else [f"{angle:.2f}°"]
            table.add_row(str(index), event.kind, number(event.parameter), *angles, *_event(event, energy[event.state]))
            if event.snapped is not None and event.snapped_parameter is not None:
                size = [number(size) for size in (event.snapped.energy, event.jump, event.released)]
                table.add_row(str(index), SNAP, number(event.snapped_parameter), *angles, "", *size)
    return table


def _event(event: Event, energy: float) -> list[str]:
    before, after = event.negative_modes
    return [f"{before} → {after}", number(energy)]
