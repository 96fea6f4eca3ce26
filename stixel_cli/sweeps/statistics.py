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
        n: how many seeds have a value; one whose estimate is not finite may have none.
        mean: None if none has.
        standard deviation: standard deviation, n - 1 in the denominator; None below two values.
        low, high: ends of the 95 % interval of the mean, Student's t with n - 1 degrees of
            freedom; None below two values.
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
    """The statistics of runs, of which those of equal settings are repetitions.

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
    """The statistic of one metric's values; those that are None are left out."""
    known = np.array([value for value in values if value is not None], dtype=np.float64)
    n = len(known)
    if n == 0:
        return Statistic(setting, metric, 0, None, None, None, None)
    # Summed in order of size, so that the order of the seeds does not show in the last bit.
    mean = float(np.sort(known).mean())
    if n == 1:
        return Statistic(setting, metric, 1, mean, None, None, None)
    std = float(np.sort(known).std(ddof=1))
    half = student_t(n - 1) * std / math.sqrt(n)
    return Statistic(setting, metric, n, mean, std, mean - half, mean + half)


@cache
def student_t(degrees_of_freedom: int) -> float:
    """Quantile of Student's t that leaves out half of 5 % at each end."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + CONFIDENCE / 2))
