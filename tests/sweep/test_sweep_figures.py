"""Figures of a sweep: lines side by side, intervals within bounds, incomplete settings."""

import numpy as np
import pytest

from stixel_cli.pictures import style
from stixel_cli.report.charts import line, line_look
from stixel_cli.report.statistics import statistic
from stixel_cli.sweeps.figures import (
    MOST_LINES,
    _lines,
    axis_figures,
    caption,
    dodges,
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


def drawn(rows, **look):
    with style.drawing():
        axes = style.new_figure(3.0, 2.0).add_subplot()
        line(axes, [0.1 + i for i in range(len(rows))], rows, bars=True, **line_look(0) | look)
    return [np.transpose(line.get_data()) for line in axes.lines]


def test_drawn_means_and_intervals():
    known = statistic("iou_mean", [0.2, 0.95, 0.5, 0.6])
    interval, line = drawn([known, statistic("iou_mean", [None])])
    np.testing.assert_allclose(interval, [[0.1, known.low], [0.1, known.high]])
    np.testing.assert_allclose(line, [[0.1, 0.5625]])


def test_below_four_the_runs_are_drawn():
    runs, _ = drawn([statistic("iou_mean", [0.2, 0.95])])
    np.testing.assert_allclose(runs, [[0.1, 0.2], [0.1, 0.95]])
    assert len(drawn([statistic("iou_mean", [0.5])])) == 1
    assert len(drawn([statistic("iou_mean", [0.5, 0.6])], marker="")) == 1


def test_the_caption_says_what_is_drawn():
    assert caption("seeds", 1, 0, {5}) == "mean over n = 5 seeds; bars: 95 % intervals"
    assert caption("seeds", 1, 0, {2}) == "mean over n = 2 seeds; ticks: the runs"
    assert caption("seeds", 1, 0, {1}) == "one run of each setting (seeds: 1)"
    text = caption("seeds", 3, 2, {4, 5})
    assert "n = 4 to 5 seeds" in text and "shifted" in text
    assert "without 2 incomplete settings" in text


def test_many_combinations_are_thin_lines_with_their_mean():
    many = [(("a", str(i)), ("b", str(i % 2))) for i in range(2 * MOST_LINES + 2)]
    runs = [(setting, ("0",), {"iou_mean": 0.5}) for setting in many]
    found, looks = _lines(["b"], runs, 0)
    assert len(looks) == len(many) + 1
    assert found[("0",), ""]["iou_mean"].n == 1
    # The mean over incomplete settings would not be over the same ones.
    assert len(_lines(["b"], runs, 1)[1]) == len(many)
    assert set(axis_figures(runs, [["a"], ["b"], ["seed"]])) == {"a.png", "b.png"}


def test_no_two_lines_look_alike():
    looks = [tuple(line_look(i).values()) for i in range(32)]
    assert len(set(looks)) == 32
    # Without colour, too, the first eight differ.
    assert len({look[1:] for look in looks[:8]}) == 8


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
        ("centre_rmse_m", [0.1, 0.12, 0.1, 9.0], None),
    ],
)
def test_the_axis_of_values_fits_the_metric(name, values, limits):
    with style.drawing():
        axes = style.new_figure(3.0, 2.0).add_subplot()
        axes.plot(range(len(values)), values)
        scale_values(axes, name)
        low, high = axes.get_ylim()
    if limits is None:
        assert axes.get_yscale() == "log" and low < min(values) and high > max(values)
    else:
        assert (low, high) == pytest.approx(limits)
