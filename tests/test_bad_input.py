"""Bad input gets one line that helps, the right exit code, and leaves nothing behind.

CONTRACT: exit 2 for invalid input (one line: file, field, what was found, what is allowed), 3 for infeasible or not
converged (one line: why); exit 3 still writes `--out` and no picture. Never a traceback. In Python: `InvalidScenario`
before any
solve; a solve that fails is a value.

The command line is called in this process, and a few times as a process of its own: once for each exit code, and
where what is read could end or stop it. Behind the mark `full` it is a process every time.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import fishbone as fb
from changes import Change, drop, put, rename, several
from fishbone import cli
from helpers import Json, clamped, example1, solve_any

HUGE_FILE = 100_000_000
HUGE_FILE_SECONDS = 5.0
HUGE_FILE_MEMORY = 30_000_000


@dataclass(frozen=True)
class Case:
    """One thing wrong in an otherwise good scenario, and the words its message must hold (letter case aside)."""

    name: str
    change: Change
    words: tuple[str, ...]


def good() -> Json:
    return example1("wunderlich", elements=80)


def reverse_supports(scenario: Json) -> None:
    scenario["supports"].reverse()


MATERIAL = {"young": 3.2e9, "poisson": 0.34, "thickness": 140e-6}
STRAIGHT = {"kind": "straight", "length": 0.5}
NAN, INF = math.nan, math.inf

UNKNOWN_KEYS = (
    Case("unknown key", put("colour", "red"), ("colour",)),
    Case("misspelt energy", rename("energy", "enrgy"), ("enrgy", "energy")),
    Case("misspelt belt", rename("belt", "bellt"), ("bellt", "belt")),
    Case("misspelt width", rename("belt.width", "widht"), ("widht", "width")),
    Case("misspelt rigidity", rename("belt.rigidity", "rigidty"), ("rigidty", "rigidity")),
    Case("misspelt length", rename("belt.segments.0.length", "lenght"), ("lenght", "length")),
    Case("misspelt position", rename("supports.1.position", "positon"), ("positon", "position")),
    Case("misspelt rotation", rename("supports.1.rotation", "rotaton"), ("rotaton", "rotation")),
    Case("misspelt elements", rename("solver.elements", "elments"), ("elments", "elements")),
)

WRONG_TYPES = (
    Case("width a string", put("belt.width", "wide"), ("width",)),
    Case("width a list", put("belt.width", [0.1]), ("width",)),
    Case("energy a number", put("energy", 3), ("energy",)),
    Case("belt a list", put("belt", [1.0]), ("belt",)),
    Case("supports a table", put("supports", {"at": "start"}), ("supports",)),
    Case("supports of numbers", put("supports", [1.0, 2.0]), ("supports",)),
    Case("position of two", put("supports.1.position", [0.0, 0.5]), ("position",)),
    Case("position of four", put("supports.1.position", [0.0, 0.5, 0.1, 0.0]), ("position",)),
    Case("position of strings", put("supports.1.position", ["a", "b", "c"]), ("position",)),
    Case("rotation a number", put("supports.1.rotation", 0.5), ("rotation",)),
    Case("square_rib a string", put("supports.1.square_rib", "yes"), ("square_rib",)),
    Case("elements a fraction", put("solver.elements", 80.5), ("elements",)),
    Case("elements a string", put("solver.elements", "80"), ("elements",)),
    Case("bulge of two", put("solver.bulge", [1.0, 0.0]), ("bulge",)),
)

MISSING = (
    Case("no belt", drop("belt"), ("belt",)),
    Case("no width", drop("belt.width"), ("width",)),
    Case("no segments", drop("belt.segments"), ("segments",)),
    Case("empty segments", put("belt.segments", []), ("segments",)),
    Case("no length", drop("belt.segments.0.length"), ("length",)),
    Case("no kind", drop("belt.segments.0.kind"), ("kind",)),
    Case("no at", drop("supports.1.at"), ("at",)),
    Case("no rigidity", drop("belt.rigidity"), ("rigidity",)),
    Case("two rigidities", put("belt.material", MATERIAL), ("rigidity", "material")),
)

NUMBERS = (
    *(
        Case(f"{field} {value}", put(path, value), (field, str(value)))
        for field, path in (
            ("width", "belt.width"),
            ("rigidity", "belt.rigidity"),
            ("length", "belt.segments.0.length"),
        )
        for value in (NAN, INF, -INF, -0.25)
    ),
    Case("width 0", put("belt.width", 0.0), ("width", "0")),
    Case("rigidity 0", put("belt.rigidity", 0.0), ("rigidity", "0")),
    Case("length 0", put("belt.segments.0.length", 0.0), ("length", "0")),
    Case("position nan", put("supports.1.position", [0.0, NAN, 0.1]), ("position", "nan")),
    Case("position inf", put("supports.1.position", [0.0, 0.5, INF]), ("position", "inf")),
    Case("rotation nan", put("supports.1.rotation", [0.0, NAN, 0.0]), ("rotation", "nan")),
    Case("rotation inf", put("supports.1.rotation", [0.0, INF, 0.0]), ("rotation", "inf")),
    Case("bulge nan", put("solver.bulge", [NAN, 0.0, 0.0]), ("bulge", "nan")),
    Case("bulge 0", put("solver.bulge", [0.0, 0.0, 0.0]), ("bulge",)),
    Case("tolerance nan", put("solver.tolerance", NAN), ("tolerance", "nan")),
    Case("tolerance 0", put("solver.tolerance", 0.0), ("tolerance", "0")),
    Case("3 elements", put("solver.elements", 3), ("elements", "3", "4")),
    Case("100001 elements", put("solver.elements", 100_001), ("elements", "100001", "100000")),
    Case("0 elements", put("solver.elements", 0), ("elements", "0")),
    Case("-80 elements", put("solver.elements", -80), ("elements", "-80")),
)


def quaternion(values: list[float]) -> Change:
    return several(drop("supports.1.rotation"), put("supports.1.quaternion", values))


ORIENTATIONS = (
    Case("quaternion too long", quaternion([1.0, 0.01, 0.0, 0.0]), ("quaternion",)),
    Case("quaternion 3e-6 too long", quaternion([1.000003, 0.0, 0.0, 0.0]), ("quaternion",)),
    Case("quaternion 3e-6 too short", quaternion([0.0, 0.999997, 0.0, 0.0]), ("quaternion",)),
    Case("quaternion 0", quaternion([0.0, 0.0, 0.0, 0.0]), ("quaternion",)),
    Case("quaternion nan", quaternion([NAN, 0.0, 0.0, 0.0]), ("quaternion", "nan")),
    Case("quaternion of three", quaternion([1.0, 0.0, 0.0]), ("quaternion",)),
    Case(
        "two orientations",
        put("supports.1.euler", [0.1, 0.2, 0.3]),
        ("rotation", "euler"),
    ),
)

CHOICES = (
    Case("unknown energy", put("energy", "sadovsky"), ("energy", "sadovsky", "sadowsky")),
    Case("unknown kind", put("belt.segments.0.kind", "strait"), ("strait", "straight")),
    Case("unknown at", put("supports.1.at", "middle"), ("at", "middle", "start", "end")),
    Case("unknown method", put("solver.method", "guess"), ("method", "guess", "intrinsic")),
)

SUPPORTS = (
    Case("supports out of order", reverse_supports, ("supports",)),
    Case("two supports at the start", put("supports.1.at", "start"), ("supports", "start")),
    Case("support beyond the end", put("supports.1.at", 1.5), ("at", "1.5")),
    Case("support before the start", put("supports.0.at", -0.1), ("at", "-0.1")),
    Case("support at nan", put("supports.1.at", NAN), ("at", "nan")),
)


def board(*segments: Json) -> Change:
    return put("belt.segments", list(segments))


CLOSED = put("belt.closed", True)
CORNER = {"kind": "corner", "angle": 1.0}
RIGID = {"kind": "rigid", "length": 0.1}

BOARDS = (
    Case("nothing flexible", board(RIGID), ("segments", "straight", "arc")),
    Case("corner first", board(CORNER, STRAIGHT), ("segments[0]", "corner")),
    Case("corner last", board(STRAIGHT, CORNER), ("segments[1]", "corner")),
    Case("sharp corner", board(STRAIGHT, {"kind": "corner", "angle": 2.2}, STRAIGHT), ("angle", "2.2", "120")),
    Case("corner at a stiffener", board(STRAIGHT, {"kind": "corner", "angle": 1.6}, RIGID), ("angle", "1.6", "90")),
    Case("natural bend nan", put("belt.natural_bend", NAN), ("natural_bend", "nan")),
    Case("half turns of an open belt", put("belt.half_turns", 1), ("half_turns", "closed")),
    Case("end of a closed belt", CLOSED, ("supports[1].at", "start")),
    Case(
        "unknown material",
        several(drop("belt.rigidity"), put("belt.material", {"preset": "polyimid", "thickness": 25e-6})),
        ("preset", "polyimid", "polyimide", "FR-4"),
    ),
)

OUTSIDE = (
    Case(
        "point load off the belt",
        put("loads", {"points": [{"at": 1.5, "force": [0.0, 0.0, -1.0]}]}),
        ("loads.points[0].at", "1.5"),
    ),
    Case(
        "link of a point with itself",
        put("links", [{"from": 0.2, "to": 0.2, "offset": [0.0, 0.3, 0.0]}]),
        ("links[0].to", "0.2"),
    ),
    Case(
        "hinge without an orientation",
        several(drop("supports.1.rotation"), put("supports.1.hinge", "zeta")),
        ("hinge", "orientation"),
    ),
)

CASES = (
    *UNKNOWN_KEYS,
    *WRONG_TYPES,
    *MISSING,
    *NUMBERS,
    *ORIENTATIONS,
    *CHOICES,
    *SUPPORTS,
    *BOARDS,
    *OUTSIDE,
)
cases = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])


# ------------------------------------------------------------------------------------------------ machinery


def inline(value: Any) -> str:
    """A TOML value on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(inline(item) for item in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    return repr(value)


def toml(scenario: Json) -> str:
    return "".join(f"{key} = {inline(value)}\n" for key, value in scenario.items())


def changed(case: Case) -> Json:
    scenario = good()
    case.change(scenario)
    return scenario


def arguments(path: Path) -> list[str]:
    return ["solve", str(path), "--out", "result.json", "--figure", "views.png"]


def command(path: Path) -> list[str]:
    return [sys.executable, "-m", "fishbone", *arguments(path)]


@dataclass(frozen=True)
class Outcome:
    """What the command line came to."""

    code: int
    out: str
    err: str


Solve = Callable[[Path], Outcome]


def solve_as_a_process(path: Path) -> Outcome:
    """The command line on one file, in that file's folder."""
    done = subprocess.run(command(path), cwd=path.parent, capture_output=True, text=True, timeout=60, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)


@pytest.fixture(params=["called", pytest.param("process", marks=pytest.mark.full)])
def solve_file(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Solve:
    """The same, in this process or in one of its own."""

    def call(path: Path) -> Outcome:
        monkeypatch.chdir(path.parent)
        code = cli.main(arguments(path))
        return Outcome(code, *capfd.readouterr())

    return call if request.param == "called" else solve_as_a_process


def the_line(text: str) -> str:
    """The one line of an error, without regard to letter case."""
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) == 1, text
    assert "traceback" not in lines[0].lower()
    assert "panicked" not in lines[0].lower()
    return lines[0].lower()


def assert_refused(solve: Solve, path: Path, words: tuple[str, ...] = ()) -> None:
    """Exit 2, one line with the file's name and `words`, nothing written."""
    before = sorted(path.parent.iterdir())
    outcome = solve(path)
    line = the_line(outcome.err)
    assert outcome.code == 2, line
    for word in (path.name, *words):
        assert word.lower() in line, f"{word!r} not in {line!r}"
    assert outcome.out.strip() == ""
    assert sorted(path.parent.iterdir()) == before


# ------------------------------------------------------------------------------------------------ scenarios


def test_good_scenario_is_accepted(tmp_path: Path) -> None:
    """What the cases below change is good: without the change it is solved and written."""
    path = tmp_path / "good.toml"
    path.write_text(toml(good()))
    out = tmp_path / "result.json"
    words = [sys.executable, "-m", "fishbone", "solve", str(path), "--out", str(out)]
    process = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert process.returncode == 0, process.stderr
    assert json.loads(out.read_text())["status"] == "converged"


@cases
def test_command_line_refuses_with_one_line(case: Case, tmp_path: Path, solve_file: Solve) -> None:
    """Exit 2; the line names the file, the field and what was found."""
    path = tmp_path / "scenario.toml"
    path.write_text(toml(changed(case)))
    assert_refused(solve_file, path, case.words)


@pytest.mark.parametrize("case", [UNKNOWN_KEYS[0], OUTSIDE[-1]], ids=lambda case: case.name)
def test_process_refuses_with_one_line(case: Case, tmp_path: Path) -> None:
    """What Python and the core refuse."""
    path = tmp_path / "scenario.toml"
    path.write_text(toml(changed(case)))
    assert_refused(solve_as_a_process, path, case.words)


@cases
def test_python_refuses_with_one_line(case: Case) -> None:
    """`InvalidScenario`, a `FishboneError` and a `ValueError`, before any solve."""
    with pytest.raises(fb.InvalidScenario) as caught:
        fb.solve(fb.Scenario.from_dict(changed(case)))
    assert isinstance(caught.value, fb.FishboneError)
    assert isinstance(caught.value, ValueError)
    line = the_line(str(caught.value))
    for word in case.words:
        assert word.lower() in line, f"{word!r} not in {line!r}"


@pytest.mark.parametrize("scale", [1.0 + 5e-7, 1.0 - 5e-7])
def test_quaternion_within_a_millionth_of_unit_length_is_accepted(scale: float) -> None:
    """The other side of the limit."""
    scenario = good()
    quaternion([scale, 0.0, 0.0, 0.0])(scenario)
    assert solve_any(scenario).status == "converged"


def test_zero_natural_bend_is_accepted() -> None:
    """Spelling out a default changes nothing."""
    scenario = good()
    put("belt.natural_bend", 0.0)(scenario)
    put("belt.closed", False)(scenario)
    assert solve_any(scenario).status == "converged"


def test_four_elements_are_accepted() -> None:
    """The other side of the limit: the answer may be poor, but it is an answer."""
    scenario = clamped((0.0, 0.6, 0.0), elements=4)
    assert solve_any(scenario).u.shape == (5,)


# ----------------------------------------------------------------------------------------------- infeasible


TOO_FAR = {
    "clamped": clamped((0.0, 1.25, 0.0)),
    "pinned": {
        **clamped((0.0, 1.25, 0.0)),
        "supports": [
            {"at": "start", "position": [1.0, 1.0, 1.0]},
            {"at": "end", "position": [1.0, 1.0, 2.25]},
        ],
    },
    "oblique": clamped((0.75, 0.0, 1.0), (0.1, 0.2, 0.3)),
}
too_far = pytest.mark.parametrize("name", TOO_FAR)


@too_far
def test_end_beyond_the_belts_length_is_infeasible(name: str) -> None:
    """|x(U) − x(0)| = 1.25 > U = 1: a value, not an exception."""
    assert solve_any(TOO_FAR[name]).status == "infeasible"


def assert_too_short(solve: Solve, path: Path) -> None:
    """Exit 3, one line with the missing 0.25; `--out` is written and says so; no picture."""
    outcome = solve(path)
    line = the_line(outcome.err)
    assert outcome.code == 3, line
    assert "0.25" in line
    written = json.loads((path.parent / "result.json").read_text())
    assert written["status"] == "infeasible"
    assert sorted(p.name for p in path.parent.iterdir()) == sorted(["result.json", path.name])


@too_far
def test_command_line_says_by_how_much_the_belt_is_too_short(name: str, tmp_path: Path, solve_file: Solve) -> None:
    path = tmp_path / "too_far.toml"
    path.write_text(toml(TOO_FAR[name]))
    assert_too_short(solve_file, path)


def test_process_says_by_how_much_the_belt_is_too_short(tmp_path: Path) -> None:
    path = tmp_path / "too_far.toml"
    path.write_text(toml(TOO_FAR["clamped"]))
    assert_too_short(solve_as_a_process, path)


# ---------------------------------------------------------------------------------------------------- files


def test_missing_file_is_refused(tmp_path: Path, solve_file: Solve) -> None:
    """There is no such file."""
    assert_refused(solve_file, tmp_path / "missing.toml")


def test_folder_is_refused(tmp_path: Path, solve_file: Solve) -> None:
    """A folder is not a file."""
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    assert_refused(solve_file, folder)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.toml", b""),
        ("empty.json", b""),
        ("blank.toml", b"\n \n"),
        ("syntax.toml", b"belt = {\n"),
        ("syntax.json", b'{"belt": '),
        ("list.json", b"[1, 2]"),
        ("null.json", b"null"),
        ("not_utf8.toml", b'name = "\xff\xfe"\n'),
        ("binary.toml", bytes(range(256))),
        ("binary.json", bytes(range(256))),
        ("truncated.json", json.dumps(good()).encode()[:-10]),
        ("twice.toml", b'energy = "sadowsky"\nenergy = "sadowsky"\n'),
    ],
)
def test_file_that_is_no_scenario_is_refused(name: str, content: bytes, tmp_path: Path, solve_file: Solve) -> None:
    """Nothing in it, not TOML or JSON, not text, not a table, a key twice."""
    path = tmp_path / name
    path.write_bytes(content)
    assert_refused(solve_file, path)


@pytest.mark.parametrize(("name", "content"), [("deep.json", b"[" * 100_000), ("deep.toml", b"a = " + b"[" * 100_000)])
def test_file_nested_without_end_is_refused(name: str, content: bytes, tmp_path: Path) -> None:
    """A process of its own: one whose stack is full is ended."""
    path = tmp_path / name
    path.write_bytes(content)
    assert_refused(solve_as_a_process, path)


def test_dangling_link_is_refused(tmp_path: Path, solve_file: Solve) -> None:
    """Unreadable for anybody, root included."""
    path = tmp_path / "dangling.toml"
    path.symlink_to(tmp_path / "nowhere.toml")
    assert_refused(solve_file, path)


def test_pipe_is_refused_without_waiting_for_it(tmp_path: Path) -> None:
    """Reading a named pipe that nobody writes to would wait for ever, so that this is a process with a time limit."""
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    assert_refused(solve_as_a_process, path)


def peak_memory(path: Path) -> tuple[int, subprocess.CompletedProcess[str]]:
    """Largest resident size of the command on one file, in bytes, measured by a parent of its own."""
    watch = (
        "import resource, subprocess, sys\n"
        "code = subprocess.run(sys.argv[1:]).returncode\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
        "sys.exit(code)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", watch, *command(path)],
        cwd=path.parent,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    unit = 1 if sys.platform == "darwin" else 1024
    return int(process.stdout.split()[-1]) * unit, process


@pytest.fixture(scope="module")
def usual_memory(tmp_path_factory: pytest.TempPathFactory) -> int:
    """What a missing file takes, in bytes."""
    return peak_memory(tmp_path_factory.mktemp("missing") / "missing.toml")[0]


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_huge_file_is_refused_without_loading_it(suffix: str, tmp_path: Path, usual_memory: int) -> None:
    """A good scenario and 100 MB of blank lines: refused in seconds, in hardly more memory than a missing file
    takes."""
    path = tmp_path / f"huge{suffix}"
    text = (toml(good()) if suffix == ".toml" else json.dumps(good())).encode()
    with path.open("wb") as file:
        file.write(text)
        for _ in range(HUGE_FILE // 1_000_000):
            file.write(b"\n" * 1_000_000)
    before = sorted(tmp_path.iterdir())

    start = time.monotonic()
    peak, process = peak_memory(path)
    elapsed = time.monotonic() - start

    line = the_line(process.stderr)
    assert process.returncode == 2, line
    assert path.name in line
    assert elapsed < HUGE_FILE_SECONDS
    assert peak - usual_memory < HUGE_FILE_MEMORY
    assert sorted(tmp_path.iterdir()) == before
    path.unlink()


# ------------------------------------------------------------------------------------------------- JSON too


@pytest.mark.parametrize(
    "case",
    [UNKNOWN_KEYS[3], WRONG_TYPES[0], MISSING[-1], BOARDS[0]],
    ids=lambda case: case.name,
)
def test_json_file_is_refused_like_a_toml_file(case: Case, tmp_path: Path, solve_file: Solve) -> None:
    """CONTRACT: the same structure as JSON is accepted everywhere."""
    path = tmp_path / "scenario.json"
    path.write_text(json.dumps(changed(case)))
    assert_refused(solve_file, path, case.words)
