"""The scripts of the folder examples: displays and simulators that keep up with a tracker."""

from __future__ import annotations

import asyncio
import functools
import runpy
import socket
import sys

import numpy as np
import pytest

import fishbone as fb
from conftest import ROOT

EXAMPLES = ROOT / "examples"


@pytest.fixture
def display(monkeypatch):
    """The names of the example of viser, whose server listens on a free port of this machine alone."""
    viser = pytest.importorskip("viser")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        _, port = free.getsockname()
    callbacks = []
    monkeypatch.setattr(viser, "ViserServer", functools.partial(viser.ViserServer, "127.0.0.1", port))
    monkeypatch.setattr(viser.TransformControlsHandle, "on_update", lambda _, callback: callbacks.append(callback))
    names = runpy.run_path(EXAMPLES / "viser_tracker.py")
    yield names | {"callbacks": callbacks}
    names["server"].stop()


def drag(display, position):
    """What viser does when the gizmo is dragged."""
    display["gizmo"].position = position
    [callback] = display["callbacks"]
    asyncio.run(callback(None))


def test_the_belt_of_viser_follows_the_gizmo(display):
    before = np.array(display["belt"].vertices)
    drag(display, (0.0, 0.6, 0.1))
    np.testing.assert_allclose(display["tracker"].position[-1], [0.0, 0.6, 0.1], atol=1e-7)
    after = display["belt"].vertices
    np.testing.assert_allclose(after, display["tracker"].surface().reshape(-1, 3), atol=1e-6)
    assert np.abs(after - before).max() > 0.05
    assert tuple(display["belt"].color) == display["BLUE"]


def test_the_belt_of_viser_is_red_where_it_cannot_follow(display):
    before = np.array(display["belt"].vertices)
    drag(display, (0.0, 2.0, 0.0))
    np.testing.assert_array_equal(display["belt"].vertices, before)
    assert tuple(display["belt"].color) == display["RED"]
    drag(display, (0.0, 0.6, 0.1))
    assert tuple(display["belt"].color) == display["BLUE"]


def test_the_gripper_of_mujoco_carries_the_force_of_the_sheet_that_is_drawn(capsys):
    mujoco = pytest.importorskip("mujoco")
    names = runpy.run_path(EXAMPLES / "mujoco_tracker.py")
    model, data, gripper = names["model"], names["data"], names["gripper"]
    assert gripper.xpos[1] < 0.071

    # At rest the drive carries what a sheet solved afresh between the same clamps needs.
    tables = fb.load("scenarios/polystyrene.toml").to_dict()
    tables["supports"][1]["position"] = gripper.xpos.tolist()
    solved = fb.solve(fb.Scenario.from_dict(tables | {"solver": {"elements": 40}}))
    force = solved.reaction("end").force[1]
    assert force < -0.01
    assert data.actuator_force[0] == pytest.approx(force, rel=1e-5)
    assert f"{1e3 * force:.3f} mN" in capsys.readouterr().out

    scene = mujoco.MjvScene(model, maxgeom=10)
    view = mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, *view, scene)
    np.testing.assert_allclose(scene.skinvert.reshape(-1, 3), solved.mesh(fixed=True)[0], atol=1e-6)
    np.testing.assert_array_equal(model.skin_face, solved.surface_triangles())


@pytest.mark.parametrize("package", ["viser", "mujoco"])
def test_an_example_without_its_package_ends_with_the_command_that_installs_it(monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SystemExit) as end:
        runpy.run_path(EXAMPLES / f"{package}_tracker.py")
    assert end.value.code == f'{package} is not installed: pip install "fishbone[robot]"'


def test_a_random_tree_of_trackers_grows_around_the_ball(capsys):
    names = runpy.run_path(EXAMPLES / "rrt.py")
    trackers, poses, parents = names["trackers"], names["poses"], names["parents"]
    assert len(trackers) > 100
    for tracker, pose in list(zip(trackers, poses, strict=False))[::20]:
        np.testing.assert_allclose(tracker.position[-1], pose[:3], atol=1e-7)
        assert tracker.equilibrium().status == "converged"
        assert names["is_free"](tracker)
    steps = np.linalg.norm(poses[1 : len(trackers)] - poses[parents[1:]], axis=1)
    assert steps.max() <= names["STEP"] * (1.0 + 1e-9)
    assert np.linalg.norm(poses[len(trackers) - 1] - names["GOAL"]) < names["STEP"]
    assert f"{len(trackers)} nodes of {names['tried']} steps" in capsys.readouterr().out
