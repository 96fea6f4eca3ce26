"""Statistics of paired runs, and of several tests together.

The unit is a pair of runs: the same road user, path and seed, so the same motion and the same noisy
start. Scans of one run follow each other and are no units of their own. The paths are a given set,
not a sample of all paths: intervals are of the seeds' variance within each path.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.randomness import generator

DRAWS = 4000
LEAST_DRAWN = 3
"""Pairs of a path from which a bootstrap draws: one of two drawn says nothing of both."""
LEVEL = 0.95
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Paired:
    """Differences of n pairs.

    Attributes:
        n: number of pairs.
        mean: of the differences; None without a pair.
        low, high: 95 % interval of the mean, see `mean_interval`; None where it has none.
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
    """Statistics of the differences (n,), which belong to `strata` (paths)."""
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
    """95 % interval of the mean of values (n,), of which `strata` (paths) are given, not sampled.

    Student's t. A stratum of m values with variance s² adds (m / n)² s² / m to the mean's variance;
    degrees of freedom by Satterthwaite (1946). A bootstrap would be too short for few seeds: of two
    seeds of one path, its interval goes from one to the other, and covers the mean in half of all
    cases.

    None without a value, and where a stratum has only one: its variance is unknown.
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

    Of the m pairs of a stratum m - 1 are drawn with replacement, and weighted as if they were m
    (Rao & Wu 1988, *Resampling inference with complex survey data*): to draw m would make the
    mean's variance (m - 1) / m of what it is, with 5 seeds a path intervals a tenth too short. The
    only pair of a stratum stays.
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
    """p of Wilcoxon's (1945) signed rank test, two-sided, pairs without a difference left out."""
    from scipy.stats import wilcoxon as signed_rank

    differences = differences[differences != 0.0]
    return float(signed_rank(differences).pvalue) if len(differences) else 1.0


def least_p(pairs: int) -> float:
    """Smallest p that the exact test `wilcoxon` can give for so many pairs: all of one sign."""
    return min(1.0, 2.0 / 2.0**pairs)


def pairs_needed(tests: int) -> int:
    """How many pairs it takes for one of so many tests to be significant after `holm`."""
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
    """Holm's (1979) step-down correction: the chance of one false alarm in all is kept."""
    corrected: dict[str, float] = {}
    least = 0.0
    ordered = sorted(p_values.items(), key=lambda item: item[1])
    for i, (name, p) in enumerate(ordered):
        least = max(least, min(1.0, (len(ordered) - i) * p))
        corrected[name] = least
    return corrected


@dataclass(frozen=True)
class Closed:
    """Share of a gap that is closed, and its 95 % interval; see `gap_closed`."""

    share: float | None
    low: float | None
    high: float | None


def gap_closed(gap: np.ndarray, rest: np.ndarray, strata: Sequence[str], name: str) -> Closed:
    """Fraction of the gap (n,) that the correction closes; the rest (n,) is of the same pairs.

    1 - sum over the strata of |sum of the rest| / the same of the gap. The size is taken in each
    stratum (path), so that a rest that is too large on one path and too small on another does not
    pass for none. 1: nothing of it is left; 0: all of it; below 0: it became wider. None where the
    95 % interval of the mean gap holds 0, or there is none: what may not be there cannot be closed.
    Its own interval is a bootstrap's, and None where a stratum has fewer than `LEAST_DRAWN` pairs;
    `name` names the random numbers.
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
