"""The bootstrap of means of pairs or poses in fixed strata."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.randomness import generator
from stixel_cli.report.statistics import CONFIDENCE

DRAWS = 4000
"""Draws of a bootstrap."""
LEAST_DRAWN = 3
"""Least number of pairs of a path for a bootstrap."""


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
    """Percentiles of bootstrap values (n,) that enclose `CONFIDENCE` of them."""
    low, high = np.quantile(values, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(low), float(high)
