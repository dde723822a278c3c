"""The tables and pictures of docs/performance.md, from results/speed.json alone."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from speed.problem import EXAMPLES
from speed.rivals import OURS
from tables import ROOT, table, write

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    Record = dict[str, Any]
    Rows = list[list[str]]

RESULT = ROOT / "benchmarks" / "results" / "speed.json"
PAGE = ROOT / "docs" / "performance.md"
FIGURES = ROOT / "docs" / "figures"
SCHEMA = "fishbone.speed/1"


def load(path: Path = RESULT) -> Record:
    """A saved run."""
    result: Record = json.loads(path.read_text(encoding="utf-8"))
    if result["schema"] != SCHEMA:
        raise ValueError(f"{path}: found schema {result['schema']}, allowed {SCHEMA}")
    return result


def significant(value: float, digits: int = 3) -> str:
    """A number in so many significant digits, never in powers of ten."""
    decimals = max(0, digits - 1 - int(f"{value:e}".split("e")[1]))
    return f"{value:.{decimals}f}"


def ratio(value: float, ours: float | None) -> str:
    """The ratio to our value."""
    return "" if ours is None else f"{significant(value / ours, 2)} ×"


def milliseconds(seconds: float) -> str:
    """A time in ms."""
    return significant(1e3 * seconds)


def _ours(records: list[Record], **case: str) -> float | None:
    found = (r["p50"] for r in records if all(r[key] == value for key, value in ({"rival": OURS} | case).items()))
    return next(found, None)


def cold_rows(result: Record, example: str) -> Rows:
    """One row a rival and energy."""
    rows = []
    for r in result["cold"]:
        if r["example"] == example:
            case = {"example": example, "energy_model": r["energy_model"]}
            is_chain = r["rival"].startswith("MuJoCo")
            rows.append(
                [
                    r["rival"],
                    "its own" if is_chain else f"`{r['energy_model']}`",
                    milliseconds(r["p50"]),
                    milliseconds(r["min"]),
                    ratio(r["p50"], _ours(result["cold"], **case)),
                    str(r["iterations"]) if r["converged"] else f"{r['iterations']}, not converged",
                    milliseconds(r["p50"] / r["iterations"]),
                    significant(1e3 * r["distance"]),
                ]
            )
    return rows


def random_rows(result: Record) -> Rows:
    """One row a rival."""
    rows = []
    for r in result["random"]:
        shapes = r["shapes"]
        kinds = ["–"] * 3 if shapes is None else [str(shapes[kind]) for kind in ("same", "lower", "higher")]
        counts = [str(r["poses"]), str(r["converged"]), *kinds]
        rows.append([r["rival"], *counts, milliseconds(r["p50"]), ratio(r["p50"], _ours(result["random"]))])
    return rows


def warm_rows(result: Record, example: str) -> Rows:
    """One row a rival."""
    return [
        [
            r["rival"],
            str(r["updates"]),
            str(r["failures"]),
            f"{r['iterations']:.1f}",
            *(milliseconds(r[percentile]) for percentile in ("p50", "p99", "p99.9")),
            ratio(r["p50"], _ours(result["warm"], example=example)),
        ]
        for r in result["warm"]
        if r["example"] == example
    ]


def branch_rows(result: Record) -> Rows:
    """One row an energy and example."""
    return [
        [f"{r['example']}, `{r['energy_model']}`", str(r["updates"]), str(r["apart"]), str(r["snaps"])]
        for r in result["branches"]
    ]


def derivative_rows(result: Record) -> Rows:
    """One row an example: times, and times in iterations."""
    return [
        [
            r["example"],
            *(
                f"{significant(1e6 * r[part], 2)} ({significant(r[part] / r['iteration'], 2)})"
                for part in ("iteration", "factorise", "forward", "adjoint", "jacobian")
            ),
        ]
        for r in result["derivatives"]
    ]


def scaling_rows(result: Record) -> Rows:
    """One row a mesh."""
    return [
        [
            str(r["elements"]),
            str(r["iterations"]),
            milliseconds(r["per_iteration"]),
            significant(1e6 * r["per_iteration"] / r["elements"]),
            significant(r["megabytes"], 2),
            significant(1e3 * r["megabytes"] / r["elements"], 2),
        ]
        for r in result["scaling"]
    ]


def batch_rows(result: Record) -> Rows:
    """One row a number of threads."""
    return [
        [
            str(r["threads"]),
            str(r["scenarios"]),
            str(r["converged"]),
            significant(r["seconds"]),
            significant(r["scenarios"] / r["seconds"]),
            f"{result['batch'][0]['seconds'] / r['seconds']:.2f}",
        ]
        for r in result["batch"]
    ]


def instruction_rows(result: Record) -> Rows:
    """One row an example."""
    return [[r["example"], significant(1e-6 * r["instructions"])] for r in result["instructions"]]


MACHINE = ["", "this run"]
COLD = [
    "",
    "density",
    "p50 [ms]",
    "least [ms]",
    "p50 over ours",
    "iterations",
    "ms an iteration",
    "from the shell [1e-3 U]",
]
RANDOM = ["", "poses", "converged", "our shape", "of less energy", "of more", "p50 [ms]", "over ours"]
WARM = ["", "updates", "failed", "iterations", "p50 [ms]", "p99", "p99.9", "p50 over ours"]
BRANCHES = ["", "updates", "on another branch", "snaps reported"]
DERIVATIVES = ["µs (iterations)", "iteration", "factorise", "forward product", "adjoint product", "Jacobian"]
SCALING = ["elements", "iterations", "ms an iteration", "µs an iteration and element", "memory [MB]", "kB an element"]
BATCH = ["threads", "scenarios", "converged", "time [s]", "a second", "speed-up"]
INSTRUCTIONS = ["", "instructions [10⁶]"]


def sections(result: Record) -> Iterator[tuple[str, list[str], Rows]]:
    """Name, header and rows of every table."""
    yield "machine", MACHINE, machine_rows(result)
    for example in EXAMPLES:
        yield f"cold {example}", COLD, cold_rows(result, example)
    yield "random", RANDOM, random_rows(result)
    for example in EXAMPLES:
        yield f"warm {example}", WARM, warm_rows(result, example)
    yield "branches", BRANCHES, branch_rows(result)
    yield "derivatives", DERIVATIVES, derivative_rows(result)
    yield "scaling", SCALING, scaling_rows(result)
    yield "batch", BATCH, batch_rows(result)
    yield "instructions", INSTRUCTIONS, instruction_rows(result)


def text(header: list[str], rows: Rows) -> str:
    """A table of the page, or a sentence for a section that was not run."""
    return table(header, rows) if rows else "Not measured."


def machine_rows(result: Record) -> Rows:
    """Machine, date and versions of the run."""
    threads = f"{result['threads']}, unless stated otherwise"
    return [
        ["processor", f"{result['processor']}, {result['cores']} cores, {result['system']}"],
        ["threads", threads],
        ["commit", f"{result['commit']}, {result['date']}"],
        ["versions", ", ".join(f"{name} {version}" for name, version in result["versions"].items())],
    ]


def show(result: Record) -> None:
    """The tables on the terminal."""
    console = Console()
    for name, header, rows in sections(result):
        if rows:
            shown = Table(*header, title=name)
            for row in rows:
                shown.add_row(*row)
            console.print(shown)


def write_page(result: Record) -> None:
    """The tables into the page."""
    for name, header, rows in sections(result):
        write(name, text(header, rows), PAGE)


def draw(result: Record) -> None:
    """The pictures of the page."""
    _save(_bars(result["cold"], "energy_model", "fishbone", ("min", "p50")), "speed_cold")
    if result["warm"]:
        _save(_bars(result["warm"], "rival", None, ("p50", "p99", "p99.9")), "speed_warm")


def _bars(records: list[Record], key: str, value: str | None, spans: tuple[str, ...]) -> Figure:
    """Times by rival on a logarithmic scale, one panel an example: a mark each percentile, joined."""
    figure = Figure(figsize=(7.0, 2.4), layout="constrained")
    for axes, example in zip(figure.subplots(1, 2, sharex=True, sharey=True), EXAMPLES, strict=True):
        shown = [r for r in records if r["example"] == example and (value is None or r[key] == value)]
        names = [r["rival"] for r in shown]
        for row, r in enumerate(shown):
            times = [1e3 * r[span] for span in spans]
            axes.plot(times, [row] * len(times), color="0.6", linewidth=1.0, zorder=1)
        for span, marker in zip(spans, "os^", strict=False):
            axes.plot(
                [1e3 * r[span] for r in shown], range(len(shown)), marker, color="0.0", markersize=4.0, label=span
            )
        axes.set(xscale="log", xlabel="time [ms]", title=example.replace("example", "Example "))
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.grid(visible=True, color="0.9", linewidth=0.5)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=8.0)
    return figure


def _save(figure: Figure, name: str) -> None:
    for axes in figure.axes:
        for label in (axes.title, axes.xaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()):
            label.set_fontsize(8.0)
    figure.savefig(FIGURES / f"{name}.png", metadata={"Software": None}, dpi=200.0)
