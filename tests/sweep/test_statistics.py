"""Statistics over seeds that are not those of a mean: a share of runs, and χ² of a NEES."""

import numpy as np
import pytest
from scipy.stats import binomtest
from stixel_cli.report.intervals import wilson_interval
from stixel_cli.report.statistics import consistent_bounds, statistic, summarise


def test_the_share_of_lost_runs_has_an_interval_also_where_none_is_lost():
    lost = [0] * 9 + [1]
    (row,) = summarise(("a", (i,), {"track_lost": one}) for i, one in enumerate(lost))["a"].values()
    assert (row.metric, row.n, row.mean) == ("track_loss_rate", 10, 0.1)
    expected = binomtest(1, 10).proportion_ci(method="wilson")
    assert (row.low, row.high) == pytest.approx((expected.low, expected.high), abs=1e-9)
    never = statistic("track_loss_rate", [0, 0, 0, 0])
    assert never.low == 0.0 and 0.3 < never.high < 0.6
    assert statistic("track_loss_rate", [None]).mean is None


def test_bounds_of_a_mean_nees_agree_with_pyrecest():
    # PyRecEst 2.4.2 has a circular import unless this comes first.
    import pyrecest.distributions  # noqa: F401
    from pyrecest.utils.metrics import nees_confidence_bounds

    for name, degrees in (("nees_position_mean", 2), ("nees_orientation_mean", 1)):
        for n in (1, 2, 25):
            found = consistent_bounds(statistic(name, [1.0] * n))
            expected = np.divide(nees_confidence_bounds(degrees, n_samples=n), degrees)
            np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert consistent_bounds(statistic("iou_mean", [1.0, 2.0])) == (None, None)
    assert consistent_bounds(statistic("nees_position_mean", [None])) == (None, None)


@pytest.mark.parametrize("n", range(4, 40))
def test_the_interval_of_a_share_contains_it(n):
    for count in range(n + 1):
        low, high = wilson_interval(count / n, n)
        assert 0.0 <= low <= count / n <= high <= 1.0
