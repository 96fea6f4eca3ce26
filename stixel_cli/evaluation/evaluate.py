"""Scores of one track: conventions → validate → metric functions → evaluate.

Conventions are those of `metrics.py`. A scan has low overlap if its IoU is below `LOW_OVERLAP`. The
second half begins at scan K // 2. A summary over scans is None where one of its errors is missing;
NIS and NEES are taken over the scans that have one.
"""

import numpy as np

from stixel_cli.evaluation.metrics import (
    centre_errors,
    intersections_over_unions,
    normalised_errors,
    orientation_errors,
)
from stixel_cli.evaluation.scores import LOW_OVERLAP, Scores
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def validate(track: Track, scenario: Scenario, scans: Scans) -> None:
    """Raise ValueError unless the three tell of the same scans, at least one."""
    if len(scenario.times) == 0:
        raise ValueError("no scan to score")
    for name, times in (("track", track.times), ("scans", scans.times)):
        if not np.array_equal(times, scenario.times):
            raise ValueError(f"the times of the {name} are not those of the scenario")
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

    count = len(scenario.times)
    half = count // 2
    metrics = {
        "centre_rmse_m": _root_mean_square(centre),
        "centre_mean_m": _mean(centre),
        "centre_rmse_second_half_m": _root_mean_square(centre[half:]),
        "centre_final_m": _mean(centre[-1:]),
        "orientation_rmse_deg": _root_mean_square(np.degrees(orientation)),
        "orientation_rmse_second_half_deg": _root_mean_square(np.degrees(orientation[half:])),
        "iou_mean": _mean(iou),
        "iou_second_half": _mean(iou[half:]),
        "iou_final": _mean(iou[-1:]),
        "low_overlap_share": _mean(iou < LOW_OVERLAP),
        "nees_position_mean": _mean(nees_position[np.isfinite(nees_position)]),
        "nees_heading_mean": _mean(nees_heading[np.isfinite(nees_heading)]),
        "nis_mean": _mean(nis[np.isfinite(nis)]),
        "scans": count,
        "empty_scans": int(np.sum(np.diff(scans.offsets) == 0)),
        "points_per_scan_mean": _mean(np.diff(scans.offsets)),
        "points_used_mean": _mean(np.diff(track.used_offsets)),
    }
    return Scores(
        times=np.array(scenario.times, dtype=np.float64),
        centre_error=centre,
        orientation_error=orientation,
        iou=iou,
        nees_position=nees_position,
        nis=nis,
        metrics=metrics,
    )


def _mean(values: np.ndarray) -> float | None:
    """Mean, or None if there is no value or one that is not finite."""
    values = np.asarray(values, dtype=np.float64)
    return float(values.mean()) if len(values) and np.isfinite(values).all() else None


def _root_mean_square(values: np.ndarray) -> float | None:
    """Root of the mean square, or None if there is no value or one that is not finite."""
    square = _mean(np.square(np.asarray(values, dtype=np.float64)))
    return None if square is None else float(np.sqrt(square))
