"""Intervals: possible ends, their coverage, and crossed axes of draws."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from stixel_cli.report.intervals import (
    UNBOUNDED,
    between_bounds,
    bootstrap_weights,
    combined_interval,
    crossed_parts,
    student_t,
)
from stixel_cli.report.statistics import statistic


def test_an_interval_has_possible_ends():
    # Student's interval would be [-0.10, 0.25] and [-5.5, 14].
    iou = statistic("iou_mean", [0.0, 0.01, 0.02, 0.27])
    assert 0.0 < iou.low < 0.02 and 0.3 < iou.high < 1.0
    error = statistic("centre_rmse_m", [0.2, 0.3, 0.4, 17.0])
    assert 0.0 < error.low < 0.4 and error.high > 17.0
    # Differences are not bounded: Student's interval.
    values = [0.2, -0.1, 0.3, 0.4]
    apart, ends = statistic("", values), ttest_1samp(values, 0.0).confidence_interval()
    assert (apart.low, apart.high) == pytest.approx((ends.low, ends.high))


def test_a_narrow_interval_is_student_s():
    for bounds in ((0.0, 1.0), (0.0, None), (None, None)):
        low, high = between_bounds(0.6, 1e-4, bounds)
        np.testing.assert_allclose([low, high], [0.5999, 0.6001], rtol=1e-6)


def test_values_at_a_bound_or_beyond_have_an_interval():
    assert [statistic("iou_mean", [one] * 4).low for one in (0.0, 1.0)] == [0.0, 1.0]
    # A foreign file has an IoU of 3.
    foreign = statistic("iou_mean", [1.0, 2.0, 3.0, 3.0])
    assert foreign.low < 2.25 < foreign.high


def test_three_values_have_no_interval():
    assert statistic("iou_mean", [0.1, 0.2, 0.3]).low is None
    assert statistic("track_loss_rate", [0, 1, 0]).low is None
    assert statistic("iou_mean", [0.1, 0.2, 0.3, 0.3]).low is not None


def test_skewed_values_are_covered_more_often_than_by_student():
    """`pytest -s` prints the coverage that docs/decisions.md gives."""
    random = np.random.default_rng(0)
    values = random.lognormal(-0.5, 1.0, (4000, 5))
    mean = values.mean(axis=1)
    half = student_t(4) * values.std(axis=1, ddof=1) / np.sqrt(5)
    drawn = values @ bootstrap_weights(["one"] * 5, "coverage")[:500].T
    ends = {
        "log scale": between_bounds(mean, half, (0.0, None)),
        "Student": between_bounds(mean, half, UNBOUNDED),
        "bootstrap": np.quantile(drawn, [0.025, 0.975], axis=1),
    }
    covered = {name: np.mean((low <= 1.0) & (high >= 1.0)) for name, (low, high) in ends.items()}
    print({name: f"{share:.2f}" for name, share in covered.items()})
    assert covered["log scale"] > covered["Student"] + 0.03
    assert covered["Student"] > covered["bootstrap"] + 0.03


def _coverage(shape_std, seed_std, noise_std, shapes=6, seeds=5):
    random = np.random.default_rng(1)
    levels = np.array([(i, j) for i in range(shapes) for j in range(seeds)])
    covered = 0
    for _ in range(400):
        values = random.normal(0.0, shape_std, shapes)[levels[:, 0]]
        values = values + random.normal(0.0, seed_std, seeds)[levels[:, 1]]
        values = values + random.normal(0.0, noise_std, len(levels))
        low, high = combined_interval(values.mean(), crossed_parts(values, levels))
        covered += low <= 0.0 <= high
    return covered / 400


def test_crossed_draws_are_not_taken_for_independent_runs():
    # 30 runs of 6 shapes: as independent runs they would cover the mean in half of all cases.
    assert 0.92 <= _coverage(1.0, 0.0, 0.2) <= 0.99
    assert _coverage(1.0, 1.0, 0.2) >= 0.92
    assert _coverage(0.0, 0.0, 1.0) >= 0.92


def test_the_values_of_a_unit_are_averaged_first():
    values = [0.1, 0.3, 0.2, 0.4, None, 0.5]
    units = [("0",), ("0",), ("1",), ("1",), ("2",), ("2",)]
    one = statistic("iou_mean", values, units)
    assert (one.n, one.mean, one.std) == (2, pytest.approx(0.25), pytest.approx(0.1 / np.sqrt(2)))
    again = statistic("iou_mean", values[::-1], units[::-1])
    assert again == one
