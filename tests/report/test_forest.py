"""Forest plots: what is drawn of which row, and that zero is one line in all panels."""

import pytest

from stixel_cli.report.forest import Row, forest
from stixel_cli.report.page import smallest_text
from stixel_cli.report.statistics import Statistic


def value(mean, low=None, high=None):
    return Statistic(mean, low, high, 5)


CAR = Row("car", "lidar", "centre RMSE", "m", value(0.1, 0.07, 0.13), True, True)
IOU = Row("car", "lidar", "mean IoU", "", value(-0.2), more_is_better=True)


@pytest.fixture
def drawn(monkeypatch):
    """The Matplotlib figure of the rows."""
    seen = []

    def keep(figure):
        seen.append(figure)
        return b"<svg"

    def draw(*rows):
        monkeypatch.setattr("stixel_cli.pictures.style.svg", keep)
        assert forest("f", rows, "better", "worse").svg == b"<svg"
        return seen[-1]

    return draw


def test_zero_is_one_line_and_worse_is_on_one_side(drawn):
    centre, iou = drawn(CAR, IOU).axes
    zeros = [axes.transAxes.inverted().transform(axes.transData.transform((0.0, 0.0)))[0]
             for axes in (centre, iou)]  # fmt: skip
    assert zeros[0] == pytest.approx(zeros[1])
    # A lower IoU and a larger error are both to the right.
    assert iou.get_xlim()[0] > iou.get_xlim()[1]
    for axes, value in ((centre, 0.1), (iou, -0.2)):
        assert (
            axes.transAxes.inverted().transform(axes.transData.transform((value, 0.0)))[0]
            > (zeros[0])
        )


def test_tested_marks_are_filled_and_significant_ones_have_a_star(drawn):
    centre, iou = drawn(CAR, IOU).axes
    filled, hollow = (
        next(line for line in axes.lines if list(line.get_xdata()) == [value])
        for axes, value in ((centre, 0.1), (iou, -0.2))
    )
    assert filled.get_markerfacecolor() == filled.get_color()
    assert hollow.get_markerfacecolor() == "#ffffff" != hollow.get_color()
    assert [text.get_text() for text in centre.texts] == ["+0.100\u202fm [0.070, 0.130] *"]
    assert [text.get_text() for text in iou.texts] == ["−0.200"]


def test_rows_of_several_series_name_them(drawn):
    other = Row("car", "wide lidar", "centre RMSE", "m", value(0.2, 0.1, 0.3))
    (axes,) = drawn(CAR, other).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["car, lidar", "car, wide lidar"]


def test_nothing_known_has_no_plot():
    assert forest("f", [Row("car", "", "m", "", value(None, None, None))]) is None


def test_letters_are_large_enough_on_paper_and_screen():
    svg = forest("f", [CAR, IOU], "better", "worse").svg.decode()
    assert smallest_text(svg) == 9.0
