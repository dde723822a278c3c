"""Sweeps: points, rows, the table in any division, and what is left where a sweep ends early.

One cluster of two processes serves most tests, by its address; a few start processes of their own.
"""

from __future__ import annotations

import errno
import importlib
import itertools
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import dask
import distributed
import numpy as np
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fishbone as fb
from conftest import ROOT
from fishbone import cli, plot, progress
from fishbone.sweep import lock, workers
from fishbone.sweep import parts as table_parts
from fishbone.sweep.limit import limit_of
from fishbone.sweep.points import MAX_POINTS, number_of, points_of
from fishbone.sweep.rows import ALONG, LEFT_OUT, UNBENT, WORDS, flatten, solve_part

Y, Z = "supports[1].position[1]", "supports[1].position[2]"
GRID = {Y: (0.4, 1.2, 5), Z: (0.0, 0.2, 4)}
"""Twenty points, of which seven are out of reach."""
HERE = {"version": fb.__version__, "origin": "a digest"}
"""The version and the sweep of a part."""
PATIENCE = 100.0
"""Time after which a process is taken to hang [s]."""


@pytest.fixture(scope="module")
def belt():
    """A belt of few elements, which takes a millisecond."""
    tables = fb.load(ROOT / "scenarios" / "planar.toml").to_dict()
    tables["solver"]["elements"] = 24
    return fb.Scenario.from_dict(tables)


@pytest.fixture(scope="module")
def film():
    """A belt of a material, so that its units are known; it hangs straight, without load."""
    return fb.Scenario.from_dict(
        {
            "energy": "wunderlich",
            "belt": {
                "width": 0.01,
                "segments": [{"kind": "straight", "length": 0.1}],
                "material": {"preset": "polyimide", "thickness": 50e-6},
            },
            "supports": [{"at": "start", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}],
            "solver": {"elements": 16},
        }
    )


@pytest.fixture(scope="module")
def scheduler():
    """The address of a cluster of two processes."""
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def swept(belt, scheduler, tmp_path_factory):
    """A grid, undisturbed."""
    return fb.sweep(belt, tmp_path_factory.mktemp("swept") / "grid.parquet", GRID, scheduler=scheduler)


@pytest.fixture
def belt_file(belt, tmp_path):
    path = tmp_path / "belt.json"
    path.write_text(json.dumps(belt.to_dict()), "utf-8")
    return path


@pytest.fixture
def run(capsys, monkeypatch, tmp_path, scheduler):
    """Runs `fishbone sweep` on the cluster: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(progress, "QUIET_IN_LOGS", 1e6)

    def run(*arguments):
        code = cli.main(["sweep", "belt.json", *map(str, arguments), "--scheduler", scheduler])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def at(scenario, values):
    """The scenario of a point of `GRID`."""
    tables = scenario.to_dict()
    tables["supports"][1]["position"][1:] = values
    return fb.Scenario.from_dict(tables)


def rows_of(path):
    return pq.ParquetFile(path).read().to_pylist()


def interrupted(belt, path, scheduler, ranges=GRID, share=0.4):
    """A sweep that ends early; the folder of its parts."""

    def stop(solved, planned):
        if solved >= share * planned:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fb.sweep(belt, path, ranges, scheduler=scheduler, progress=stop)
    return path.with_name(f"{path.name}.parts")


def spawned():
    """The processes of clusters that this one has started."""

    def is_spawned(process):
        try:
            return "multiprocessing.spawn" in " ".join(process.cmdline())
        except (psutil.ZombieProcess, psutil.NoSuchProcess):  # it has ended just now
            return False

    return [one for one in psutil.Process().children(recursive=True) if is_spawned(one)]


# ---------------------------------------------------------------------------------------------------- the points


def test_a_grid_has_all_combinations_the_last_field_first(belt):
    points = points_of(belt, GRID, {}, None, 0)
    expected = [(y, z) for y in np.linspace(0.4, 1.2, 5) for z in np.linspace(0.0, 0.2, 4)]
    np.testing.assert_array_equal(points.values(0, 20), expected)
    np.testing.assert_array_equal(points.values(7, 11), points.values(0, 20)[7:11])
    assert points.values(19, 99).tolist() == [[1.2, 0.2]]


def test_a_latin_hypercube_has_one_point_in_each_slice(belt):
    drawn = points_of(belt, {Y: (0.4, 0.8), Z: (0.3, -0.1)}, {}, 50, 3).values(0, 50)
    assert sorted((50 * (drawn[:, 0] - 0.4) / 0.4).astype(int)) == list(range(50))
    assert sorted((50 * (drawn[:, 1] - 0.3) / -0.4).astype(int)) == list(range(50))


def test_tolerances_are_uniform_about_the_number_of_the_scenario(belt):
    drawn = points_of(belt, {}, {Y: 0.01, "belt.width": 0.02}, 4000, 0).values(0, 4000)
    for numbers, middle, tolerance in zip(drawn.T, (0.6, 0.1), (0.01, 0.02), strict=True):
        assert np.abs(numbers - middle).max() <= tolerance
        counts, _ = np.histogram(numbers, bins=4, range=(middle - tolerance, middle + tolerance))
        assert np.abs(counts - 1000).max() < 150  # more than five standard deviations
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 0.1


def test_the_seed_determines_what_is_drawn(belt):
    first, again, other = (points_of(belt, {Y: (0.4, 0.8)}, {Z: 0.1}, 20, seed) for seed in (1, 1, 2))
    assert first.design == again.design
    np.testing.assert_array_equal(first.values(0, 20), again.values(0, 20))
    assert first.design != other.design


@pytest.mark.parametrize(
    ("ranges", "options", "words"),
    [
        ({}, {}, "found no field"),
        ({"belt.widht": (0.1, 0.2, 3)}, {}, "belt.widht: found nothing"),
        ({"supports[1].position": (0.1, 0.2, 3)}, {}, "found [0.0,0.6,0.0]"),
        ({"supports[-1].position[1]": (0.1, 0.2, 3)}, {}, "found nothing"),
        ({Y: (0.1, 0.2)}, {}, "found 0.1:0.2, allowed start:stop:n"),
        ({Y: (0.1, 0.2, 3)}, {"sample": 5}, "found 0.1:0.2:3, allowed start:stop:n in a grid, start:stop in a sample"),
        ({Y: (0.1, float("inf"), 3)}, {}, "found inf, allowed finite numbers"),
        ({Y: (0.1, 0.2, 2.5)}, {}, "found 2.5 values"),
        ({Y: (0.1, 0.2, 0)}, {}, "found 0 values"),
        ({Y: "abc"}, {}, "found 'abc', allowed numbers"),
        ({Y: ("0.1", "0.2", "3")}, {}, "found ('0.1', '0.2', '3'), allowed numbers"),
        ({Y: (-1e308, 1e308, 3)}, {}, "found -1e+308:1e+308:3, allowed numbers up to 1e+300"),
        ([Y], {}, "ranges: found ['supports[1].position[1]'], allowed numbers by field"),
        ({1: (0.1, 0.2, 3)}, {}, "ranges: found {1: (0.1, 0.2, 3)}, allowed numbers by field"),
        ({}, {"tolerances": [(Y, 0.1)], "sample": 5}, "tolerances: found [('supports[1].position[1]', 0.1)], allowed"),
        ({}, {"tolerances": {Z: "0.1"}, "sample": 5}, "supports[1].position[2]: found '0.1', allowed a number"),
        ({}, {"tolerances": {Z: 1e308}, "sample": 5}, "found the tolerance 1e+308, allowed a positive number up to"),
        ({Y: (0.1, 0.2, 3)}, {"tolerances": {Z: 0.1}}, "allowed with a sample"),
        ({Y: (0.1, 0.2)}, {"tolerances": {Y: 0.1}, "sample": 5}, "found twice"),
        ({Y: (0.1, 0.2, 3), "supports.1.position.1": (0.1, 0.2, 3)}, {}, "found twice"),
        ({}, {"tolerances": {Z: -0.1}, "sample": 5}, "found the tolerance -0.1"),
        ({Y: (0.1, 0.2)}, {"sample": 0}, "found 0, allowed 1 to"),
        ({Y: (0.1, 0.2)}, {"sample": MAX_POINTS + 1}, "allowed 1 to"),
        ({Y: (0.1, 0.2)}, {"sample": 5, "seed": -1}, "seed: found -1"),
        ({Y: (0.1, 0.2, 10**6), Z: (0.1, 0.2, 10**6)}, {}, "found 1000000000000 points"),
    ],
)
def test_what_is_no_sweep_is_refused_before_anything_is_written(belt, tmp_path, ranges, options, words):
    with pytest.raises(ValueError, match="found") as refused:
        fb.sweep(belt, tmp_path / "a.parquet", ranges, **options)
    assert isinstance(refused.value, fb.FishboneError)
    assert words in str(refused.value)
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------ the rows


def test_plain_data_get_dotted_names():
    data = {"a": 1.0, "b": {"c": None, "d": [1.0, None, 3.0]}, "e": [{"f": 2}, {"f": 3}], "g": [0.1, 0.2], "h": []}
    expected = {"a": 1.0, "b.c": None, "b.d.x": 1.0, "b.d.y": None, "b.d.z": 3.0}
    assert dict(flatten("", data)) == expected | {"e[0].f": 2, "e[1].f": 3, "g": [0.1, 0.2], "h": None}


def test_a_row_has_the_figures_of_the_result(swept, belt):
    points = points_of(belt, GRID, {}, None, 0).values(0, 20)
    for number, (row, values) in enumerate(zip(rows_of(swept.path), points.tolist(), strict=True)):
        result = fb.solve(at(belt, values)).to_dict()
        expected = dict(flatten("", {name: result[name] for name in result.keys() - ALONG - LEFT_OUT}))
        if result["status"] == "converged":
            expected |= {name: math.inf for name in UNBENT if expected[name] is None}
        assert row["point"] == number
        assert [row[Y], row[Z]] == values
        assert {name: row.get(name) for name in expected} == expected
    assert swept.statuses == {"converged": 13, "infeasible": 7}
    assert (len(swept), swept.solved, swept.is_grid) == (20, 20, True)
    assert {"supports[1].moment.z", "bend_radius.area.p99", "negative_modes", "error.force"} < set(swept.names)
    assert not {"solve_time", "u", "error", "scenario"} & set(swept.names)


def test_rows_do_not_depend_on_the_division_into_parts(belt, tmp_path):
    fields = {"solver.elements": (15.5, 18.0, 6), Y: (0.5, 1.5, 2)}
    points = points_of(belt, fields, {}, None, 0)
    numbers = {field: number_of(belt, field) for field in fields}

    def rows(*bounds):
        found = []
        for first, last in itertools.pairwise(bounds):
            number, content = solve_part(
                belt.to_dict(), numbers, first, points.values(first, last), shapes=False, **HERE
            )
            assert number == first
            (tmp_path / "part.parquet").write_bytes(content)
            found += [
                {name: x for name, x in row.items() if x is not None} for row in rows_of(tmp_path / "part.parquet")
            ]
        return found

    whole = rows(0, 12)
    assert rows(0, 1, 5, 6, 12) == whole
    # A number of elements has to be whole.
    is_valid = [row["solver.elements"].is_integer() for row in whole]
    assert [row["status"] != "invalid" for row in whole] == is_valid
    assert 0 < sum(is_valid) < 12


def test_points_where_the_scenario_is_invalid_are_rows(belt, scheduler, tmp_path):
    found = fb.sweep(belt, tmp_path / "a.parquet", {"belt.width": (-0.1, 0.1, 3)}, scheduler=scheduler)
    assert found.statuses == {"invalid": 2, "converged": 1}
    assert found.column("message")[0] == "belt.width: found -0.1, must be a positive finite number"
    assert np.isnan(found.column("energy")).tolist() == [True, True, False]


def test_shapes_are_lists(belt, scheduler, tmp_path):
    found = fb.sweep(belt, tmp_path / "a.parquet", {Y: (0.5, 0.6, 2)}, shapes=True, scheduler=scheduler)
    row, shape = rows_of(found.path)[1], fb.solve(belt)
    np.testing.assert_array_equal(row["u"], shape.u)
    np.testing.assert_array_equal(row["position"], shape.position)
    np.testing.assert_array_equal(row["frame"], shape.frame)
    np.testing.assert_array_equal(row["edges.plus"], shape.edges.plus)


def test_a_column_that_is_not_there_is_named_with_the_nearest(swept):
    with pytest.raises(fb.InvalidArgument, match=r"bend_radius.area.p9: found no such column, .* bend_radius.area.p9"):
        swept.column("bend_radius.area.p9")


# ----------------------------------------------------------------------------------------------------- the table


def test_the_table_is_the_same_where_a_worker_is_lost_and_a_second_start_solves_nothing(belt, swept, tmp_path):
    lost, others = [], spawned()

    def lose(solved, planned):
        if not lost and 0 < solved < planned:
            lost.append(next(one for one in spawned() if one not in others))
            lost[0].kill()

    found = fb.sweep(belt, tmp_path / "a.parquet", GRID, progress=lose)
    assert len(lost) == 1
    assert found.path.read_bytes() == swept.path.read_bytes()
    assert list(tmp_path.iterdir()) == [found.path]
    # The address is never asked.
    again = fb.sweep(belt, tmp_path / "a.parquet", GRID, scheduler="tcp://127.0.0.1:1")
    assert (again.solved, again.statuses) == (0, swept.statuses)


def test_an_interrupted_sweep_goes_on_where_it_ended(belt, swept, scheduler, tmp_path):
    parts = list(interrupted(belt, tmp_path / "a.parquet", scheduler).glob("*.parquet"))
    assert not (tmp_path / "a.parquet").exists()
    assert sum(len(rows_of(part)) for part in parts) == 8
    seen = []
    found = fb.sweep(
        belt, tmp_path / "a.parquet", GRID, scheduler=scheduler, progress=lambda *counts: seen.append(counts)
    )
    assert found.solved == 12
    assert seen == [(solved, 12) for solved in range(1, 13)]
    assert found.path.read_bytes() == swept.path.read_bytes()


def with_a_changed_byte(content, column=0):
    """A table in which a byte of the pages of a column is another one."""
    pages = pq.read_metadata(pa.BufferReader(content)).row_group(0).column(column)
    place = pages.data_page_offset + pages.total_compressed_size // 2
    return content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :]


def with_another_number(content):
    """A part in which the energy is another one, written by someone else."""
    table = pq.read_table(pa.BufferReader(content))
    columns = {name: table[name].to_pylist() for name in table.column_names} | {"energy": [0.0]}
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue().to_pybytes()


@pytest.mark.parametrize(
    "harm",
    [
        lambda _: b"",
        lambda content: content[:-100],
        lambda content: content[100:],
        lambda _: b"PAR1 no parquet PAR1",
        with_a_changed_byte,
        with_another_number,
    ],
    ids=["empty", "truncated", "beheaded", "garbage", "changed", "rewritten"],
)
def test_a_part_that_is_not_whole_is_solved_again(belt, swept, scheduler, tmp_path, harm):
    path = tmp_path / "a.parquet"
    parts = sorted(interrupted(belt, path, scheduler).glob("*.parquet"))
    parts[2].write_bytes(harm(parts[2].read_bytes()))
    found = fb.sweep(belt, path, GRID, scheduler=scheduler)
    assert found.solved == 20 - len(parts) + 1
    assert found.path.read_bytes() == swept.path.read_bytes()
    assert list(tmp_path.iterdir()) == [path]


def test_a_part_of_other_points_or_of_another_sweep_is_solved_again(belt, swept, scheduler, tmp_path):
    path = tmp_path / "a.parquet"
    parts = sorted(interrupted(belt, path, scheduler).glob("*.parquet"))
    shutil.copy(parts[0], parts[1])
    other = interrupted(at(belt, [0.6, 0.1]), tmp_path / "b.parquet", scheduler, share=1.0)
    shutil.copy(other / parts[2].name, parts[2])
    found = fb.sweep(belt, path, GRID, scheduler=scheduler)
    assert found.solved == 20 - len(parts) + 2
    assert found.path.read_bytes() == swept.path.read_bytes()


def test_files_among_the_parts_are_not_merged_and_not_removed(belt, swept, scheduler, tmp_path):
    path = tmp_path / "a.parquet"
    parts = interrupted(belt, path, scheduler)
    stray = parts / "00000099.parquet"
    shutil.copy(parts / "manifest.json", parts / "notes.txt")
    shutil.copy(next(parts.glob("*.parquet")), stray)
    (parts / ".left.part").mkdir()  # a draft of a process that was killed
    assert fb.sweep(belt, path, GRID, scheduler=scheduler).path.read_bytes() == swept.path.read_bytes()
    assert sorted(file.name for file in parts.iterdir()) == [stray.name, "notes.txt"]


@pytest.mark.parametrize("manifest", [b"", b"[]", b"{", b"\xff", None])
def test_a_manifest_that_is_lost_is_written_again_where_all_parts_are_of_the_sweep(
    belt, swept, scheduler, tmp_path, manifest
):
    path = tmp_path / "a.parquet"
    parts = interrupted(belt, path, scheduler)
    count = len(list(parts.glob("*.parquet")))
    (parts / "manifest.json").unlink()
    if manifest is not None:
        (parts / "manifest.json").write_bytes(manifest)
    found = fb.sweep(belt, path, GRID, scheduler=scheduler)
    assert (found.solved, found.path.read_bytes()) == (20 - count, swept.path.read_bytes())


def test_parts_of_an_unknown_sweep_are_refused_and_stay(belt, scheduler, tmp_path):
    path = tmp_path / "a.parquet"
    parts = interrupted(belt, path, scheduler)
    (parts / "manifest.json").write_bytes(b"")
    before = {file: file.read_bytes() for file in parts.iterdir()}
    with pytest.raises(fb.InvalidArgument, match=r"found parts of an unknown sweep, .*: remove the folder") as refused:
        fb.sweep(at(belt, [0.6, 0.1]), path, GRID, scheduler=scheduler)
    assert "\n" not in str(refused.value)
    assert {file: file.read_bytes() for file in parts.iterdir()} == before


def test_a_part_that_is_lost_before_the_end_is_named_and_a_second_start_goes_on(belt, swept, scheduler, tmp_path):
    path = tmp_path / "a.parquet"

    def lose(solved, planned):
        if solved == planned:
            (tmp_path / "a.parquet.parts" / "00000003.parquet").unlink()

    with pytest.raises(fb.FishboneError, match=r"00000003.parquet: found no whole part any more; repeat the sweep"):
        fb.sweep(belt, path, GRID, scheduler=scheduler, progress=lose)
    found = fb.sweep(belt, path, GRID, scheduler=scheduler)
    assert (found.solved, found.path.read_bytes()) == (1, swept.path.read_bytes())


@pytest.mark.parametrize("name", ["a" * 247, "ü" * 123 + "a", "a" * 242], ids=["letters", "umlauts", "shorter"])
def test_a_table_may_have_a_name_of_255_bytes(belt, swept, scheduler, tmp_path, name):
    path = tmp_path / f"{name}.parquet"
    with pytest.raises(KeyboardInterrupt):
        fb.sweep(belt, path, GRID, scheduler=scheduler, progress=lambda *_: signal.raise_signal(signal.SIGINT))
    [parts] = tmp_path.iterdir()
    assert parts.name.startswith(name[:100])
    assert parts.name.endswith(".parts")
    found = fb.sweep(belt, path, GRID, scheduler=scheduler)
    assert found.solved < 20
    assert found.path.read_bytes() == swept.path.read_bytes()
    assert list(tmp_path.iterdir()) == [path]


def test_long_names_have_parts_of_their_own(belt, scheduler, tmp_path):
    folders = {table_parts._folder_name(f"{'a' * 246}{last}.parquet") for last in "ab"}
    assert {len(folder) for folder in folders} == {255}
    assert len(folders) == 2


def test_a_second_sweep_at_the_same_time_is_refused_and_leaves_the_first_alone(belt, swept, scheduler, tmp_path):
    path, refusals = tmp_path / "a.parquet", []

    def start_again(solved, planned):
        with pytest.raises(fb.InvalidArgument) as refused:
            fb.sweep(belt, path, GRID, scheduler=scheduler)
        refusals.append(str(refused.value))

    found = fb.sweep(belt, path, GRID, scheduler=scheduler, progress=start_again)
    assert set(refusals) == {f"{path}: found another sweep at work on it, allowed one at a time"}
    assert (found.solved, found.path.read_bytes()) == (20, swept.path.read_bytes())


def test_a_sweep_that_was_killed_locks_nothing(belt, belt_file, scheduler, tmp_path):
    code = (
        "import os, sys, fishbone as fb\n"
        "kill = lambda *_: os.kill(os.getpid(), 9)\n"
        "ranges = {sys.argv[1]: (0.4, 1.2, 5)}\n"
        "fb.sweep(fb.load('belt.json'), 'a.parquet', ranges, scheduler=sys.argv[2], progress=kill)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, Y, scheduler], cwd=tmp_path, check=False)
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / "a.parquet.parts" / "lock").exists()
    found = fb.sweep(fb.load(belt_file), tmp_path / "a.parquet", {Y: (0.4, 1.2, 5)}, scheduler=scheduler)
    assert 0 < found.solved < 5


def test_a_file_system_without_locks_takes_sweeps(belt, swept, scheduler, tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(lock, "_lock", refuse)
    found = fb.sweep(belt, tmp_path / "a.parquet", GRID, scheduler=scheduler)
    assert found.path.read_bytes() == swept.path.read_bytes()


def test_a_finished_table_need_not_be_writable(belt, swept, tmp_path):
    path = tmp_path / "a.parquet"
    shutil.copy(swept.path, path)
    path.chmod(0o444)
    found = fb.sweep(belt, path, GRID)
    assert (found.solved, found.statuses) == (0, swept.statuses)
    with pytest.raises(fb.InvalidArgument, match="found a sweep that differs in its points"):
        fb.sweep(belt, path, {Y: (0.5, 0.6, 3)})


@pytest.mark.parametrize("is_finished", [True, False])
def test_another_sweep_is_refused(belt, film, scheduler, tmp_path, is_finished):
    def stop(solved, planned):
        if not is_finished:
            raise KeyboardInterrupt

    path, once = tmp_path / "a.parquet", {Y: (0.5, 0.6, 2)}
    try:
        fb.sweep(belt, path, once, scheduler=scheduler, progress=stop)
    except KeyboardInterrupt:
        assert not is_finished
    name = "a.parquet: " if is_finished else "a.parquet.parts: "
    with pytest.raises(fb.InvalidArgument, match=f"{name}found a sweep that differs in its points, allowed"):
        fb.sweep(belt, path, {Y: (0.5, 0.6, 3)})
    with pytest.raises(fb.InvalidArgument, match=f"{name}found a sweep that differs in its shapes, allowed"):
        fb.sweep(belt, path, once, shapes=True)
    with pytest.raises(fb.InvalidArgument, match=f"{name}found a sweep that differs in its scenario, allowed"):
        fb.sweep(at(belt, [0.6, 0.1]), path, once)


def test_a_file_that_is_no_table_of_a_sweep_is_refused(belt, tmp_path):
    path = tmp_path / "a.parquet"
    path.write_text("a letter", "utf-8")
    with pytest.raises(fb.InvalidArgument, match="found a file that is no table of a sweep, allowed a new file"):
        fb.sweep(belt, path, GRID)
    assert path.read_text("utf-8") == "a letter"


@pytest.mark.parametrize("text", [b"[]", b"a letter"])
def test_a_table_whose_manifest_is_none_is_refused(belt, tmp_path, text):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"point": [0]}).replace_schema_metadata({table_parts.KEY: text}), path)
    with pytest.raises(fb.InvalidArgument, match="found a file that is no table of a sweep, allowed a new file"):
        fb.sweep(belt, path, GRID)


def test_a_table_that_is_not_as_it_was_written_is_refused(belt, swept, tmp_path):
    path = tmp_path / "a.parquet"
    path.write_bytes(with_a_changed_byte(swept.path.read_bytes(), swept.names.index("status")))
    with pytest.raises(fb.InvalidArgument, match="found a table that is not whole"):
        fb.sweep(belt, path, GRID)


def test_tables_go_to_a_parquet_file_alone(belt, tmp_path):
    with pytest.raises(fb.InvalidArgument, match=r"found \.csv, allowed \.parquet"):
        fb.sweep(belt, tmp_path / "a.csv", GRID)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere"])
def test_a_scheduler_that_does_not_answer_is_named(belt, tmp_path, monkeypatch, address):
    monkeypatch.setattr(workers, "PATIENCE", "1s")
    with pytest.raises(fb.InvalidArgument, match=f"scheduler: found '{address}' .*tcp://host:8786"):
        fb.sweep(belt, tmp_path / "a.parquet", GRID, scheduler=address)


def test_a_worker_of_another_version_is_refused(belt):
    number = {Y: number_of(belt, Y)}
    with pytest.raises(fb.InvalidArgument, match=f"found a worker with fishbone {fb.__version__}, allowed 0.0.1"):
        solve_part(belt.to_dict(), number, 0, np.array([[0.5]]), shapes=False, **HERE | {"version": "0.0.1"})


def test_workers_without_a_package_are_named(scheduler):
    found = workers.results(scheduler, importlib.import_module, [("no_such_package",)], 1, {})
    with pytest.raises(
        fb.InvalidArgument, match=r"found workers without a package \(No module named 'no_such_package'\)"
    ):
        list(found)


def test_a_scheduler_that_is_lost_ends_a_sweep(belt, tmp_path):
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with (
        cluster,
        pytest.raises(fb.FishboneError, match="scheduler: found the connection lost; repeat the sweep to go on"),
    ):
        fb.sweep(
            belt,
            tmp_path / "a.parquet",
            {Y: (0.5, 0.6, 1000)},
            scheduler=cluster.scheduler_address,
            progress=lambda *_: cluster.close(),
        )
    assert list((tmp_path / "a.parquet.parts").glob("*.parquet"))


def test_workers_that_are_lost_with_the_same_points_end_a_sweep(belt, tmp_path):
    others = spawned()

    def lose(solved, planned):
        for one in spawned():
            if one not in others:
                one.kill()

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        pytest.raises(fb.FishboneError, match="workers: found 1 lost in a row with the same points"),
    ):
        fb.sweep(belt, tmp_path / "a.parquet", {Y: (0.5, 0.6, 1000)}, progress=lose)
    assert list((tmp_path / "a.parquet.parts").glob("*.parquet"))


# ----------------------------------------------------------------------------------------------------- the yield


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("bend_radius.area.p99>0.002", ("bend_radius.area.p99", ">", 0.002)),
        ("least_spine_radius.value > 2 mm", ("least_spine_radius.value", ">", 2e-3)),
        ("bend_radius.area.p95 > 1.5e3um", ("bend_radius.area.p95", ">", 1.5e-3)),
        ("supports[1].force.y < -30 mN", ("supports[1].force.y", "<", -0.03)),
        ("supports[0].moment.x<1 N mm", ("supports[0].moment.x", "<", 1e-3)),
        ("energy<2 mJ", ("energy", "<", 2e-3)),
        ("rib_margin.value>0.1 1/mm", ("rib_margin.value", ">", 100.0)),
    ],
)
def test_limits_are_in_the_units_of_the_scenario(film, text, limit):
    found = limit_of(film, text)
    assert (found.column, found.sign) == limit[:2]
    assert found.value == pytest.approx(limit[2], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("energy", "found 'energy', allowed a figure, < or > and a number"),
        ("energy>=2", "found 'energy>=2'"),
        ("energy>--2", "found 'energy>--2'"),
        ("energy<2 mm", "found the unit 'mm' of energy, allowed J, mJ"),
        ("negative_modes<1 m", "found the unit 'm' of negative_modes, allowed none"),
        ("energy<1e999", "found 1e999, allowed a number up to 1e+300"),
        ("u>1", "found the column u, allowed one of numbers"),
        ("edges.plus>1", "found the column edges.plus, allowed one of numbers"),
        (5, "found 5, allowed a figure"),
    ],
)
def test_what_is_no_limit_is_refused(film, text, words):
    with pytest.raises(fb.InvalidArgument, match="limit: ") as refused:
        limit_of(film, text)
    assert words in str(refused.value)


def test_columns_that_are_no_numbers_are_known_before_there_is_a_table(belt, swept):
    kinds = {name: swept.column(name) for name in swept.names}
    words = {name for name, values in kinds.items() if any(isinstance(x, str | bool | np.ndarray) for x in values)}
    assert {"status", "message", "stable"} <= words <= WORDS
    for name in WORDS:
        with pytest.raises(fb.InvalidArgument, match=f"limit: found the column {name}, allowed one of numbers"):
            limit_of(belt, f"{name}>1")


def test_a_column_without_any_number_passes_nowhere(film, scheduler, tmp_path):
    found = fb.sweep(film, tmp_path / "a.parquet", {"belt.width": (0.01, 0.02, 2)}, scheduler=scheduler)
    assert found.column("half_turns").tolist() == [None, None]
    assert found.passes("half_turns>-1").tolist() == [False, False]


def test_units_are_refused_where_the_scenario_has_none(belt):
    with pytest.raises(fb.InvalidArgument, match="found the unit 'mm', allowed none"):
        limit_of(belt, "bend_radius.area.p99>2 mm")


def test_a_point_passes_if_it_has_converged_within_the_limit(swept):
    energy, status = swept.column("energy"), swept.column("status")
    middle = float(np.median(energy[status == "converged"]))
    passing = swept.passes(f"energy<{middle!r}")
    assert passing.tolist() == [bool(e < middle and s == "converged") for e, s in zip(energy, status, strict=True)]
    assert np.any((energy < middle) & ~passing)  # of solves that have failed
    with pytest.raises(fb.InvalidArgument, match="found the column status, allowed one of numbers"):
        swept.passes("status>0")


def test_a_belt_that_does_not_bend_is_above_every_radius(film, scheduler, tmp_path):
    found = fb.sweep(film, tmp_path / "a.parquet", {"belt.width": (0.01, 0.02, 2)}, scheduler=scheduler)
    assert np.all(found.column("bend_radius.spine.value") == np.inf)
    assert found.passes("bend_radius.area.p99>2 mm").all()


# ------------------------------------------------------------------------------------------------- the command


def test_the_command_prints_statuses_and_yield_and_draws(run, belt_file, swept):
    ranges = ("--set", f"{Y}=0.4:1.2:5", "--set", f"{Z}=0:0.2:4")
    limit = "bend_radius.spine.value>0.12"
    code, out, err = run(*ranges, "-o", "a.parquet", "--figure", "a.png", "--limit", limit)
    passing = swept.passes(limit).sum()
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        "a.parquet: 20 points, 13 converged, 7 infeasible; 20 solved now",
        f"yield {passing / 20:.2%}, {passing} of 20 points converged with {limit}",
    ]
    assert 0 < passing < 13
    assert Path("a.parquet").read_bytes() == swept.path.read_bytes()
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")
    assert run(*ranges, "-o", "a.parquet")[1] == out.splitlines()[0].replace("20 solved", "0 solved") + "\n"


def test_the_command_draws_samples(run, belt_file):
    words = ("--sample", "7", "--seed", "5", "--set", f"{Y}=0.4:0.8", "--tolerance")
    assert run(*words, f"{Z} = ±0.1", "-o", "a.parquet")[0] == 0
    assert run(*words, f"{Z}=+-0.1", "--out", "b.parquet")[0] == 0
    assert Path("a.parquet").read_bytes() == Path("b.parquet").read_bytes()


def test_no_point_that_converges_ends_the_command_with_3(run, belt_file):
    code, out, err = run("--set", f"{Y}=1.5:1.6:2", "-o", "a.parquet", "--figure", "a.pdf", "--limit", "energy<9")
    assert (code, err.count("\n")) == (3, 1)
    assert "found no point that converged" in err
    assert "yield 0.00%, 0 of 2 points" in out
    assert Path("a.parquet").exists()


@pytest.mark.parametrize("fields", [["belt.width"], ["belt.width", Y]])
def test_a_sweep_without_any_figure_is_drawn_empty(run, belt_file, fields):
    ranges = [word for field in fields for word in ("--set", f"{field}=-2:-1:2")]
    code, out, _ = run(*ranges, "-o", "a.parquet", "--figure", "a.png", "--limit", "energy<9")
    assert code == 3
    assert f"yield 0.00%, 0 of {2 ** len(fields)} points" in out
    assert Path("a.png").exists()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ((), "found no field"),
        (("--set", "belt.width"), "--set: found 'belt.width'"),
        (("--set", "belt.width=1:b:3"), "found belt.width=1:b:3, allowed numbers start:stop:n"),
        (("--set", "belt.width=1:2:3", "--set", "belt.width=1:2:3"), "found belt.width twice"),
        (("--tolerance", "belt.width=0.01", "--sample", "3"), "found belt.width=0.01, allowed ± and a number"),
        (("--set", "belt.width=1:2:3", "--limit", "energy"), "limit: found 'energy'"),
        (
            ("--set", "belt.width=1:2:3", "--limit", "enrgy<1"),
            "enrgy: found no such column, allowed those of the table",
        ),
        (("--set", "belt.width=1:2:3", "--figure", "a.txt"), "found .txt"),
        (
            ("--set", "belt.width=1:2:3", "--figure", "a.png", "--limit", "status>1"),
            "limit: found the column status, allowed one of numbers",
        ),
        (("--set", "belt.width=1:2:3", "--set", f"{Y}=1:2:3", "--set", f"{Z}=1:2:3", "--figure", "a.png"), "3 fields"),
    ],
)
def test_invalid_use_ends_the_command_with_2_in_one_line(run, belt_file, words, found):
    code, out, err = run(*words, "-o", "a.parquet")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert found in err
    assert list(Path().iterdir()) == [Path("belt.json")]


def test_a_limit_to_the_number_of_a_point_is_one_to_a_column(run, belt_file):
    code, out, err = run("--set", f"{Y}=0.5:0.6:4", "-o", "a.parquet", "--limit", "point>0")
    assert (code, err) == (0, "")
    assert out.splitlines()[1] == "yield 75.00%, 3 of 4 points converged with point>0"


def test_a_finished_table_that_is_read_only_is_drawn(run, belt_file):
    words = ("--set", f"{Y}=0.5:0.6:2", "-o", "a.parquet")
    assert run(*words)[0] == 0
    Path("a.parquet").chmod(0o444)
    code, out, err = run(*words, "--figure", "a.png")
    assert (code, err) == (0, "")
    assert "0 solved now" in out
    assert Path("a.png").exists()
    code, _, err = run("--set", f"{Y}=0.5:0.6:3", "-o", "a.parquet")
    assert (code, err.count("\n")) == (2, 1)


@pytest.mark.parametrize("package", ["distributed", "pyarrow"])
def test_a_missing_package_is_one_line(run, belt_file, monkeypatch, package):
    for module in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.setitem(sys.modules, module, None)
    code, _, err = run("--set", f"{Y}=0.5:0.6:2", "-o", "a.parquet")
    assert (code, err) == (2, f'fishbone: {package} is not installed: pip install "fishbone[sweep]"\n')


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="there are no groups of processes on Windows")
def test_control_c_leaves_whole_parts_and_ends_the_command_with_130(belt_file, tmp_path):
    words = [sys.executable, "-m", "fishbone", "sweep", "belt.json", "--set", f"{Y}=0.4:0.8:5000", "-o", "a.parquet"]
    child = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    start, parts = time.monotonic(), tmp_path / "a.parquet.parts"
    while not list(parts.glob("*.parquet")):
        assert time.monotonic() - start < PATIENCE
        assert child.poll() is None
        time.sleep(0.05)
    os.killpg(child.pid, signal.SIGINT)
    _, err = child.communicate(timeout=PATIENCE)
    assert (child.returncode, err.splitlines()[-1]) == (130, "fishbone: interrupted")
    assert [line for line in err.splitlines()[:-1] if not line.startswith("fishbone: sweeping, ")] == []
    assert {len(rows_of(part)) for part in parts.glob("*.parquet")} == {79}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.parquet.parts", "belt.json"]


# ------------------------------------------------------------------------------------------------- the pictures


def test_a_map_is_white_where_there_is_no_equilibrium_and_has_a_line_at_the_limit(swept):
    figure = plot.sweep(swept, limit="energy<12")
    axes, bar = figure.axes
    [mesh] = [part for part in axes.collections if type(part).__name__ == "QuadMesh"]
    assert mesh.get_array().mask.sum() == 7
    assert len(axes.collections) == 2
    assert (axes.get_xlabel(), axes.get_ylabel(), bar.get_ylabel()) == (Y, Z, "energy")
    assert "of 20 points converged with energy<12" in figure.get_suptitle()
    assert len(plot.sweep(swept, limit="energy<1e9").axes[0].collections) == 1
    [crosses] = axes.lines
    assert len(crosses.get_xdata()) == 7
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no equilibrium"]
    assert "13 of 20 points converged" in plot.sweep(swept).get_suptitle()


@pytest.mark.parametrize(
    "ranges",
    [
        {Y: (0.5, 0.5, 2), Z: (0.0, 0.1, 2)},
        {Y: (0.5, 0.5, 2), Z: (0.1, 0.1, 2)},
        {Y: (0.5, np.nextafter(0.5, 1.0), 5), Z: (0.0, 0.1, 2)},
        {Y: (0.5, 0.5, 1), Z: (0.0, 0.1, 3)},
    ],
)
def test_a_map_has_a_cell_for_each_point_also_where_numbers_are_repeated(belt, scheduler, tmp_path, ranges):
    found = fb.sweep(belt, tmp_path / "a.parquet", ranges, scheduler=scheduler)
    counts = tuple(count for _, _, count in ranges.values())
    assert found.counts == counts
    figure = plot.sweep(found, limit="energy<12")
    [mesh] = [part for part in figure.axes[0].collections if type(part).__name__ == "QuadMesh"]
    np.testing.assert_array_equal(mesh.get_array(), found.column("energy").reshape(counts))
    assert plot.encode(found, ".png", limit="energy<12").startswith(b"\x89PNG")


def test_a_picture_with_a_limit_to_words_is_refused(swept):
    with pytest.raises(fb.InvalidArgument, match="limit: found the column status, allowed one of numbers"):
        plot.sweep(swept, limit="status>1")


def test_lines_have_a_panel_for_each_figure_and_for_the_limit(film, belt, scheduler, tmp_path):
    found = fb.sweep(belt, tmp_path / "a.parquet", {Y: (0.5, 1.1, 4)}, scheduler=scheduler)
    figure = plot.sweep(found, limit="supports[1].force.y < 0")
    labels = [axes.get_title(loc="left") for axes in figure.axes]
    assert labels == ["energy", "bend_radius.spine.value", "bend_radius.area.p99", "supports[1].force.y"]
    line, limit, crosses = figure.axes[-1].lines
    np.testing.assert_array_equal(line.get_ydata()[:3], found.column("supports[1].force.y")[:3])
    assert np.isnan(line.get_ydata()[3])
    assert list(limit.get_ydata()) == [0.0, 0.0]
    np.testing.assert_allclose(crosses.get_xdata(), [1.1])


def test_pictures_of_samples_have_units_where_they_are_known(film, scheduler, tmp_path):
    fields = {"belt.width": 0.002, "belt.segments[0].length": 0.01}
    found = fb.sweep(film, tmp_path / "a.parquet", {}, sample=6, tolerances=fields, scheduler=scheduler)
    figure = plot.sweep(found, limit="energy < 1 mJ")
    assert figure.axes[1].get_ylabel() == "energy [J]"
    assert figure.axes[0].get_xlabel() == "belt.width [m]"
    assert figure.axes[0].collections[0].get_offsets().shape == (6, 2)
    assert not figure.axes[0].lines
    widths = np.sort(found.column("belt.width"))
    beyond = plot.sweep(found, limit=f"belt.width < {1e3 * widths[3]} mm")
    [circles] = beyond.axes[0].lines
    np.testing.assert_array_equal(np.sort(circles.get_xdata()), widths[3:])
    assert [text.get_text() for text in beyond.legends[0].get_texts()] == ["beyond the limit"]
    assert plot.encode(found, ".svg", limit="energy < 1 mJ") == plot.encode(found, ".svg", limit="energy < 1 mJ")


def test_the_time_left_is_shown():
    assert [progress._left(share, 30.0) for share in (None, 0.0, 0.75)] == ["", "", ", about 10 s left"]
