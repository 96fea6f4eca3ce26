"""Statistics of the errors of a run's points: bias, scatter, correlations, and missed columns."""

from collections.abc import Sequence

import numpy as np
import shapely

from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.validation.point_errors import PointErrors


def point_statistics(errors: PointErrors, focal: float, lag: float) -> dict[str, float | None]:
    """Statistics of one run's points by name; None without values.

    `bias_along`, `std`, m: mean and standard deviation of the error along the ray;
    `bias_disparity`, `std_disparity`, px: of the disparity's. `bias_across`: shift of both ends to
    the right, m at the mean range. `neighbours`: correlation of the disparity's errors `lag`
    columns apart; `scans`: of successive scans' means. `reach`, px: beyond the silhouette's ends.
    `beside`: share of points outside the silhouette; `missed`: of the target's columns without a
    point. `points`, `clutter`: numbers a scan.

    Args:
        errors: of the run.
        focal: focal length, px.
        lag: columns.
    """
    shift, reach = mean(0.5 * (errors.reach_right - errors.reach_left)), mean(errors.true_ranges)
    return {
        "bias_along": mean(errors.along),
        "bias_disparity": mean(errors.disparities),
        "std": std(errors.along),
        "std_disparity": std(errors.disparities),
        "bias_across": None if shift is None or reach is None else shift * reach / focal,
        "neighbours": correlogram([errors], [lag])[0],
        "scans": _scan_correlation(errors),
        "reach": mean(np.concatenate([errors.reach_left, errors.reach_right])),
        "beside": mean(errors.inside < 0.0),
        "missed": mean(1.0 - errors.covered),
        "points": len(errors.scans) / len(errors.times),
        "clutter": mean(errors.clutter),
    }


def mean(values: np.ndarray) -> float | None:
    """Mean of the finite values; None without any."""
    values = 1.0 * values
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else None


def std(values: np.ndarray) -> float | None:
    """Standard deviation, n - 1 in the denominator; None of fewer than two values."""
    return float(values.std(ddof=1)) if len(values) > 1 else None


def _scan_correlation(run: PointErrors) -> float | None:
    """Correlation of a scan's mean error with the next scan's; None without a spread."""
    count = np.bincount(run.scans, minlength=len(run.times))
    total = np.bincount(run.scans, weights=run.disparities, minlength=len(run.times))
    both = (count[1:] > 0) & (count[:-1] > 0)
    means = np.divide(total, count, out=np.zeros(len(count)), where=count > 0)
    if both.sum() < 3:
        return None
    one, other = means[:-1][both], means[1:][both]
    if one.std() < 1e-9 or other.std() < 1e-9:
        return None
    return float(np.corrcoef(one, other)[0, 1])


def neighbour_columns(runs: Sequence[PointErrors]) -> float:
    """Median spacing of points, columns: the lag at which all kinds of scan are compared."""
    spacings = [run.spacing for run in runs if np.isfinite(run.spacing)]
    return float(np.median(spacings)) if spacings else 1.0


def correlogram(runs: Sequence[PointErrors], lags: Sequence[float]) -> list[float | None]:
    """Correlation of the disparity's error at lags, columns within half a column.

    The mean error of each run is subtracted; points outside the silhouette are left out.
    """
    products: list[list[np.ndarray]] = [[] for _ in lags]
    squares = []
    for run in runs:
        own = run.inside > 0.0
        if not own.any():
            continue
        rest = run.disparities - run.disparities[own].mean()
        squares.append(rest[own] ** 2)
        for step in range(1, len(rest)):
            apart = run.columns[step:] - run.columns[:-step]
            same = (run.scans[step:] == run.scans[:-step]) & own[step:] & own[:-step]
            if not same.any() or apart[same].min() > max(lags) + 0.5:
                break
            product = rest[step:] * rest[:-step]
            for i, lag in enumerate(lags):
                products[i].append(product[same & (np.abs(apart - lag) < 0.5)])
    power = float(np.concatenate(squares).mean()) if squares else 0.0
    found = [np.concatenate(p) if p else np.zeros(0) for p in products]
    # Blocks of columns are rarely closer than a block's width, which leaves too few pairs.
    fewest = max(2.0, 0.1 * max((len(p) for p in found), default=0))
    return [float(p.mean()) / power if len(p) >= fewest and power > 0.0 else None for p in found]


def contour_distances(scans: Scans, scenario: Scenario) -> np.ndarray:
    """Distance (P,) m of every scan's points from the true contour, negative inside it."""
    distances = np.empty(len(scans.points_world))
    for k in range(len(scans)):
        rows = scans.rows(k)
        if rows.start == rows.stop:
            continue
        truth = shapely.Polygon(scenario.contour_world(k))
        points = shapely.points(scans.points_world[rows])
        away = shapely.distance(truth.exterior, points)
        distances[rows] = np.where(shapely.contains(truth, points), -away, away)
    return distances
