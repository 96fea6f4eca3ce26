import re
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.evaluation.metric_table import METRICS, OF_ESTIMATES, metric, over_runs
from stixel_cli.evaluation.scan_errors import ScanErrors

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


def test_labels_differ():
    for field in ("label", "short_label"):
        assert len({getattr(row, field) for row in METRICS.values()}) == len(METRICS)


def test_a_metric_of_errors_that_are_not_finite_has_no_value():
    lost = ScanErrors(centre=np.full(3, np.nan))
    greatest = replace(METRICS["centre_rmse_m"], over_scans=lambda e: float(np.max(e.centre)))
    assert greatest.of_run(lost) is None
    assert greatest.of_run(ScanErrors(centre=np.array([1.0, 3.0, 2.0]))) == 3.0


def test_unknown_metric_has_a_label_from_its_name():
    row = metric("new_thing_m")
    assert (row.label, row.unit, row.better, row.bounds) == ("new thing", "m", None, (None, None))
    assert row.bounds == (None, None)
    assert metric("missed_columns_share").bounds == (0.0, 1.0)  # An interval ends within them.


def test_a_metric_of_the_smoothed_track_is_shown_as_that_of_the_filter_and_named_so():
    row, filtered = metric("smoothed_success"), METRICS["success"]
    assert row.label == f"{filtered.label}, smoothed" and row.name == "smoothed_success"
    assert (row.percent, row.better, row.unit) == (True, "more", filtered.unit)
    assert OF_ESTIMATES and set(OF_ESTIMATES) <= METRICS.keys()


def test_a_lost_track_is_a_rate_over_runs():
    assert over_runs("track_lost") == "track_loss_rate" and over_runs("iou_mean") == "iou_mean"
    assert metric("track_loss_rate").better == "less"
