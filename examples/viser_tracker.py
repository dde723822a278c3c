"""A belt in the browser: drag the gizmo at its end, and the belt follows; it is red where it cannot follow.

Run it from the root of the repository. Ctrl-C ends it.
"""

import sys

import fishbone as fb

try:
    import viser
except ImportError:
    sys.exit(str(fb.MissingPackage("viser", "robot")))

BLUE, RED = (90, 200, 255), (230, 60, 60)

tables = fb.load("scenarios/example1.toml").to_dict()
# On a mesh of a fixed number of elements all shapes have the same triangles.
tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"solver": {"elements": 80}}))
vertices, faces = tracker.equilibrium().mesh(fixed=True)

server = viser.ViserServer()
belt = server.scene.add_mesh_simple("/belt", vertices, faces, color=BLUE, side="double")
gizmo = server.scene.add_transform_controls("/end", scale=0.2, position=tracker.position[-1])


@gizmo.on_update
async def follow(_: viser.TransformControlsEvent) -> None:
    """Leads the end of the belt to the gizmo; viser calls coroutines one after another."""
    update = tracker.update(fb.Pose.from_quaternion(gizmo.position, gizmo.wxyz))
    belt.vertices = tracker.surface().reshape(-1, 3)
    belt.color = BLUE if update.status == "converged" else RED


if __name__ == "__main__":
    server.sleep_forever()
