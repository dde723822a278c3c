import csv
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fishbone as fb
from fishbone import cli, examples, files, plot, progress, report


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Runs the command line in an empty folder: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    # A machine that is busy with other tests adds no lines to standard error.
    monkeypatch.setattr(progress, "QUIET_IN_LOGS", 1e6)

    def run(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def out_of_reach_file(tmp_path_factory, out_of_reach):
    path = tmp_path_factory.mktemp("scenarios") / "far.json"
    path.write_text(json.dumps(out_of_reach.to_dict()), "utf-8")
    return path


def assert_one_line(err, *parts):
    assert err.startswith("fishbone: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    for part in parts:
        assert str(part) in err


def test_the_table_shows_energy_extremes_and_reactions(run, example_file):
    code, out, err = run("solve", example_file)
    assert (code, err) == (0, "")
    for quantity in (
        "energy",
        "highest point",
        "least bend radius, on the spine",
        "bend radius, 99 % of the area",
        "crosses itself",
        "largest rib angle",
        "iterations",
        "residual",
        "time",
    ):
        assert quantity in out
    assert "whole width" not in out
    for place in ("start", "end"):
        assert f"force on the belt, {place}" in out
        assert f"moment on the belt, {place}" in out


def test_the_table_shows_the_strain_of_every_layer_in_per_cent(run, example):
    tables = example.to_dict() | {"energy": "shell"}
    del tables["belt"]["rigidity"]
    layers = [{"material": "PET", "thickness": 4e-4}, {"material": "PET", "thickness": 3e-4}]
    Path("laminate.json").write_text(json.dumps(tables | {"belt": tables["belt"] | {"layers": layers}}), "utf-8")
    code, out, _ = run("solve", "laminate.json")
    assert code == 0
    equilibrium = fb.solve(fb.load("laminate.json"))
    assert equilibrium.strain is not None
    lines = {line.split("  ")[0]: line for line in out.splitlines()}
    for index, layer in enumerate(equilibrium.strain.layers, start=1):
        largest = lines[f"largest strain, layer {index} of 2, V/5 off clamps"]
        assert f"{100.0 * layer.value:.5g}  %, at u = {layer.u:.5g}, v = {layer.v:.5g}" in largest
        assert f"{100.0 * layer.area.p99:.5g}  %, or less" in lines[f"strain, layer {index} of 2, 99 % of the area"]
    assert equilibrium.least_bend_radius is not None
    assert f"{equilibrium.least_bend_radius.value:.5g}  m, at u" in lines["least bend radius, V/5 off clamps"]


def test_the_table_shows_loads_links_and_hinges(run, example):
    tables = example.to_dict()
    tables["belt"]["density"] = 1.0
    tables["supports"][1] |= {"hinge": "zeta"}
    tables["links"] = [{"from": 0.3, "to": 0.7, "offset": [0.0, 0.2, 0.0]}]
    tables["loads"] = {"gravity": [-1.0, 0.0, 0.0], "points": [{"at": 0.5, "force": [0.0, 0.0, 2.0]}]}
    Path("loaded.json").write_text(json.dumps(tables), "utf-8")
    code, out, _ = run("solve", "loaded.json")
    assert code == 0
    for words in ("end hinged about zeta", "gravity", "load, u = 0.5", "force of the link from u = 0.3, u = 0.7"):
        assert words in out


def test_a_self_crossing_is_a_row_of_the_table_and_a_warning(run, example):
    tables = example.to_dict()
    tables["supports"][1] |= {"position": [-0.1, 0.0, 0.0], "rotation": [0.0, 0.0, 2.4]}
    Path("teardrop.json").write_text(json.dumps(tables), "utf-8")
    code, out, err = run("solve", "teardrop.json")
    assert code == 0
    assert re.search(r"crosses itself +yes +at u = [\d.]+ and u = [\d.]+", out)
    assert_one_line(err, "warning: the belt crosses itself at u = ")


def test_all_outputs_are_written_and_nothing_else(run, example_file):
    code, _, _ = run("solve", example_file, "--out", "a.json", "--figure", "a.png", "--mesh", "a.stl")
    assert code == 0
    assert sorted(path.name for path in Path().iterdir()) == ["a.json", "a.png", "a.stl"]
    assert json.loads(Path("a.json").read_text("utf-8"))["schema"] == "fishbone.result/1"
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")


def test_json_goes_to_the_screen_and_to_the_file_alike(run, example_file):
    code, out, _ = run("solve", example_file, "--json", "--out", "a.json")
    assert code == 0
    assert out == Path("a.json").read_text("utf-8")


def test_runs_differ_in_their_time_only(run, example_file):
    results = [json.loads(run("solve", example_file, "--json")[1]) for _ in range(2)]
    for result in results:
        del result["solve_time"]
    assert results[0] == results[1]


def test_invalid_input_is_exit_2_and_one_line(run):
    Path("wrong.toml").write_text("[belt]\nwidth = -1.0\nsegments = [{ kind = 'straight', length = 1.0 }]\n", "utf-8")
    code, out, err = run("solve", "wrong.toml", "--out", "a.json")
    assert (code, out) == (2, "")
    assert_one_line(err, "fishbone: wrong.toml: belt.width: found -1")
    assert not Path("a.json").exists()


def test_a_missing_file_is_exit_2_and_one_line(run):
    code, _, err = run("solve", "missing.toml")
    assert code == 2
    assert_one_line(err, "missing.toml")


@pytest.mark.parametrize(
    "arguments",
    [
        ("solve",),
        ("solve", "a.toml", "--colour"),
        ("solve", "a.toml", "--out", "a.txt"),
        ("solve", "a.toml", "--out", "nowhere/a.json"),
        ("solve", "a.toml", "--out", "folder.json"),
        ("solve", "a.toml", "--figure", "a.json"),
        ("solve", "a.toml", "--mesh", "belt"),
        ("twist",),
        ("examples", "nothing"),
        ("examples", "../example1"),
    ],
)
def test_wrong_use_is_exit_2_and_one_line_before_any_solve(run, monkeypatch, arguments):
    Path("folder.json").mkdir()
    monkeypatch.setattr(fb, "solve", lambda _: pytest.fail("solved"))
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert_one_line(err)


def test_a_read_only_folder_is_exit_2_before_any_solve(run, monkeypatch, example_file):
    Path("locked").mkdir()
    # The superuser may write anywhere: let the system answer as it would for anyone else.
    monkeypatch.setattr(files.os, "access", lambda folder, _: Path(folder).name != "locked")
    monkeypatch.setattr(fb, "solve", lambda _: pytest.fail("solved"))
    code, _, err = run("solve", example_file, "--out", "locked/a.json")
    assert code == 2
    assert_one_line(err, "locked")


def test_the_scenario_is_not_overwritten_by_its_result(run, example):
    text = json.dumps(example.to_dict())
    Path("a.json").write_text(text, "utf-8")
    code, _, err = run("solve", "a.json", "--out", "./a.json")
    assert code == 2
    assert_one_line(err, "a.json")
    assert Path("a.json").read_text("utf-8") == text


def test_no_equilibrium_is_exit_3_with_a_result_and_no_picture(run, out_of_reach_file):
    code, out, err = run("solve", out_of_reach_file, "--out", "a.json", "--figure", "a.png", "--mesh", "a.ply")
    assert (code, out) == (3, "")
    assert_one_line(err, out_of_reach_file, "infeasible")
    assert [path.name for path in Path().iterdir()] == ["a.json"]
    assert json.loads(Path("a.json").read_text("utf-8"))["status"] == "infeasible"


def test_no_equilibrium_is_still_json_for_machines(run, out_of_reach_file):
    code, out, err = run("solve", out_of_reach_file, "--json")
    assert code == 3
    assert json.loads(out)["status"] == "infeasible"
    assert_one_line(err)


@pytest.mark.parametrize("package", ["matplotlib", "trimesh"])
def test_a_missing_package_is_reported_before_the_solve(run, monkeypatch, example_file, package):
    module, option = {"matplotlib": ("plot", "--figure"), "trimesh": ("export", "--mesh")}[package]
    monkeypatch.delitem(sys.modules, f"fishbone.{module}", raising=False)
    monkeypatch.delattr(fb, module, raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr(fb, "solve", lambda _: pytest.fail("solved"))
    code, _, err = run("solve", example_file, option, "a.png" if module == "plot" else "a.stl")
    assert code == 2
    assert_one_line(err, package, "pip install")


def test_control_c_is_exit_130_and_one_line(run, monkeypatch, example_file):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(fb, "solve", interrupt)
    code, out, err = run("solve", example_file)
    assert (code, out) == (130, "")
    assert_one_line(err, "interrupted")


class _Panic(BaseException):
    pass


@pytest.mark.parametrize("bug", [ZeroDivisionError("two\nlines"), _Panic("panicked")])
def test_a_bug_is_one_line_too(run, monkeypatch, example_file, bug):
    def fail(_):
        raise bug

    monkeypatch.setattr(fb, "solve", fail)
    code, out, err = run("solve", example_file)
    assert (code, out) == (1, "")
    assert_one_line(err, "internal error")


def test_a_result_is_written_whole_or_not_at_all(run, monkeypatch, example_file):
    Path("a.json").write_text("as before", "utf-8")

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    code, _, err = run("solve", example_file, "--out", "a.json")
    assert code == 74
    assert_one_line(err, "a.json", "No space left")
    assert [path.name for path in Path().iterdir()] == ["a.json"]
    assert Path("a.json").read_text("utf-8") == "as before"


def test_a_link_stays_a_link(tmp_path):
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("as before", "utf-8")
    link.symlink_to(target)
    files.write_whole(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_examples_are_listed_with_what_they_are(run, example_file):
    code, out, _ = run("examples")
    assert code == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(path.stem for path in example_file.parent.glob("*.toml"))
    assert all(len(line.split()) > 1 for line in lines)


def test_an_example_is_copied_and_solves(run, example_file):
    code, _, _ = run("examples", "example1")
    assert code == 0
    assert Path("example1.toml").read_bytes() == example_file.read_bytes()
    assert run("solve", "example1.toml")[0] == 0


def test_an_example_is_not_copied_over_ones_own_file_unasked(run):
    Path("example1.toml").write_text("mine", "utf-8")
    code, _, err = run("examples", "example1")
    assert code == 2
    assert_one_line(err, "example1.toml", "--force")
    assert Path("example1.toml").read_text("utf-8") == "mine"
    assert run("examples", "example1", "--force")[0] == 0
    assert Path("example1.toml").read_text("utf-8") == examples.text("example1")


@pytest.mark.parametrize("name", examples.names())
def test_every_shipped_scenario_is_valid(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    path.write_text(examples.text(name), "utf-8")
    assert fb.load(path).to_dict()["name"]


def test_version_and_help_are_exit_0(run):
    assert run()[1] == run("--help")[1]
    assert run()[0] == run("--help")[0] == 0
    assert run("--version")[:2] == (0, f"fishbone, version {fb.__version__}\n")
    code, out, _ = run("solve", "--help")
    assert code == 0
    for option in ("--out", "--figure", "--mesh", "--all", "--json"):
        assert option in out


def test_the_installed_command_passes_its_exit_code_on(example_file, tmp_path):
    command = [Path(sys.executable).with_name("fishbone"), "solve"]
    good = subprocess.run([*command, example_file], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (good.returncode, good.stderr) == (0, "")
    bad = subprocess.run([*command, "missing.toml"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (bad.returncode, bad.stdout) == (2, "")
    assert_one_line(bad.stderr)


def test_elements_too_long_for_the_width_are_warned_of(run, example):
    tables = example.to_dict()
    tables["solver"]["elements"] = 40
    Path("coarse.json").write_text(json.dumps(tables), "utf-8")
    code, out, err = run("solve", "coarse.json")
    assert code == 0
    assert "energy" in out
    for_width, for_accuracy = err.splitlines()
    assert_one_line(f"{for_width}\n", "coarse.json", "warning", "80")
    assert_one_line(f"{for_accuracy}\n", "coarse.json", "warning", "accuracy")


def test_energy_of_the_file_gives_place_to_the_one_that_is_asked_for(run, example, tmp_path):
    tables = example.to_dict()
    tables["belt"]["thickness"] = 7e-4
    file = tmp_path / "thick.json"
    file.write_text(json.dumps(tables), "utf-8")
    energies = {}
    for energy in ("sadowsky", "shell"):
        code, out, _ = run("solve", file, "--energy", energy, "--json")
        found = json.loads(out)
        assert (code, found["energy_model"]) == (0, energy)
        energies[energy] = found["energy"]
    assert energies["shell"] < energies["sadowsky"]
    code, _, err = run("solve", file, "--energy", "plate")
    assert code == 2
    assert_one_line(err, "--energy", "'plate'", "'wunderlich'")


def test_default_elements_are_not_warned_of(run, example_file):
    code, _, err = run("solve", example_file)
    assert (code, err) == (0, "")


def test_an_output_that_is_no_plain_file_or_leads_nowhere_is_exit_2_before_any_solve(run, monkeypatch, example_file):
    monkeypatch.setattr(fb, "solve", lambda _: pytest.fail("solved"))
    os.mkfifo("pipe.json")
    Path("loop.json").symlink_to("loop.json")
    Path("dangling.json").symlink_to("nowhere/a.json")
    for name in ("pipe.json", "loop.json", "dangling.json", "a" * 300 + ".json"):
        code, out, err = run("solve", example_file, "--out", name)
        assert (code, out) == (2, ""), name
        assert_one_line(err)


def test_nothing_is_written_where_a_picture_cannot_be_made(run, monkeypatch, example_file):
    def fail(*_):
        raise fb.FishboneError("no picture")

    monkeypatch.setattr(plot, "encode", fail)
    code, _, err = run("solve", example_file, "--out", "a.json", "--figure", "a.png")
    assert code == 2
    assert_one_line(err, "no picture")
    assert list(Path().iterdir()) == []


# ---------------------------------------------------------------------------------------------------------- all


@pytest.fixture
def searches(monkeypatch, arches):
    """Replaces the search by the equilibria of the planar arch; returns the `progress` of each call."""
    searches = []

    def branches(scenario, *, progress):
        searches.append(progress)
        progress(1, 2)
        time.sleep(0.3)
        return arches

    monkeypatch.setattr(fb, "branches", branches)
    return searches


def test_all_is_an_array_of_what_branches_finds_byte_for_byte(run, monkeypatch, mirrored, mirrored_arches, search):
    """A second search finds the same equilibria."""
    monkeypatch.setattr(fb, "branches", search)
    Path("mirrored.json").write_text(json.dumps(mirrored.to_dict()), "utf-8")
    code, out, err = run("solve", "mirrored.json", "--all", "--json", "--out", "a.json")
    assert code == 0
    for_width, for_accuracy = err.splitlines()
    assert_one_line(f"{for_width}\n", "warning", "80")
    assert_one_line(f"{for_accuracy}\n", "warning", "accuracy")
    assert out == Path("a.json").read_text("utf-8")
    found = json.loads(out)
    expected = [equilibrium.to_dict() for equilibrium in mirrored_arches]
    for result in (*found, *expected):
        del result["solve_time"]
    assert json.dumps(found) == json.dumps(expected)


def test_all_has_a_row_for_each_equilibrium(run, planar_file, searches, arches):
    code, out, err = run("solve", planar_file, "--all")
    assert (code, err) == (0, "")
    assert all(len(line) <= 80 for line in out.splitlines())
    assert f"{len(arches)} equilibria" in out
    rows = [line.split() for line in out.splitlines()[-len(arches) - 1 :] if line.strip()]
    assert [int(row[0]) for row in rows] == list(range(len(arches)))
    assert [row[1] for row in rows] == [report.number(one.energy) for one in arches]
    assert [row[2] for row in rows] == ["yes" if one.stable else "no" for one in arches]
    assert [int(row[3]) for row in rows] == [one.negative_modes for one in arches]
    for column, values in (
        (4, [one.highest_point.position[0] for one in arches]),
        (5, [one.least_spine_radius.value for one in arches]),
        (6, [max(np.linalg.norm(one.reaction(index).force) for index in (0, 1)) for one in arches]),
        (7, [one.twist for one in arches]),
    ):
        # Rounding is printed as 0.
        rounding = 1e-14 + 1e-4 * np.abs(values).max()
        assert [float(row[column]) for row in rows] == pytest.approx(values, abs=rounding)
    assert [row[8] for row in rows] == ["no" if one.crosses_itself is None else "yes" for one in arches]


def test_all_is_drawn_on_one_page(run, planar_file, searches, arches):
    code, _, _ = run("solve", planar_file, "--all", "--figure", "a.png", "--out", "a.json")
    assert code == 0
    assert sorted(path.name for path in Path().iterdir()) == ["a.json", "a.png"]
    assert Path("a.png").read_bytes() == plot.encode(arches, ".png")


def test_all_has_no_mesh(run, monkeypatch, planar_file):
    monkeypatch.setattr(fb, "branches", lambda *_, **__: pytest.fail("searched"))
    code, out, err = run("solve", planar_file, "--all", "--mesh", "a.stl")
    assert (code, out) == (2, "")
    assert_one_line(err, "--mesh", "--all")
    assert not list(Path().iterdir())


def test_all_without_any_is_exit_3_with_a_result_and_no_picture(run, out_of_reach_file):
    code, out, err = run("solve", out_of_reach_file, "--all", "--out", "a.json", "--figure", "a.png")
    assert (code, out) == (3, "")
    assert_one_line(err, out_of_reach_file, "infeasible")
    assert [path.name for path in Path().iterdir()] == ["a.json"]
    [only] = json.loads(Path("a.json").read_text("utf-8"))
    assert only["status"] == "infeasible"


def test_all_writes_nothing_where_a_picture_cannot_be_made(run, monkeypatch, planar_file, searches):
    def fail(*_):
        raise fb.FishboneError("no picture")

    monkeypatch.setattr(plot, "encode", fail)
    code, out, err = run("solve", planar_file, "--all", "--out", "a.json", "--figure", "a.png")
    assert (code, out) == (2, "")
    assert_one_line(err, "no picture")
    assert not list(Path().iterdir())


def test_all_passes_every_warning_on_once(run, monkeypatch, example):
    tables = example.to_dict()
    tables["solver"]["elements"] = 40
    Path("coarse.json").write_text(json.dumps(tables), "utf-8")
    equilibrium = fb.solve(fb.Scenario.from_dict(tables))
    monkeypatch.setattr(fb, "branches", lambda *_, **__: [equilibrium, equilibrium])
    code, out, err = run("solve", "coarse.json", "--all")
    assert (code, "2 equilibria" in out) == (0, True)
    for_width, for_accuracy = err.splitlines()
    assert_one_line(f"{for_width}\n", "coarse.json", "warning", "80")
    assert_one_line(f"{for_accuracy}\n", "coarse.json", "warning", "accuracy")


def test_all_shows_its_progress_once_it_takes_long(run, monkeypatch, planar_file, searches):
    assert run("solve", planar_file, "--all")[2] == ""
    monkeypatch.setattr(progress, "QUIET", 0.05)
    monkeypatch.setattr(progress, "QUIET_IN_LOGS", 0.1)
    lines = run("solve", planar_file, "--all")[2].splitlines()
    assert "fishbone: searching, 1 of 2 starts so far, after 0 s" in lines
    monkeypatch.setenv("FORCE_COLOR", "1")
    err = run("solve", planar_file, "--all")[2]
    assert "searching, 1 of 2 starts so far" in err


def test_the_share_of_the_same_work_never_falls():
    state = progress.Progress("searching")
    shares = []
    for words, share in [("searching", 0.5), ("searching", 0.3), ("searching", 0.7), ("reporting", 0.1)]:
        state.show(words, share)
        shares.append(state.share)
    assert shares == [0.5, 0.5, 0.7, 0.1]


def test_a_solve_shows_that_it_goes_on(run, monkeypatch, planar_file):
    """Without any word from the core, as of a mesh of 100 000 elements."""
    solve = fb.solve
    monkeypatch.setattr(fb, "solve", lambda scenario: (time.sleep(0.4), solve(scenario))[1])
    monkeypatch.setattr(progress, "QUIET_IN_LOGS", 0.1)
    code, _, err = run("solve", planar_file)
    lines = [line for line in err.splitlines() if "solving" in line]
    assert code == 0
    # After 0.1 s, and after twice the time from then on.
    assert 2 <= len(lines) <= 3


def test_control_c_ends_all_with_exit_130_and_one_line(planar_file, tmp_path):
    """The command as it is run, interrupted while the core is at work."""
    code = (
        "import signal, sys, threading\n"
        "from fishbone import cli\n"
        "threading.Timer(1.0, signal.raise_signal, [signal.SIGINT]).start()\n"
        f"sys.exit(cli.main(['solve', {str(planar_file)!r}, '--all', '--out', 'a.json', '--figure', 'a.png']))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert_one_line(done.stderr, "interrupted")
    assert not list(tmp_path.iterdir())


# ------------------------------------------------------------------------------------------------------- follow


@pytest.fixture
def planar_file(example_file):
    return example_file.with_name("planar.toml")


TURN = ("--to", "supports[1].rotation[2]=-1.5")


def test_follow_prints_branches_and_events(run, planar_file):
    code, out, err = run("follow", planar_file, *TURN)
    assert (code, err) == (0, "")
    for words in ("supports[1].rotation[2]", "with the path", "fold", "-1.1231", "0 → 1", "26.344", "10.042"):
        assert words in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_follow_prints_that_there_are_no_events(run, planar_file):
    code, out, _ = run("follow", planar_file, "--to", "supports[1].rotation[2] = 0.2")
    assert code == 0
    assert "no events" in out


def test_follow_prints_where_a_branch_ends_short_of_the_path(run, planar_file):
    outputs = ("--out", "a.json", "--table", "a.csv", "--figure", "a.png")
    code, out, err = run("follow", planar_file, *TURN, "--states", "10", *outputs)
    assert code == 3
    assert "branch 0 has used up its states" in out
    assert_one_line(err, planar_file, "is followed to -0.49", "of -1.5", "branch 0 has used up its states", "--states")
    diagram = json.loads(Path("a.json").read_text("utf-8"))
    assert diagram["goal"] == -1.5
    assert diagram["reached"] == diagram["branches"][0]["states"][-1]["parameter"]
    assert sorted(path.name for path in Path().iterdir()) == ["a.csv", "a.json", "a.png"]


def test_follow_is_complete_at_the_end_of_the_path_and_where_a_branch_has_turned_back(run, planar_file, turned):
    assert turned.is_complete
    assert turned.reached == turned.branches[0].parameter.min() > turned.goal
    code, _, err = run("follow", planar_file, *TURN, "--snaps", "--branches", "1")
    assert code == 3
    assert_one_line(err, "of -1.5", "branch 0 ends where the belt snaps", "--branches")
    assert run("follow", planar_file, *TURN, "--snaps")[0] == 0


def test_follow_says_how_many_events_it_leaves_out(turned):
    [branch] = turned.branches
    unconfirmed = [event._replace(confirmed=False) for event in branch.events] * 2
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(branch, "events", [*unconfirmed, *branch.events])
        patch.setattr(branch, "end", "lost")
        assert "2 of 3 events are left out" in report.shortfall(turned)


def test_a_branch_that_is_led_no_further_says_what_is_known_of_its_end(monkeypatch, turned):
    [branch] = turned.branches
    [fold] = branch.events
    monkeypatch.setattr(branch, "end", "unstable")
    assert report.shortfall(turned).endswith("ends where the belt snaps (raise --branches)")
    monkeypatch.setattr(branch, "events", [fold._replace(confirmed=False)])
    assert "ends where the belt snaps, which a finer mesh does not confirm" in report.shortfall(turned)
    monkeypatch.setattr(branch, "events", [fold._replace(snapped=None, snapped_parameter=None)])
    assert report.shortfall(turned).endswith("loses its stability, and no minimum is found beyond")


@pytest.mark.parametrize(
    "path",
    [
        ("--to", "supports[1].position[1]=3"),
        ("--pose", "0 0.7 0 0 0 0", "--pose", "0 3 0 0 0 0", "--pose", "0 0.7 0 0 0 0"),
    ],
)
def test_a_path_out_of_reach_is_exit_3_at_once(run, monkeypatch, planar_file, path):
    monkeypatch.setattr(fb, "follow", lambda *_, **__: pytest.fail("followed"))
    code, out, err = run("follow", planar_file, *path, "--out", "a.json")
    assert (code, out) == (3, "")
    assert_one_line(err, planar_file, "infeasible", "2 more than the belt between them (1)")
    assert list(Path().iterdir()) == []


def test_a_snap_has_a_row_with_its_size_in_both_tables(run, planar_file, turned):
    code, out, _ = run("follow", planar_file, *TURN, "--snaps", "--table", "a.csv")
    assert code == 0
    [fold] = turned.branches[0].events
    shown = [line.split() for line in out.splitlines() if " snap " in line]
    sizes = [report.number(size) for size in (fold.snapped.energy, fold.jump, fold.released)]
    assert shown == [["0", "snap", report.number(fold.snapped_parameter), *sizes]]
    with Path("a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    [place] = [index for index, row in enumerate(rows) if row["event"] == "snap"]
    before, snap, after = rows[place - 1 : place + 2]
    assert (before["event"], before["branch"], snap["branch"], after["branch"]) == ("fold", "0", "0", "1")
    assert float(snap["jump"]) == pytest.approx(fold.jump, rel=1e-6)
    assert float(snap["released"]) == pytest.approx(float(before["energy"]) - float(snap["energy"]), rel=1e-3)
    for name in ("energy", "height", "supports[1].force.y", "supports[1].moment.z", "bend_radius.p99"):
        assert float(snap[name]) == pytest.approx(float(after[name]), rel=0.01)
    assert {row["jump"] for row in rows if row is not snap} == {"nan"}


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf"])
def test_a_limit_that_is_no_radius_is_exit_2_before_any_solve(run, monkeypatch, planar_file, limit):
    monkeypatch.setitem(fb.follow.__globals__, "solve", lambda _: pytest.fail("solved"))
    code, out, err = run("follow", planar_file, *TURN, "--radius-limit", limit)
    assert (code, out) == (2, "")
    assert_one_line(err, "--radius-limit: found", limit)


def test_follow_says_where_the_radius_is_below_its_limit_with_or_without_a_figure(run, planar_file, turned):
    [branch] = turned.branches
    radius, places = branch.least_spine_radius, branch.parameter
    least = report.number(radius.min())
    code, _, err = run("follow", planar_file, *TURN, "--radius-limit", "0.09")
    assert code == 0
    # Along the branch the belt bends ever tighter, and is at the limit between two states.
    assert np.all(np.diff(radius) < 0.0)
    broken = [report.number(np.interp(1.0 / 0.09, 1.0 / radius, places)), report.number(places[-1])]
    where = f"tighter than the limit of 0.09 between {broken[0]} and {broken[1]}: the least radius is {least} at "
    assert_one_line(err, "warning", where + report.number(places[radius.argmin()]))
    assert_one_line(run("follow", planar_file, *TURN, "--radius-limit", "0.01")[2], f"the least radius is {least}")


@pytest.mark.parametrize("path", [("--pose", "0 0.5 0 0 0 30"), ("--to", "supports[1].rotation[2]=30")])
def test_follow_warns_of_an_angle_in_degrees(run, planar_file, monkeypatch, path):
    def stop(*_):
        raise cli.NoEquilibrium("stopped before it is solved")

    monkeypatch.setattr(cli, "_followed", stop)
    warning = "the path turns a support to 30 rad, which is more than a turn: angles are in radians"
    assert warning in run("follow", planar_file, *path)[2]
    assert "radians" not in run("follow", planar_file, *TURN)[2]


@pytest.mark.parametrize("elements", [None, 80])
def test_follow_warns_of_a_mesh_that_is_too_coarse_for_the_path(run, elements):
    """A strip is pulled aside from its clamp, which bends it in a layer thinner than an element of 80."""
    tables = {
        "belt": {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]},
        "supports": [{"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.6]}],
        "loads": {"points": [{"at": "end", "force": [0.0, 10.0, 0.0]}]},
        "solver": {} if elements is None else {"elements": elements},
    }
    Path("pulled.json").write_text(json.dumps(tables), "utf-8")
    code, _, err = run("follow", "pulled.json", "--to", "loads.points[0].force[1]=1e5")
    assert code == 0
    if elements is None:
        assert err == ""
    else:
        assert_one_line(err, "warning: the error by the mesh is up to 3", "leave out solver.elements")


def test_follow_writes_all_outputs_and_nothing_else(run, planar_file, turned):
    code, _, _ = run("follow", planar_file, *TURN, "--out", "a.json", "--table", "a.csv", "--figure", "a.png")
    assert code == 0
    assert sorted(path.name for path in Path().iterdir()) == ["a.csv", "a.json", "a.png"]
    tables = json.loads(Path("a.json").read_text("utf-8"))
    assert tables["schema"] == "fishbone.diagram/1"
    assert len(tables["branches"][0]["states"]) == len(turned.branches[0])
    assert Path("a.png").read_bytes() == plot.encode(turned, ".png")


def test_the_table_of_follow_holds_all_digits(run, planar_file, turned):
    run("follow", planar_file, *TURN, "--table", "a.csv")
    with Path("a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    table = turned.table()
    assert list(rows[0]) == list(table)
    for name in ("parameter", "energy", "supports[1].moment.z", "rib_margin"):
        assert [float(row[name]) for row in rows] == table[name].tolist()
    stable = ["" if one is None else str(one) for one in table["stable"].tolist()]
    assert [row["stable"] for row in rows] == stable
    assert [row["event"] for row in rows].count("fold") == 1


def test_follow_prints_json_for_machines(run, planar_file, turned):
    code, out, err = run("follow", planar_file, *TURN, "--json", "--out", "a.json")
    assert (code, err) == (0, "")
    assert out == Path("a.json").read_text("utf-8")
    assert json.loads(out)["branches"][0]["events"][0]["parameter"] == turned.branches[0].events[0].parameter


def test_follow_leads_several_numbers_a_list_or_poses(run, planar_file):
    ends = (
        ("--to", "supports[1].position[1]=0.7", "--to", "supports[1].position[2]=.1"),
        ("--to", "supports[1].position=[0, 0.7, .1]"),
        ("--pose", "0 0.7 0.1 0 0 0"),
        ("--pose", "0, 0.7, 0.1, 0, 0, 0", "--support", "end", "--screw"),
        ("--pose", "0 0.7 0.1 0 0 0", "--support", "-1"),
        ("--pose", "0 0.7 0.1 0 0 0", "--support", "1.0"),
    )
    energies = []
    for arguments in ends:
        code, out, _ = run("follow", planar_file, *arguments, "--branches", "1", "--step", "0.1", "--json")
        assert code == 0
        energies.append(json.loads(out)["branches"][0]["states"][-1]["result"]["energy"])
    assert energies == pytest.approx([energies[0]] * len(energies), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "neither --to nor --pose"),
        (("--to", "belt.width=0.2", "--pose", "0 0 0 0 0 0"), "--to and --pose"),
        (("--to", "belt.width"), "FIELD=VALUE"),
        (("--to", "=1"), "FIELD=VALUE"),
        (("--to", "belt.width=wide"), "belt.width: found 'wide'"),
        (("--to", "belt.width=[1"), "belt.width: found '[1'"),
        (("--to", "belt.width=1,2"), "belt.width: found '1,2'"),
        (("--to", "belt.width=nan"), "belt.width: found nan"),
        (("--to", "belt.width=0.2", "--to", "belt.width=0.3"), "belt.width twice"),
        (("--to", "belt.width=0.2", "--screw"), "--screw"),
        (("--to", "belt.width=0.2", "--support", "end"), "--support"),
        (("--to", "belt.colour=0.2"), "belt.colour: found nothing"),
        (("--to", "belt.width=-1"), "at the end of the path, belt.width: found -1"),
        (("--to", "belt.width=0.1"), "nothing that changes"),
        (("--to", "belt.width=0.2", "--step", "0"), "step: found 0"),
        (("--to", "belt.width=0.2", "--step", "far"), "far"),
        (("--to", "belt.width=0.2", "--states", "1"), "states: found 1"),
        (("--to", "belt.width=0.2", "--branches", "0"), "branches: found 0"),
        (("--pose", "0 0.7 0 0 0"), "six numbers"),
        (("--pose", "0 0.7 0 0 0 z"), "six numbers"),
        (("--pose", "0 0.7 0 0 0 0", "--support", "middle"), "found 'middle'"),
        (("--to", "belt.width=0.2", "--out", "a.txt"), "a.txt"),
        (("--to", "belt.width=0.2", "--table", "a.json"), "a.json"),
        (("--to", "belt.width=0.2", "--figure", "nowhere/a.png"), "nowhere"),
    ],
)
def test_wrong_use_of_follow_is_exit_2_and_one_line_before_any_solve(run, monkeypatch, planar_file, arguments, words):
    monkeypatch.setitem(fb.follow.__globals__, "solve", lambda _: pytest.fail("solved"))
    code, out, err = run("follow", planar_file, *arguments)
    assert (code, out) == (2, "")
    assert_one_line(err, words)


def test_a_support_that_is_not_there_is_exit_2(run, planar_file):
    code, _, err = run("follow", planar_file, "--pose", "0 0.7 0 0 0 0", "--support", "0.5")
    assert code == 2
    assert_one_line(err, "support 0.5")


def test_a_start_that_cannot_be_followed_is_exit_3_and_nothing_is_written(run, out_of_reach_file):
    outputs = ("--out", "a.json", "--table", "a.csv", "--figure", "a.png")
    code, out, err = run("follow", out_of_reach_file, *TURN, *outputs)
    assert (code, out) == (3, "")
    assert_one_line(err, out_of_reach_file, "nothing to follow")
    assert list(Path().iterdir()) == []


def test_follow_writes_nothing_where_a_picture_cannot_be_made(run, monkeypatch, planar_file):
    def fail(*_):
        raise fb.FishboneError("no picture")

    monkeypatch.setattr(plot, "encode", fail)
    code, _, err = run("follow", planar_file, *TURN, "--out", "a.json", "--table", "a.csv", "--figure", "a.png")
    assert code == 2
    assert_one_line(err, "no picture")
    assert list(Path().iterdir()) == []


def test_follow_does_not_overwrite_the_scenario(run, example):
    Path("a.json").write_text(json.dumps(example.to_dict()), "utf-8")
    code, _, err = run("follow", "a.json", *TURN, "--out", "a.json")
    assert code == 2
    assert_one_line(err, "a.json")


def test_follow_misses_matplotlib_before_the_solve(run, monkeypatch, planar_file):
    monkeypatch.delitem(sys.modules, "fishbone.plot", raising=False)
    monkeypatch.delattr(fb, "plot", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(fb.follow.__globals__, "solve", lambda _: pytest.fail("solved"))
    code, _, err = run("follow", planar_file, *TURN, "--figure", "a.png")
    assert code == 2
    assert_one_line(err, "matplotlib", "pip install")


def test_follow_shows_its_progress_once_it_takes_long(run, monkeypatch, planar_file):
    follow = fb.follow

    def slow(*arguments, progress, **settings):
        def show(branch, share):
            progress(branch, share)
            time.sleep(0.01)

        return follow(*arguments, progress=show, **settings)

    monkeypatch.setattr(fb, "follow", slow)
    assert run("follow", planar_file, *TURN)[2] == ""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(progress, "QUIET", 0.05)
    assert "following branch 0" in run("follow", planar_file, *TURN)[2]


def test_control_c_ends_follow_with_exit_130_and_one_line(planar_file, tmp_path):
    """The command as it is run, interrupted while the core is at work."""
    code = (
        "import signal, sys, threading, time\n"
        "from fishbone import cli\n"
        "threading.Timer(0.7, signal.raise_signal, [signal.SIGINT]).start()\n"
        f"to = ['--to', 'supports[1].position[2]=0.6', '--step', '0.001', '--states', '100000', '--out', 'a.json']\n"
        f"sys.exit(cli.main(['follow', {str(planar_file)!r}, *to]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert_one_line(done.stderr, "interrupted")
    assert not list(tmp_path.iterdir())
