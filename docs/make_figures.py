"""Makes every picture of README.md and docs: `make figures`.

Whatever is shown is computed here by the package, save the shell (tests/data/shell) and what the source prints. Grey
levels, line styles and markers alone tell things apart; where there are colours they are as good in grey.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

import fishbone as fb
import ritz
import shear
from cases import (
    ENERGIES,
    EXAMPLES,
    SHEET,
    apart,
    distance_to_shell,
    example,
    gentle_arc,
    refine,
    shapes,
    shell,
    solve,
    thick,
)
from fishbone import chart, plot
from fishbone.plot import VIEWER
from tables import ROOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FIGURES = Path(__file__).parent / "figures"
WIDTH = 7.0
STYLE: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "savefig.dpi": 200.0,
}
LINES: dict[str, dict[str, Any]] = {
    "fishbone": {"color": "0.0", "linestyle": "-", "marker": "o", "markersize": 4.0},
    "sadowsky": {"color": "0.35", "linestyle": "--", "marker": "s", "markersize": 4.0},
    "wunderlich": {"color": "0.0", "linestyle": "-.", "marker": "^", "markersize": 5.0, "markerfacecolor": "white"},
}
SHELL_LINE = {"color": "0.55", "linestyle": "-", "marker": "D", "markersize": 4.0}
OPEN = {"color": "0.55", "linestyle": "-.", "marker": "v", "markersize": 5.0, "markerfacecolor": "white"}
GENTLE = {"color": "0.55", "marker": "D", "markersize": 4.0}
GALLERY = {
    "bent": (0.5, -0.75, 0.4),
    "cantilever": (0.3, 0.45, -0.8),
    "curl": (0.3, 0.75, 0.35),
    "curved": (0.5, -0.75, 0.4),
    "example1": VIEWER,
    "example2": VIEWER,
    "hinge": (0.4, -0.5, -0.7),
    "mobius": (0.75, 0.45, -0.5),
    "planar": VIEWER,
    "polystyrene": VIEWER,
    "twist": VIEWER,
}
"""The shipped scenarios, with the direction of view of each."""
SPLIT: dict[bool, dict[str, Any]] = {True: {"height_ratios": (5.0, 1.0)}, False: {"width_ratios": (2.0, 1.0)}}
UP = np.array([1.0, 0.0, 0.0])
VIEW = np.array([0.38, 0.6, -0.7]) / np.linalg.norm([0.38, 0.6, -0.7])
"""Towards the viewer."""
MESHES = (40, 80, 160, 320, 640, 1280, 2560)


def plain(energy: str) -> dict[str, Any]:
    """The line of an energy, without markers."""
    return {key: LINES[energy][key] for key in ("color", "linestyle")} | {"label": energy}


# ------------------------------------------------------------------------------------------------ the two examples


def examples() -> Figure:
    """Both examples in parallel projection and on one scale, with their ribs."""
    shapes = [solve(example(name), "fishbone", 80) for name in EXAMPLES]
    boxes = [box(shape) for shape in shapes]
    width = sum(high[0] - low[0] for low, high in boxes)
    height = max(high[1] - low[1] for low, high in boxes)
    figure = Figure(figsize=(WIDTH, WIDTH * height / width + 0.35))
    left, share = 0.0, WIDTH * height / width / figure.get_figheight()
    for i, (shape, (low, high)) in enumerate(zip(shapes, boxes, strict=True), start=1):
        extent = (high[0] - low[0]) / width
        axes = figure.add_axes((left, 1.0 - share, extent, share))
        draw_belt(axes, shape)
        middle = 0.5 * (low[1] + high[1])
        axes.set(xlim=(low[0], high[0]), ylim=(middle - 0.5 * height, middle + 0.5 * height), aspect="equal")
        axes.set_axis_off()
        draw_axes(axes, np.array([low[0] + 0.06, middle + 0.1]))
        x, y, z = (f"{value:.3f}".replace("-", "−") for value in shape.highest_point.position)
        title = f"Example {i}: highest point ({x}, {y}, {z}) U"
        figure.text(left + 0.5 * extent, 0.03, title, ha="center", va="bottom")
        left += extent
    return figure


def box(shape: fb.Equilibrium) -> tuple[Floats, Floats]:
    """Corners of the belt on the page, with a margin for the clamps."""
    points = page(np.concatenate(shape.edges))
    margin = np.array([0.07, 0.03])
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def draw_belt(axes: Axes, shape: fb.Equilibrium) -> None:
    """A belt on the page, near parts over far parts."""
    normals = 0.5 * (shape.frame[1:, :, 0] + shape.frame[:-1, :, 0])
    light = np.array([0.8, 0.5, 0.1]) / np.linalg.norm([0.8, 0.5, 0.1])
    shades = 0.68 + 0.3 * np.abs(normals @ light)
    lines = (shape.edges.minus, shape.edges.plus, shape.position)
    pages = [page(line) for line in lines]
    depth = shape.position @ VIEW
    for k in np.argsort(depth[1:] + depth[:-1]):
        minus, plus, spine = (line[k : k + 2] for line in pages)
        outline = np.concatenate((minus, plus[::-1]))
        axes.fill(*outline.T, facecolor=str(shades[k]), edgecolor="0.45", linewidth=0.3, zorder=2)
        for edge in (minus, plus):
            axes.plot(*edge.T, color="black", linewidth=0.9, zorder=2, solid_capstyle="round")
        axes.plot(*spine.T, color="black", linewidth=0.7, zorder=2, solid_capstyle="round")
    for end in (0, -1):
        clamp = page(shape.position[end] + np.outer([-0.07, 0.07], shape.frame[end, :, 2]))
        axes.plot(*clamp.T, color="black", linewidth=3.2, zorder=3, solid_capstyle="butt")


def draw_axes(axes: Axes, origin: Floats) -> None:
    """A triad of the world axes."""
    for name, tip in zip("xyz", page(0.09 * np.eye(3)), strict=True):
        axes.annotate("", origin + tip, origin, arrowprops={"arrowstyle": "-|>", "color": "0.3", "linewidth": 0.7})
        axes.annotate(name, origin + 1.35 * tip, color="0.2", ha="center", va="center", fontstyle="italic")


def page(points: Floats) -> Floats:
    """World points seen along −VIEW, the world's x upwards."""
    right = np.cross(UP, VIEW)
    right /= np.linalg.norm(right)
    return np.stack([points @ right, points @ np.cross(VIEW, right)], axis=-1)


# ----------------------------------------------------------------------------------------------------------- gallery


def gallery(name: str) -> Figure:
    """A shipped scenario, bent and flat: the flat board below if it is long, else beside."""
    shape = fb.solve(fb.load(ROOT / "scenarios" / f"{name}.toml"), strict=True)
    outline = np.concatenate(shape.outline().loops)
    is_long = np.ptp(outline[:, 1]) < 0.3 * np.ptp(outline[:, 0])
    figure = Figure(figsize=(5.6, 3.6 if is_long else 3.0), layout="constrained")
    bent, flat = figure.subplots(*((2, 1) if is_long else (1, 2)), **SPLIT[is_long])
    plot.draw_oblique(bent, shape, GALLERY[name])
    plot.draw_flat(flat, shape)
    flat.set(title="", xlabel="", ylabel="")
    flat.set_axis_off()
    return figure


def gallery_shapes() -> Figure:
    """Five shapes of one board between the same clamps, and below them the flat boards with their ribs."""
    figure = Figure(figsize=(WIDTH, 4.7), layout="constrained")
    panels = figure.subfigures(2, 3).flat
    drawn = apart(shapes(), 5)
    for letter, panel, shape in zip("abcde", panels, drawn, strict=False):
        radius, margin = shape.least_spine_radius, shape.snap_margin(reach=0.3)
        assert radius is not None
        assert margin is not None
        axes = panel.subplots()
        plot.draw_oblique(axes, shape)
        force = np.linalg.norm(shape.reaction("end").force)
        numbers = f"radius {radius.value:.3f}, force {force:.1f}, margin {margin.distance:.3f}"
        axes.set_title(f"({letter}) energy {shape.energy:.2f}\n{numbers}", fontsize=7.5)
    last = figure.subfigs[-1]
    for letter, axes, shape in zip("abcde", last.subplots(5, 1), drawn, strict=True):
        plot.draw_flat(axes, shape)
        axes.set(title="", xlabel="", ylabel="")
        axes.set_axis_off()
        axes.text(-0.04, 0.0, f"({letter})", ha="right", va="center")
    last.suptitle("ribs on the flat board", fontsize=7.5)
    return figure


# ------------------------------------------------------------------------------------------------------- convergence


def convergence() -> Figure:
    """Changes of energy and spine under refinement."""
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    cases = {
        "gentle arc, fishbone": (gentle_arc(), "fishbone", MESHES[:5], GENTLE),
        "gentle arc, wunderlich": (gentle_arc(), "wunderlich", MESHES, OPEN),
        **{f"example 1, {energy}": (example("example1"), energy, MESHES, LINES[energy]) for energy in ENERGIES},
    }
    energy, position = figure.subplots(1, 2)
    for label, (tables, model, meshes, line) in cases.items():
        refinement = refine(tables, model, meshes)
        energy.loglog(meshes[:-1], refinement.energy, label=label, **line)
        position.loglog(meshes[:-1], refinement.position, label=label, **line)
    for axes, quantity in ((energy, "energy [$R_f/U$]"), (position, "spine [U]")):
        axes.set(xlabel="elements n", ylabel=f"change of {quantity} from n to 2n")
    energy.set_title("Energy")
    position.set_title("Spine at the nodes of the coarsest mesh")
    slope_mark(energy, 2, (160.0, 640.0), 3e-6)
    slope_mark(energy, 4, (80.0, 320.0), 1e-6)
    slope_mark(position, 2, (160.0, 640.0), 3e-7)
    slope_mark(position, 4, (80.0, 320.0), 1e-7)
    for axes in (energy, position):
        axes.set_xticks(MESHES[:-1], [str(mesh) for mesh in MESHES[:-1]])
        axes.minorticks_off()
    figure.legend(*energy.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def slope_mark(axes: Axes, order: int, span: tuple[float, float], height: float) -> None:
    """A thin line of this order."""
    low, high = span
    fall = height * (low / high) ** order
    axes.loglog(span, (height, fall), color="0.5", linewidth=0.8, linestyle=":")
    place = {"xytext": (3, 3), "textcoords": "offset points", "color": "0.3"}
    axes.annotate(f"order {order}", ((low * high) ** 0.5, (height * fall) ** 0.5), **place)


# -------------------------------------------------------------------------------------------------- bound and radius


def bound() -> Figure:
    """The parts of example 1 where ribs are at the bound."""
    figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
    slope, rate = figure.subplots(1, 2)
    for energy in ENERGIES:
        shape = solve(example("example1"), energy, 640)
        slope.plot(shape.u, shape.rib_slope, **plain(energy))
        middle = 0.5 * (shape.u[1:] + shape.u[:-1])
        rate.plot(middle, np.diff(shape.rib_slope) / np.diff(shape.u), **plain(energy))
    for sign in (-1.0, 1.0):
        rate.axhline(sign * 20.0, color="0.5", linewidth=0.7, linestyle=":")
    rate.annotate("2/V", (1.0, 20.0), xytext=(3, 0), textcoords="offset points", va="center")
    rate.annotate("−2/V", (1.0, -20.0), xytext=(3, 0), textcoords="offset points", va="center")
    slope.set(xlabel="u [U]", ylabel="rib slope β", title="Rib slope", xlim=(0.0, 1.0))
    rate.set(xlabel="u [U]", ylabel="β' [1/U]", title="Its rate, bounded by 2/V", xlim=(0.0, 1.0))
    figure.legend(*slope.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def bend_radius() -> Figure:
    """Bend radius by mesh: least over the width, least on the spine, and exceeded on 99 % of the area."""
    figure = Figure(figsize=(0.62 * WIDTH, 2.7), layout="constrained")
    axes = figure.subplots()
    meshes = MESHES[1:-1]
    shapes = [solve(example("example1"), "wunderlich", mesh) for mesh in meshes]
    radii = [shape.bend_radius for shape in shapes]
    on_spine = [radius.spine.value for radius in radii if radius.spine is not None]
    over_width = [shape.least_bend_radius.value for shape in shapes if shape.least_bend_radius is not None]
    axes.loglog(meshes, on_spine, color="0.0", marker="o", markersize=4.0, label="on the spine")
    over_area = [radius.area.p99 for radius in radii]
    axes.loglog(meshes, over_area, color="0.5", marker="s", markersize=4.0, label="exceeded on 99 % of the area")
    axes.loglog(meshes, over_width, label="over the whole width", **LINES["wunderlich"])
    axes.set_xticks(meshes, [str(mesh) for mesh in meshes])
    axes.minorticks_off()
    axes.set(xlabel="elements", ylabel="bend radius [U]", title="Example 1, wunderlich")
    axes.legend()
    return figure


# ------------------------------------------------------------------------------------------------------ continuation


def continuation() -> Figure:
    """A strut under thrust, its far end held square and sliding: its buckling and its branches."""
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict() | {"name": "A strut under thrust"}
    tables["supports"][1]["position"] = [0.0, "free", 0.0]
    tables["loads"] = {"points": [{"at": "end", "force": [0.0, -1.0, 0.0]}]}
    return plot.diagram(fb.follow(fb.Scenario.from_dict(tables), {"loads.points[0].force[1]": -100.0}))


def hinge_there_and_back() -> Figure:
    """The shipped hinge, opened from flat to 130° and closed again, with its snaps."""
    tables = fb.load(ROOT / "scenarios" / "hinge.toml").to_dict() | {"name": "The hinge, opened and closed"}
    angles = np.radians([0.0, 130.0, 0.0])
    poses = [([0.016 * np.sin(a), 0.016 + 0.016 * np.cos(a), 0.034], [0.0, 0.0, -a]) for a in angles]
    tables["supports"][1] |= dict(zip(("position", "rotation"), poses[0], strict=True))
    tables["solver"]["elements"] = 200
    path = fb.Poses(poses[1:], motion="screw")
    return plot.diagram(fb.follow(fb.Scenario.from_dict(tables), path, snaps=True), radius_limit=0.0105)


def shear_diagrams() -> Figure:
    """Height of sheared bands: their equilibria, and the minima of a tracker on the way out and back."""
    figure = Figure(figsize=(WIDTH, 8.6), layout="constrained")
    rows = figure.subplots(len(shear.RATIOS), len(ENERGIES), sharex=True, sharey="row")
    ways = (("there", slice(None, shear.STEPS + 1), "0.78", 5.0), ("back", slice(shear.STEPS, None), "0.55", 2.2))
    for ratio, row in zip(shear.RATIOS, rows, strict=True):
        for energy, axes in zip(ENERGIES, row, strict=True):
            led = shear.swing(ratio, energy)
            for label, way, color, width in ways:
                axes.plot(led.z[way], led.height[way], color=color, linewidth=width, label=label)
            for branch in shear.diagram(ratio, energy).branches:
                for states, is_stable in chart.runs(branch):
                    name, style = chart.LINES[is_stable]
                    axes.plot(branch.parameter[states], branch.height[states], color="black", label=name, **style)
            axes.set(xlim=(0.0, shear.FARTHEST))
        row[0].set_ylabel(f"V/U = 1/{ratio}\nhighest x [U]")
    for energy, axes in zip(ENERGIES, rows[0], strict=True):
        axes.set_title(energy)
    for axes in rows[-1]:
        axes.set_xlabel("z of the far clamp [U]")
    labels = {label: line for axes in rows.flat for line, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=4)
    return figure


# ------------------------------------------------------------------------------------------------------------- shell


def shell_thickness() -> Figure:
    """Distance from the shell by thickness, both examples."""
    figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
    for i, axes in enumerate(figure.subplots(1, 2), start=1):
        names = [f"example{i}{suffix}" for suffix in ("_h4", "_h2", "", "_2h")]
        thickness = [shell(name)["thickness"] for name in names]
        for energy, line in {**LINES, "shell": SHELL_LINE}.items():
            distance = [distance_to_shell(name, energy) for name in names]
            axes.loglog(thickness, distance, label=energy, **line)
        axes.set_xticks(thickness, [f"{value / SHEET:g}" for value in thickness])
        axes.minorticks_off()
        ticks = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3) if i == 1 else (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)
        axes.set_yticks(ticks, [f"{1e3 * tick:g}" for tick in ticks])
        axes.set(xlabel="thickness of the shell [0.0007 U]", ylabel="RMS distance [1e-3 U]", title=f"Example {i}")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def strip_ribs() -> Figure:
    """Example 2 about its inflections: ribs on the flat board, torsion, and curvature across the spine."""
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    rows = figure.subplots(4, 1, height_ratios=(1.0, 1.0, 2.2, 2.2), sharex=True)
    tables = example("example2")
    flat = solve(tables, "wunderlich", 160)
    strips = {h: solve(thick(tables, h), "shell", 160) for h in (0.25 * SHEET, SHEET, 4.0 * SHEET)}
    sheet = strips[SHEET]
    reach = 0.5 * tables["belt"]["width"] * np.array([-1.0, 1.0])
    drawn = {"wunderlich": flat, f"shell, h = {SHEET:g} U": sheet}
    for axes, (name, belt) in zip(rows, drawn.items(), strict=False):
        for u, slope in zip(belt.u[::2], belt.rib_slope[::2], strict=True):
            axes.plot(u - slope * reach, reach, color="0.35", linewidth=0.5)
        axes.plot((0.0, 1.0), (0.0, 0.0), color="0.0", linewidth=0.8)
        axes.set(ylabel="v [U]", ylim=(-0.05, 0.05), yticks=(-0.05, 0.0, 0.05), title=f"Ribs on the flat board, {name}")
    torsion, across = rows[2:]
    for (h, belt), color in zip(strips.items(), ("0.72", "0.45", "0.0"), strict=True):
        inside = belt.u[(belt.u > 0.02) & (belt.u < 0.98)]
        found = belt.strain_at(np.column_stack([inside, 0.0 * inside]))
        assert found is not None
        label = f"shell, h = {h:g} U"
        torsion.plot(belt.u, belt.torsion, color=color, label=label)
        across.plot(inside, found.curvature[:, 1, 1], color=color, label=label)
    torsion.plot(flat.u, flat.torsion, **plain("wunderlich"))
    across.plot(flat.u, -(flat.rib_slope**2) * flat.bend, **plain("wunderlich"))
    torsion.set(ylabel="$ω_η$ [1/U]")
    across.set(xlabel="u [U]", ylabel="$b_{vv}$ [1/U]", xlim=(0.0, 1.0))
    # The bend changes its sign beside the clamp, too.
    for inflection in sheet.u[np.flatnonzero(np.diff(np.sign(sheet.bend)))][1:]:
        for axes in rows:
            axes.axvline(inflection, color="0.6", linewidth=0.7, linestyle=":")
    figure.legend(*across.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


# ------------------------------------------------------------------------------------------------------------ sweep


def sweep() -> Figure:
    """The sweep that docs/sweep.md runs: a sheet whose far clamp is moved along it and turned."""
    ranges = {"supports[1].position[1]": (0.08, 0.18, 21), "supports[1].rotation[0]": (0.0, 1.2, 13)}
    with tempfile.TemporaryDirectory() as folder:
        found = fb.sweep(fb.load(ROOT / "scenarios" / "polystyrene.toml"), Path(folder) / "sweep.parquet", ranges)
        return plot.sweep(found, limit="bend_radius.area.p99>18 mm")


# --------------------------------------------------------------------------------------------- the source's method


def collocation() -> Figure:
    """Eq. (25) at the collocation points and between them."""
    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    for i, axes in enumerate(figure.subplots(1, 2), start=1):
        shape = ritz.solve(f"example{i}", penalty=1e2, updates=0)
        rate = ritz.geodesic(shape)
        axes.plot(shape.u, rate, color="black", linewidth=0.9, label="along the belt")
        points = slice(None, None, ritz.NODES_PER_INTERVAL)
        dots = {"marker": "o", "markersize": 4.0, "markerfacecolor": "white", "linestyle": ""}
        axes.plot(shape.u[points], rate[points], color="black", label="at the 16 points", **dots)
        axes.set(xlabel="u [U]", ylabel="$ω_ξ$ [rad/U]", title=f"Example {i}: Eq. (25) asks for 0", xlim=(-0.02, 1.02))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def locking() -> Figure:
    """Energy and height of example 1 by penalty."""
    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    energy, height = figure.subplots(1, 2)
    shapes = [ritz.solve("example1", penalty=penalty, updates=0) for penalty in ritz.PENALTIES]
    ours = solve(example("example1"), "fishbone")
    line = {"color": "black", "marker": "o", "markersize": 4.0, "label": "the source's method, multipliers 0"}
    level = {"color": "black", "linestyle": "--", "linewidth": 0.9, "label": "intrinsic method"}
    energy.semilogx(ritz.PENALTIES, [shape.energy for shape in shapes], **line)
    energy.axhline(ours.energy, **level)
    height.semilogx(ritz.PENALTIES, [shape.highest_point.position[0] for shape in shapes], **line)
    height.axhline(ours.highest_point.position[0], **level)
    height.axhline(0.35, color="0.5", linestyle=":", label="printed by the source")
    energy.set(xlabel="penalty", ylabel="energy [$R_f/U$]", title="Example 1: energy", ylim=(0.0, None))
    height.set(xlabel="penalty", ylabel="x of the highest point [U]", title="Example 1: height")
    figure.legend(*height.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def main() -> None:
    """Writes all pictures, or those drawn by the functions that the command line names."""
    FIGURES.mkdir(exist_ok=True)
    if len(sys.argv) > 1:
        for name in sys.argv[1:]:
            with mpl.rc_context(STYLE):
                save(globals()[name](), name)
        return
    for name in GALLERY:
        with mpl.rc_context(STYLE | {"axes.grid": False, "savefig.dpi": 150.0}):
            save(gallery(name), f"gallery_{name}")
    with mpl.rc_context(STYLE | {"axes.grid": False, "savefig.dpi": 150.0}):
        save(gallery_shapes(), "gallery_shapes")
    with mpl.rc_context(STYLE | {"savefig.dpi": 150.0}):
        save(shear_diagrams(), "shear_diagrams")
    drawn = (examples, convergence, bound, bend_radius, continuation, hinge_there_and_back)
    for draw in (*drawn, shell_thickness, strip_ribs, sweep, collocation, locking):
        with mpl.rc_context(STYLE):
            save(draw(), draw.__name__)


def save(figure: Figure, name: str) -> None:
    """Writes a picture and prints its size."""
    path = FIGURES / f"{name}.png"
    figure.savefig(path, metadata={"Software": None}, bbox_inches="tight" if name.startswith("gallery") else None)
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main()
