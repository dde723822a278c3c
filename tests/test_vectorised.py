"""Kernels that take several elements at a time are vectorised in the core that is installed.

A branch in a lane, or a helper that is not inlined, makes the compiler take the lanes one after the other: no result
changes, and the speed is gone. So the tests count the vector instructions of the built core. The count needs no clock
and no second build, and it includes the optimisation of the whole core, which the assembly of the crate alone does not.

The core has no names of functions. Its tables for unwinding have the first and last address of each function. The rest
of the core is made for processors without AVX, so that an instruction that begins with v belongs to a kernel. Kernels
of matrixmultiply fuse products with sums; those of this project never do, for results that are the same on every
processor.
"""

from __future__ import annotations

import bisect
import platform
import re
import shutil
import subprocess
import sys
from collections import Counter

import pytest

from fishbone import _core

# As in `15fff0:  vmulpd %zmm1,%zmm2,%zmm3`.
ARITHMETIC = re.compile(
    r"^ *(?P<address>[0-9a-f]+):\s+v(?P<what>add|sub|mul|div|sqrt|fn?m\w+)(?P<kind>[ps]d)\s+(?P<operands>.*)",
    re.MULTILINE,
)
START = re.compile(r"pc=([0-9a-f]+)\.\.")
# Numbers that one instruction works on.
WIDTHS = {"zmm": 8, "ymm": 4, "xmm": 2, "scalar": 1}


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture(scope="module")
def kernels():
    """Arithmetic instructions of each function that is made for AVX, by the registers that they work on."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the instructions that are counted are those of x86-64, in the ELF files of Linux")
    if not (shutil.which("objdump") and shutil.which("readelf")):
        pytest.skip("the core is taken apart by objdump and readelf, and one is missing: install binutils")
    starts = sorted(int(start, 16) for start in START.findall(output("readelf", "--debug-dump=frames", _core.__file__)))
    found = {}
    for line in ARITHMETIC.finditer(output("objdump", "-d", "--no-show-raw-insn", _core.__file__)):
        start = bisect.bisect_right(starts, int(line["address"], 16)) - 1
        registers = "scalar" if line["kind"] == "sd" else re.search("[xyz]mm", line["operands"])[0]
        found.setdefault(start, Counter())["fused" if line["what"].startswith("f") else registers] += 1
    return [counts for counts in found.values() if not counts["fused"]]


def scalar_share(counts):
    """Share of the numbers that instructions on single numbers work on."""
    numbers = {registers: width * counts[registers] for registers, width in WIDTHS.items()}
    return numbers["scalar"] / sum(numbers.values())


@pytest.mark.parametrize(("registers", "more_than"), [("zmm", 150), ("ymm", 300)])
def test_kernels_of_elements_take_all_lanes_at_a_time(kernels, registers, more_than):
    # The motions of developable strips and of thick ones, and for the source's energy and for the plate's, the
    # derivatives. A loop that takes the lanes one by one is a few instructions here, and as many again for every lane
    # when it runs: a kernel with such a loop is none of these.
    of_elements = [counts for counts in kernels if set(counts) == {registers} and counts[registers] > more_than]
    assert len(of_elements) == 4, kernels


@pytest.mark.parametrize("registers", ["zmm", "ymm"])
def test_derivatives_of_thick_strips_take_most_lanes_at_a_time(kernels, registers):
    # On straight boards and on curved ones. The functions of the edge layers and a part of the work along the chain
    # take the lanes one by one.
    thick = [counts for counts in kernels if counts[registers] > 1000 and counts["scalar"]]
    assert len(thick) == 2, kernels
    assert all(scalar_share(counts) < 0.06 for counts in thick), thick


def test_kernels_of_stages_work_on_several_numbers_at_a_time(kernels):
    # Of the elimination of belts 0.07 is scalar: pivots are divided by one after the other. Of that of the programme
    # that proves flat parts stable it is 0.16, and 0.25 and 0.27 of the steps there: its odd size leaves a remainder,
    # and ties of controls, at joints alone, are products of small matrices.
    # The compiler makes some of the kernels twice, one for each part of the core that calls them.
    distinct = {tuple(sorted(counts.items())): scalar_share(counts) for counts in kernels}
    assert max(distinct.values()) < 0.28, kernels
    # A fourth such kernel has lost its lanes.
    assert sum(share >= 0.15 for share in distinct.values()) == 3, kernels
