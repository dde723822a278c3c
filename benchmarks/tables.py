"""Tables of Markdown files, written between the markers `<!-- name -->` and `<!-- /name -->`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

ROOT = Path(__file__).parent.parent
VALIDATION = ROOT / "docs" / "validation.md"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table, its first column to the left and all others to the right."""
    ruler = ["---"] + ["---:"] * (len(header) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, ruler, *rows))


def vector(components: Iterable[float], decimals: int = 4) -> str:
    """(x, y, z) with equal decimals and a proper minus; no −0."""
    return "(" + ", ".join(number(component, decimals) for component in components) + ")"


def number(value: float, decimals: int) -> str:
    """A decimal number with a proper minus; no −0."""
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}".replace("-", "−")


def signed(value: float, decimals: int) -> str:
    """A decimal number with its sign, but for 0."""
    text = number(value, decimals)
    return text if text.startswith("−") or float(text) == 0.0 else f"+{text}"


def scientific(value: float, decimals: int = 1) -> str:
    """A number in powers of ten."""
    mantissa, exponent = f"{float(value):.{decimals}e}".split("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def write(name: str, text: str, path: Path = VALIDATION) -> None:
    """Replaces what stands between the markers."""
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    before, rest = path.read_text(encoding="utf-8").split(begin)
    _, after = rest.split(end)
    path.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")
    print(f"{path.relative_to(ROOT)}: {name}")
