"""Answers about many runs, calculated by hand or by plain loops; their tables and figures."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from stixel_cli.answers.runs import Runs
from stixel_cli.errors import UserError

IOU, CENTRE = "iou_box_mean", "centre_rmse_m"


def frame_of(rows, names, metric=IOU):
    """A frame of runs: `rows` have the values of `names`, then the metric; None: failed."""
    columns = [*names, metric]
    frame = pd.DataFrame([dict(zip(columns, row, strict=True)) for row in rows])
    status = np.where(frame[metric].isna(), "failed", "done")
    frame.insert(len(names), "status", status)
    return frame.assign(track_lost=np.where(frame[metric].isna(), np.nan, 0.0))


def of_values(values, metric=IOU):
    """Runs of `values`, by tracker and path the values of the seeds."""
    series = [(name, path, own) for name, paths in values.items() for path, own in paths.items()]
    rows = [(*names, *pair) for *names, own in series for pair in enumerate(own)]
    return Runs(frame_of(rows, ("tracker", "path", "seed"), metric))


def half_width(values, tests=1):
    n = len(values)
    return student.ppf(1.0 - 0.025 / tests, n - 1) * np.std(values, ddof=1) / np.sqrt(n)


def test_only_what_every_value_of_an_axis_has_counts():
    # The mean of what exists is highest at .9; within each road user the values fall.
    rows = []
    for user, high in (("car", 0.7), ("cyclist", 0.5), ("bus", 0.9)):
        for sigma, less in ((0.15, 0.0), (0.45, 0.02), (0.9, 0.03)):
            if user != "bus" or sigma == 0.9:
                rows += [(sigma, user, s, high - less + 0.01 * (s % 2)) for s in range(4)]
    frame = frame_of(rows, ("tracker.sigma_f", "road_user", "seed"))
    assert frame.groupby("tracker.sigma_f")[IOU].mean().idxmax() == 0.9
    answer = Runs(frame).ask()
    assert answer.question.compare == ("tracker.sigma_f",)
    assert (answer.units, answer.left_out, answer.scenarios) == (4, 4, ("car", "cyclist"))
    np.testing.assert_allclose(answer.table["mean"], [0.605, 0.585, 0.575])
    assert (answer.best, answer.shown) == (0.15, True)
    assert answer.sentence == (
        "Mean IoU, box: sigma_f=0.15 0.605 [0.596, 0.614] is the best (4 seeds, each the mean of 2 "
        "of 3 road users); sigma_f=0.45 is next, −0.0200 [−0.0200, −0.0200]."
    )
    assert answer.notes == ["Left out: bus, where sigma_f=0.15 and sigma_f=0.45 lack values."]


def test_a_harder_scene_of_one_option_does_not_count():
    easy = [0.8, 0.82, 0.81, 0.79]
    better = [v + 0.02 + i / 1000 for i, v in enumerate(easy)]
    values = {"contour": {"turn": easy}, "gp_ekf": {"turn": better, "hard": [0.3] * 4}}
    answer = of_values(values).ask()
    assert answer.table.loc["gp_ekf", "mean"] > answer.table.loc["contour", "mean"]
    assert (answer.best, answer.shown, answer.left_out) == ("gp_ekf", True, 4)
    assert answer.table.loc["gp_ekf", "runs"] == 8


def test_units_are_seeds_and_differences_are_paired():
    first = {"turn": [0.2, 0.23, 0.18, 0.21, 0.2], "hard": [0.5, 0.55, 0.52, 0.5, 0.53]}
    rise = 0.02 + 0.002 * np.arange(5)
    second = {path: own + rise for path, own in first.items()}
    answer = of_values({"a": first, "b": second}, CENTRE).ask(metric=CENTRE)
    values = np.mean([*second.values()], axis=0) - np.mean([*first.values()], axis=0)
    row = answer.table.loc["b"]
    ends = values.mean() + half_width(values) * np.array([0.0, -1.0, 1.0])
    np.testing.assert_allclose(row[["minus", "minus_low", "minus_high"]], ends)
    assert (row["runs"], answer.units, answer.best, answer.shown) == (10, 5, "a", True)
    # The same as a t-test over the seeds.
    low, high = ttest_1samp(values, 0.0).confidence_interval()
    np.testing.assert_allclose(row[["minus_low", "minus_high"]], [low, high])
    assert answer.over == "5 seeds, each the mean of 2 paths"


def test_differences_from_the_best_hold_together():
    rng = np.random.default_rng(3)
    values = {name: {"turn": list(0.8 + rng.normal(0.0, 0.01, 6))} for name in "abcd"}
    answer = of_values(values).ask()
    best = np.array(values[answer.best]["turn"])
    for name in set("abcd") - {answer.best}:
        minus = np.array(values[name]["turn"]) - best
        found = answer.table.loc[name, "minus_high"] - answer.table.loc[name, "minus"]
        assert found == pytest.approx(half_width(minus, tests=3))
    alone = of_values(values).ask(reference="a")
    minus = np.array(values["b"]["turn"]) - np.array(values["a"]["turn"])
    found = alone.table.loc["b", "minus_high"] - alone.table.loc["b", "minus"]
    assert found == pytest.approx(half_width(minus)) and np.isnan(alone.table.loc["a", "minus"])
    assert "against a (0.798" in alone.sentence


def test_a_ratio_has_no_best_and_is_compared_with_a_stated_reference_alone():
    values = {"a": {"turn": [1.0, 1.1, 0.9, 1.0, 1.05]}, "b": {"turn": [3.0, 3.1, 2.9, 3.0, 3.05]}}
    nees = "nees_position_mean"
    assert "b +2.00" in of_values(values, nees).ask(metric=nees, reference="a").sentence
    assert "minus" not in of_values(values, nees).ask(metric=nees).sentence
    answer = of_values({"a": {"turn": [0.5] * 4}, "b": {"turn": [1.1] * 4}}, nees).ask(metric=nees)
    assert answer.best is None and not answer.shown and "best" not in answer.sentence
    assert answer.worst.loc["a", "value"] == 0.5


def test_a_failed_run_stays_and_counts_as_lost():
    own = {"mine": [0.9, None, 0.91, 0.92, None, 0.9], "point": [0.5, 0.52, 0.51, 0.5, 0.53, 0.51]}
    values = {name: {"turn": seeds} for name, seeds in (own | {"broken": [None] * 6}).items()}
    answer = of_values(values).ask()
    assert list(answer.table["failed"]) == [2, 0, 6] and list(answer.table["runs"]) == [6, 6, 6]
    np.testing.assert_allclose(answer.table["lost_share"], [1 / 3, 0.0, 1.0])
    assert (answer.units, answer.left_out) == (4, 2)
    assert np.isnan(answer.table.loc["broken", "mean"])
    assert answer.over == "4 of 6 seeds"
    lost = "counted as lost in the track loss rate, and in no other value."
    assert answer.notes == [
        "Left out: seed=1 and seed=4, where mine lacks values.",
        "Not compared: broken, without a value.",
        f"Failed: mine 2 of 6 runs and broken 6 of 6 runs; {lost}",
    ]
    assert answer.worst.loc["mine", "status"] == "failed" and answer.order[-1] == "broken"
    rate = of_values(values).ask(metric="track_lost").table["mean"]
    assert (rate["mine"], rate["broken"]) == (pytest.approx(1 / 3), 1.0)


def test_options_are_compared_over_what_all_of_them_have():
    good, poor = [0.9, 0.91, 0.92, 0.9], [0.5, 0.52, 0.51, 0.5]
    values = {"mine": {"car": poor, "cyclist": [None] * 4}, "point": {"car": good, "cyclist": poor}}
    answer = of_values(values).ask()
    assert (answer.over, answer.used) == ("4 seeds, car only", 4)
    assert answer.sentence.startswith("Mean IoU, box: point 0.907 [0.891, 0.922] is the best (4 ")
    assert answer.notes[0] == "Left out: cyclist, where mine lacks values."
    answer = of_values({"a": {"turn": [0.9, None]}, "b": {"turn": [None, 0.5]}}).ask()
    assert "not compared, as each scenario, and each seed, lacks" in answer.sentence
    assert answer.notes[0] == "Left out: turn, where a and b lack values."
    apart = {"a": {"p": [0.9, None], "q": [None] * 2}, "b": {"p": [None, 0.5], "q": [None] * 2}}
    assert of_values(apart).ask().over == "0 of 2 seeds"
    none = of_values({"a": {"turn": [None]}, "b": {"turn": [None]}}).ask(metric=IOU)
    assert "no run has a value" in none.sentence
    values = {"a": {"p": [0.9, 0.5], "q": [0.8, 0.8]}, "b": {"p": [0.7, None], "q": [None, None]}}
    found = of_values(values).ask().by_scenario()
    np.testing.assert_allclose(found.loc["p"], [0.9, 0.7])
    np.testing.assert_allclose(found.loc["q"], [0.8, np.nan])


def test_a_sentence_names_the_last_option_and_counts_more():
    same = {name: {"turn": [0.5, 0.6, 0.7, 0.8]} for name in "abcdefg"}
    assert of_values(same).ask().sentence.endswith("not shown to differ: b, c, d, e and 2 more.")
    del same["g"]
    assert of_values(same).ask().sentence.endswith("not shown to differ: b, c, d, e and f.")
    one_worse = same | {"b": {"turn": [0.1, 0.2, 0.3, 0.4]}}
    answer = of_values(one_worse).ask()
    assert answer.sentence.endswith("not shown to differ: c, d, e and f; worse: b.")
    assert repr(answer) == f"<Answer: {answer.sentence}>"


def test_two_units_claim_nothing():
    values = {"a": {"turn": [0.035, 0.036]}, "b": {"turn": [0.395, 0.39]}}
    answer = of_values(values, CENTRE).ask(metric=CENTRE)
    assert answer.table[["low", "high", "minus_low", "minus_high"]].isna().all(axis=None)
    assert not answer.shown and "too few to compare, 4 are needed" in answer.sentence
    assert "best" not in answer.sentence and "differ" not in answer.sentence


def test_shares_of_lost_runs_have_intervals_over_the_same_units():
    ious = (("a", 0.5), ("b", 0.4))
    values = {name: {"turn": [iou] * 5, "hard": [iou] * 5} for name, iou in ious}
    row = of_values(values).ask(metric="track_lost").table.loc["a"]
    # Wilson's of 0 of 5 seeds, not of 0 of 10 runs.
    assert (row["mean"], row["low"]) == (0.0, 0.0) and row["high"] == pytest.approx(0.434, abs=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_answers_agree_with_plain_loops(seed):
    """Any holes: the larger rectangle of cells that every option has, and its means."""
    rng = np.random.default_rng(seed)
    options, scenes, units = ["x", "y"], ["p", "q", "r"], [0, 1, 2, 3, 4]
    keys = itertools.product(options, scenes, units)
    cells = {key: rng.uniform() if rng.uniform() < 0.85 else None for key in keys}
    rows = [(*key, value) for key, value in cells.items()]
    answer = Runs(frame_of(rows, ("tracker", "path", "seed"))).ask()
    places = [*itertools.product(scenes, units)]
    known = {at for at in places if all(cells[o, *at] is not None for o in options)}
    whole = [s for s in scenes if all((s, u) in known for u in units)]
    full = [u for u in units if all((s, u) in known for s in scenes)]
    used = (whole, units) if len(whole) * len(units) >= len(full) * len(scenes) else (scenes, full)
    if not (used[0] and used[1]):
        assert answer.table["mean"].isna().all()
        return
    for option in options:
        expected = np.mean([np.mean([cells[option, s, u] for s in used[0]]) for u in used[1]])
        assert answer.table.loc[option, "mean"] == pytest.approx(expected)
    assert answer.left_out == len(places) - len(used[0]) * len(used[1])


def test_what_is_not_a_question_is_refused():
    runs = of_values({"a": {"turn": [0.5, 0.6]}, "b": {"turn": [0.4, 0.5]}})
    for parts, said in (
        ({"metric": "ious"}, "ious: no such column"),
        ({"compare": "tracker", "within": "tracker"}, "tracker: is in two of"),
        ({"reference": "c"}, "reference: c: no option"),
        ({"over": (), "within": "path"}, "two are a turn: name"),
        ({"metric": "path"}, "path: must be a column of numbers"),
        ({"better": "up"}, "better: up: must be more, less or one"),
    ):
        with pytest.raises(UserError, match=said):
            runs.ask(compare=parts.pop("compare", "tracker"), **parts)
    with pytest.raises(UserError, match="status is missing"):
        Runs(pd.DataFrame({"tracker": ["a"]}))


def test_any_frame_of_numbers_is_asked_by_name_and_a_missing_setting_is_a_value():
    frame = pd.DataFrame({"method": ["a", "b"] * 4, "seed": np.arange(8) // 2, "status": "done"})
    frame["quality"] = [1.0, 2.0, 1.1, 2.2, 0.9, 1.9, 1.0, 2.1]
    answer = Runs(frame).ask(metric="quality", better="more")
    assert (answer.best, answer.shown) == ("b", True)
    assert Runs(frame).ask(metric="quality", better="less").best == "a"
    alone = Runs(frame[frame["method"] == "a"].drop(columns="method")).ask()
    assert alone.sentence == "Quality: all runs 1.00 [0.87, 1.13] (4 seeds)."
    rows = [("a", None, 0, 0.5), ("a", "turn", 0, 0.7), ("b", None, 0, 0.6), ("b", "turn", 0, 0.8)]
    answer = Runs(frame_of(rows, ("tracker", "path", "seed"))).ask()
    assert answer.scenarios == ("–", "turn")
    np.testing.assert_allclose(answer.table["mean"], [0.6, 0.7])
