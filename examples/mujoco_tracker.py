"""A gripper in MuJoCo moves the end of a sheet along a rail and carries its force; the sheet is a skin of the model.

Run it from the root of the repository. It prints the forces at rest and ends.
"""

import sys

import numpy as np

import fishbone as fb

try:
    import mujoco
except ImportError:
    sys.exit(str(fb.MissingPackage("mujoco", "robot")))

STEPS, STROKE = 500, 0.03
GRIPPER = """
<mujoco>
  <worldbody>
    <body name="gripper" pos="0 0.1 0.02">
      <joint name="rail" type="slide" axis="0 1 0" damping="10"/>
      <geom type="box" size="0.01 0.01 0.01" mass="0.1"/>
    </body>
  </worldbody>
  <actuator><position joint="rail" kp="400"/></actuator>
</mujoco>
"""

tables = fb.load("scenarios/polystyrene.toml").to_dict()
# On a mesh of a fixed number of elements all shapes have the same triangles.
tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"solver": {"elements": 40}}))
vertices, faces = tracker.equilibrium().mesh(fixed=True)

spec = mujoco.MjSpec.from_string(GRIPPER)
# The only bone of the skin is the world, so that its vertices are in world axes.
skin = spec.add_skin(name="sheet", vert=vertices.ravel(), face=faces.ravel())
skin.bodyname, skin.bindpos, skin.bindquat = ["world"], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
skin.vertid, skin.vertweight = [np.arange(len(vertices))], [np.ones(len(vertices))]
model = spec.compile()
data = mujoco.MjData(model)
gripper = data.body("gripper")

for step in range(STEPS):
    data.ctrl = -STROKE * min(1.0, 2.0 * step / STEPS)
    mujoco.mj_step(model, data)
    tracker.update(fb.Pose.from_quaternion(gripper.xpos, gripper.xquat))
    force, moment = tracker.reaction("end")  # of the gripper on the sheet, about the gripper's centre of mass
    gripper.xfrc_applied = -np.concatenate([force, moment])
    model.skin_vert[:] = tracker.surface().reshape(-1, 3)

print(f"force of the drive {1e3 * data.actuator_force[0]:.3f} mN, of the gripper on the sheet {1e3 * force[1]:.3f} mN")
