"""Threads, signals, forks and pickles at once hang nothing; `benchmarks/stress.py` goes on for ten minutes."""

import os
import signal
import subprocess
import sys

import pytest

from conftest import ROOT

needs_unix = pytest.mark.skipif(
    not hasattr(os, "fork") or not hasattr(signal, "setitimer"), reason="there are no forks or timers on Windows"
)


@needs_unix
def test_nothing_hangs_while_threads_signals_forks_and_pickles_mix():
    words = [sys.executable, "benchmarks/stress.py", "--seconds", "5"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    counts, verdict = done.stdout.splitlines()
    assert verdict == "nothing hangs, nothing fails"
    assert all(f" {name}" in counts for name in ("forks", "moved", "pickled", "read", "signals", "solved"))
