"""Statistics of paired runs, and of several tests together.

The unit is a pair of runs: the same road user, path and seed, so the same motion and the same noisy
start. Scans of one run follow each other and are no units of their own. The paths are a given set,
not a sample of all paths: the bootstrap draws among the seeds of each path.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.randomness import generator

DRAWS = 4000
LEVEL = 0.95
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Paired:
    """Differences of n pairs.

    Attributes:
        n: number of pairs.
        mean: of the differences; None without a pair.
        low, high: 95 % interval of the mean, paired bootstrap; None below two pairs.
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


def paired(differences: np.ndarray, strata: Sequence[str], name: str) -> Paired:
    """Statistics of the differences (n,), which belong to `strata` (paths).

    `name` names the random numbers of the bootstrap.
    """
    n = len(differences)
    if n == 0:
        return Paired(0, None, None, None, None, None)
    mean = float(differences.mean())
    effect = rank_biserial(differences)
    if n < 2:
        return Paired(n, mean, None, None, None, effect)
    low, high = interval(weights(strata, name) @ differences)
    return Paired(n, mean, low, high, wilcoxon(differences), effect)


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
    """How much of the gap (n,) the rest (n,), of the same pairs, leaves not.

    1 - sum over the strata of |sum of the rest| / the same of the gap. The size is taken in each
    stratum (path), so that a rest that is too large on one path and too small on another does not
    pass for none. 1: nothing of it is left; 0: all of it; below 0: it became wider. None where the
    95 % interval of the mean gap holds 0: what may not be there cannot be closed.
    """
    if len(gap) < 2:
        return Closed(None, None, None)
    drawn = weights(strata, name)
    low, high = interval(drawn @ gap)
    if low <= 0.0 <= high:
        return Closed(None, None, None)
    columns = np.array(strata)
    of_stratum = (columns[:, None] == np.unique(columns)).astype(np.float64)

    def size(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.abs((rows * values) @ of_stratum).sum(axis=-1)

    whole = np.full((1, len(gap)), 1.0 / len(gap))
    share = 1.0 - size(whole, rest) / size(whole, gap)
    shares = 1.0 - size(drawn, rest) / np.maximum(size(drawn, gap), 1e-12)
    return Closed(float(share[0]), *interval(shares))
