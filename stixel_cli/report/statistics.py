"""Statistics of runs: means over seeds with intervals, paired differences, several tests together.

In paired differences the unit is a pair of runs with the same road user, path and seed, so with the
same motion and initialisation. Successive scans of a run are not independent units. The paths are a
given set, not a sample of all paths: intervals describe the seeds' variance within each path.

SciPy is imported where it is used: a command that needs no statistics starts without it.
"""

import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, count
from typing import Any

import numpy as np

from stixel_cli.evaluation.metric_table import LOSS_RATE, over_runs
from stixel_cli.evaluation.metric_table import metric as metric_row
from stixel_cli.report import intervals
from stixel_cli.report.metrics import listed_by_user
from stixel_cli.results.reader import listed

SIGNIFICANT = 0.05
LEAST_DRAWN = 3
"""Least number of pairs of a path for a bootstrap."""


Unit = tuple[Hashable, ...]
"""What is drawn anew in a repetition: the level of each drawn axis, such as (seed,)."""
Repetition = tuple[Hashable, Unit, Mapping[str, float | int | None]]
"""The setting, the unit and the metrics of a run."""


@dataclass(frozen=True)
class Statistic:
    """A number with its 95 % interval, such as a metric of one setting over its units.

    Attributes:
        mean: None if it is unknown.
        low, high: ends of the interval, see `intervals.combined_interval`; of a share of runs
            Wilson's. None of fewer than four values.
        n: number of units, such as seeds, with a value; 0 if there are no units.
        std: standard deviation of the units, n - 1 in the denominator; None if n < 2.
        metric: its name.
        values: of the units.
    """

    mean: float | None = None
    low: float | None = None
    high: float | None = None
    n: int = 0
    std: float | None = None
    metric: str = ""
    values: tuple[float, ...] = field(default=(), repr=False)

    def scaled(self, factor: float) -> "Statistic":
        """The number and its interval in another unit."""
        values = (self.mean, self.low, self.high)
        return Statistic(*(None if one is None else factor * one for one in values))


def summarise(runs: Iterable[Repetition]) -> dict[Any, dict[str, Statistic]]:
    """The statistics by setting and metric; runs of equal settings are repetitions."""
    groups: dict[Any, list[tuple[Unit, Mapping[str, float | int | None]]]] = {}
    for setting, unit, metrics in runs:
        groups.setdefault(setting, []).append((unit, metrics))
    known = dict.fromkeys(n for group in groups.values() for _, run in group for n in run)
    return {
        setting: {
            over_runs(name): statistic(
                over_runs(name), [run.get(name) for _, run in group], [unit for unit, _ in group]
            )
            for name in known
        }
        for setting, group in groups.items()
    }


def statistic(
    metric: str,
    values: Iterable[float | int | None],
    units: Iterable[Unit] | None = None,
    confidence: float = intervals.CONFIDENCE,
) -> Statistic:
    """The statistic of one metric's values over their units; None: each value is a unit.

    The values of a unit are averaged first; a unit with a missing value is left out. `metric` is
    "" for differences, which do not have its bounds.
    """
    values = [math.nan if value is None else float(value) for value in values]
    if units is None:
        values = sorted(value for value in values if math.isfinite(value))
        units = ((i,) for i in range(len(values)))
    groups: dict[Unit, list[float]] = defaultdict(list)
    for unit, value in zip(units, values, strict=True):
        groups[unit].append(value)
    # Sorted, so that the order of the runs does not change the last bit.
    means = {unit: float(np.mean(sorted(groups[unit]))) for unit in sorted(groups)}
    known = {unit: mean for unit, mean in means.items() if math.isfinite(mean)}
    n, own = len(known), np.array([*known.values()])
    if n == 0:
        return Statistic(metric=metric)
    mean, std = float(own.mean()), float(own.std(ddof=1)) if n > 1 else None
    if metric == LOSS_RATE:
        ends = intervals.wilson_interval(mean, sum(len(groups[unit]) for unit in known))
    else:
        parts = intervals.crossed_parts(own, np.array([*known]))
        ends = intervals.combined_interval(mean, parts, metric_row(metric).bounds, confidence)
    return Statistic(mean, *ends, n, std, metric, tuple(known.values()))


def excludes_zero(one: Statistic) -> bool:
    """Whether the interval is known and excludes 0."""
    return one.low is not None and not one.low <= 0.0 <= one.high


def in_words(
    found: Iterable[tuple[str, str, Statistic]], unit: str = "", more: str = "greater"
) -> str:
    """Differences (road user, what it is compared with, difference) as the end of a sentence.

    "0.037 to 0.051 m greater for the car and not shown to differ for the cyclist": where the
    interval excludes 0, and by how much. `more` is the word for a positive difference.
    """
    shown: dict[str, list[tuple[str, str, float]]] = {more: [], "smaller": []}
    rest = []
    for user, other, one in found:
        if excludes_zero(one):
            shown[more if one.mean > 0.0 else "smaller"].append((user, other, abs(one.mean)))
        else:
            rest.append((user, other))
    parts = []
    for word, own in shown.items():
        if own:
            ends = dict.fromkeys(f"{end(size for *_, size in own):.2g}" for end in (min, max))
            users = listed_by_user((user, other) for user, other, _ in own)
            parts.append(f"{' to '.join(ends)}{unit and f' {unit}'} {word} for {users}")
    if rest:
        parts.append(f"not shown to differ for {listed_by_user(rest)}")
    return listed(parts)


def consistent_bounds(one: Statistic) -> tuple[float, float] | tuple[None, None]:
    """The 95 % χ² interval of a mean NEES over seeds (ANEES) of a consistent filter.

    Bar-Shalom, Li & Kirubarajan 2001, 5.4.2: n runs with d degrees of freedom have χ² of n d over
    n d. A run counts as one scan, because the errors of its scans are alike. None for a metric
    without such a distribution.
    """
    degrees = metric_row(one.metric).degrees_of_freedom
    if degrees is None or one.n == 0:
        return None, None
    low, high = intervals.chi_square_bounds(one.n * degrees)
    return float(low / (one.n * degrees)), float(high / (one.n * degrees))


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


@dataclass(frozen=True)
class Paired(Statistic):
    """The mean of the differences of n pairs; the paths are fixed strata.

    Attributes:
        p: of Wilcoxon's signed rank test, two-sided; None below two pairs.
        effect: matched-pairs rank-biserial correlation, -1 to 1: (R+ - R-) / (R+ + R-), R the sum
            of the ranks of |difference|; None where all are 0.
    """

    p: float | None = None
    effect: float | None = None


def paired(differences: np.ndarray, strata: Sequence[str]) -> Paired:
    """Statistics of the differences (n,) of pairs in `strata` (paths)."""
    n = len(differences)
    if n == 0:
        return Paired()
    mean = float(differences.mean())
    ends = intervals.combined_interval(mean, intervals.stratified_parts(differences, strata))
    p = wilcoxon(differences) if n > 1 else None
    return Paired(mean, *ends, n, p=p, effect=rank_biserial(differences))


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
