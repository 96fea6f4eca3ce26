"""The 95 % intervals of means, of shares and of a bootstrap: all of them are computed here.

SciPy is imported where it is used: a command that needs no statistics starts without it.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from stixel_cli.randomness import generator

CONFIDENCE = 0.95
LEAST_FREEDOM = 3
"""Least degrees of freedom of an interval, those of four values: with three values Student's
interval is 2.5 standard deviations of the values long to either side, and says nothing."""
DRAWS = 4000
"""Draws of a bootstrap."""

Bounds = tuple[float | None, float | None]
"""Least and greatest possible value; None where there is no bound."""
UNBOUNDED: Bounds = (None, None)


@cache
def student_t(degrees_of_freedom: float, confidence: float = CONFIDENCE) -> float:
    """The quantile of Student's t distribution that encloses `confidence` with its negative."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + confidence / 2))


def between_bounds(
    mean: np.ndarray | float, half: np.ndarray | float, bounds: Bounds
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (low, high) of intervals mean ± half whose values have `bounds`, elementwise.

    On the logit scale between 0 and 1 and on the log scale above 0, with the slope of the scale at
    the mean (delta method): the ends are possible values. On skewed values these cover the mean
    more often than Student's interval, and a bootstrap's less (docs/decisions.md).
    """
    from scipy.special import expit, logit

    mean, half = np.asarray(mean, np.float64), np.asarray(half, np.float64)
    low, high = mean - half, mean + half
    with np.errstate(invalid="ignore", divide="ignore"):
        if bounds == (0.0, 1.0):
            slope = half / (mean * (1.0 - mean))
            scaled = expit(logit(mean) - slope), expit(logit(mean) + slope)
        elif bounds == (0.0, None):
            scaled = mean * np.exp(-half / mean), mean * np.exp(half / mean)
        else:
            scaled = low, high
    # At a bound all values are equal; files of others can have values beyond one.
    usable = (half > 0.0) & np.isfinite(scaled[0]) & np.isfinite(scaled[1])
    return np.where(usable, scaled[0], low), np.where(usable, scaled[1], high)


def combined_interval(
    mean: float,
    parts: Sequence[tuple[float, int]],
    bounds: Bounds = UNBOUNDED,
    confidence: float = CONFIDENCE,
) -> tuple[float, float] | tuple[None, None]:
    """Interval of a mean whose variance is the sum of independent parts, see `between_bounds`.

    Each part is a variance with its degrees of freedom; the sum's are Satterthwaite's (1946). For
    the difference of two means it is Welch's (1947) interval. None below `LEAST_FREEDOM`.
    """
    if any(degrees < 1 for _, degrees in parts) or sum(d for _, d in parts) < LEAST_FREEDOM:
        return None, None
    variance = sum(part for part, _ in parts)
    if variance == 0.0:
        return mean, mean
    freedom = 1.0 / sum((part / variance) ** 2 / degrees for part, degrees in parts)
    half = student_t(freedom, confidence) * math.sqrt(variance)
    low, high = between_bounds(mean, half, bounds)
    return float(low), float(high)


def stratified_parts(values: np.ndarray, strata: Sequence[str]) -> list[tuple[float, int]]:
    """The parts of the variance of the mean of values (n,) in fixed `strata` (paths).

    Not a bootstrap's: that of two seeds covers the mean in half of all cases.
    """
    columns = np.array(strata)
    members = [values[columns == stratum] for stratum in sorted(set(strata))]
    return [_part(own, (len(own) / len(values)) ** 2) for own in members]


def crossed_parts(values: np.ndarray, levels: np.ndarray) -> list[tuple[float, int]]:
    """The parts of the variance of the mean of values (n,) drawn on crossed axes: one an axis.

    `levels` (n, axes) has the draw of each axis, such as a seed and a shape. Each axis adds the
    variance between the means of its levels; what these share is the variance within (random
    effects without interaction), and is counted once.
    """
    n, axes = levels.shape
    if axes == 1:
        return [_part(values)]
    parts, within, freedom = [], values - values.mean(), n - 1
    for axis in levels.T:
        names, place = np.unique(axis, return_inverse=True)
        means = np.bincount(place, values) / np.bincount(place)
        parts.append(_part(means))
        within = within - (means - values.mean())[place]
        freedom -= len(names) - 1
    total = sum(part for part, _ in parts)
    shared = (axes - 1) * float(within @ within) / (n * freedom) if freedom > 0 else 0.0
    kept = max(total - shared, *(part for part, _ in parts)) / total if total else 1.0
    return [(kept * part, degrees) for part, degrees in parts]


def _part(values: np.ndarray, weight: float = 1.0) -> tuple[float, int]:
    """Variance of the mean of values (n,), times `weight`, with its degrees of freedom."""
    n = len(values)
    return (weight * float(values.var(ddof=1)) / n if n > 1 else 0.0), n - 1


def wilson_interval(share: float, n: int) -> tuple[float, float] | tuple[None, None]:
    """Interval of a share of n independent trials (Wilson 1927); None of fewer than four."""
    from scipy.special import ndtri

    if n <= LEAST_FREEDOM:
        return None, None
    z = float(ndtri(0.5 + CONFIDENCE / 2))
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    # Without rounding, the interval contains the share: for 0 of n its low end is 0.
    return min(share, max(0.0, middle - half)), max(share, min(1.0, middle + half))


def chi_square_bounds(degrees: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the central 95 % of chi-square, each with the shape of `degrees`."""
    from scipy.special import gammaincinv

    half = 0.5 * np.asarray(degrees, np.float64)
    return 2.0 * gammaincinv(half, 0.025), 2.0 * gammaincinv(half, 0.975)


def bootstrap_weights(strata: Sequence[str], name: str) -> np.ndarray:
    """Weights (DRAWS, n) of the bootstrap's means of n pairs: each row sums to 1.

    From the m pairs of a stratum, m - 1 are drawn with replacement and weighted up to m (Rao & Wu
    1988, *Resampling inference with complex survey data*). With m draws, the mean's variance would
    be (m - 1) / m of the true one: with 5 seeds per path, intervals would be a tenth too short. The
    only pair of a stratum is always drawn.
    """
    random = generator(0, f"bootstrap {name}")
    columns = np.array(strata)
    found = np.zeros((DRAWS, len(columns)))
    for stratum in sorted(set(strata)):
        members = np.flatnonzero(columns == stratum)
        m = len(members)
        if m == 1:
            found[:, members] = 1.0
            continue
        drawn = random.multinomial(m - 1, np.full(m, 1.0 / m), DRAWS)
        found[:, members] = drawn * (m / (m - 1.0))
    return found / len(columns)


def bootstrap_interval(values: np.ndarray) -> tuple[float, float]:
    """Percentiles of bootstrap values (n,) that enclose `CONFIDENCE` of them."""
    low, high = np.quantile(values, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(low), float(high)
