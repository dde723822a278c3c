"""Plans a way of a belt's end to a pose, around a ball, on which the belt never snaps: a rapidly exploring random tree.

Every node of the tree has a tracker of its own, a copy of its parent's that has been led one small step farther. Run it
from the root of the repository. It prints the size of the tree, its rate, and the length of the way.
"""

import time

import numpy as np

import fishbone as fb

TRIES, STEP, BIAS = 5000, 0.03, 0.1
"""Steps that are tried; length of a step, in the unit of length and rad; share of them that go straight to the goal."""
LOW, HIGH = np.array([-0.1, 0.3, 0.0, -0.1, -0.3, -0.1]), np.array([0.35, 0.7, 0.3, 0.5, 0.3, 0.5])
"""Positions and rotation vectors of the end that are tried."""
GOAL = np.array([0.25, 0.45, 0.2, 0.3, 0.0, 0.4])
BALL, RADIUS = np.array([0.36, 0.3, 0.15]), 0.03


def is_free(tracker: fb.Tracker) -> bool:
    """Whether the centre line of the belt is clear of the ball."""
    return np.linalg.norm(tracker.position - BALL, axis=1).min() > RADIUS


tables = fb.load("scenarios/example1.toml").to_dict()
tracker = fb.Tracker(fb.Scenario.from_dict(tables | {"solver": {"elements": 40}}))
poses = np.zeros((TRIES + 1, 6))
poses[0, :3] = tracker.position[-1]
trackers, parents = [tracker], [0]
random = np.random.default_rng(0)
began = time.perf_counter()

for tried in range(1, TRIES + 1):  # noqa: B007 - its last value is printed
    wanted = GOAL if random.random() < BIAS else random.uniform(LOW, HIGH)
    ways = wanted - poses[: len(trackers)]
    distances = np.linalg.norm(ways, axis=1)
    nearest = int(np.argmin(distances))
    pose = poses[nearest] + min(1.0, STEP / distances[nearest]) * ways[nearest]
    fork = trackers[nearest].copy()
    update = fork.update(pose[:3], pose[3:], max_iterations=20)
    if update.status == "converged" and not update.snapped and is_free(fork):
        poses[len(trackers)] = pose
        trackers.append(fork)
        parents.append(nearest)
        if np.linalg.norm(pose - GOAL) < STEP:
            break

seconds = time.perf_counter() - began
left = np.linalg.norm(poses[: len(trackers)] - GOAL, axis=1)
way = [int(np.argmin(left))]
while way[0]:
    way.insert(0, parents[way[0]])
print(f"{len(trackers)} nodes of {tried} steps, {tried / seconds:.0f} steps a second")
print(f"a way of {len(way)} poses leads up to {min(left):.3f} from the goal")
