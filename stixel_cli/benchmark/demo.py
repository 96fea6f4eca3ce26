"""The scans of the demo of Wahlström and Özkan's filter (2015), from its figures."""

import numpy as np

from stixel_cli.evaluation.contour_errors import even_points, in_frames, seen_points
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario


def demo_scans(scenario: Scenario, seed: int, count: int, std: float, whole: bool) -> Scans:
    """Scans of `count` of 720 points of the outline each, or only of the side that is seen.

    The error of a point is `std` m along each axis.
    """
    outlines, truth = scenario.contours_target, scenario.target_poses_world
    points = even_points(outlines, 720)
    sensors = in_frames(scenario.ego_poses_world[:, None, :2], truth)[:, 0]
    seen = whole | seen_points(points, outlines, scenario.limb_poses, sensors)
    scans = []
    for k, pose in enumerate(truth):
        random = generator(seed, "demo", k)
        drawn = random.choice(np.flatnonzero(seen[k]), count)
        measured = world_from_target(points[scenario.limb_poses[k]][drawn], pose)
        measured = measured + std * random.standard_normal((count, 2))
        scans.append((measured, np.tile(std**2 * np.eye(2), (count, 1, 1))))
    return Scans.of_each(scenario.times, scenario.ego_poses_world, scans)
