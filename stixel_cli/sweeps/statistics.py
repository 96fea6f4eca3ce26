"""Mean, standard deviation and 95 % interval of each metric over the seeds of each setting."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from stixel_cli.evaluation.metric_table import LOSS_RATE, over_runs
from stixel_cli.evaluation.metric_table import metric as metric_row

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Statistic:
    """A metric of one setting over its seeds.

    Attributes:
        setting: keys that differ between runs, without the seed, with their values as typed.
        metric: its name.
        n: number of seeds with a value; where an estimate is not finite there may be no value.
        mean: None if n is 0.
        std: standard deviation, n - 1 in the denominator; None if n < 2.
        low, high: ends of the 95 % interval of the mean, Student's t with n - 1 degrees of
            freedom, None if n < 2; of a share of runs Wilson's.
    """

    setting: Mapping[str, str]
    metric: str
    n: int
    mean: float | None
    std: float | None
    low: float | None
    high: float | None


def summarise(
    settings: Sequence[Mapping[str, str]], metrics: Sequence[Mapping[str, float | int | None]]
) -> list[Statistic]:
    """The statistics of runs; runs of equal settings are repetitions.

    Args:
        settings: of each run, without the seed.
        metrics: of each run, name to value.
    """
    groups: dict[tuple, list[int]] = {}
    for i, setting in enumerate(settings):
        groups.setdefault(tuple(setting.items()), []).append(i)
    names = list(dict.fromkeys(name for run in metrics for name in run))
    return [
        statistic(dict(setting), over_runs(name), [metrics[i].get(name) for i in members])
        for setting, members in groups.items()
        for name in names
    ]


def statistic(
    setting: Mapping[str, str], metric: str, values: Sequence[float | int | None]
) -> Statistic:
    """The statistic of one metric's values, without those that are None."""
    known = np.array([value for value in values if value is not None], dtype=np.float64)
    n = len(known)
    if n == 0:
        return Statistic(setting, metric, 0, None, None, None, None)
    # Sorted before the sum, so that the order of the seeds does not change the last bit.
    mean = float(np.sort(known).mean())
    if metric == LOSS_RATE:
        std = float(np.sort(known).std(ddof=1)) if n > 1 else None
        return Statistic(setting, metric, n, mean, std, *wilson_interval(mean, n))
    if n == 1:
        return Statistic(setting, metric, 1, mean, None, None, None)
    std = float(np.sort(known).std(ddof=1))
    half = student_t(n - 1) * std / math.sqrt(n)
    return Statistic(setting, metric, n, mean, std, mean - half, mean + half)


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
    from scipy.special import gammaincinv

    total = one.n * degrees
    low, high = (2.0 * gammaincinv(0.5 * total, p) / total for p in (0.025, 0.975))
    return float(low), float(high)


@cache
def student_t(degrees_of_freedom: int) -> float:
    """The 97.5 % quantile of Student's t distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + CONFIDENCE / 2))
