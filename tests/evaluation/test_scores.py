"""Errors of scans, and the table of the metrics that sum them up."""

import re
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.evaluation.evaluate import off_target
from stixel_cli.evaluation.metric_table import METRICS, OF_ESTIMATES, metric, over_runs
from stixel_cli.evaluation.scores import (
    DIVERGED_NIS,
    ScanErrors,
    finite_median,
    low_overlap_share,
    precision,
    success,
    sure_and_wrong_share,
    time_to_divergence,
    time_to_loss,
)

TIMES = 0.1 * np.arange(40)


def off(*spans):
    """Whether each of 40 scans is off the target: from the first to the last of each span."""
    lost = np.zeros(40, bool)
    for first, last in spans:
        lost[first : last + 1] = True
    return lost


@pytest.mark.parametrize(
    ("lost", "time"),
    [
        (off(), None),
        (off((3, 12)), None),  # 0.9 s from the first scan to the last
        (off((3, 13)), 0.3),
        (off((3, 9), (11, 18)), None),  # back on the target between
        (off((3, 9), (11, 21)), 1.1),
        (off((0, 39)), 0.0),
        (off((31, 39)), None),
    ],
)
def test_a_track_is_lost_after_a_second_off_the_target(lost, time):
    assert time_to_loss(TIMES, lost) == (None if time is None else pytest.approx(time))


def output(**changes):
    """Errors of 40 scans of a tracker that is consistent by its own output."""
    usual = {"scan_times": TIMES, "nis": np.ones(40), "points": np.full(40, 9)}
    usual |= {"points_used": np.full(40, 8), "uses_scans": True}
    return ScanErrors(**(usual | changes))


ABOVE = DIVERGED_NIS + 0.1


@pytest.mark.parametrize(
    ("changes", "time"),
    [
        ({}, None),
        ({"nis": np.full(40, np.nan)}, None),
        # Points that are not used, for a second; an empty scan tells nothing.
        ({"points_used": 8 * ~off((3, 13))}, 0.3),
        ({"points_used": 8 * ~off((3, 12))}, None),
        ({"points_used": 8 * ~off((3, 30)), "points": 9 * ~off((3, 30))}, None),
        ({"points_used": 8 * off(), "uses_scans": False}, None),
        # The mean NIS of a second, far above its expectation.
        ({"nis": np.where(off((5, 39)), ABOVE, DIVERGED_NIS)}, 0.0),
        ({"nis": np.where(off((20, 39)), 2.0 * ABOVE, 1.0)}, 1.5),
        ({"nis": np.where(off((20, 22)), 15.0, 1.0)}, None),
        ({"nis": np.where(off((20, 39)), 50.0, np.nan), "points_used": off((20, 39))}, 0.0),
    ],
)
def test_a_tracker_diverges_by_its_own_output(changes, time):
    found = time_to_divergence(output(**changes))
    assert found == (None if time is None else pytest.approx(time))


def test_less_than_a_second_is_too_short_to_diverge():
    short = output(nis=np.where(off((0, 9)), 1e6, np.nan))
    assert time_to_divergence(short) is None


@pytest.mark.parametrize(
    ("iou_box", "degrees", "speed", "replaced_wrongly", "expected"),
    [
        (0.2, 0.0, 5.0, False, False),
        (0.19, 0.0, 5.0, False, True),
        (np.nan, 0.0, 5.0, False, True),
        (0.9, 89.0, 5.0, False, False),
        (0.9, -91.0, 5.0, False, True),
        # A target that stands has no direction of motion.
        (0.9, 180.0, 0.4, False, False),
        (0.9, 0.0, 5.0, True, True),
    ],
)
def test_off_target(iou_box, degrees, speed, replaced_wrongly, expected):
    arrays = (np.array([value]) for value in (iou_box, np.radians(degrees), speed))
    assert off_target(*arrays, np.array([replaced_wrongly])).tolist() == [expected]


def test_shares_count_what_is_known():
    sigmas, iou = np.array([2.9, 3.1, 3.1, np.nan]), np.array([0.1, 0.1, 0.3, 0.1])
    errors = output(nees_position=0.5 * sigmas**2, iou_box=iou)
    assert sure_and_wrong_share(errors) == 0.25
    assert low_overlap_share(np.array([0.1, 0.3])) == 0.5
    assert low_overlap_share(np.array([0.1, np.nan])) is None
    assert finite_median(np.array([3.0, np.nan, 1.0])) == 2.0
    assert finite_median(np.array([np.nan])) is None


def test_success_and_precision_are_areas_under_their_curves():
    """Shares at 21 thresholds, by the trapezoidal rule, as of lidar single-object tracking."""
    iou, centre = np.array([0.0, 0.42, 0.9, 1.0]), np.array([0.05, 0.31, 1.99, 7.0])
    cases = [(success(iou), 1, lambda t: iou >= t), (precision(centre), 2, lambda t: centre <= t)]
    for found, end, passed in cases:
        thresholds = np.linspace(0, end, 21)
        curve = [passed(t).mean() for t in thresholds]
        area = np.trapezoid(curve, thresholds) / thresholds[-1]
        assert found == pytest.approx(area, abs=1e-12)
    assert success(np.ones(3)) == precision(np.zeros(3)) == 1.0
    assert success(np.array([0.5, np.nan])) is None and precision(np.array([np.nan])) is None


UNITS = {"_deg_s": "°/s", "_m_s": "m/s", "_m": "m", "_deg": "°", "_s": "s"}


@pytest.mark.parametrize("row", METRICS.values(), ids=METRICS)
def test_row_is_complete(row):
    assert METRICS[row.name] is row and metric(row.name) is row
    assert re.fullmatch(r"[a-z_]+", row.name)
    assert row.label and row.short_label and len(row.short_label) <= 32
    assert row.unit == next((u for s, u in UNITS.items() if row.name.endswith(s)), "")
    assert row.shown_unit == ("%" if row.percent else row.unit)
    low, high = row.bounds
    assert low == 0.0 and high in (None, 1.0)
    assert (row.better == "one") == ("consistent" in row.label)


def test_labels_differ_and_those_of_other_metrics_follow_from_their_names():
    for field in ("label", "short_label"):
        assert len({getattr(row, field) for row in METRICS.values()}) == len(METRICS)
    row = metric("new_thing_m")
    assert (row.label, row.unit, row.better, row.bounds) == ("new thing", "m", None, (None, None))
    assert row.bounds == (None, None)
    assert metric("missed_columns_share").bounds == (0.0, 1.0)  # An interval ends within them.
    row, filtered = metric("smoothed_success"), METRICS["success"]
    assert row.label == f"{filtered.label}, smoothed" and row.name == "smoothed_success"
    assert (row.percent, row.better, row.unit) == (True, "more", filtered.unit)
    assert OF_ESTIMATES and set(OF_ESTIMATES) <= METRICS.keys()
    assert over_runs("track_lost") == "track_loss_rate" and over_runs("iou_mean") == "iou_mean"
    assert metric("track_loss_rate").better == "less"


def test_a_metric_of_errors_that_are_not_finite_has_no_value():
    lost = ScanErrors(centre=np.full(3, np.nan))
    greatest = replace(METRICS["centre_rmse_m"], over_scans=lambda e: float(np.max(e.centre)))
    assert greatest.of_run(lost) is None
    assert greatest.of_run(ScanErrors(centre=np.array([1.0, 3.0, 2.0]))) == 3.0
