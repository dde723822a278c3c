"""Instructions of a solve and of a warm update, of this build and of another one, counted by callgrind.

    python benchmarks/instructions.py [--against PYTHON]

PYTHON is the interpreter of an environment in which the other build is installed. Instructions can be compared where
the clock cannot, on machines that do other work: two counts of one build differ by less than a thousandth. callgrind
knows no AVX-512, so both are counted without. Of the updates, those of the scenario `curved` are of a board that is an
arc: their ratio to those of example 1, a straight board of as many elements, is the price of curved edges.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import track
from rich.table import Table

from speed import measure
from speed.problem import EXAMPLES, TRACKED

if TYPE_CHECKING:
    from collections.abc import Callable

COUNTS: dict[str, tuple[Callable[[str, str], int], tuple[str, ...]]] = {
    "cold solve": (measure.cold_instructions, EXAMPLES),
    "warm update": (measure.warm_instructions, TRACKED),
}
"""How each is counted, and of which scenarios."""


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--against", metavar="PYTHON", help="the Python that has the other build")
    options = parser.parse_args()
    if shutil.which("valgrind") is None:
        parser.error("valgrind is not installed")
    builds = [sys.executable] if options.against is None else [sys.executable, options.against]
    table = Table("instructions [10⁶]", "example")
    for header in ("this build", "the other", "this / other")[: 2 * len(builds) - 1]:
        table.add_column(header, justify="right")
    cases = [(what, example) for what, (_, examples) in COUNTS.items() for example in examples]
    for what, example in track(cases, "counting", console=Console(stderr=True), transient=True):
        count, _ = COUNTS[what]
        counts = [count(example, python) for python in builds]
        ratio = [f"{counts[0] / counts[1]:.4f}"] if len(counts) > 1 else []
        table.add_row(what, example, *(f"{1e-6 * count:.4f}" for count in counts), *ratio)
    Console().print(table)


if __name__ == "__main__":
    main()
