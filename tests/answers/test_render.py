"""An answer as tables and figures."""

import io
import itertools

import numpy as np
import pandas as pd
import pytest
from test_answer import CENTRE, IOU, frame_of, of_values

from stixel_cli.answers import figures, render
from stixel_cli.answers.runs import Runs
from stixel_cli.pictures import style


@pytest.fixture(scope="module")
def answers():
    ious = {"contour": [0.91, 0.92, 0.9, 0.93], "gp_ekf": [0.81, 0.8, 0.82, 0.8]}
    ious["my_100%"] = [0.5, None, 0.52, 0.51]
    runs = with_centre(of_values({name: {"turn": own} for name, own in ious.items()}))
    return [runs.ask(metric=name) for name in (IOU, CENTRE)]


def with_centre(runs):
    return Runs(runs.frame.assign(**{CENTRE: 1.0 - runs.frame[IOU]}), runs.axes)


def test_the_overview_has_the_best_first_and_counts_failures(answers):
    cells = render.overview(answers)
    assert cells.header[:3] == ("tracker", "runs used", "failed")
    failed = zip(("contour", "gp_ekf", "my_100%"), ("0", "0", "1"), strict=True)
    assert [row[:3] for row in cells.rows] == [(name, "3 of 4", n) for name, n in failed]
    lost = Runs(answers[0].runs, ("tracker", "path", "seed")).ask(metric="track_lost")
    assert render.overview([answers[0], lost]).header[-1] == "track loss rate (4 runs) [95 %]"
    # Three units are left: no interval, no best.
    assert not any(map(any, cells.best)) and "[" not in cells.rows[0][3]


def test_a_table_for_a_paper(answers):
    shown = [of_values({"a_1": {"turn": [0.9, 0.91, 0.92, 0.9]}, "b": {"turn": [0.5] * 4}}).ask()]
    text = render.latex(shown, "A & B", "tab:one")
    assert r"\toprule" in text and r"\textbf{0.907" in text and r"a\_1" in text
    assert "\u2212" not in text and r"\label{tab:one}" in text
    assert r"my\_100\%" in render.latex(answers)
    markdown = render.markdown(shown)
    assert "| **0.907" in markdown and shown[0].sentence in markdown
    table = pd.read_csv(io.StringIO(render.csv(shown)))
    assert list(table["tracker"]) == ["a_1", "b"] and table["mean"][0] == pytest.approx(0.9075)
    assert render.records(shown)[0]["minus"] is None


def test_figures_repeat_to_the_byte_and_may_be_over_an_axis_of_numbers(answers):
    for write in (style.svg, style.png, figures.pdf):
        assert figures.differences(answers[0], write) == figures.differences(answers[0], write)
    assert figures.over_axis(answers[0]) is None
    values = {str(v): {"turn": [v, 2 * v, v], "hard": [v, v, v]} for v in (0.1, 0.2, 0.4)}
    assert figures.over_axis(of_values(values).ask()).startswith(b"<?xml")
    values = {name: {"turn": [0.1, 0.2]} for name in ("0.1", "x", "0.2")}
    assert figures.over_axis(of_values(values).ask()) is None
    assert np.isfinite(of_values(values).ask().table["mean"]).all()


def test_runs_and_answers_give_tables_and_figures_themselves(tmp_path):
    runs = with_centre(of_values({"a": {"turn": [0.9] * 4}, "b": {"turn": [0.5] * 4}}))
    both = runs.answers([IOU, CENTRE])
    for form, write in render.TABLES.items():
        assert runs.table([IOU, CENTRE], form) == write(both)
    assert runs.ask(metric=CENTRE).to_latex("A") == render.latex(both[1:], "A")
    runs.ask(metric=CENTRE).figure().savefig(tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert len(both[0].figure().axes) == 2


def test_a_question_of_its_own_keeps_the_units_of_the_default():
    runs = of_values({"a": {"turn": [0.9] * 4, "hard": [0.8] * 4}})
    default = {"compare": "tracker", "within": "seed", "over": "path"}
    runs = type(runs)(runs.frame, runs.axes, default)
    assert runs.ask().question.within == ("seed",)
    assert runs.ask(compare="seed").question.over == ("path",)
    assert runs.ask(compare="seed").question.within == ("tracker",)
    assert runs.ask(over="seed").question.within == ("path",)


def test_the_shares_of_a_consistent_filter_are_the_probabilities():
    # NEES / 2 of an exact filter has the distribution 1 - exp(-x).
    half_nees = -np.log1p(-(np.arange(10_000) + 0.5) / 10_000)
    known = figures.shares_inside({"nees_position": np.append(half_nees, np.nan)})
    np.testing.assert_allclose(known, figures.PROBABILITIES, atol=1e-4)
    # Errors are twice as large as stated.
    larger = figures.shares_inside({"nees_position": 4.0 * half_nees})
    np.testing.assert_allclose(larger, 1.0 - (1.0 - figures.PROBABILITIES) ** 0.25, atol=1e-4)
    assert np.isnan(figures.shares_inside({})).all()


@pytest.mark.drawn
def test_the_figure_of_a_nees_is_a_reliability_diagram(tmp_path):
    runs = of_values({name: {"turn": [1.0] * 4} for name in "ab"})
    folders = [tmp_path / str(i) for i in range(len(runs))]
    for folder in folders:
        folder.mkdir()
        np.savez(folder / "scores.npz", t=np.arange(3.0), nees_position=np.ones(3))
    frame = runs.frame.assign(folder=folders, nees_position_mean=1.0)
    answer = type(runs)(frame, runs.axes).ask(metric="nees_position_mean")
    assert figures.drawing(answer)[0] == figures.reliability(answer) != figures.differences(answer)
    (folders[0] / "scores.npz").unlink()
    assert figures.drawing(answer) == (figures.differences(answer), figures.legend(answer))


def test_the_explanation_names_the_units_and_the_interval_of_each_kind_of_value(answers):
    text = render.explanation([of_values({"a": {"turn": [0.9] * 4}}).ask()])
    assert text.startswith("Each value is the mean over 4 seeds, which every option has; in brack")
    assert "Wilson's for the track loss rate" in text
    assert "the mean over the units named under “In words”, which" in render.explanation()


def test_a_figure_has_the_best_options_and_its_labels_lie_within_it():
    cells = itertools.product(range(25), range(4))
    rows = [(f"{i}", f"{0.1 * i}", seed, 0.9 - 0.01 * i + 0.001 * seed) for i, seed in cells]
    frame = frame_of(rows, ("tracker.degrees_of_freedom", "tracker.length_scale", "seed"))
    answer = Runs(frame).ask()
    figure = answer.figure()
    assert len(figure.axes[0].get_yticks()) == figures.MOST_ROWS // 2  # Names of two lines.
    assert figures.legend(answer).startswith("The best 10 of 25 options; Grey")
    label = figure.axes[1].xaxis.label
    figure.draw_without_rendering()
    assert label.get_text() == "minus the best"
    ends = label.get_window_extent()
    assert 0 <= ends.x0 < ends.x1 <= figure.bbox.width


@pytest.mark.drawn
def test_names_of_any_length_leave_room_for_the_values():
    names = ["tracker.degrees_of_freedom=4.0 tracker.slip=0.05 " * 6, "x" * 300]
    answer = of_values({name: {"turn": [0.5, 0.6, 0.7, 0.8]} for name in names}).ask()
    assert b"</svg>" in figures.differences(answer)
