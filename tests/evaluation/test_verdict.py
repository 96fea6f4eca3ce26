import sys
from pathlib import Path

import numpy as np
import pytest

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.evaluation.verdict import LIMITS, badges, verdict, word

GOOD = {"scans": 50, "empty_scans": 3, "track_lost": 0, "time_to_loss_s": None, "diverged": 0}
GOOD |= {"iou_mean": 0.9, "iou_baseline": 0.4, "iou_star_convex_upper_bound": 0.98}
GOOD |= {"centre_mean_m": 0.19, "nees_position_mean": 1.2, "nees_orientation_mean": 0.7}
GOOD |= {"nis_mean": 0.9, "band_coverage": 0.93, "time_to_divergence_s": None}
UNCERTAINTY = "uncertainty: NEES/2 of the position 1.2, NEES of the orientation 0.70, NIS 0.90, "
UNCERTAINTY += "95 % band covers 93 %."


def test_a_consistent_track_has_its_word_its_accuracy_and_its_uncertainty():
    accuracy = "good: IoU 0.90 (baseline 0.40, upper bound 0.98), mean centre error 0.19 m."
    assert verdict(GOOD) == [accuracy, UNCERTAINTY]


@pytest.mark.parametrize(
    ("way", "expected"),
    [(LIMITS["good"], "good"), (LIMITS["fair"], "fair"), (LIMITS["fair"] - 0.01, "poor")],
)
def test_the_word_is_of_the_way_from_the_baseline_to_the_upper_bound(way, expected):
    assert word(GOOD | {"iou_mean": 0.4 + 0.58 * way + 1e-9}) == expected
    only_box = {"iou_mean": None, "iou_box_mean": 0.4 + 0.6 * way + 1e-9}
    assert word(GOOD | only_box) == expected
    assert word(GOOD | {"track_lost": 1}) == "lost"


def test_a_baseline_at_the_upper_bound_is_taken_as_below_it():
    at_bound = {"iou_baseline": 0.98, "iou_mean": 0.98}
    assert word(GOOD | at_bound) == "poor"
    assert word(GOOD | at_bound | {"iou_baseline": 0.88}) == "good"


def test_the_sides_are_named_and_what_the_run_speaks_for():
    sides = {"seen_contour_error_m": 0.06, "hidden_contour_error_m": 0.25}
    turned = sides | {"orientation_rmse_deg": 12.3}
    first, second, _ = verdict(GOOD | turned)
    assert first.endswith("near side 6 cm off, far side 25 cm, heading 12° off.")
    assert "tracker=contour" in second
    # A tracker that already takes the class's outline, and a far side that is as near.
    assert len(verdict(GOOD | turned | {"size_deviation": 0.2})) == 2
    assert len(verdict(GOOD | sides | {"hidden_contour_error_m": 0.09})) == 2


def test_a_lost_track_begins_with_its_time():
    lost = GOOD | {"track_lost": 1, "time_to_loss_s": 3.2}
    assert verdict(lost)[0].startswith("lost: off the target from 3.2 s on; IoU 0.90")
    first, second, _ = verdict(lost | {"time_to_loss_s": 0.0})
    assert "from the first scan on" in first and "describe start" in second


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"nees_position_mean": 46.2}, "NEES/2 of the position 46,"),
        ({"nees_position_mean": 0.08}, "NEES/2 of the position 0.080,"),
        ({"nees_orientation_mean": 4.04}, "NEES of the orientation 4.0,"),
        ({"nees_position_mean": 0.2}, "NEES/2 of the position 0.20,"),
        ({"nees_position_mean": 9.97}, "NEES/2 of the position 10,"),
        ({"nis_mean": 0.05}, "NIS 0.050 (residuals smaller than assumed)"),
        ({"nis_mean": 9.26}, "NIS 9.3 (residuals larger than assumed)"),
        ({"band_coverage": 0.41}, "95 % band covers 41 %."),
    ],
)
def test_the_uncertainty_is_one_line_that_names_what_is_beyond_its_limits(changes, expected):
    first, line = verdict(GOOD | changes)
    assert first == verdict(GOOD)[0]
    assert line.startswith("uncertainty: ") and expected in line


def test_points_that_do_not_fit_the_class_are_named():
    beside = {"points_beside_share": 0.3, "size_deviation": 0.2}
    for changes in ({"size_deviation": 5.8}, beside, {"class_replaced_share": 0.8}):
        assert "prior=unknown" in verdict(GOOD | changes)[1]
        assert "reported class" in verdict(GOOD | changes | {"class_error": 1.0})[1]


def test_runs_disturbed_by_a_known_amount_have_the_expected_words(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs")
    import verdicts

    for (*_, expected), found in verdicts.rows(seed=1000, part=24):
        assert found.total() >= 1
        assert sum(found[one] for one in expected) >= 0.5 * found.total()
    sys.modules.pop("verdicts")


def test_the_class_is_named_with_its_probability_and_a_new_one_without_advice():
    classes = dict(car_probability=0.001, cyclist_probability=0.993, pedestrian_probability=0.006)
    right = classes | {"class_error": 0.0, "class_replaced_share": None}
    *_, last = verdict(GOOD | right)
    assert last == "Class: cyclist, 99 %."
    assert verdict({"scans": 3, "nis_mean": 1.0, **classes})[-1] == last
    classes = {"car_probability": 0.02, "cyclist_probability": 0.97, "pedestrian_probability": 0.01}
    assert verdict(GOOD | classes)[-1] == "Class: unknown (cyclist 97 %, car 2 %, pedestrian 1 %)."
    replaced = {"class_replaced_share": 0.5}
    assert verdict(GOOD | classes | replaced)[-1] == "Class: cyclist, 97 %."
    assert verdict(GOOD | {"car_probability": 0.9})[-1] == "Class: car, 90 %."
    words = verdict(GOOD | {"class_replaced_share": 0.5, "other_probability": 1.0})
    assert "new class" in words[1]
    assert "prior=unknown" not in " ".join(words)


def test_a_run_of_a_consistent_filter_whose_errors_persist_is_called_nothing():
    """No word on NEES and band: with an error that stays all run, limits would call many wrong."""
    random = np.random.default_rng(1)
    for nees in (random.chisquare(2, 50) / 2.0, random.chisquare(1, 50)):
        assert np.mean(nees < 1.0 / 3.0) > 0.2
        for value in nees:
            persistent = {"nees_position_mean": value, "nees_orientation_mean": value}
            found = verdict(GOOD | persistent | {"band_coverage": 0.1})
            assert "(" not in found[-1]


def test_limits_are_those_of_the_table():
    for limit, factor in zip(METRICS["nis_mean"].expected, (0.99, 1.01), strict=True):
        assert "(" not in verdict(GOOD | {"nis_mean": limit})[-1]
        assert "(" in verdict(GOOD | {"nis_mean": limit * factor})[-1]


def test_runs_without_measurements_or_of_older_folders_have_a_verdict():
    for lost, begin in ((0, "No verdict: "), (1, "lost: ")):
        unmeasured = {"empty_scans": 50, "nees_position_mean": 50.0, "track_lost": lost}
        (sentence,) = verdict(GOOD | unmeasured)
        assert sentence.startswith(begin) and "empty" in sentence
    assert "older version" in verdict({"iou_mean": 0.5, "scans": 3})[0]
    unknown = ["No verdict: no truth.", "uncertainty: NIS 1.0."]
    assert verdict({"nis_mean": 1.0, "scans": 3}) == unknown
    without_baseline = {**GOOD, "iou_baseline": None}
    assert word(without_baseline) is None
    assert verdict(without_baseline)[0] == "IoU 0.90, mean centre error 0.19 m."


def test_a_diverged_tracker_is_warned_of_first():
    diverged = {"diverged": 1, "time_to_divergence_s": 2.34}
    warning, *_ = verdict(GOOD | diverged)
    assert warning.startswith("WARNING") and "2.3 s" in warning
    lost = verdict(GOOD | diverged | {"track_lost": 1, "time_to_loss_s": 3.0})
    assert lost[0] == warning and lost[1].startswith("lost: off the target from 3.0 s on")
    # A good IoU is no reason to use the estimates.
    assert word(GOOD | diverged) == "poor" and verdict(GOOD | diverged)[1].startswith("poor: ")
    # It needs no truth.
    assert verdict({"scans": 3, **diverged}) == [warning]


def test_a_road_user_out_of_view_is_the_cause_and_no_divergence():
    # As of path=waypoints path.points=[[0,12],[3,15]], in which nothing is measured at the end.
    unmeasured = {"diverged": 1, "time_to_divergence_s": 5.1, "time_out_of_view_s": 4.6}
    first, second, *_ = verdict(GOOD | unmeasured)
    assert first.startswith("The road user leaves the field of view at 4.6 s")
    assert word(GOOD | unmeasured) == "good" and second.startswith("good: ")
    before = verdict(GOOD | unmeasured | {"time_to_divergence_s": 3.0})
    assert before[0].startswith("WARNING") and before[1].startswith("poor: ")


def test_badges_name_what_is_not_expected():
    assert badges({"nees_position_mean": 1.0, "nis_mean": 1.0}) == {}
    found = badges({"nees_position_mean": 4.2, "nis_mean": 0.05, "time_to_loss_s": 1.23})
    assert found == {"centre_error": "lost at 1.2 s", "nis": "residuals smaller × 0.050"}
    assert badges({}) == {}
