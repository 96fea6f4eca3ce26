"""Mean, standard deviation and 95 % interval of each metric over the seeds of each setting."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

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
            freedom; None if n < 2.
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
        statistic(dict(setting), name, [metrics[i].get(name) for i in members])
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
    if n == 1:
        return Statistic(setting, metric, 1, mean, None, None, None)
    std = float(np.sort(known).std(ddof=1))
    half = student_t(n - 1) * std / math.sqrt(n)
    return Statistic(setting, metric, n, mean, std, mean - half, mean + half)


@cache
def student_t(degrees_of_freedom: int) -> float:
    """The 97.5 % quantile of Student's t distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + CONFIDENCE / 2))
