"""Every interval of means and shares over units is computed here.

SciPy is imported where it is used: a command that needs no statistics starts without it.
"""

import numpy as np
import pandas as pd

CONFIDENCE = 0.95
LEAST_UNITS = 4
"""Least number of units of an interval: with three, Student's interval is 2.5 standard deviations
of the values long to either side, and says nothing."""

Bounds = tuple[float | None, float | None]
"""Least and greatest possible value; None where there is no bound."""


def mean_interval(
    values: pd.DataFrame, bounds: Bounds = (None, None), tests: int = 1
) -> pd.DataFrame:
    """The columns `low` and `high` of each column's mean over its rows, Student's t.

    Args:
        values: one row a unit; each of `values` has a value.
        bounds: of the values: the interval's ends are possible values, see `between_bounds`.
        tests: of so many intervals all hold together with 95 % (Bonferroni).
    """
    from scipy.special import stdtrit

    n, mean = len(values), values.mean()
    if n < LEAST_UNITS:
        nothing = np.full(len(mean), np.nan)
        return pd.DataFrame({"low": nothing, "high": nothing}, index=values.columns)
    quantile = stdtrit(n - 1, 0.5 + 0.5 * (1.0 - (1.0 - CONFIDENCE) / tests))
    half = quantile * values.std(ddof=1) / np.sqrt(n)
    low, high = between_bounds(mean.to_numpy(), half.to_numpy(), bounds)
    return pd.DataFrame({"low": low, "high": high}, index=values.columns)


def between_bounds(
    mean: np.ndarray, half: np.ndarray, bounds: Bounds
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (low, high) of intervals mean ± half whose values have `bounds`, elementwise.

    On the logit scale between 0 and 1 and on the log scale above 0, with the slope of the scale at
    the mean (delta method): the ends are possible values. On skewed values these cover the mean
    more often than Student's interval, and a bootstrap's less (docs/decisions.md).
    """
    from scipy.special import expit, logit

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


def share_interval(shares: pd.DataFrame) -> pd.DataFrame:
    """As `mean_interval`, of shares whose units count as one trial each (Wilson 1927).

    Student's interval of shares that are all 0 would have no length.
    """
    from scipy.special import ndtri

    n, share = len(shares), shares.mean()
    if n < LEAST_UNITS:
        return mean_interval(shares)
    z = ndtri(0.5 + 0.5 * CONFIDENCE)
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    low = np.minimum(share, (middle - half).clip(0.0))
    high = np.maximum(share, (middle + half).clip(upper=1.0))
    return pd.DataFrame({"low": low, "high": high})
