"""Statistics of the errors of a run's points: bias, scatter, correlations, and missed columns.

And the parameters of the fitted noise, which makes errors like them.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import finite_mean
from stixel_cli.measurements.rays import FittedNoise
from stixel_cli.validation.point_errors import PointErrors

_FEWEST = 10
"""Points that a fit of the noise takes."""
_DIGITS = 4
"""Of the fitted parameters."""


def point_statistics(errors: PointErrors, lag: float) -> dict[str, float | None]:
    """Statistics of one run's points by name; None without values.

    `bias_along`, `std`, m: mean and standard deviation of the error along the ray;
    `bias_disparity`, `std_disparity`, px: of the disparity's. `neighbours`: correlation of the
    disparity's errors `lag` columns apart; `scans`: of successive scans' means. `reach`, px: beyond
    the silhouette's ends. `missed`: share of the target's columns without a point. `points`,
    `clutter`: numbers a scan.
    """
    return {
        "bias_along": finite_mean(errors.along),
        "bias_disparity": finite_mean(errors.disparities),
        "std": std(errors.along),
        "std_disparity": std(errors.disparities),
        "neighbours": _neighbour_correlation(errors, lag),
        "scans": _scan_correlation(errors),
        "reach": finite_mean(np.concatenate([errors.reach_left, errors.reach_right])),
        "missed": finite_mean(1.0 - errors.covered),
        "points": len(errors.scans) / len(errors.times),
        "clutter": finite_mean(errors.clutter),
    }


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


def _neighbour_correlation(run: PointErrors, lag: float) -> float | None:
    """Correlation of the disparity's error at a `lag`, columns within half a column.

    The mean error is subtracted; points outside the silhouette are left out.
    """
    own = run.inside > 0.0
    if not own.any():
        return None
    rest = run.disparities - run.disparities[own].mean()
    products = [np.zeros(0)]
    for step in range(1, len(rest)):
        apart = run.columns[step:] - run.columns[:-step]
        same = (run.scans[step:] == run.scans[:-step]) & own[step:] & own[:-step]
        if not same.any() or apart[same].min() > lag + 0.5:
            break
        products.append((rest[step:] * rest[:-step])[same & (np.abs(apart - lag) < 0.5)])
    found, power = np.concatenate(products), float(np.mean(rest[own] ** 2))
    return float(found.mean()) / power if len(found) >= 2 and power > 0.0 else None


def fit_noise(runs: Sequence[PointErrors]) -> FittedNoise:
    """The noise that makes errors like those of `runs`, by the moments of simulated points.

    Each parameter of `FittedNoise` has a simple estimator: means for bias and variance, the mean
    product of neighbouring residuals for the correlation, mean and variance of the points' reach
    beyond the silhouette's ends, counts for missed points. UserError if the runs have too few
    points between the ends of the silhouette.
    """
    first = np.cumsum([0, *(len(run.times) for run in runs)])
    scan = np.concatenate([run.scans + first[i] for i, run in enumerate(runs)])
    column, along, sensitivity, inside = (
        np.concatenate([getattr(run, name) for run in runs])
        for name in ("columns", "along", "range_sensitivities", "inside")
    )
    # The first and the last point of each scan.
    starts = np.diff(scan, prepend=-1) != 0
    outermost = starts | np.roll(starts, -1)
    core = (inside > 0.0) & ~outermost
    if np.count_nonzero(core) < _FEWEST:
        raise UserError(
            f"{np.count_nonzero(core)} points of the target in the training runs are too few to "
            f"fit the noise, it takes {_FEWEST}"
        )
    width = max(1, round(neighbour_columns(runs)))

    # Divided by the range sensitivity (m/px), i.e. in px, errors are about as large at all ranges.
    range_bias = float(np.average(along[core], weights=sensitivity[core] ** -2.0))
    rest = (along - range_bias) / sensitivity
    variance = float(np.mean(rest[core] ** 2))
    edge_variance = float(np.mean(rest[outermost] ** 2)) - variance
    missed_share, missed_columns = _missed(scan, column, width)
    correlated = _correlation_columns(rest, scan, column, core, width)
    metres, metres_variance = _ends(runs, width, missed_share, missed_columns)
    return FittedNoise(
        kind="fitted",
        columns_per_point=width,
        range_bias=_rounded(range_bias),
        disparity_std=_root(variance),
        correlation_columns=_rounded(correlated, 0.0, 1000.0),
        edge_metres=_rounded(metres),
        edge_metres_std=_root(metres_variance),
        edge_disparity_std=_root(edge_variance),
        missed_share=_rounded(missed_share, 0.0, 0.99),
        missed_columns=_rounded(missed_columns, 1.0, 1000.0),
    )


def _correlation_columns(
    rest: np.ndarray, scan: np.ndarray, column: np.ndarray, core: np.ndarray, width: int
) -> float:
    """Length L, columns, of e^(-width / L) = the correlation of direct neighbours; 0 if none."""
    left, right = np.arange(len(scan) - 1), np.arange(1, len(scan))
    pairs = (scan[left] == scan[right]) & core[left] & core[right]
    pairs &= np.rint((column[right] - column[left]) / width) == 1
    if not pairs.any():
        return 0.0
    power = np.mean(rest[core] ** 2)
    product = np.mean(rest[left][pairs] * rest[right][pairs])
    correlation = float(product / power) if power > 0.0 else 0.0
    return -width / np.log(correlation) if 0.0 < correlation < 1.0 else 0.0


def _ends(
    runs: Sequence[PointErrors], width: int, missed_share: float, missed_columns: float
) -> tuple[float, float]:
    """Mean shift of the ends, m, and its variance, m²: least squares in columns.

    Missed points shorten the reach where they are the outermost. The noise misses them after it
    has moved the ends, so what they take is given back here: with the probability `missed_share`
    the rest of a run, geometric as the whole one is, of mean `missed_columns` L and mean square
    2 L² - width L.
    """
    reach = np.concatenate([np.concatenate([run.reach_left, run.reach_right]) for run in runs])
    scale = np.concatenate([np.tile(run.columns_per_metre, 2) for run in runs])
    known = np.isfinite(reach) & np.isfinite(scale)
    reach, scale = reach[known], scale[known]
    if len(reach) == 0:
        return 0.0, 0.0
    taken = missed_share * missed_columns
    metres = float(scale @ (reach + taken) / (scale @ scale))
    squares = (reach + taken - metres * scale) ** 2
    taken_variance = missed_share * (2.0 * missed_columns - width) * missed_columns - taken**2
    # A block counts if its middle is before the end: its own end is anywhere within one block.
    squares = squares - width**2 / 12.0 - taken_variance
    return metres, float(scale**2 @ squares / (scale**2 @ scale**2))


def _missed(scan: np.ndarray, column: np.ndarray, width: int) -> tuple[float, float]:
    """Share of the blocks between the outermost points that gave none, mean run in columns."""
    same = np.diff(scan) == 0
    gaps = np.maximum(np.rint(np.diff(column)[same] / width) - 1.0, 0.0)
    # Between the n points of a scan lie n - 1 gaps, and n - 2 points.
    of_scan = np.unique(scan, return_counts=True)[1]
    between = gaps.sum() + np.maximum(of_scan - 2, 0).sum()
    if gaps.sum() == 0.0:
        return 0.0, float(width)
    return float(gaps.sum() / between), float(width * gaps[gaps > 0.0].mean())


def _rounded(value: float, low: float = -10.0, high: float = 10.0) -> float:
    return float(np.round(np.clip(value, low, high), _DIGITS)) + 0.0


def _root(variance: float) -> float:
    return _rounded(float(np.sqrt(max(variance, 0.0))), 0.0)
