"""Scores of one track: conventions → validate → errors of each scan → metrics.

Conventions: K scans; poses (K, 3) = x m, y m, heading rad in the world; polygons (K, M, 2) m in the
world, the first vertex not repeated; errors are estimated minus true. Errors count at every scan,
also at empty ones; where the truth is unknown, or `Scenario.scored` is false, they are left out. A
missing value is NaN. The metrics are those of `metric_table.py`: a metric is None if one of its
errors is not finite; NIS and NEES are averaged over the scans that have one.
"""

from numbers import Real
from typing import Any

import numpy as np

from stixel_cli.border.own_code import loaded
from stixel_cli.evaluation.contour_errors import (
    BESIDE,
    baseline_overlaps,
    centre_errors,
    contour_errors,
    star_convex_upper_bound,
)
from stixel_cli.evaluation.metric_table import METRICS, OF_CLASSES, OF_ESTIMATES, OF_SIZE, SMOOTHED
from stixel_cli.evaluation.scores import LOW_OVERLAP, ScanErrors, Scores
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.motion import LEAST_SPEED
from stixel_cli.tracking.track import OTHER, REPORTED, Track, check_finite


def validate(track: Track, scenario: Scenario, scans: Scans) -> None:
    """Raise ValueError unless all three have the same scans, at least one, and finite estimates."""
    if len(scenario.times) == 0:
        raise ValueError("no scan to score")
    for name, times in (("track", track.times), ("scans", scans.times)):
        if not np.array_equal(times, scenario.times):
            raise ValueError(f"the times of the {name} differ from those of the scenario")
    if len(track.used_points) and track.used_points.max() >= len(scans.points_world):
        raise ValueError("the track used points that the scans do not have")
    check_finite(track)


def evaluate(
    track: Track,
    scenario: Scenario,
    scans: Scans,
    road_user: str | None = None,
    own: tuple[str, ...] = (),
) -> Scores:
    """Errors over time and their summary; see `Scores` for units.

    `road_user` is the true class, None if it is unknown. Where the truth is unknown, errors over
    time are NaN and metrics leave them out. Without any truth there are only the metrics of scans
    and track. The metrics of a smoothed track have names of their own; all else is of the filtered
    one. `own` are the user's functions, "module:function": each is called as
    `function(track, scenario, scans)` and gives the metric of its name; None and NaN are no value.
    ValueError as `validate` does, if a result is not a number, and if a metric of its name exists.
    """
    validate(track, scenario, scans)
    of_classes = class_errors(track, road_user)
    replaced_wrongly = (of_classes["class_replaced"] == 1.0) & (of_classes["class_wrong"] == 1.0)
    over_time = errors_over_time(track, scenario, replaced_wrongly)
    nearest, rows = scans.nearest_returns()
    over_time["iou_baseline"] = baseline_overlaps(scenario, nearest)
    over_time["out_of_view"] = out_of_view(scenario, scans)
    times, nis = scenario.times - scenario.times[0], track.normalised_nis
    counted = scenario.known if scenario.scored is None else scenario.known & scenario.scored
    errors = ScanErrors(
        times=times[counted],
        **{name: values[counted] for name, values in over_time.items()},
        star_convex_upper_bound=np.full(counted.sum(), star_convex_upper_bound(scenario)),
        nis=nis,
        points=np.diff(scans.offsets),
        points_used=np.diff(track.used_offsets),
        scan_times=times,
        **size_errors(track, scans, rows),
        **of_classes,
        uses_scans=track.uses_scans,
    )
    missing = [
        *(["scored_scans"] if scenario.scored is None else []),
        *(["time_out_of_view_s"] if scans.field_of_view is None else []),
        *(OF_SIZE if track.size_deviations is None else []),
        *(OF_CLASSES if track.class_probabilities is None else []),
    ]
    rows = {name: row for name, row in METRICS.items() if name not in missing}
    metrics = {name: row.of_run(errors) for name, row in rows.items()}
    if not counted.any():
        metrics = {name: value for name, value in metrics.items() if value is not None}
    if track.smoothed is not None:
        later = evaluate(track.smoothed, scenario, scans, road_user).metrics
        later["lag"] = len(times) - 1 if track.smoothed.lag is None else track.smoothed.lag
        metrics |= {SMOOTHED + n: later[n] for n in (*OF_ESTIMATES, "lag") if n in later}
    metrics |= _own_metrics(own, metrics, track, scenario, scans)
    return Scores(
        times=np.array(scenario.times, dtype=np.float64),
        centre_error=over_time["centre"],
        orientation_error=wrap_angle(track.means[:, 2] - scenario.target_poses_world[:, 2]),
        **{name: over_time[name] for name in ("iou", "iou_box", "nees_position")},
        nis=nis,
        metrics=metrics,
    )


def _own_metrics(
    functions: tuple[str, ...], known: dict[str, Any], *given: Track | Scenario | Scans
) -> dict[str, float | None]:
    """The results of the user's functions, by name; errors as of `evaluate`."""
    found: dict[str, float | None] = {}
    for function in functions:
        name, value = function.partition(":")[2], loaded(function)(*given)
        if name in known | found:
            raise ValueError(f"{function}: a metric {name} exists: rename the function")
        if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
            raise ValueError(f"{function}: must return a number, returned a {type(value).__name__}")
        found[name] = None if value is None or not np.isfinite(value) else float(value)
    return found


def errors_over_time(
    track: Track, scenario: Scenario, replaced_wrongly: np.ndarray
) -> dict[str, np.ndarray]:
    """The errors at all scans, fields of `ScanErrors`, each (K,); NaN where the truth is unknown.

    `replaced_wrongly` (K,) is whether the reported class is neither the prior's nor the true one.
    """
    truth, rates = scenario.target_poses_world, scenario.target_rates_world
    offsets, covariances = track.means[:, :2] - truth[:, :2], track.covariances
    orientation = wrap_angle(track.means[:, 2] - truth[:, 2])
    true_speed = np.hypot(*rates[:, :2].T)
    contours = {}
    for name, values in contour_errors(track, scenario).items():
        contours[name] = np.full(len(truth), np.nan)
        contours[name][scenario.known] = values
    return contours | {
        "centre": centre_errors(track.means, truth),
        "orientation": np.degrees(orientation),
        "speed": np.hypot(*track.means[:, 3:5].T) - true_speed,
        "yaw_rate": np.degrees(track.means[:, 5] - rates[:, 2]),
        "nees_position": normalised_errors(offsets, covariances[:, :2, :2]),
        "nees_orientation": normalised_errors(orientation[:, None], covariances[:, 2:3, 2:3]),
        "lost": off_target(contours["iou_box"], orientation, true_speed, replaced_wrongly),
    }


def out_of_view(scenario: Scenario, scans: Scans) -> np.ndarray:
    """Whether the true centre is outside the borders of the sensor's view, (K,); False: unknown."""
    view, sensors = scans.field_of_view, scans.sensor_poses_world
    if view is None:
        return np.zeros(len(scans), bool)
    way = scenario.target_poses_world[:, :2] - sensors[:, :2]
    bearings = wrap_angle(np.arctan2(way[:, 1], way[:, 0]) - sensors[:, 2])
    return (bearings < view.right) | (bearings > view.left)


def class_errors(track: Track, road_user: str | None) -> dict[str, Any]:
    """The probabilities of the classes and their errors: fields of `ScanErrors`."""
    probabilities, replaced = track.class_probabilities, track.class_replaced
    wrong = missing = np.full(len(track.times), np.nan)
    if probabilities is None:
        probabilities, replaced = {}, None
    elif road_user is not None:
        names = np.array(list(probabilities))
        named = names[np.argmax(list(probabilities.values()), axis=0)]
        # A track that names no class names no wrong one.
        wrong = np.where(named == OTHER, np.nan, named != road_user)
    return {
        "class_probabilities": {name: probabilities.get(name, missing) for name in REPORTED},
        "class_wrong": wrong,
        "class_replaced": missing if replaced is None else replaced.astype(float),
    }


def size_errors(track: Track, scans: Scans, nearest: np.ndarray) -> dict[str, np.ndarray]:
    """What shows that the points do not fit the class, without any truth: fields of `ScanErrors`.

    Of a class that is too large, the estimated size falls far below the class's; of one that is too
    small, many points next to the used ones do not fit. Only the `nearest` (n,) rows count.
    """
    count = len(scans)
    if track.size_deviations is None:
        return {name: np.full(count, np.nan) for name in ("size_deviations", "points_beside")}
    beside, points = np.zeros(count), scans.points_world
    unused = np.zeros(len(points), bool)
    unused[nearest] = True
    unused[track.used_points] = False
    for k in range(count):
        rows = scans.rows(k)
        used = points[track.used_points[slice(*track.used_offsets[k : k + 2])]]
        others = points[rows][unused[rows]]
        if len(used) and len(others):
            apart = others[:, None] - used
            beside[k] = np.sum(np.hypot(apart[..., 0], apart[..., 1]).min(axis=1) < BESIDE)
    return {"size_deviations": track.size_deviations, "points_beside": beside}


def off_target(
    iou_box: np.ndarray, orientation: np.ndarray, speed: np.ndarray, replaced_wrongly: np.ndarray
) -> np.ndarray:
    """Whether each of n estimates is off the target, (n,) bool.

    It is where the IoU of the boxes is below `LOW_OVERLAP` or unknown, where the heading of a
    target that moves is wrong by more than 90°, and where the reported class is neither the
    prior's nor the road user's. `orientation` is the error, rad, `speed` the true one, m/s.
    """
    backwards = (np.abs(orientation) > 0.5 * np.pi) & (speed > LEAST_SPEED)
    return ~(iou_box >= LOW_OVERLAP) | backwards | replaced_wrongly


def normalised_errors(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """NEES (K,) divided by its dimension: eᵀ P⁻¹ e / D of `errors` (K, D) and P (K, D, D).

    NaN where P is not positive definite.
    """
    try:
        roots = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        if len(errors) == 1:
            return np.array([np.nan])
        # NumPy does not report which covariance is not valid.
        middle = len(errors) // 2
        halves = slice(middle), slice(middle, None)
        return np.concatenate([normalised_errors(errors[h], covariances[h]) for h in halves])
    whitened = np.linalg.solve(roots, errors[..., None])[..., 0]
    return np.mean(whitened**2, axis=1)
