"""What the command line writes: whole files, and text that every stream can take."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import stat
import subprocess
import sys
import threading
import unicodedata
from pathlib import Path
from xml.parsers import expat

import pytest

import fishbone as fb
from fishbone import cli, files, text

ESCAPES = "\x1b[31mred\x1b]0;title\x07\x9b1m\x7f\u202edegas [red]bold[/red]"
"""Colours, the title of a window and the order of letters, as a terminal takes them; and marks of style of rich."""
SHOWN = r"\x1b[31mred\x1b]0;title\x07\x9b1m\x7f\u202edegas [red]bold[/red]"
TURN = ("--to", "supports[1].rotation[2]=-0.1")
COMMANDS = (("solve", "a.json"), ("follow", "a.json", *TURN))
OPTIONS = [
    (arguments, param.opts[0], suffix)
    for arguments in COMMANDS
    for param in cli.command.commands[arguments[0]].params
    if isinstance(param.type, cli.Output)
    for suffix in param.type.suffixes[:1]
]
"""The options of all commands that name a file to write, with a suffix of each."""
PRINTING = (
    ("solve", "a.json"),
    ("solve", "a.json", "--json"),
    ("follow", "a.json", *TURN),
    ("examples",),
    ("--version",),
    ("--help",),
    ("solve", "--help"),
    (),
)
"""Commands that end well, and print."""


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path, example):
    """The working folder, with the scenario a.json."""
    monkeypatch.chdir(tmp_path)
    Path("a.json").write_text(json.dumps(example.to_dict() | {"name": "Gürtel"}), "utf-8")
    return tmp_path


@pytest.fixture
def run(capsys):
    """Runs the command line: exit code, standard output, standard error."""

    def run(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def unsolved(monkeypatch):
    """No solve may begin."""
    monkeypatch.setattr(fb, "solve", lambda _: pytest.fail("solved"))
    monkeypatch.setitem(fb.follow.__globals__, "solve", lambda _: pytest.fail("solved"))


def process(*arguments, environment=(), **streams):
    """The command line as a process of its own, with standard streams as bytes."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
    command = [sys.executable, "-m", "fishbone", *arguments]
    return subprocess.run(command, env=os.environ | dict(environment), check=False, timeout=120.0, **streams)


@contextlib.contextmanager
def broken_pipe():
    """The end to write to of a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    try:
        yield writer
    finally:
        os.close(writer)


def assert_one_line(err, *parts):
    assert err.startswith("fishbone: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    for part in parts:
        assert part in err


def names():
    return sorted(path.name for path in Path().iterdir())


# ------------------------------------------------------------------------------------------------------ whole files


def test_threads_that_write_one_file_leave_a_whole_one_at_all_times():
    path, contents = Path("b.json"), [bytes([letter]) * 300_000 for letter in b"abc"]
    files.write_whole(path, contents[0])
    errors, broken = [], 0

    def write(content):
        try:
            for _ in range(30):
                files.write_whole(path, content)
        except OSError as error:
            errors.append(error)

    threads = [threading.Thread(target=write, args=(content,)) for content in contents]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        broken += path.read_bytes() not in contents
    assert (errors, broken) == ([], 0)
    assert names() == ["a.json", "b.json"]


def test_content_is_on_the_disk_before_a_file_takes_its_place(monkeypatch):
    steps = []
    fsync, replace = os.fsync, Path.replace
    monkeypatch.setattr(files.os, "fsync", lambda file: (steps.append(os.fstat(file).st_size), fsync(file)))
    monkeypatch.setattr(Path, "replace", lambda draft, to: (steps.append(to.name), replace(draft, to)))
    files.write_all({Path("b.json"): b"three", Path("c.json"): b"four"})
    with files.whole(Path("d.json")) as draft:
        draft.write_bytes(b"x" * 100)
    assert steps == [5, 4, "b.json", "c.json", 100, "d.json"]
    assert names() == ["a.json", "b.json", "c.json", "d.json"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_a_file_keeps_its_mode(mode):
    path = Path("b.json")
    path.touch()
    path.chmod(mode)
    files.write_whole(path, b"new")
    assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (b"new", mode)


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_a_new_file_has_the_mode_of_any_new_file(mask):
    before = os.umask(mask)
    try:
        files.write_whole(Path("b.json"), b"new")
    finally:
        os.umask(before)
    assert stat.S_IMODE(Path("b.json").stat().st_mode) == 0o666 & ~mask


@pytest.mark.parametrize("arguments", COMMANDS, ids=["solve", "follow"])
def test_a_read_only_file_is_refused_before_any_solve(run, unsolved, arguments):
    """By its mode, which the superuser keeps to as well."""
    Path("b.json").write_bytes(b"as before")
    Path("b.json").chmod(0o444)
    code, out, err = run(*arguments, "--out", "b.json")
    assert (code, out) == (2, "")
    assert_one_line(err, "b.json", "read-only")
    assert Path("b.json").read_bytes() == b"as before"


def test_a_file_that_only_others_may_write_is_refused(run, unsolved, monkeypatch):
    Path("b.json").touch()
    # The superuser may write to all files: the system answers as it would for anyone else.
    monkeypatch.setattr(files.os, "access", lambda path, _: Path(path).name != "b.json")
    code, _, err = run("solve", "a.json", "--out", "b.json")
    assert code == 2
    assert_one_line(err, "b.json", "read-only")


def test_a_read_only_file_stays_as_it_is_from_python_too(equilibrium):
    path = Path("b.png")
    path.write_bytes(b"as before")
    path.chmod(0o444)
    with pytest.raises(PermissionError, match=r"read-only.*b\.png"):
        fb.plot.save(equilibrium, path)
    assert path.read_bytes() == b"as before"


def test_an_example_is_not_copied_over_a_read_only_file_by_force_either(run):
    path = Path("example1.toml")
    path.write_bytes(b"as before")
    path.chmod(0o444)
    code, out, err = run("examples", "example1", "--force")
    assert (code, out) == (2, "")
    assert_one_line(err, "example1.toml", "read-only")
    assert path.read_bytes() == b"as before"


def test_a_pipe_is_refused_and_stays_a_pipe():
    os.mkfifo("pipe.stl")
    with pytest.raises(PermissionError, match="no plain file"):
        files.write_whole(Path("pipe.stl"), b"new")
    assert Path("pipe.stl").is_fifo()


def test_a_name_of_255_bytes_can_be_written(run):
    name = "ü" * 125 + ".json"
    assert len(name.encode()) == 255
    assert run("solve", "a.json", "--out", name)[0] == 0
    assert json.loads(Path(name).read_bytes())["status"] == "converged"


@pytest.mark.parametrize("step", ["write_bytes", "chmod", "replace"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.EIO, "Input/output error")], ids=["key", "disk"])
def test_a_write_that_is_cut_short_leaves_nothing_behind(monkeypatch, step, error):
    Path("b.json").write_bytes(b"as before")

    def fail(*_):
        raise error

    monkeypatch.setattr(Path, step, fail)
    with pytest.raises(type(error)):
        files.write_whole(Path("b.json"), b"new")
    assert Path("b.json").read_bytes() == b"as before"
    assert names() == ["a.json", "b.json"]


def test_of_several_files_none_is_written_where_one_cannot_be():
    Path("b.json").write_bytes(b"as before")
    with pytest.raises(FileNotFoundError) as caught:
        files.write_all({Path("b.json"): b"new", Path("nowhere/b.png"): b"new"})
    assert caught.value.filename == str(Path("nowhere/b.png"))
    assert Path("b.json").read_bytes() == b"as before"
    assert names() == ["a.json", "b.json"]


def test_a_folder_that_vanishes_during_the_solve_is_exit_2_and_nothing_is_written(run, monkeypatch):
    Path("gone").mkdir()
    solve = fb.solve
    monkeypatch.setattr(fb, "solve", lambda scenario: (Path("gone").rmdir(), solve(scenario))[1])
    code, out, err = run("solve", "a.json", "--out", "b.json", "--figure", "gone/b.png")
    assert (code, out) == (2, "")
    assert_one_line(err, str(Path("gone/b.png")), "No such file or directory")
    assert names() == ["a.json"]


# --------------------------------------------------------------------------------------------------- one file twice


@pytest.mark.parametrize(("arguments", "option", "suffix"), OPTIONS)
@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_no_output_is_the_scenario_by_a_link_either(run, unsolved, arguments, option, suffix, link):
    content = Path("a.json").read_bytes()
    link("a.json", f"b{suffix}")
    code, out, err = run(*arguments, option, f"b{suffix}")
    assert (code, out) == (2, "")
    assert_one_line(err, option, f"b{suffix}", "'FILE'")
    assert Path("a.json").read_bytes() == content


def test_no_output_is_the_scenario_that_is_named_by_a_link(run, unsolved):
    Path("link.json").symlink_to("a.json")
    code, _, err = run("solve", "link.json", "--out", "a.json")
    assert code == 2
    assert_one_line(err, "--out", "a.json", "'FILE'")


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_two_outputs_are_two_files(run, unsolved, link):
    Path("b.json").touch()
    link("b.json", "b.png")
    code, out, err = run("solve", "a.json", "--out", "b.json", "--figure", "b.png")
    assert (code, out) == (2, "")
    assert_one_line(err, "--figure", "b.png", "--out")


def test_two_outputs_are_two_files_before_there_is_any(run, unsolved):
    Path("b.png").symlink_to("b.json")
    code, _, err = run("solve", "a.json", "--out", "b.json", "--figure", "b.png")
    assert code == 2
    assert_one_line(err, "--figure", "b.png", "--out")


def test_a_scenario_that_leads_nowhere_is_one_line_with_an_output_too(run):
    Path("loop.json").symlink_to("loop.json")
    code, _, err = run("solve", "loop.json", "--out", "b.json")
    assert code == 2
    assert_one_line(err, "loop.json")


# ------------------------------------------------------------------------------------------------------- encodings

ENCODINGS = {
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "strict": {"PYTHONIOENCODING": "ascii:strict"},
    "latin-1": {"PYTHONIOENCODING": "latin-1:strict"},
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""},
}
encodings = pytest.mark.parametrize("environment", ENCODINGS.values(), ids=ENCODINGS)


@encodings
def test_tables_are_printed_in_any_encoding(environment):
    """A question mark stands for a character that the encoding lacks."""
    done = process("follow", "a.json", *TURN, environment=environment)
    assert (done.returncode, done.stderr) == (0, b"")
    name = "Gürtel" if environment is ENCODINGS["latin-1"] else "G?rtel"
    assert done.stdout.decode("latin-1").startswith(f"{name}: ")
    assert b" 0 ? -0.1 " in done.stdout


@encodings
def test_lines_of_error_are_printed_in_any_encoding(environment):
    done = process("solve", "→.toml", environment=environment)
    assert (done.returncode, done.stdout) == (2, b"")
    assert_one_line(done.stderr.decode("ascii"), r"\u2192.toml" if environment.get("LC_ALL") != "C" else r"\udc")


@pytest.mark.parametrize("arguments", [(), ("solve", "--help"), ("follow", "--help"), ("examples", "--help")])
def test_help_is_the_same_in_any_encoding(run, arguments):
    assert run(*arguments)[1].isascii()


def test_a_file_whose_name_is_not_utf8_is_read_written_and_named():
    name = os.fsdecode(b"\xff.json")
    try:
        Path("a.json").rename(name)
    except OSError:
        pytest.skip("the file system has names in UTF-8 alone")
    result = os.fsdecode(b"\xfe.json")
    done = process("solve", name, "--out", result)
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(Path(result).read_bytes())["status"] == "converged"
    Path(name).write_text('{"belt": 1}', "utf-8")
    done = process("solve", name)
    assert done.returncode == 2
    assert_one_line(done.stderr.decode(), r"\udcff.json: belt")


def test_a_field_that_is_not_utf8_is_refused_in_one_line(run):
    code, _, err = run("follow", "a.json", "--to", "\udcff=1")
    assert code == 2
    assert_one_line(err, r"\udcff: found nothing")


# -------------------------------------------------------------------------------------------------- broken streams


@pytest.mark.parametrize("arguments", PRINTING, ids=" ".join)
def test_a_broken_pipe_is_exit_141_and_one_line(arguments):
    with broken_pipe() as out:
        done = process(*arguments, stdout=out)
    assert done.returncode == 141
    assert_one_line(done.stderr.decode(), "standard output")


def test_a_broken_pipe_leaves_the_files_that_are_written():
    with broken_pipe() as out:
        done = process("solve", "a.json", "--json", "--out", "b.json", stdout=out)
    assert done.returncode == 141
    assert json.loads(Path("b.json").read_bytes())["status"] == "converged"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize("arguments", PRINTING, ids=" ".join)
def test_a_full_disk_under_standard_output_is_exit_74_and_one_line(arguments):
    with Path("/dev/full").open("wb") as out:
        done = process(*arguments, stdout=out)
    assert done.returncode == 74
    assert_one_line(done.stderr.decode(), "standard output", "No space left")


def test_a_disk_that_takes_no_more_is_exit_74_and_nothing_is_written():
    """A limit to the size of files, which the result exceeds, stands for the disk."""
    Path("b.json").write_bytes(b"as before")
    code = (
        "import resource, sys\n"
        "from fishbone import cli\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))\n"
        "sys.exit(cli.main(['solve', 'a.json', '--out', 'b.json']))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (74, "")
    assert_one_line(done.stderr, "b.json", "too large")
    assert Path("b.json").read_bytes() == b"as before"
    assert names() == ["a.json", "b.json"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_a_full_disk_is_exit_74_and_no_file_is_written(run, monkeypatch, code):
    write = Path.write_bytes
    calls = itertools.count()

    def full(path, content):
        if next(calls):
            raise OSError(code, os.strerror(code))
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    exit_code, out, err = run("solve", "a.json", "--out", "b.json", "--figure", "b.svg")
    assert (exit_code, out) == (74, "")
    assert_one_line(err, "b.svg", os.strerror(code))
    assert names() == ["a.json"]


def test_a_broken_standard_error_leaves_exit_code_and_result():
    with broken_pipe() as err:
        assert process("solve", "missing.toml", stderr=err).returncode == 2
        done = process("solve", "a.json", stderr=err)
    assert done.returncode == 0
    assert "energy" in done.stdout.decode()


def test_a_bar_of_progress_on_a_broken_pipe_leaves_standard_output():
    code = (
        "import sys, time, fishbone\n"
        "from fishbone import cli, progress\n"
        "progress.QUIET = 0.0\n"
        "solve = fishbone.solve\n"
        "fishbone.solve = lambda scenario: (time.sleep(1.0), solve(scenario))[1]\n"
        "sys.exit(cli.main(['solve', 'a.json']))\n"
    )
    with broken_pipe() as err:
        streams = {"stdout": subprocess.PIPE, "stderr": err, "env": os.environ | {"FORCE_COLOR": "1"}}
        done = subprocess.run([sys.executable, "-c", code], check=False, **streams)
    assert done.returncode == 0
    assert "energy" in done.stdout.decode()


# ---------------------------------------------------------------------------------------------------------- escapes


def write_named(name, example):
    Path("b.json").write_text(json.dumps(example.to_dict() | {"name": name}), "utf-8")


@pytest.mark.parametrize("arguments", [("solve", "b.json"), ("follow", "b.json", *TURN)], ids=["solve", "follow"])
def test_escapes_in_the_name_of_a_scenario_are_shown(run, example, arguments):
    write_named(ESCAPES, example)
    code, out, err = run(*arguments)
    assert (code, err) == (0, "")
    assert out.startswith(f"{SHOWN}: ")


def test_escapes_in_the_name_of_a_scenario_are_shown_above_all_equilibria(run, example, monkeypatch, equilibrium):
    tables = example.to_dict() | {"name": ESCAPES}
    write_named(ESCAPES, example)
    monkeypatch.setattr(fb, "branches", lambda *_, **__: [fb.solve(fb.Scenario.from_dict(tables))])
    assert run("solve", "b.json", "--all")[1].startswith(f"{SHOWN}: ")


@pytest.mark.parametrize("arguments", [("solve", "b.json"), ("follow", "b.json", *TURN)], ids=["solve", "follow"])
def test_a_picture_of_a_scenario_with_escapes_in_its_name_can_be_read(run, example, arguments):
    write_named(ESCAPES, example)
    assert run(*arguments, "--figure", "b.svg")[0] == 0
    assert expat.ParserCreate().Parse(Path("b.svg").read_bytes(), True) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ("solve", f"{ESCAPES}.toml"),
        ("solve", "a.json", "--out", f"{ESCAPES}.txt"),
        ("solve", "a.json", "--out", f"{ESCAPES.partition(']')[0]}/a.json"),
        ("solve", "a.json", "--energy", ESCAPES),
        ("solve", "a.json", f"--{ESCAPES}"),
        ("follow", "a.json", "--to", f"{ESCAPES}=1"),
        ("follow", "a.json", "--to", f"belt.width={ESCAPES}"),
        ("follow", "a.json", "--pose", ESCAPES),
        ("follow", "a.json", "--pose", "0 0.5 0.1 0 0 0", "--support", ESCAPES),
        ("examples", ESCAPES),
        (ESCAPES,),
    ],
)
def test_escapes_in_arguments_are_shown_in_errors(run, arguments):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert_one_line(err, r"\x1b[31mred")
    assert not any(unicodedata.category(letter) == "Cc" or letter == "\u202e" for letter in err[:-1])


def test_escapes_in_a_field_are_shown_in_errors(run, example):
    Path("b.json").write_text(json.dumps(example.to_dict() | {ESCAPES: 1}), "utf-8")
    code, _, err = run("solve", "b.json")
    assert code == 2
    assert_one_line(err, "unknown field")
    assert "\x1b" not in err
    assert "\u202e" not in err


def test_escapes_in_the_name_of_a_file_are_shown_in_warnings(run, example):
    tables = example.to_dict()
    tables["solver"]["elements"] = 40
    Path("\x1b[31m.json").write_text(json.dumps(tables), "utf-8")
    code, _, err = run("solve", "\x1b[31m.json")
    assert code == 0
    assert err.startswith(r"fishbone: \x1b[31m.json: warning: ")
    assert "\x1b" not in err


def test_json_of_a_scenario_with_escapes_is_that_of_any_other(run, example):
    write_named(ESCAPES, example)
    code, out, _ = run("solve", "b.json", "--json")
    assert (code, out.isascii()) == (0, True)
    assert json.loads(out)["scenario"]["name"] == ESCAPES


def test_all_text_but_controls_is_shown_as_it_is():
    everything = map(chr, range(sys.maxunicode + 1))
    hidden = {letter for letter in everything if text.shown(letter) != letter}
    assert {letter for letter in hidden if unicodedata.category(letter) not in {"Cc", "Cs"}} == {
        *"\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
    }
    assert {letter for letter in map(chr, range(sys.maxunicode + 1)) if unicodedata.category(letter) == "Cc"} <= hidden
    assert not any(unicodedata.category(letter) == "Cc" for letter in "".join(map(text.shown, hidden)))
