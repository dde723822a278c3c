"""Measures the times of fishbone and of its alternatives: `make bench`.

    python -m speed [--only cold warm …] [--dry-run]

Saves results/speed.json and writes the tables and pictures of docs/performance.md from it; with --dry-run it only shows
them. Sections that are left out by --only are saved as not measured.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import time
from datetime import datetime, timezone
from importlib.metadata import version
from typing import Any

from speed import measure, report
from tables import ROOT
from validation import processor

PACKAGES = ("fishbone", "casadi", "mujoco", "scipy", "numpy")


def about() -> dict[str, Any]:
    """Machine, date and versions of the run."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],  # noqa: S607
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return {
        "schema": report.SCHEMA,
        "date": datetime.now(timezone.utc).date().isoformat(),
        "commit": commit.stdout.strip(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "threads": 1,
        "versions": {"python": platform.python_version()} | {package: version(package) for package in PACKAGES},
    }


def main() -> None:
    """Measures, saves, writes, shows."""
    parser = argparse.ArgumentParser(prog="speed", description="Speed of fishbone and of its rivals.")
    parser.add_argument("--only", nargs="+", choices=measure.SECTIONS, default=list(measure.SECTIONS))
    parser.add_argument("--dry-run", action="store_true", help="show the tables, save and write nothing")
    arguments = parser.parse_args()
    start = time.monotonic()
    sections = {name: run() if name in arguments.only else [] for name, run in measure.SECTIONS.items()}
    result = about() | sections
    report.show(result)
    if not arguments.dry_run:
        report.RESULT.parent.mkdir(exist_ok=True)
        report.RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        report.write_page(result)
        report.draw(result)
    print(f"measured in {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
