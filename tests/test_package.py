import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
import types

import numpy as np
import pytest

import fishbone as fb

BELT = {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}
CLAMP = {"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
OTHER_CLAMP = {"at": "end", "position": [0.0, 0.5, 0.1], "rotation": [0.0, 0.0, 0.0]}
SHAPES = {
    "u": (),
    "position": (3,),
    "frame": (3, 3),
    "bend": (),
    "torsion": (),
    "rib_slope": (),
    "rib_angle": (),
    "curvature": (),
}


def test_the_version_is_that_of_the_core():
    assert fb.__version__ == fb._core.__version__


def test_all_names_exist_and_are_documented():
    for name in fb.__all__:
        assert getattr(fb, name).__doc__, name


def test_pictures_and_meshes_are_not_imported_until_asked_for():
    code = "import sys, fishbone.cli; print({'matplotlib', 'trimesh', 'rich.table'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize(("name", "shape"), SHAPES.items())
def test_arrays_are_float64_in_c_order_of_the_documented_shape(equilibrium, name, shape):
    array = getattr(equilibrium, name)
    assert array.shape == (len(equilibrium.u), *shape)
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert array.flags.writeable


@pytest.mark.parametrize("name", ["edges", "internal"])
def test_pairs_of_vector_fields_have_a_row_for_each_node(equilibrium, name):
    for field in getattr(equilibrium, name):
        assert field.shape == (len(equilibrium.u), 3)
        assert field.dtype == np.float64


def test_arrays_belong_to_the_caller(equilibrium):
    equilibrium.bend[:] = math.nan
    assert np.isfinite(equilibrium.bend).all()


def test_the_columns_of_the_frame_are_normal_tangent_and_width(equilibrium):
    # The tangent is the direction of the spine, which a transposed frame would miss.
    chord = np.diff(equilibrium.position, axis=0)
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    tangent = (equilibrium.frame[:-1, :, 1] + equilibrium.frame[1:, :, 1]) / 2.0
    assert np.einsum("ij,ij->i", chord, tangent).min() > 0.99


def test_the_surface_runs_from_edge_to_edge_across_the_spine(equilibrium):
    surface = equilibrium.surface(n_across=5)
    assert surface.shape == (len(equilibrium.u), 5, 3)
    assert surface.flags.c_contiguous
    np.testing.assert_allclose(surface[:, 0], equilibrium.edges.minus, atol=1e-12)
    np.testing.assert_allclose(surface[:, 2], equilibrium.position, atol=1e-12)
    np.testing.assert_allclose(surface[:, -1], equilibrium.edges.plus, atol=1e-12)


@pytest.mark.parametrize("n_across", [-1, 0, 1, 10**9])
def test_a_surface_needs_a_sensible_number_of_points_across(equilibrium, n_across):
    with pytest.raises(fb.InvalidArgument, match=rf"n_across: found {n_across}, allowed 2"):
        equilibrium.surface(n_across)
    with pytest.raises(fb.InvalidArgument, match="n_across"):
        equilibrium.mesh(n_across)


def test_mesh_triangles_are_indices_of_vertices(equilibrium):
    vertices, triangles = equilibrium.mesh(4)
    assert vertices.shape[1] == triangles.shape[1] == 3
    assert triangles.dtype == np.int64
    assert set(np.unique(triangles)) == set(range(len(vertices)))


def test_supports_are_found_by_end_and_by_index(equilibrium):
    for by_end, by_index in (("start", 0), ("end", 1), ("end", -1)):
        for one, other in zip(equilibrium.reaction(by_end), equilibrium.reaction(by_index), strict=True):
            assert one.shape == (3,)
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("support", [2, -3, "middle"])
def test_a_support_that_is_not_there_is_an_error(equilibrium, support):
    with pytest.raises(fb.NoSupport, match="found"):
        equilibrium.reaction(support)


def test_the_result_as_a_dict_has_the_numbers_of_the_attributes(equilibrium):
    result = equilibrium.to_dict()
    assert result["schema"] == "fishbone.result/1"
    assert result["status"] == equilibrium.status == "converged"
    assert result["energy"] == equilibrium.energy
    assert result["energy_model"] == equilibrium.energy_model == "fishbone"
    assert result["iterations"] == equilibrium.iterations
    assert result["solve_time"] == equilibrium.solve_time > 0.0
    assert result["residuals"] == equilibrium.residuals._asdict()
    assert result["least_bend_radius"] == equilibrium.least_bend_radius._asdict()
    assert result["rib_margin"] == equilibrium.rib_margin._asdict()
    assert result["crosses_itself"] is equilibrium.crosses_itself is None
    assert result["scenario"] == equilibrium.scenario.to_dict()


@pytest.mark.parametrize("name", SHAPES)
def test_the_fields_of_a_result_are_those_of_the_arrays(equilibrium, name):
    np.testing.assert_array_equal(np.array(equilibrium.to_dict()[name]), getattr(equilibrium, name))


def test_a_result_survives_json(equilibrium):
    result = equilibrium.to_dict()
    assert json.loads(json.dumps(result, allow_nan=False)) == result


def test_repr_of_an_equilibrium_is_short(equilibrium):
    assert repr(equilibrium).startswith("<Equilibrium: converged, energy ")
    assert "\n" not in repr(equilibrium)


def test_keywords_and_dict_make_the_same_scenario():
    by_keywords = fb.Scenario(name="a", belt=BELT, supports=[CLAMP, OTHER_CLAMP])
    by_dict = fb.Scenario.from_dict({"name": "a", "belt": BELT, "supports": [CLAMP, OTHER_CLAMP]})
    assert by_keywords == by_dict
    assert hash(by_keywords) == hash(by_dict)
    assert by_keywords != fb.Scenario(name="b", belt=BELT, supports=[CLAMP, OTHER_CLAMP])
    assert by_keywords != "a"


def test_numpy_is_welcome_in_a_scenario():
    clamp = OTHER_CLAMP | {"position": np.array(OTHER_CLAMP["position"])}
    belt = types.MappingProxyType(BELT | {"width": np.float32(0.5)})
    scenario = fb.Scenario(belt=belt, supports=(CLAMP, clamp))
    assert scenario == fb.Scenario(belt=BELT | {"width": 0.5}, supports=[CLAMP, OTHER_CLAMP])


def test_a_scenario_survives_its_own_dict_repr_and_pickle(example):
    assert fb.Scenario.from_dict(example.to_dict()) == example
    assert eval(repr(example), {"Scenario": fb.Scenario}) == example  # noqa: S307
    assert pickle.loads(pickle.dumps(example)) == example  # noqa: S301


@pytest.mark.parametrize("number", [math.nan, -math.inf, np.float64("inf")])
def test_a_number_that_is_not_finite_is_refused_by_its_field(number):
    with pytest.raises(fb.InvalidScenario, match=r"^supports\[1\]\.position\[2\]: found -?(nan|inf), allowed"):
        fb.Scenario(belt=BELT, supports=[CLAMP, OTHER_CLAMP | {"position": (0.0, 0.5, number)}])


def _nested(depth):
    table = {}
    for _ in range(depth):
        table = {"belt": table}
    return table


@pytest.mark.parametrize(
    "tables",
    [
        {},
        {"belt": BELT | {"width": -1.0}},
        {"belt": BELT | {"width": math.nan}},
        {"belt": BELT | {"width": object()}},
        {"belt": BELT, "colour": "red"},
        _nested(100_000),
        [],
    ],
    ids=["empty", "negative", "nan", "object", "unknown", "deep", "list"],
)
def test_an_invalid_scenario_is_refused_in_one_line(tables):
    with pytest.raises(fb.InvalidScenario) as refusal:
        fb.Scenario.from_dict(tables)
    assert isinstance(refusal.value, fb.FishboneError)
    assert isinstance(refusal.value, ValueError)
    assert re.fullmatch(r"[^\n:]+: .+", str(refusal.value))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("empty.toml", b"", "nothing"),
        ("blank.json", b" \n", "nothing"),
        ("latin.toml", b'name = "\xe9"', "UTF-8"),
        ("binary.json", bytes(range(256)), "UTF-8"),
        ("broken.toml", b"[belt\nwidth", "line 1"),
        ("broken.json", b"{", "line 1"),
        ("list.json", b"[1, 2]", "found"),
        ("table.yaml", b"belt: 1", ".toml or .json"),
        ("table", b"belt: 1", "no suffix"),
        ("large.toml", b"#" * (16 * 1024 * 1024 + 1), "16 MB"),
        ("deep.json", b"[" * 100_000, "line 1"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused_in_one_line_with_its_name(tmp_path, name, content, words):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(fb.InvalidScenario, match=words) as refusal:
        fb.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


def test_a_missing_file_and_a_folder_are_refused_with_their_names(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    for path in (tmp_path / "missing.toml", tmp_path / "folder.toml"):
        with pytest.raises(fb.InvalidScenario) as refusal:
            fb.load(str(path))
        assert str(refusal.value).startswith(f"{path}: file: found ")


def test_a_pipe_is_refused_without_waiting_for_it(tmp_path):
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    with pytest.raises(fb.InvalidScenario, match="found a folder, pipe or device"):
        fb.load(path)


def test_a_byte_order_mark_is_no_obstacle(tmp_path, example_file, example):
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + example_file.read_bytes())
    assert fb.load(path) == example


def test_toml_and_json_are_one_structure(tmp_path, example):
    path = tmp_path / "example.json"
    path.write_text(json.dumps(example.to_dict()), "utf-8")
    assert fb.load(path) == example


def test_failure_is_a_value_unless_asked_to_be_an_exception(out_of_reach):
    equilibrium = fb.solve(out_of_reach)
    assert equilibrium.status == "infeasible"
    assert equilibrium.message
    with pytest.raises(fb.NotConverged, match="infeasible") as failure:
        fb.solve(out_of_reach, strict=True)
    assert failure.value.equilibrium.status == "infeasible"
    assert isinstance(failure.value, fb.FishboneError)


def test_an_equilibrium_passes_strictness(example):
    assert fb.solve(example, strict=True).status == "converged"


class _Alarm(Exception):  # noqa: N818
    pass


@pytest.fixture
def fine(example):
    """A scenario that takes long."""
    return fb.Scenario.from_dict(example.to_dict() | {"solver": {"elements": 5000}})


def test_a_signal_ends_a_solve(fine):
    def ring(*_):
        raise _Alarm

    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        with pytest.raises(_Alarm):
            fb.solve(fine)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_solves_in_threads_do_not_disturb_one_another(example, equilibrium):
    energies = []
    threads = [threading.Thread(target=lambda: energies.append(fb.solve(example).energy)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert energies == [equilibrium.energy] * 4


def test_plot_and_export_are_there_without_an_import_of_their_own():
    code = "import fishbone as fb; fb.plot.views; fb.export.encode"
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(AttributeError, match="nothing"):
        _ = fb.nothing


def test_solve_names_the_type_that_it_needs():
    with pytest.raises(fb.InvalidArgument, match=r"found str, allowed a Scenario, as fishbone\.load gives"):
        fb.solve("example1.toml")  # type: ignore[arg-type]


def test_an_orientation_by_more_than_a_turn_is_warned_of(example):
    tables = example.to_dict()
    tables["supports"][1]["rotation"] = [0.0, 30.0, 0.0]
    [warning] = [line for line in fb.solve(fb.Scenario.from_dict(tables)).warnings if "supports[1]" in line]
    assert "radians" in warning
