"""Statistics of runs: means over seeds with intervals, paired differences, several tests together.

In paired differences the unit is a pair of runs with the same road user, path and seed, so with the
same motion and initialisation. Successive scans of a run are not independent units. The paths are a
given set, not a sample of all paths: intervals describe the seeds' variance within each path.

SciPy is imported where it is used: a command that needs no statistics starts without it.
"""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate, count
from typing import Any

import numpy as np

from stixel_cli.evaluation.metric_table import LOSS_RATE, over_runs
from stixel_cli.evaluation.metric_table import metric as metric_row
from stixel_cli.randomness import generator

CONFIDENCE = 0.95
SIGNIFICANT = 0.05
DRAWS = 4000
"""Draws of a bootstrap."""
LEAST_DRAWN = 3
"""Least number of pairs of a path for a bootstrap."""


@dataclass(frozen=True)
class Estimate:
    """A number with the ends of its 95 % interval; None where they are unknown."""

    mean: float | None = None
    low: float | None = None
    high: float | None = None

    def scaled(self, factor: float) -> "Estimate":
        """In another unit."""
        values = (self.mean, self.low, self.high)
        return Estimate(*(None if one is None else factor * one for one in values))


@dataclass(frozen=True)
class Statistic:
    """A metric of one setting over its seeds.

    Attributes:
        metric: its name.
        n: number of seeds with a value; where an estimate is not finite there may be no value.
        mean: None if n is 0.
        std: standard deviation, n - 1 in the denominator; None if n < 2.
        low, high: ends of the 95 % interval of the mean, Student's t with n - 1 degrees of
            freedom, None if n < 2; of a share of runs Wilson's.
    """

    metric: str
    n: int
    mean: float | None = None
    std: float | None = None
    low: float | None = None
    high: float | None = None


def summarise(
    runs: Iterable[tuple[Hashable, Mapping[str, float | int | None]]],
) -> dict[Any, dict[str, Statistic]]:
    """The statistics by setting and metric of runs, each given as its setting and its metrics.

    Runs of equal settings are repetitions.
    """
    groups: dict[Any, list[Mapping[str, float | int | None]]] = {}
    for setting, metrics in runs:
        groups.setdefault(setting, []).append(metrics)
    names = list(dict.fromkeys(n for group in groups.values() for run in group for n in run))
    return {
        setting: {
            over_runs(name): statistic(over_runs(name), [run.get(name) for run in group])
            for name in names
        }
        for setting, group in groups.items()
    }


def statistic(metric: str, values: Iterable[float | int | None]) -> Statistic:
    """The statistic of one metric's values, without those that are None."""
    # Sorted, so that the order of the seeds does not change the last bit.
    known = np.sort(np.array([value for value in values if value is not None], dtype=np.float64))
    n = len(known)
    if n == 0:
        return Statistic(metric, 0)
    mean, std = float(known.mean()), float(known.std(ddof=1)) if n > 1 else None
    if metric == LOSS_RATE:
        return Statistic(metric, n, mean, std, *wilson_interval(mean, n))
    if std is None:
        return Statistic(metric, n, mean)
    half = student_t(n - 1) * std / math.sqrt(n)
    return Statistic(metric, n, mean, std, mean - half, mean + half)


def excludes_zero(one: Estimate | Statistic) -> bool:
    """Whether the interval is known and excludes 0."""
    return one.low is not None and not one.low <= 0.0 <= one.high


def wilson_interval(share: float, n: int) -> tuple[float, float]:
    """The 95 % interval of a share of n independent trials (Wilson 1927)."""
    from scipy.special import ndtri

    z = float(ndtri(0.5 + CONFIDENCE / 2))
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    # Without rounding, the interval contains the share: for 0 of n its low end is 0.
    return min(share, max(0.0, middle - half)), max(share, min(1.0, middle + half))


def consistent_bounds(one: Statistic) -> tuple[float, float] | tuple[None, None]:
    """The 95 % χ² interval of a mean NEES over seeds (ANEES) of a consistent filter.

    Bar-Shalom, Li & Kirubarajan 2001, 5.4.2: n runs with d degrees of freedom have χ² of n d over
    n d. A run counts as one scan, because the errors of its scans are alike. None for a metric
    without such a distribution.
    """
    degrees = metric_row(one.metric).degrees_of_freedom
    if degrees is None or one.n == 0:
        return None, None
    low, high = chi_square_bounds(one.n * degrees)
    return float(low / (one.n * degrees)), float(high / (one.n * degrees))


@cache
def student_t(degrees_of_freedom: float) -> float:
    """The 97.5 % quantile of Student's t distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + CONFIDENCE / 2))


def over_seeds(values: Iterable[float | int | None]) -> Statistic:
    """n, mean, standard deviation and 95 % interval (Student's t) of the finite values."""
    return statistic("", (v for v in values if v is not None and math.isfinite(v)))


def t_test(difference: Statistic) -> float | None:
    """p of the t-test that a mean of paired differences is 0, two-sided; None below two pairs."""
    from scipy.special import stdtr

    if difference.std is None:
        return None
    if difference.std == 0.0:
        return 1.0 if difference.mean == 0.0 else 0.0
    ratio = difference.mean / (difference.std / math.sqrt(difference.n))
    return float(2.0 * stdtr(difference.n - 1, -abs(ratio)))


def least_effect(seeds: int, tests: int) -> float:
    """Mean difference above which one of so many t-tests can be significant after `holm`.

    In standard deviations of the differences over two or more seeds.
    """
    from scipy.special import stdtrit

    return -float(stdtrit(seeds - 1, 0.5 * SIGNIFICANT / tests)) / math.sqrt(seeds)


def chi_square_bounds(degrees: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the central 95 % of chi-square, each with the shape of `degrees`."""
    from scipy.special import gammaincinv

    half = 0.5 * np.asarray(degrees, np.float64)
    return 2.0 * gammaincinv(half, 0.025), 2.0 * gammaincinv(half, 0.975)


@dataclass(frozen=True)
class Paired(Estimate):
    """The mean of the differences of n pairs; its interval is that of `mean_interval`.

    Attributes:
        p: of Wilcoxon's signed rank test, two-sided; None below two pairs.
        effect: matched-pairs rank-biserial correlation, -1 to 1: (R+ - R-) / (R+ + R-), R the sum
            of the ranks of |difference|; None where all are 0.
    """

    n: int = 0
    p: float | None = None
    effect: float | None = None


def paired(differences: np.ndarray, strata: Sequence[str]) -> Paired:
    """Statistics of the differences (n,) of pairs in `strata` (paths)."""
    n = len(differences)
    if n == 0:
        return Paired()
    low, high = mean_interval(differences, strata) or (None, None)
    p = wilcoxon(differences) if n > 1 else None
    return Paired(float(differences.mean()), low, high, n, p, rank_biserial(differences))


def mean_interval(values: np.ndarray, strata: Sequence[str]) -> tuple[float, float] | None:
    """95 % interval of the mean of values (n,) in fixed `strata` (paths), see `combined_interval`.

    A bootstrap's would be too short: that of two seeds covers the mean in half of all cases. None
    if there is no value, or a stratum has only one: its variance is unknown.
    """
    columns = np.array(strata)
    members = [values[columns == stratum] for stratum in sorted(set(strata))]
    if not members or min(map(len, members)) < 2:
        return None
    parts = [(len(own) * own.var(ddof=1) / len(values) ** 2, len(own) - 1) for own in members]
    return combined_interval(float(values.mean()), parts)


def combined_interval(mean: float, parts: Sequence[tuple[float, int]]) -> tuple[float, float]:
    """95 % interval (Student's t) of a mean whose variance is the sum of independent parts.

    Each part is a variance with its degrees of freedom; the sum's are Satterthwaite's (1946). For
    the difference of two means it is Welch's (1947) interval.
    """
    variance = sum(part for part, _ in parts)
    if variance == 0.0:
        return mean, mean
    freedom = 1.0 / sum((part / variance) ** 2 / degrees for part, degrees in parts)
    half = student_t(freedom) * math.sqrt(variance)
    return mean - half, mean + half


def wilcoxon(differences: np.ndarray) -> float:
    """p of Wilcoxon's (1945) signed rank test, two-sided, without pairs of equal values."""
    from scipy.stats import wilcoxon as signed_rank

    differences = differences[differences != 0.0]
    return float(signed_rank(differences).pvalue) if len(differences) else 1.0


def least_p(pairs: int) -> float:
    """Smallest p of the exact test `wilcoxon` for a number of pairs: all of one sign."""
    return min(1.0, 2.0 / 2.0**pairs)


def pairs_needed(tests: int) -> int:
    """Number of pairs with which one of `tests` tests can be significant after `holm`."""
    return next(pairs for pairs in count(1) if tests * least_p(pairs) < SIGNIFICANT)


def rank_biserial(differences: np.ndarray) -> float | None:
    """Matched-pairs rank-biserial correlation (Kerby 2014)."""
    from scipy.stats import rankdata

    differences = differences[differences != 0.0]
    if len(differences) == 0:
        return None
    ranks = rankdata(np.abs(differences))
    return float(np.sign(differences) @ ranks / ranks.sum())


def holm(p_values: Mapping[Any, float | None]) -> dict[Any, float]:
    """Holm's (1979) step-down correction of the known p, against the family-wise error rate."""
    known = {name: p for name, p in p_values.items() if p is not None}
    ordered = sorted(known, key=known.get)
    steps = (min(1.0, (len(ordered) - i) * known[name]) for i, name in enumerate(ordered))
    return dict(zip(ordered, accumulate(steps, max), strict=True))


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
