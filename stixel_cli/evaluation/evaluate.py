"""Scores of one track: conventions → validate → errors of each scan → metrics.

Conventions: K scans; poses (K, 3) = x m, y m, heading rad in the world; polygons (K, M, 2) m in the
world, the first vertex not repeated; errors are estimated minus true. Errors count at every scan,
also at empty ones; where the truth is unknown, or `Scenario.scored` is false, they are left out. A
missing value is NaN. The metrics are those of `metric_table.py`: a metric is None if one of its
errors is not finite; NIS and NEES are averaged over the scans that have one.
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

    Where the truth is unknown, errors over time are NaN and metrics leave them out. Without any
    truth there are only the metrics that need none.

    Raises:
        ValueError: as `validate` does.
    """
    validate(track, scenario, scans)
    known = scenario.known
    truth, means, covariances = (
        values[known] for values in (scenario.target_poses_world, track.means, track.covariances)
    )
    true_contours = np.array(
        [world_from_target(scenario.contour_target, pose) for pose in truth]
    ).reshape(len(truth), *scenario.contour_target.shape)
    centre = centre_errors(means, truth)
    orientation = orientation_errors(means[:, 2], truth[:, 2])
    iou = intersections_over_unions(track.contours_world[known], true_contours)
    nees_position = normalised_errors(means[:, :2] - truth[:, :2], covariances[:, :2, :2])
    nees_heading = normalised_errors(orientation[:, None], covariances[:, 2:3, 2:3])
    degrees = track.nis_degrees_of_freedom
    nis = np.divide(track.nis, degrees, out=np.full(len(degrees), np.nan), where=degrees > 0)

    counted = np.ones(len(truth), bool) if scenario.scored is None else scenario.scored[known]
    errors = ScanErrors(
        centre=centre[counted],
        orientation=np.degrees(orientation)[counted],
        iou=iou[counted],
        nees_position=nees_position[counted],
        nees_heading=nees_heading[counted],
        nis=nis,
        points=np.diff(scans.offsets),
        points_used=np.diff(track.used_offsets),
    )
    metrics = {name: metric.of_run(errors) for name, metric in METRICS.items()}
    if scenario.scored is None:
        del metrics["scored_scans"]
    if not counted.any():
        metrics = {name: value for name, value in metrics.items() if value is not None}
    return Scores(
        times=np.array(scenario.times, dtype=np.float64),
        centre_error=_over_time(centre, known),
        orientation_error=_over_time(orientation, known),
        iou=_over_time(iou, known),
        nees_position=_over_time(nees_position, known),
        nis=nis,
        metrics=metrics,
    )


def _over_time(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The values (n,) of the n scans that are `known` (K,), NaN at the others."""
    result = np.full(len(known), np.nan)
    result[known] = values
    return result


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
    points that it encloses an odd number of times. The IoU of a non-finite estimate is 0.
    """
    finite = np.isfinite(estimated_world).all(axis=(1, 2))
    overlap = np.zeros(len(estimated_world))
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
