"""Checks the wheel of `make wheel`: it has all files and no others, and runs without cargo."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
DIST = ROOT / "dist"
OUT = ROOT / "out" / "wheel"
METADATA = ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE")


def main() -> None:
    [wheel] = DIST.glob("*.whl")
    [sources] = DIST.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    check_names(contents)
    check_paths(contents)
    check_glibc(wheel.name, contents)
    run(wheel)
    for made in (wheel, sources):
        print(f"{made.relative_to(ROOT)} written, {made.stat().st_size / 1e6:.1f} MB")
    print(f"installed without cargo; what it solved there is in {OUT.relative_to(ROOT)}")


def check_names(contents: dict[str, bytes]) -> None:
    """Modules, stubs, scenarios, core and licence, and nothing else."""
    package = ROOT / "python" / "fishbone"
    files = [*package.rglob("*.py"), *package.glob("*.pyi"), package / "py.typed", *package.glob("scenarios/*.toml")]
    expected = {f"fishbone/{file.relative_to(package).as_posix()}" for file in files}
    found = {re.sub(r"^fishbone-[^/]+\.dist-info/", "dist-info/", name) for name in contents}
    core = {name for name in found if re.fullmatch(r"fishbone/_core\.(abi3\.so|pyd)", name)}
    expected |= core | {f"dist-info/{name}" for name in METADATA}
    if found != expected or len(core) != 1:
        sys.exit(f"wheel: missing {sorted(expected - found)}, not expected {sorted(found - expected)}, core {core}")


def check_paths(contents: dict[str, bytes]) -> None:
    """The wheel has no path of this machine."""
    places = {str(Path.home()), str(ROOT), os.environ.get("CARGO_HOME", ""), tempfile.gettempdir()} - {"", "/"}
    for name, content in contents.items():
        for place in places:
            if f"{place}/".encode() in content:
                sys.exit(f"wheel: {name} names {place}")


def check_glibc(wheel: str, contents: dict[str, bytes]) -> None:
    """The core needs no symbol of a younger glibc than the name of the wheel promises."""
    promised = re.search(r"manylinux_(\d+)_(\d+)_", wheel)
    if promised is None:
        return
    newest = tuple(map(int, promised.groups()))
    needed = re.findall(rb"\0GLIBC_(\d+)\.(\d+)", contents["fishbone/_core.abi3.so"])
    if not needed or max((int(major), int(minor)) for major, minor in needed) > newest:
        sys.exit(f"wheel: needs {needed}, promises glibc {newest}")


def run(wheel: Path) -> None:
    """Installs the wheel into an empty environment, and solves a shipped scenario there."""
    OUT.mkdir(parents=True, exist_ok=True)
    for file in OUT.iterdir():
        file.unlink()
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        programs = Path(folder) / ("Scripts" if os.name == "nt" else "bin")
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
        environment |= {
            "PATH": str(programs),
            "PIP_CONSTRAINT": str(ROOT / "requirements-dev.txt"),
            "PIP_DISABLE_PIP_VERSION_CHECK": "1",
            "PIP_ONLY_BINARY": ":all:",
        }
        for program, *arguments in (
            ["python", "-m", "pip", "--quiet", "install", f"{wheel}[plot]"],
            ["fishbone", "examples", "example1"],
            ["fishbone", "solve", "example1.toml", "--out", "example1.json", "--figure", "example1.png"],
        ):
            done = subprocess.run([programs / program, *arguments], cwd=OUT, env=environment, check=False)
            if done.returncode != 0:
                sys.exit(f"wheel: {program} {' '.join(arguments)}: exit code {done.returncode}")
    if not all((OUT / f"example1.{suffix}").stat().st_size for suffix in ("toml", "json", "png")):
        sys.exit(f"wheel: an empty file in {OUT}")


if __name__ == "__main__":
    main()
