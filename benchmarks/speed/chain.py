"""MuJoCo: a chain of rigid links, simulated until it rests, as a robot programmer would do.

The elasticity plugin of MuJoCo 2 and 3, a cable, is not in MuJoCo 4, so this is that cable by hand: between two links a
hinge about ζ and one about η, with the belt's rigidity and its torsional rigidity as springs, none about ξ. Such a rod
knows of no ribs: it is another model, and its shape another shape.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from speed import guess
from speed.problem import LENGTH, Answer, Energy, Floats, Pose
from speed.stopwatch import timed

LINKS = 40
TORSION = 1.32
"""2(1 − ν) R_f: of a thin flat strip by Saint-Venant, ν = 0.34 as of the shell."""
STEP = 0.02
DAMPING = 0.03
"""Damping over stiffness [s]; with it the chain comes to rest soonest."""
INERTIA = 0.01
"""Added to every hinge: it changes the motion but not the shape at rest, and allows long steps."""
REST = 1e-4
"""Largest rate of a hinge at rest [rad/s]."""
BETWEEN = 10
"""Steps between checks of the rates."""
MOST = 2000
HELD = 1e-3
"""Distance [U] between the chain's end and its clamp above which it is not held."""


def _links(length: float) -> str:
    """Links within links, from the far end; the first and the last are half as long."""
    nested = ""
    for k in reversed(range(LINKS + 1)):
        own = 0.5 * length if k in {0, LINKS} else length
        before = 0.0 if k == 0 else 0.5 * length if k == 1 else length
        hinges = "".join(
            f'<joint type="hinge" axis="{axis}" stiffness="{rigidity / length}" '
            f'damping="{DAMPING * rigidity / length}" armature="{INERTIA}"/>'
            for axis, rigidity in (("0 0 1", 1.0), ("0 1 0", TORSION))
        )
        box = f'<geom type="box" size="0.0005 {0.5 * own} 0.05" pos="0 {0.5 * own} 0" mass="{own}"/>'
        nested = f'<body name="link{k}" pos="0 {before} 0">{hinges if k else ""}{box}{nested}</body>'
    return nested


def _model(length: float) -> str:
    return f"""<mujoco>
      <option timestep="{STEP}" gravity="0 0 0" integrator="implicitfast"><flag contact="disable"/></option>
      <worldbody><body name="clamp" mocap="true"/>{_links(length)}</worldbody>
      <equality>
        <weld body1="clamp" body2="link{LINKS}" relpose="0 {-0.5 * length} 0 1 0 0 0" solref="{2.0 * STEP} 1"
          solimp="0.999 0.9999 0.001"/>
      </equality>
    </mujoco>"""


class Chain:
    """The chain, of its own number of links; neither energy nor mesh of the others applies to it."""

    def __init__(self, energy: Energy, elements: int) -> None:
        del energy, elements
        self.length = LENGTH / LINKS
        self.model: Any = mujoco.MjModel.from_xml_string(_model(self.length))
        self.state: Any = mujoco.MjData(self.model)
        # `state.warning` reports a chain that flies apart; MuJoCo would also write a file of its own.
        mujoco.set_mju_user_warning(lambda _: None)

    def cold(self, pose: Pose) -> Answer:
        """From the core's guess, at rest."""
        mujoco.mj_resetData(self.model, self.state)
        self.state.qpos[0::2] = self.length * guess.bends(pose, (np.arange(LINKS) + 0.5) / LINKS)
        return self.warm(pose)

    def warm(self, pose: Pose) -> Answer:
        """From the current shape of the chain."""
        self.state.mocap_pos[0] = pose.position
        self.state.mocap_quat[0] = Rotation.from_rotvec(pose.rotation).as_quat(scalar_first=True)
        seconds, steps = timed(self._rest)
        energy = 0.5 * float(self.model.jnt_stiffness @ self.state.qpos**2)
        is_held = np.linalg.norm(self.curve()[0][-1] - pose.position) < HELD
        is_sound = self.state.warning.number.sum() == 0
        return Answer(bool(steps < MOST and is_held and is_sound), seconds, steps, energy)

    def _rest(self) -> int:
        """Steps until the chain rests."""
        for steps in range(BETWEEN, MOST, BETWEEN):
            mujoco.mj_step(self.model, self.state, BETWEEN)
            if np.abs(self.state.qvel).max() < REST:
                return steps
        return MOST

    def curve(self) -> tuple[Floats, Floats]:
        """Positions and tangents at equal distances: the middles of the links, and the two ends."""
        starts = self.state.xpos[2:]
        tangents = self.state.xmat[2:].reshape(-1, 3, 3)[:, :, 1]
        # Hinges are at the middles of elements: a node is in the middle of its link.
        nodes = starts + 0.5 * self.length * tangents
        nodes[0] = starts[0]
        return nodes, tangents
