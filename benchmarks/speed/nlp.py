"""CasADi with IPOPT or with fatrop on the core's own discrete programme (transcription.py)."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from speed.problem import TOLERANCE, Answer, Energy, Pose
from speed.stopwatch import timed
from speed.transcription import CONTROL, END, STATE, Form, Programme

if TYPE_CHECKING:
    from collections.abc import Callable

    from speed.problem import Floats

    Solver = Callable[..., dict[str, Any]]

ITERATIONS = 500
QUIET = {"print_time": False, "show_eval_warnings": False}
MUMPS = {
    "mumps_pivot_order": 0,
    "mumps_scaling": 0,
    "mumps_permuting_scaling": 0,
    "fast_step_computation": "yes",
}
"""Minimum degree and no scaling: a fifth to a third less time here than with the defaults."""
PUSHES = (
    "warm_start_bound_push",
    "warm_start_bound_frac",
    "warm_start_slack_bound_push",
    "warm_start_slack_bound_frac",
    "warm_start_mult_bound_push",
)


class Nlp:
    """A programme with a solver for cold starts and a solver with other settings for warm starts."""

    def __init__(self, programme: Programme, cold: Solver, warm: Solver) -> None:
        self.programme, self.solvers = programme, {"cold": cold, "warm": warm}
        self.bounds = {
            "lbx": programme.lower,
            "ubx": programme.upper,
            "lbg": programme.lowest,
            "ubg": programme.highest,
        }

    def cold(self, pose: Pose) -> Answer:
        """From the core's guess."""
        return self._run("cold", pose, {"x0": self.programme.start(pose)})

    def warm(self, pose: Pose) -> Answer:
        """From the last shape and its multipliers."""
        last = {"x0": self.found["x"], "lam_x0": self.found["lam_x"], "lam_g0": self.found["lam_g"]}
        return self._run("warm", pose, last)

    def _run(self, start: str, pose: Pose, given: dict[str, Any]) -> Answer:
        solver: Any = self.solvers[start]
        parameters = self.programme.parameters(pose)
        seconds, self.found = timed(solver, p=parameters, **self.bounds, **given)
        statistics = solver.stats()
        return Answer(bool(statistics["success"]), seconds, int(statistics["iter_count"]), float(self.found["f"]))

    def curve(self) -> tuple[Floats, Floats]:
        """Positions and tangents of the last answer."""
        return self.programme.curve(np.asarray(self.found["x"]).ravel())


def ipopt_interpreted(energy: Energy, elements: int) -> Nlp:
    """CasADi derives the whole programme, expanded to scalars, and interprets the derivatives."""
    programme = Programme(Form.NODAL, energy, elements)
    return _ipopt(programme, programme.plain(), {"expand": True})


def ipopt_compiled(energy: Energy, elements: int) -> Nlp:
    """Derivatives of one element mapped over the belt, compiled; MUMPS set for programmes of this size."""
    programme = Programme(Form.NODAL, energy, elements)
    with TemporaryDirectory() as folder:
        return _ipopt(programme, programme.compiled(for_fatrop=False, folder=Path(folder)), {})


def _ipopt(programme: Programme, source: dict[str, Any] | str, options: dict[str, Any]) -> Nlp:
    common = {"print_level": 0, "sb": "yes", "tol": TOLERANCE, "max_iter": ITERATIONS} | MUMPS
    near = {"warm_start_init_point": "yes", "mu_init": 1e-6} | dict.fromkeys(PUSHES, 1e-6)
    cold, warm = (
        ca.nlpsol("solver", "ipopt", source, QUIET | options | {"ipopt": settings})
        for settings in (common, common | near)
    )
    return Nlp(programme, cold, warm)


def fatrop_compiled(energy: Energy, elements: int) -> Nlp:
    """Stage by stage for fatrop's Riccati recursion, compiled; it estimates multipliers anew at every start."""
    programme = Programme(Form.STAGED, energy, elements)
    structure = {
        "structure_detection": "manual",
        "nx": [1] + [STATE] * elements,
        "nu": [CONTROL] * elements + [0],
        "ng": [0] * elements + [END],
        "N": elements,
        "equality": [True] * len(programme.highest),
    }
    common = {"print_level": 0, "tolerance": TOLERANCE, "max_iter": ITERATIONS}
    near = {"mu_init": 1e-8, "bound_push": 1e-9, "bound_frac": 1e-9}
    with TemporaryDirectory() as folder:
        source = programme.compiled(for_fatrop=True, folder=Path(folder))
        cold, warm = (
            ca.nlpsol("solver", "fatrop", source, QUIET | structure | {"fatrop": settings})
            for settings in (common, common | near)
        )
    return Nlp(programme, cold, warm)
