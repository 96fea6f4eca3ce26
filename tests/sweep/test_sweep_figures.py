"""Figures of a sweep: lines side by side, intervals within bounds, incomplete settings."""

import pytest

from stixel_cli.pictures import style
from stixel_cli.report.statistics import statistic
from stixel_cli.sweeps.figures import (
    MOST_LINES,
    axis_figures,
    caption,
    dodges,
    draw_line,
    drawn_interval,
    is_geometric,
    scale_values,
)


def test_error_bars_do_not_overlap():
    assert dodges([0, 1, 2], 1) == [0.0]
    moved = dodges([3.0, 1.0, 1.4], 4)
    assert moved == sorted(moved)
    assert sum(moved) == pytest.approx(0.0)
    # Lines of two neighbouring places do not meet: 0.4 apart.
    assert 0.0 < moved[-1] - moved[0] < 0.4 / 2
    assert len({0.0, *dodges([5.0], 2)}) == 3


def test_intervals_are_clipped_in_figures_but_not_in_tables():
    iou = statistic("iou_mean", [0.2, 0.95])
    assert iou.low < 0.0
    assert iou.high > 1.0
    assert drawn_interval(iou) == (0.0, 1.0)
    error = statistic("centre_rmse_m", [0.1, 2.0])
    assert drawn_interval(error) == (0.0, error.high)
    other = statistic("gain_db", [-3.0, 4.0])
    assert drawn_interval(other) == (other.low, other.high)
    assert drawn_interval(statistic("iou_mean", [0.5])) == (0.5, 0.5)


def test_drawn_means_and_intervals():
    rows = [statistic("iou_mean", values) for values in ([0.2, 0.95], [0.5, 0.5], [None])]
    with style.drawing():
        axes = style.new_figure(3.0, 2.0).add_subplot()
        assert draw_line(axes, [0.1, 1.1, 2.1], rows, "#000000", "a", True)
        (bars,) = axes.collections
        low, high = bars.get_segments()[0][:, 1]
        assert (low, high) == pytest.approx((0.0, 1.0))
        assert bars.get_segments()[0][0, 0] == pytest.approx(0.1)
        assert not draw_line(axes, [0.0], rows[1:2], "#000000", "a", True)


def test_the_caption_names_every_change_of_the_drawing():
    text = caption(False, 1, False, 0, {2})
    assert text == "mean over n = 2 seeds, with the 95 % interval (Student's t)"
    assert caption(False, 1, False, 0, {1}) == "mean over n = 1 seeds, no interval"
    text = caption(False, 3, True, 2, {4, 5})
    assert "n = 4 to 5 seeds" in text
    assert "shifted" in text
    assert "intervals clipped" in text
    assert "without 2 incomplete settings" in text


def test_means_over_other_axes_are_not_drawn_for_incomplete_settings():
    settings = [{"a": str(i), "b": str(i % 2)} for i in range(2 * MOST_LINES + 2)]
    runs = [(setting, {"iou_mean": 0.5}) for setting in settings]
    assert set(axis_figures(runs, [["a"], ["b"]])) == {"a.png", "b.png"}
    assert set(axis_figures(runs, [["a"], ["b"]], 1)) == {"a.png"}


def test_geometric_steps_have_a_log_axis():
    assert is_geometric([0.1, 0.3, 1.0, 3.0])
    assert not is_geometric([1.0, 2.0, 3.0, 4.0])
    assert not is_geometric([0.0, 0.1, 0.2]) and not is_geometric([1.0, 10.0])


@pytest.mark.parametrize(
    ("name", "values", "limits"),
    [
        ("low_overlap_share", [0.0, 0.0], (0.0, 1.0)),
        ("nees_position_mean", [0.9, 1.1], (0.5, 2.0)),
        ("nis_mean", [0.02, 30.0], None),
    ],
)
def test_the_axis_of_values_fits_the_metric(name, values, limits):
    with style.drawing():
        axes = style.new_figure(3.0, 2.0).add_subplot()
        axes.plot([0, 1], values)
        scale_values(axes, name)
        low, high = axes.get_ylim()
    if limits is None:
        assert axes.get_yscale() == "log" and low < 0.02 and high > 30.0
    else:
        assert (low, high) == pytest.approx(limits)
