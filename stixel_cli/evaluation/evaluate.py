"""Scores of one track: conventions → validate → errors of each scan → metrics.

Conventions are those of `scan_errors.py`; the metrics are those of `metric_table.py`. A metric is
None if one of its errors is not finite; NIS and NEES are averaged over the scans that have one.
"""

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS, ScanErrors
from stixel_cli.evaluation.scan_errors import (
    centre_errors,
    intersections_over_unions,
    normalised_errors,
    orientation_errors,
)
from stixel_cli.evaluation.scores import Scores
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def validate(track: Track, scenario: Scenario, scans: Scans) -> None:
    """Raise ValueError unless all three have the same scans, at least one."""
    if len(scenario.times) == 0:
        raise ValueError("no scan to score")
    for name, times in (("track", track.times), ("scans", scans.times)):
        if not np.array_equal(times, scenario.times):
            raise ValueError(f"the times of the {name} differ from those of the scenario")
    if len(track.used_points) and track.used_points.max() >= len(scans.points_world):
        raise ValueError("the track used points that the scans do not have")


def evaluate(track: Track, scenario: Scenario, scans: Scans) -> Scores:
    """Errors over time and their summary; see `Scores` for units.

    Raises:
        ValueError: as `validate` does.
    """
    validate(track, scenario, scans)
    truth = scenario.target_poses_world
    true_contours = np.stack([world_from_target(scenario.contour_target, pose) for pose in truth])
    centre = centre_errors(track.means, truth)
    orientation = orientation_errors(track.means[:, 2], truth[:, 2])
    iou = intersections_over_unions(track.contours_world, true_contours)
    nees_position = normalised_errors(
        track.means[:, :2] - truth[:, :2], track.covariances[:, :2, :2]
    )
    nees_heading = normalised_errors(orientation[:, None], track.covariances[:, 2:3, 2:3])
    degrees = track.nis_degrees_of_freedom
    nis = np.divide(track.nis, degrees, out=np.full(len(degrees), np.nan), where=degrees > 0)

    errors = ScanErrors(
        centre=centre,
        orientation=np.degrees(orientation),
        iou=iou,
        nees_position=nees_position,
        nees_heading=nees_heading,
        nis=nis,
        points=np.diff(scans.offsets),
        points_used=np.diff(track.used_offsets),
    )
    return Scores(
        times=np.array(scenario.times, dtype=np.float64),
        centre_error=centre,
        orientation_error=orientation,
        iou=iou,
        nees_position=nees_position,
        nis=nis,
        metrics={name: metric.over_scans(errors) for name, metric in METRICS.items()},
    )
