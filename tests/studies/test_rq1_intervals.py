"""Intervals of RQ1 count poses: neither seeds nor stixels of a pose make them shorter."""

from types import SimpleNamespace

import numpy as np
import pytest

from stixel_cli.studies.rq1.intervals import (
    STIXEL_BIAS,
    STIXEL_RMS,
    Estimate,
    difference,
    estimate,
    ratio,
    stixel_sums,
)


def group(values, seeds=1):
    """Sums (count, total) of frames with the values, of two road users in turn, `seeds` times."""
    poses = np.tile(np.arange(len(values)), seeds)
    made = SimpleNamespace(
        poses=poses,
        pose_strata=tuple(("car", "cyclist")[i % 2] for i in range(len(values))),
        pose_frames=tuple(range(len(values))),
    )
    sums = np.stack([np.ones(len(poses)), np.tile(values, seeds)], axis=-1)
    return made, sums


def test_seeds_of_a_pose_are_no_more_poses():
    values = np.random.default_rng(2).normal(0.3, 1.0, 24)
    one, many = (estimate(*group(values, seeds), ratio(1)) for seeds in (1, 10))
    assert one.value == pytest.approx(values.mean())
    assert (many.value, many.low, many.high) == pytest.approx((one.value, one.low, one.high))
    # As wide as the mean of 12 poses of either road user makes it.
    deviation = np.sqrt(0.5 * (values[::2].var(ddof=1) + values[1::2].var(ddof=1)) / 24)
    assert one.high - one.low == pytest.approx(2 * 1.96 * deviation, rel=0.1)


def test_frames_of_which_there_is_nothing_do_not_count():
    made, sums = group(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    sums[4:] = 0.0
    assert estimate(made, sums, ratio(1)).value == 2.5
    assert np.isnan(estimate(made, 0.0 * sums, ratio(1)).value)
    sums[2:] = 0.0
    alone = estimate(made, sums, ratio(1))
    assert alone.value == 1.5 and np.isnan(alone.low)
    assert alone.text("m") == "1.50\u202fm" and alone.cells == (1.5, None, None)


def test_a_difference_is_paired_by_pose():
    values = np.random.default_rng(4).normal(0.0, 5.0, 20)
    (one, sums_one), (other, sums_other) = group(values + 0.1, 3), group(values, 2)
    sums = {id(one): sums_one, id(other): sums_other}
    found = difference(one, other, lambda side: sums[id(side)], ratio(1))
    # Poses differ by far more than the pairs do.
    assert found.value == pytest.approx(0.1)
    assert 0.09 < found.low <= found.high < 0.11


def test_sums_of_stixels_leave_out_gross_errors_and_other_ranges():
    errors = SimpleNamespace(
        offsets=np.array([0, 2, 2, 5]),
        true_depth=np.array([10.0, 60.0, 20.0, 20.0, 20.0]),
        disparity=np.array([0.1, 0.1, 3.0, 0.2, -0.2]),
        depth=np.array([0.5, 9.0, 9.0, 1.0, -2.0]),
        area_depth=np.array([0.4, 9.0, 9.0, np.nan, 1.0]),
        sigma=np.full(5, 1.0),
        height=np.zeros(5),
    )
    made = SimpleNamespace(errors=SimpleNamespace(stixels=errors))
    sums = stixel_sums(made, 5.0, 50.0)
    assert sums[:, 0].tolist() == [1.0, 0.0, 2.0]
    total = sums.sum(axis=0)
    assert STIXEL_BIAS(total) == pytest.approx((0.5 + 1.0 - 2.0) / 3)
    assert STIXEL_RMS(total) == pytest.approx(np.sqrt((0.25 + 1.0 + 4.0) / 3))
    assert (total[4], total[5]) == (2.0, pytest.approx(0.16 + 1.0))


def test_shares_are_told_as_per_cent():
    assert Estimate(0.1234, 0.11, 0.14).share() == "12.3\u202f% [11.0, 14.0]"
