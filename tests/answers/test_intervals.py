"""Intervals: possible ends, and their coverage."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from stixel_cli.evaluation.intervals import between_bounds, mean_interval, share_interval


def ends(values, bounds=(None, None), interval=mean_interval):
    given = () if interval is share_interval else (bounds,)
    found = interval(pd.DataFrame({"one": values}), *given)
    return tuple(found.loc["one", ["low", "high"]])


def test_an_interval_has_possible_ends():
    # Student's interval would be [-0.10, 0.25] and [-5.5, 14].
    low, high = ends([0.0, 0.01, 0.02, 0.27], (0.0, 1.0))
    assert 0.0 < low < 0.02 and 0.3 < high < 1.0
    low, high = ends([0.2, 0.3, 0.4, 17.0], (0.0, None))
    assert 0.0 < low < 0.4 and high > 17.0
    # Differences are not bounded: Student's interval.
    values = [0.2, -0.1, 0.3, 0.4]
    expected = ttest_1samp(values, 0.0).confidence_interval()
    assert ends(values) == pytest.approx((expected.low, expected.high))


def test_narrow_intervals_and_values_at_or_beyond_a_bound_and_too_few_values():
    for bounds in ((0.0, 1.0), (0.0, None), (None, None)):
        found = between_bounds(np.array([0.6]), np.array([1e-4]), bounds)
        np.testing.assert_allclose(np.ravel(found), [0.5999, 0.6001], rtol=1e-6)
    assert [ends([one] * 4, (0.0, 1.0))[0] for one in (0.0, 1.0)] == [0.0, 1.0]
    # A foreign file has an IoU of 3.
    low, high = ends([1.0, 2.0, 3.0, 3.0], (0.0, 1.0))
    assert low < 2.25 < high
    for interval in (mean_interval, share_interval):
        assert np.isnan(ends([0.0, 1.0, 0.0], interval=interval)).all()
        assert np.isfinite(ends([0.0, 1.0, 0.0, 0.0], interval=interval)).all()


def test_skewed_values_are_covered_more_often_than_by_student():
    """`pytest -s` prints the coverage that docs/decisions.md gives."""
    random = np.random.default_rng(0)
    values = random.lognormal(-0.5, 1.0, (4000, 5))
    mean = values.mean(axis=1)
    half = student.ppf(0.975, 4) * values.std(axis=1, ddof=1) / np.sqrt(5)
    drawn = random.multinomial(5, [0.2] * 5, 500) @ values.T / 5
    found = {
        "log scale": between_bounds(mean, half, (0.0, None)),
        "Student": between_bounds(mean, half, (None, None)),
        "bootstrap": np.quantile(drawn, [0.025, 0.975], axis=0),
    }
    covered = {name: np.mean((low <= 1.0) & (high >= 1.0)) for name, (low, high) in found.items()}
    print({name: f"{share:.2f}" for name, share in covered.items()})
    assert covered["log scale"] > covered["Student"] + 0.03
    assert covered["Student"] > covered["bootstrap"] + 0.03
