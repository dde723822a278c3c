"""Links, tests and files named in README.md and docs exist."""

from __future__ import annotations

import re

import numpy as np
import pytest

import fishbone as fb
import peers
import validation
from cases import shell
from conftest import ROOT

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
LARGEST_PICTURE = 300_000

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def anchors(text):
    """The headings of a page as links name them."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pages
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?://)([^)]+)\)", page.read_text()):
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        assert file.is_file(), target
        assert not anchor or anchor in anchors(file.read_text()), target


@pages
def test_tests_that_are_named_exist(page):
    sources = "".join(path.read_text() for path in [*ROOT.glob("tests/*.py"), *ROOT.glob("crates/**/*.rs")])
    for name in re.findall(r"`(test_\w+)`", page.read_text()):
        assert re.search(rf"\b{name}\b\(", sources), name


def test_each_promise_has_a_test():
    page = (ROOT / "docs" / "promises.md").read_text()
    promises = [item for item in re.split(r"\n(?:- |\n)", page) if item.startswith(("**", "- **"))]
    assert len(promises) > 20
    assert [promise for promise in promises if not re.search(r"`test_\w+`", promise)] == []


@pages
def test_files_that_are_named_exist(page):
    paths = re.findall(r"`((?:tests|benchmarks|crates|docs|examples|scenarios)/[\w./]+)`", page.read_text())
    assert not [path for path in paths if not (ROOT / path).exists()]


def block(page, name):
    """The cells of a measured table, row by row, without its head."""
    text = re.search(rf"<!-- {name} -->(.*?)<!-- /{name} -->", page, re.DOTALL)[1]
    rows = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


def test_the_page_of_validation_names_every_aim_that_is_missed():
    page = (ROOT / "docs" / "validation.md").read_text("utf-8")
    measured = {"≤ 50 ms": r"(\d+) ms", "≤ 2": r"^([\d.]+)", "≤ 1 s": r"in (\d+) s"}
    aims = [row for row in block(page, "before and after") if row[4] == "aim"]
    assert {aim for _, _, _, aim, _ in aims} <= set(measured)
    missed = [
        case
        for case, _, after, aim, _ in aims
        if float(re.search(measured[aim], after)[1]) > float(re.search(r"\d+", aim)[0])
    ]
    named = re.search(r"\n\nAims that are missed:\n\n(.*?)\n\n", page, re.DOTALL)[1]
    assert [item.removeprefix("- ") for item in named.splitlines()] == missed


def test_the_page_of_shapes_agrees_with_its_table():
    page = (ROOT / "docs" / "shapes.md").read_text("utf-8")
    table = block(page, "shapes")
    counts = [*re.findall(r"the (\d+) other shapes", page), *re.findall(r"margin of all (\d+)", page)]
    assert counts == [str(len(table))] * 2
    margins = {row[0]: float(row[5]) for row in table if row[0]}
    [moved] = re.findall(r"\(a\) may snap when the far clamp moves by (\d\.\d+)", page)
    assert float(moved) == margins["a"]
    [widths] = re.findall(r"([\d.]+) in \(b\), ([\d.]+) in \(c\)", page)
    assert list(map(float, widths)) == [round(margins["b"], 2), round(margins["c"], 2)]
    assert max(margins["d"], margins["e"]) <= 0.02


@pytest.mark.full
def test_the_pages_have_the_counts_of_the_shapes_that_are_found():
    found = fb.branches(fb.load(ROOT / "docs" / "shapes.toml"))
    minima = [shape for shape in found if shape.stable]
    crossing = [shape for shape in minima if shape.crosses_itself is not None]
    page = " ".join((ROOT / "docs" / "shapes.md").read_text("utf-8").split())
    saddles = len(found) - len(minima)
    assert f"finds {len(found)} equilibria: {len(minima)} minima and {saddles} saddle" in page
    assert f"{len(crossing)} of the minima pass through themselves" in page
    assert f"the {len(minima) - len(crossing)} other shapes" in page
    assert f"{len(found)} equilibria, rising in energy" in (ROOT / "README.md").read_text("utf-8")


def test_the_readme_has_the_distances_from_the_shell_that_were_measured():
    distances = {row[0]: row[2:6] for row in block((ROOT / "docs" / "validation.md").read_text("utf-8"), "shell")}
    readme = (ROOT / "README.md").read_text("utf-8")
    for thickness, case in (("140 µm", "`example2`"), ("35 µm", "`example2_h4`")):
        [row] = re.findall(rf"^\| {thickness} \| (.+) \|$", readme, re.MULTILINE)
        assert row.split(" | ") == [f"{float(distance):.1f}e-3 U" for distance in distances[case]]


def test_the_table_of_shells_has_all_of_them_and_what_the_page_says_of_it():
    page = " ".join((ROOT / "docs" / "validation.md").read_text("utf-8").split())
    rows = block((ROOT / "docs" / "validation.md").read_text("utf-8"), "shell")
    shells = sorted(f"`{path.stem}`" for path in (ROOT / "tests" / "data" / "shell").glob("*.json"))
    assert sorted(row[0] for row in rows) == shells
    distances = np.array([row[2:6] for row in rows], dtype=float)
    energies = np.array([[cell.replace("−", "-") for cell in row[7:]] for row in rows], dtype=float)
    assert np.all(distances.argmin(axis=1) == 3)
    assert f"{distances[:, 3].max():.1f}e-3 U at most" in page
    off = f"{energies[:, 3].min():.1f} to {energies[:, 3].max():.1f} %".replace("-", "−")
    assert off in page
    note = " ".join((ROOT / "docs" / "strip-shell.md").read_text("utf-8").split())
    assert off in note
    assert f"{distances[:, 3].min():.2f}e-3 to {distances[:, 3].max():.1f}e-3 of the length" in note


@pytest.mark.parametrize("name", ["example2", "curved_h8"])
def test_the_table_of_shells_is_what_the_script_measures(name, monkeypatch):
    monkeypatch.setattr(validation, "SHELL_CASES", (name,))
    [found] = validation.shell_rows()
    rows = block((ROOT / "docs" / "validation.md").read_text("utf-8"), "shell")
    [written] = [row for row in rows if row[0] == found[0]]
    assert written[1] == found[1]
    numbers = np.array([[cell.replace("−", "-") for cell in row[2:]] for row in (written, found)], dtype=float)
    np.testing.assert_allclose(*numbers, atol=0.021)


def test_the_table_of_peers_is_what_the_script_measures():
    rows = block((ROOT / "docs" / "validation.md").read_text("utf-8"), "peers")
    assert [row[0] for row in rows] == list(peers.PEERS)
    name = peers.POSES[2]
    for row in rows[:-1]:  # the last needs MuJoCo
        found = peers.off(peers.PEERS[row[0]](name), shell(name))
        assert float(row[3]) == pytest.approx(found, abs=0.011)


@pages
def test_lines_fit_the_page(page):
    lines = page.read_text().splitlines()
    assert not [line for line in lines if len(line) > 125 and not line.startswith(("|", "!"))]


def test_pictures_are_small_and_used():
    text = "".join(page.read_text() for page in PAGES)
    for picture in (ROOT / "docs" / "figures").iterdir():
        assert picture.stat().st_size < LARGEST_PICTURE
        assert f"figures/{picture.name})" in text


def test_the_reference_has_all_names():
    text = "".join(page.read_text() for page in (ROOT / "docs" / "python").iterdir())
    documented = re.findall(r"^\.\. auto(?:function|class|exception):: (\w+)$", text, re.MULTILINE)
    assert sorted(documented) == sorted(set(fb.__all__) - {"__version__"})
