import hashlib
import io
import struct
import sys

import numpy as np
import pytest
import trimesh

import fishbone as fb
from conftest import ROOT
from fishbone import chart, examples, export, plot, scene


def test_the_views_have_one_scale(equilibrium):
    figure = plot.views(equilibrium)
    figure.draw_without_rendering()
    views = [axes for axes in figure.axes if "view" in axes.get_title()]
    scales = [axes.bbox.width / np.ptp(axes.get_xlim()) for axes in views]
    scales += [axes.bbox.height / np.ptp(axes.get_ylim()) for axes in views]
    assert len(views) == 3
    np.testing.assert_allclose(scales, scales[0], rtol=1e-6)


def test_the_views_hold_the_whole_belt(equilibrium):
    points = equilibrium.surface().reshape(-1, 3)
    columns = {"Top": (1, 2), "Front": (1, 0), "Side": (2, 0)}
    for axes in plot.views(equilibrium).axes:
        if axes.get_title().split(" ")[0] in columns:
            right, up = columns[axes.get_title().split(" ")[0]]
            for column, (low, high) in ((right, axes.get_xlim()), (up, axes.get_ylim())):
                assert low < points[:, column].min()
                assert points[:, column].max() < high


def test_the_graphs_show_the_rib_angle_in_degrees_and_the_bend(equilibrium):
    graphs = {axes.get_title(): axes.lines[-1].get_ydata() for axes in plot.views(equilibrium).axes if axes.lines}
    np.testing.assert_array_equal(graphs["Rib angle"], np.degrees(equilibrium.rib_angle))
    np.testing.assert_array_equal(graphs["Bend"], equilibrium.bend)


# Matplotlib names some objects in an SVG file by their addresses in memory.
@pytest.mark.parametrize("suffix", [".png", ".pdf"])
def test_the_same_shape_gives_the_same_file(equilibrium, example, suffix):
    digests = {hashlib.sha256(plot.encode(one, suffix)).digest() for one in (equilibrium, fb.solve(example))}
    assert len(digests) == 1


def test_a_picture_is_fine_enough_to_print(equilibrium, tmp_path):
    path = tmp_path / "views.png"
    plot.save(equilibrium, path)
    width, _ = struct.unpack(">II", path.read_bytes()[16:24])
    assert width >= 2000


def test_a_name_with_markup_is_drawn_as_it_is(example):
    named = fb.Scenario.from_dict(example.to_dict() | {"name": r"$\bad_{"})
    plot.encode(fb.solve(named), ".svg")


def test_a_picture_leaves_the_users_settings_alone(equilibrium):
    before = dict(plot.mpl.rcParams)
    plot.encode(equilibrium, ".png")
    assert dict(plot.mpl.rcParams) == before


@pytest.mark.parametrize("suffix", export.SUFFIXES)
def test_meshes_hold_the_surface(equilibrium, tmp_path, suffix):
    path = tmp_path / f"belt{suffix}"
    export.save(equilibrium, path)
    mesh = trimesh.load(io.BytesIO(path.read_bytes()), file_type=suffix[1:], force="mesh")
    surface = equilibrium.surface().reshape(-1, 3)
    np.testing.assert_allclose(mesh.bounds, [surface.min(axis=0), surface.max(axis=0)], atol=1e-6)
    # A belt is inextensible: bent or flat, its area is U V.
    assert mesh.area == pytest.approx(1.0 * 0.1, rel=1e-2)


def test_the_mesh_faces_the_normal(equilibrium):
    normals = export.mesh(equilibrium).face_normals
    assert normals[0] @ equilibrium.frame[0, :, 0] > 0.0


@pytest.mark.parametrize("module", [plot, export])
def test_another_suffix_is_refused(equilibrium, tmp_path, module):
    with pytest.raises(fb.InvalidArgument, match=r"found \.bmp, allowed \."):
        module.save(equilibrium, tmp_path / "belt.bmp")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("module", "package", "extra"), [("plot", "matplotlib", "plot"), ("export", "trimesh", "mesh")]
)
def test_the_error_of_a_missing_package_has_the_command_that_installs_it(monkeypatch, module, package, extra):
    monkeypatch.delitem(sys.modules, f"fishbone.{module}")
    monkeypatch.delattr(fb, module)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(fb.MissingPackage) as refusal:
        __import__(f"fishbone.{module}")
    assert f'pip install "fishbone[{extra}]"' in str(refusal.value)


def everything(example):
    """A board with every kind of mark in a picture."""
    return fb.Scenario.from_dict(
        {
            "belt": {
                "width": 0.1,
                "rigidity": 1.0,
                "density": 1.0,
                "segments": [
                    {"kind": "rigid", "length": 0.1},
                    {"kind": "straight", "length": 0.3},
                    {"kind": "corner", "angle": 0.5},
                    {"kind": "arc", "length": 0.6, "curvature": -1.0},
                ],
            },
            "supports": [
                {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},
                {"at": 0.5, "position": ["free", 0.45, "free"]},
                {"at": "end", "position": [0.0, 0.8, 0.0], "rotation": [0.0, 0.0, 0.0], "hinge": "zeta"},
            ],
            "links": [{"from": 0.3, "to": 0.7, "offset": [0.0, 0.35, 0.0]}],
            "loads": {
                "gravity": [-1.0, 0.0, 0.0],
                "points": [{"at": 0.6, "force": [0.0, 0.0, 1.0], "lever": [0.0, 0.0, 0.04]}],
            },
            "energy": example.to_dict()["energy"],
        }
    )


def labels(figure):
    return {text.get_text() for part in figure.subfigs for legend in part.legends for text in legend.get_texts()}


def test_the_key_names_what_the_picture_has_and_nothing_else(equilibrium, example):
    always = {"spine", "edges", "ribs", "+ξ side", "−ξ side", "start, u = 0", "highest point"}
    assert labels(plot.views(equilibrium)) == always | {"held frame"}
    marks = {"rigid", "held frame", "held place", "hinge axis", "link", "force", "gravity"}
    assert labels(plot.views(fb.solve(everything(example)))) == always | marks


def test_arrows_of_forces_lie_within_the_views(example):
    equilibrium = fb.solve(everything(example))
    page = scene.Scene(equilibrium)
    assert len(page.arrows) == 1
    for arrow in page.arrows:
        for point in (arrow.at, arrow.at + arrow.reach):
            assert (page.low < point).all()
            assert (point < page.high).all()


@pytest.mark.parametrize("name", examples.names())
def test_every_shipped_scenario_is_drawn(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    path.write_text(examples.text(name), "utf-8")
    equilibrium = fb.solve(fb.load(path))
    plot.save(equilibrium, tmp_path / "views.pdf")
    export.save(equilibrium, tmp_path / "belt.stl")


def test_strips_hold_every_triangle_once_and_the_whole_spine(example):
    equilibrium = fb.solve(everything(example))
    strips = list(scene.strips_of(equilibrium))
    _, triangles = equilibrium.mesh(2)
    assert sum(len(strip.faces) for strip in strips) == len(triangles)
    rigid = [strip for strip in strips if strip.rigid]
    assert len(rigid) == 1
    edges = sum(
        np.linalg.norm(line[1] - line[0]) for strip in strips for line, style in strip.lines if style is scene.EDGE
    )
    outline = equilibrium.outline().loops[0]
    assert edges == pytest.approx(np.linalg.norm(np.diff(outline, axis=0), axis=1).sum(), rel=1e-3)


def test_the_flat_board_is_drawn_to_scale(equilibrium):
    figure = plot.flat(equilibrium)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    low, high = (np.array(limits) for limits in zip(axes.get_xlim(), axes.get_ylim(), strict=True))
    for line in equilibrium.outline().loops:
        assert (low <= line.min(axis=0)).all()
        assert (line.max(axis=0) <= high).all()


def test_a_view_along_the_upward_axis_is_refused(equilibrium):
    plot.oblique(equilibrium, (1.0, 1.0, 1.0))
    with pytest.raises(fb.InvalidArgument, match="viewer"):
        plot.oblique(equilibrium, (1.0, 0.0, 0.0))


# --------------------------------------------------------------------------------------------------- the diagram


@pytest.fixture(scope="module")
def buckling():
    """A straight strut under thrust: pitchforks, and branches that come off them."""
    tables = examples_tables("planar")
    tables["supports"][1]["position"] = [0.0, "free", 0.0]
    tables["loads"] = {"points": [{"at": "end", "force": [0.0, -1.0, 0.0]}]}
    return fb.follow(fb.Scenario.from_dict(tables), {"loads.points[0].force[1]": -90.0})


def examples_tables(name):
    return fb.load(ROOT / "scenarios" / f"{name}.toml").to_dict()


def legend_of(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def lines_of(axes, style):
    return [line.get_xydata() for line in axes.lines if line.get_linestyle() == style and len(line.get_xydata()) > 1]


ALWAYS = ["tightest bend\n[1/length]", "rib margin\n[1/length]"]
"""Labels of the last panels of every belt."""


def test_a_diagram_shows_the_quantities_of_the_branches(turned):
    figure = plot.diagram(turned)
    [branch] = turned.branches
    force = np.linalg.norm(branch.reaction("end").force, axis=1)
    values_of = (branch.energy, branch.height, force, 1.0 / branch.least_spine_radius, branch.rib_margin)
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "energy",
        "height [length]",
        "|force| of supports[1]",
        *ALWAYS,
    ]
    assert figure.axes[-1].get_xlabel() == turned.parameter_name
    assert figure.get_figwidth() == 7.0
    for axes, values in zip(figure.axes, values_of, strict=True):
        [solid], [dashed] = lines_of(axes, "-"), lines_of(axes, "--")
        points = np.column_stack([branch.parameter, values])
        fold = branch.events[0].state
        np.testing.assert_array_equal(solid, points[: fold + 1])
        np.testing.assert_array_equal(dashed, points[fold:])


def test_every_stretch_of_a_diagram_is_drawn_once_and_as_stable_as_it_is(buckling):
    for branch in buckling.branches:
        found = list(chart.runs(branch))
        assert [states.start for states, _ in found] == [0, *(states.stop - 1 for states, _ in found[:-1])]
        assert found[-1][0].stop == len(branch)
        between = {event.state for event in branch.events}
        for states, is_stable in found:
            sure = [state for state in range(states.start, states.stop) if state not in between]
            assert {branch.stable[state] for state in sure} <= {is_stable}


def test_branches_are_drawn_from_where_they_begin(buckling):
    axes = plot.diagram(buckling).axes[1]
    first = next(branch for branch in buckling.branches if branch.origin == fb.Origin(0, 0))
    root = [line for line in lines_of(axes, "-") if len(line) == 2 and line[1][0] == first.parameter[0]]
    [line] = root
    assert line[0][0] == pytest.approx(buckling.branches[0].events[0].parameter, rel=1e-6)


def test_the_key_of_a_diagram_names_what_it_has_and_nothing_else(turned, buckling):
    assert legend_of(plot.diagram(turned)) == ["stable", "unstable", "fold", "snap"]
    names = legend_of(plot.diagram(buckling))
    assert {"stable", "unstable", "pitchfork", "branch 0", "branch 1"} <= set(names)
    assert "transcritical" not in names
    assert "bifurcation" not in names
    steady = fb.follow(turned.start, {"supports[1].rotation[2]": 0.3}, branches=1)
    assert legend_of(plot.diagram(steady)) == ["stable"]


def test_snaps_of_a_diagram_lie_within_its_panels(turned):
    figure = plot.diagram(turned)
    [event] = turned.branches[0].events
    low, high = figure.axes[0].get_ylim()
    assert low < event.snapped.energy < high
    [arrow] = figure.axes[0].texts
    assert arrow.xy == (event.snapped_parameter, event.snapped.energy)


def test_the_force_of_a_diagram_is_that_of_the_support_asked_for(turned):
    axes = plot.diagram(turned, support="start").axes[2]
    assert axes.get_ylabel() == "|force| of supports[0]"
    with pytest.raises(fb.NoSupport):
        plot.diagram(turned, support=7)


def test_a_diagram_of_a_belt_without_supports_has_no_force():
    diagram = fb.follow(fb.load(ROOT / "scenarios" / "mobius.toml"), {"belt.width": 0.18}, branches=1)
    assert [axes.get_ylabel() for axes in plot.diagram(diagram).axes] == ["energy", "height [length]", *ALWAYS]


@pytest.mark.parametrize("suffix", [".png", ".pdf"])
def test_the_same_diagram_gives_the_same_file(turned, suffix):
    again = fb.follow(turned.scenario, {"supports[1].rotation[2]": -1.5})
    assert plot.encode(turned, suffix) == plot.encode(again, suffix)


def test_a_diagram_is_saved_like_an_equilibrium(turned, tmp_path):
    plot.save(turned, tmp_path / "diagram.svg")
    assert b"<svg" in (tmp_path / "diagram.svg").read_bytes()
    with pytest.raises(fb.InvalidArgument, match=r"found \.bmp, allowed \.png"):
        plot.save(turned, tmp_path / "diagram.bmp")
    assert [path.name for path in tmp_path.iterdir()] == ["diagram.svg"]


# ---------------------------------------------------------------------------------------------- several equilibria


def test_an_overview_shows_energy_and_stability_of_each(arches):
    figure = plot.overview(arches)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    for index, (title, one) in enumerate(zip(titles, arches[: plot.SHOWN], strict=True)):
        assert title.startswith(f"{index}: {one.energy:.5g}, {plot.stability(one)}")
        assert title.endswith("passes through itself") is (one.crosses_itself is not None)
    assert titles[0].endswith(", stable")
    assert any(title.endswith(", 1 negative mode") for title in titles)


def test_an_overview_has_one_scale(arches):
    figure = plot.overview((arches * 2)[:5])
    figure.draw_without_rendering()
    scales = [axes.bbox.width / np.ptp(axes.get_xlim()) for axes in figure.axes[:5]]
    np.testing.assert_allclose(scales, scales[0], rtol=1e-6)
    for axes in figure.axes[:5]:
        [low, high] = axes.dataLim.get_points()
        assert (low >= (axes.get_xlim()[0], axes.get_ylim()[0])).all()
        assert (high <= (axes.get_xlim()[1], axes.get_ylim()[1])).all()


def test_an_overview_has_the_number_of_equilibria_not_shown(arches):
    many = (arches * plot.SHOWN)[: plot.SHOWN + 3]
    figure = plot.overview(many)
    assert "3 more" in figure.get_suptitle()
    assert sum(bool(axes.get_title()) for axes in figure.axes) == plot.SHOWN
    assert "more" not in plot.overview(many[: plot.SHOWN]).get_suptitle()


def test_one_equilibrium_is_an_overview_too(equilibrium):
    assert plot.encode([equilibrium], ".pdf") != plot.encode(equilibrium, ".pdf")


def test_the_same_equilibria_give_the_same_picture(arches, tmp_path):
    plot.save(arches[:2], tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == plot.encode(arches[:2], ".png")


def test_an_overview_of_nothing_is_refused(equilibrium, out_of_reach):
    with pytest.raises(fb.InvalidArgument, match="found none"):
        plot.encode([], ".png")
    infeasible = fb.solve(out_of_reach)
    if not np.isfinite(infeasible.position).all():
        with pytest.raises(fb.InvalidArgument, match="no shape"):
            plot.overview([equilibrium, infeasible])
