"""Statistics of paired runs, and of several tests together.

The unit is a pair of runs with the same road user, path and seed, so with the same motion and
initialisation. Successive scans of a run are not independent units. The paths are a given set, not
a sample of all paths: intervals describe the seeds' variance within each path.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.randomness import generator

DRAWS = 4000
LEAST_DRAWN = 3
"""Least number of pairs of a path for a bootstrap."""
LEVEL = 0.95
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Paired:
    """Differences of n pairs.

    Attributes:
        n: number of pairs.
        mean: of the differences; None without a pair.
        low, high: 95 % interval of the mean, or None; see `mean_interval`.
        p: of Wilcoxon's signed rank test, two-sided; None below two pairs.
        effect: matched-pairs rank-biserial correlation, -1 to 1: (R+ - R-) / (R+ + R-), R the sum
            of the ranks of |difference|; None where all are 0.
    """

    n: int
    mean: float | None
    low: float | None
    high: float | None
    p: float | None
    effect: float | None


def paired(differences: np.ndarray, strata: Sequence[str]) -> Paired:
    """Statistics of the differences (n,) of pairs in `strata` (paths)."""
    n = len(differences)
    if n == 0:
        return Paired(0, None, None, None, None, None)
    mean = float(differences.mean())
    effect = rank_biserial(differences)
    if n < 2:
        return Paired(n, mean, None, None, None, effect)
    low, high = mean_interval(differences, strata) or (None, None)
    return Paired(n, mean, low, high, wilcoxon(differences), effect)


def mean_interval(values: np.ndarray, strata: Sequence[str]) -> tuple[float, float] | None:
    """95 % interval of the mean of values (n,) in fixed `strata` (paths).

    Student's t. A stratum of m values with variance s² adds (m / n)² s² / m to the mean's variance;
    degrees of freedom by Satterthwaite (1946). With few seeds, a bootstrap's interval is too
    short: with two seeds of one path it extends from one value to the other, and covers the mean in
    half of all cases.

    None if there is no value, or a stratum has only one: its variance is unknown.
    """
    from scipy.stats import t as student

    columns = np.array(strata)
    members = [values[columns == stratum] for stratum in sorted(set(strata))]
    if not members or min(map(len, members)) < 2:
        return None
    parts = [len(own) * own.var(ddof=1) / len(values) ** 2 for own in members]
    mean, variance = float(values.mean()), sum(parts)
    if variance == 0.0:
        return mean, mean
    shares = [part / variance for part in parts]
    freedom = 1.0 / sum(
        share**2 / (len(own) - 1) for share, own in zip(shares, members, strict=True)
    )
    half = float(student.ppf(0.5 + 0.5 * LEVEL, freedom) * np.sqrt(variance))
    return mean - half, mean + half


def weights(strata: Sequence[str], name: str) -> np.ndarray:
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
        count = len(members)
        if count == 1:
            found[:, members] = 1.0
            continue
        drawn = random.multinomial(count - 1, np.full(count, 1.0 / count), DRAWS)
        found[:, members] = drawn * (count / (count - 1.0))
    return found / len(columns)


def interval(values: np.ndarray) -> tuple[float, float]:
    """Percentiles of bootstrap values (n,) that enclose `LEVEL` of them."""
    low, high = np.quantile(values, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return float(low), float(high)


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
    pairs = 1
    while tests * least_p(pairs) >= SIGNIFICANT:
        pairs += 1
    return pairs


def rank_biserial(differences: np.ndarray) -> float | None:
    """Matched-pairs rank-biserial correlation (Kerby 2014)."""
    from scipy.stats import rankdata

    differences = differences[differences != 0.0]
    if len(differences) == 0:
        return None
    ranks = rankdata(np.abs(differences))
    return float(np.sign(differences) @ ranks / ranks.sum())


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Holm's (1979) step-down correction, which controls the family-wise error rate."""
    corrected: dict[str, float] = {}
    least = 0.0
    ordered = sorted(p_values.items(), key=lambda item: item[1])
    for i, (name, p) in enumerate(ordered):
        least = max(least, min(1.0, (len(ordered) - i) * p))
        corrected[name] = least
    return corrected


@dataclass(frozen=True)
class Closed:
    """Fraction of a gap that is closed, and its 95 % interval; see `gap_closed`."""

    share: float | None
    low: float | None
    high: float | None


def gap_closed(gap: np.ndarray, rest: np.ndarray, strata: Sequence[str], name: str) -> Closed:
    """Fraction of the gap (n,) that the correction closes; `rest` (n,) is the remaining gap.

    1 - sum over the strata of |sum of the rest| / the same of the gap. The sum is over
    strata (paths), because errors of opposite sign on two paths would cancel in the overall mean.
    1: closed; 0: unchanged; below 0: wider. None if the mean gap has no 95 % interval or the
    interval contains 0. The fraction's own interval is a bootstrap's, and None if a stratum has
    fewer than `LEAST_DRAWN` pairs; `name` is the label of the random numbers.
    """
    ends = mean_interval(gap, strata)
    if ends is None or ends[0] <= 0.0 <= ends[1]:
        return Closed(None, None, None)
    columns = np.array(strata)
    of_stratum = (columns[:, None] == np.unique(columns)).astype(np.float64)

    def size(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.abs((rows * values) @ of_stratum).sum(axis=-1)

    whole = np.full((1, len(gap)), 1.0 / len(gap))
    share = 1.0 - size(whole, rest) / size(whole, gap)
    if min(map(list(strata).count, strata)) < LEAST_DRAWN:
        return Closed(float(share[0]), None, None)
    drawn = weights(strata, name)
    shares = 1.0 - size(drawn, rest) / np.maximum(size(drawn, gap), 1e-12)
    return Closed(float(share[0]), *interval(shares))
