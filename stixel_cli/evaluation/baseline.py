"""The IoU of a plain estimate on the same scans, to which that of a tracker is compared."""

import numpy as np

from stixel_cli.evaluation.contour_errors import areas, in_frames, overlaps
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario

NEAR = 0.5
"""A point this near to the target's box, m, is taken as measured on the target."""


def baseline_overlaps(scenario: Scenario, scans: Scans) -> np.ndarray:
    """IoU (K,) of the true outline with itself, moved to the mean of the target's points.

    That is an estimate of the right shape and heading that takes the visible side, where the points
    are, for the whole target. NaN where the truth is unknown and at a scan without such points.
    """
    found = np.full(len(scans), np.nan)
    low, high = scenario.box_target
    for k in np.flatnonzero(scenario.known):
        pose = scenario.target_poses_world[k : k + 1]
        points = in_frames(scans.points_world[None, scans.rows(k)], pose)[0]
        points = points[((points > low - NEAR) & (points < high + NEAR)).all(axis=1)]
        if len(points):
            true = scenario.contours_target[scenario.limb_poses[k]]
            moved = true - 0.5 * (low + high) + points.mean(axis=0)
            (found[k],) = overlaps(areas(moved[None]), areas(true[None]))
    return found
