import hashlib
import io
import struct
import sys

import numpy as np
import pytest
import trimesh

import fishbone as fb
from fishbone import examples, export, plot, scene


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


# In an SVG file matplotlib names some objects by where they lie in memory.
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
def test_a_missing_package_says_how_to_get_it(monkeypatch, module, package, extra):
    monkeypatch.delitem(sys.modules, f"fishbone.{module}")
    monkeypatch.delattr(fb, module)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(fb.MissingPackage) as refusal:
        __import__(f"fishbone.{module}")
    assert f'pip install "fishbone[{extra}]"' in str(refusal.value)


def everything(example):
    """A board with something of all that a picture marks."""
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
