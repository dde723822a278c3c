"""What the tree promises of its structure: files that can be read at one sitting, a public core that can be known."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LONGEST = 500
"""Lines of code of a file, the largest number: without its tests, comments, docstrings and blank lines."""
PUBLIC = 259
"""Items of the core that other crates may use, the largest number."""
TEST_MODULE = re.compile(r"^#\[cfg\(test\)\]\nmod \w+ \{", re.MULTILINE)
PUBLIC_ITEM = re.compile(r"^\s*pub (?:const )?(?:fn|struct|enum|trait|const|type|static)\b", re.MULTILINE)
RUST = sorted(path for path in ROOT.glob("crates/*/src/**/*.rs") if path.name != "tests.rs")
PYTHON = sorted([*ROOT.glob("python/**/*.py"), *ROOT.glob("benchmarks/**/*.py"), *ROOT.glob("docs/*.py")])


def without_tests(path: Path) -> str:
    """The text of a Rust file before its tests."""
    return TEST_MODULE.split(path.read_text("utf-8"))[0]


def lines_of_rust(path: Path) -> int:
    """Lines of code."""
    lines = (line.strip() for line in without_tests(path).splitlines())
    return sum(bool(line) and not line.startswith("//") for line in lines)


def lines_of_python(path: Path) -> int:
    """Lines of code."""
    text = path.read_text("utf-8")
    strings = (
        range(node.lineno, (node.end_lineno or node.lineno) + 1)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    )
    documented = {line for lines in strings for line in lines}
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(bool(line) and not line.startswith("#") and number not in documented for number, line in lines)


@pytest.mark.parametrize(("paths", "count"), [(RUST, lines_of_rust), (PYTHON, lines_of_python)], ids=["rust", "python"])
def test_no_file_of_code_is_too_long_to_be_read_at_one_sitting(paths, count):
    assert len(paths) > 20
    long = {str(path.relative_to(ROOT)): count(path) for path in paths if count(path) > LONGEST}
    assert long == {}


def test_the_core_has_few_public_items():
    core = [path for path in RUST if path.is_relative_to(ROOT / "crates" / "fishbone")]
    items = sum(len(PUBLIC_ITEM.findall(without_tests(path))) for path in core)
    assert 100 < items <= PUBLIC
