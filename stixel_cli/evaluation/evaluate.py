"""Scores of one track: conventions → validate → errors of each scan → metrics.

Conventions: K scans; poses (K, 3) = x m, y m, heading rad in the world; polygons (K, M, 2) m in the
world, the first vertex not repeated; errors are estimated minus true. Errors count at every scan,
also at empty ones; for a recording, only at the scans that `Scenario.scored` names. A missing value
is NaN, and so is an error at a scan without truth. The metrics are those of `metric_table.py`: a
metric is None if one of its errors is not finite, or if no scan counts; NIS and NEES are averaged
over the scans that have one.
"""

import numpy as np
import shapely

from stixel_cli.evaluation.metric_table import METRICS, ScanErrors, Scores
from stixel_cli.geometry.pose import world_from_target, wrap_angle
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
    known = np.isfinite(truth).all(axis=1)
    scored = known if scenario.scored is None else known & scenario.scored
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
        centre=centre[scored],
        orientation=np.degrees(orientation)[scored],
        iou=iou[scored],
        nees_position=nees_position[scored],
        nees_heading=nees_heading[scored],
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
        metrics={name: metric.of_run(errors) for name, metric in METRICS.items()},
    )


def centre_errors(estimated_world: np.ndarray, true_world: np.ndarray) -> np.ndarray:
    """Distance (K,) m of the centres, the first two columns of (K, …)."""
    offsets = estimated_world[:, :2] - true_world[:, :2]
    return np.hypot(offsets[:, 0], offsets[:, 1])


def orientation_errors(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Estimated minus true heading (K,), wrapped to (-pi, pi] rad."""
    return wrap_angle(np.asarray(estimated) - np.asarray(true))


def intersections_over_unions(estimated_world: np.ndarray, true_world: np.ndarray) -> np.ndarray:
    """IoU (K,) of the areas inside the polygons (K, M, 2) and (K, N, 2) m.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area consists of the
    points that it encloses an odd number of times. The IoU of a non-finite estimate is 0; it is NaN
    where the true polygon is not finite.
    """
    known = np.isfinite(true_world).all(axis=(1, 2))
    finite = known & np.isfinite(estimated_world).all(axis=(1, 2))
    overlap = np.where(known, 0.0, np.nan)
    estimated = _areas(estimated_world[finite])
    true = _areas(true_world[finite])
    common = shapely.area(shapely.intersection(estimated, true))
    union = shapely.area(estimated) + shapely.area(true) - common
    overlap[finite] = np.divide(common, union, out=np.zeros_like(common), where=union > 0.0)
    return np.clip(overlap, 0.0, 1.0)


def normalised_errors(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """NEES (K,) divided by its dimension: eᵀ P⁻¹ e / D of `errors` (K, D) and P (K, D, D).

    NaN where P is not positive definite.
    """
    result = np.full(len(errors), np.nan)
    for k, (error, covariance) in enumerate(zip(errors, covariances, strict=True)):
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            continue
        whitened = np.linalg.solve(root, error)
        result[k] = whitened @ whitened / len(error)
    return result


def _areas(polygons: np.ndarray) -> np.ndarray:
    """Shapely geometries (K,) of polygons (K, M, 2), valid ones."""
    areas = shapely.polygons(polygons)
    crossed = ~shapely.is_valid(areas)
    if crossed.any():
        areas[crossed] = shapely.make_valid(areas[crossed])
    return areas
