import pytest

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.evaluation.verdict import badges, verdict

GOOD = {
    "scans": 50,
    "empty_scans": 3,
    "track_lost": 0,
    "time_to_loss_s": None,
    "diverged": 0,
    "time_to_divergence_s": None,
    "iou_box_mean": 0.81,
    "nees_position_mean": 1.2,
    "nees_orientation_mean": 0.7,
    "nis_mean": 0.9,
    "band_coverage": 0.93,
}


def test_a_consistent_track_has_one_sentence():
    (sentence,) = verdict(GOOD)
    assert "0.81" in sentence and "consistent" in sentence


def test_the_first_sentence_has_the_accuracy():
    (sentence,) = verdict(GOOD | {"iou_mean": 0.754, "centre_mean_m": 0.19})
    assert sentence.startswith("Tracked to the end: IoU 0.75, mean centre error 0.19 m;")


def test_an_upper_bound_is_named_where_it_is_below_one():
    assert len(verdict(GOOD | {"iou_star_convex_upper_bound": 0.9951})) == 1
    assert "0.97" in verdict(GOOD | {"iou_star_convex_upper_bound": 0.97})[-1]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"track_lost": 1, "time_to_loss_s": 3.2}, "Track lost at 3.2 s."),
        ({"nees_position_mean": 46.2}, "Over-confident: position NEES/2 46."),
        ({"nees_position_mean": 0.08}, "Under-confident: position NEES/2 0.08."),
        ({"nees_orientation_mean": 4.04}, "Over-confident in the orientation: NEES 4."),
        ({"nis_mean": 0.05}, "Residuals are smaller than assumed (NIS 0.05)."),
        ({"nis_mean": 9.26}, "Residuals are larger than assumed (NIS 9.3)."),
        (
            {"nis_mean": 0.05, "nees_position_mean": 46.0},
            "Residuals are smaller than assumed (NIS 0.05) while the error is larger: the points "
            "share an error.",
        ),
        ({"band_coverage": 0.41}, "The 95 % band covers only 41 % of the true outline."),
        (
            {"size_deviation": 5.8},
            "The points do not fit the prior's class; the road user may be of another class.",
        ),
        (
            {"points_beside_share": 0.3, "size_deviation": 0.2},
            "The points do not fit the prior's class; the road user may be of another class.",
        ),
        (
            {"class_replaced_share": 0.8},
            "The points do not fit the prior's class; the road user may be of another class.",
        ),
        ({"class_error": 1.0}, "The reported class is not that of the road user."),
    ],
)
def test_verdict_names_what_is_wrong(changes, expected):
    sentences = verdict(GOOD | changes)
    assert expected in sentences
    assert not any("consistent" in one for one in sentences)
    lost = changes.get("time_to_loss_s") is not None
    assert any(one.startswith("Tracked to the end") for one in sentences) != lost


def test_the_class_is_named_with_its_probability():
    classes = {
        "car_probability": 0.001,
        "cyclist_probability": 0.993,
        "pedestrian_probability": 0.006,
    }
    right = classes | {"class_error": 0.0, "class_replaced_share": None}
    first, last = verdict(GOOD | right)
    assert "consistent" in first
    assert last == "Class: cyclist, 99 %."
    assert verdict({"scans": 3, "nis_mean": 1.0, **classes})[-1] == last


def test_an_unknown_class_is_named_at_odds_of_100_and_a_replaced_one_at_once():
    classes = {"car_probability": 0.02, "cyclist_probability": 0.97, "pedestrian_probability": 0.01}
    assert verdict(GOOD | classes)[-1] == "Class: unknown (cyclist 97 %, car 2 %, pedestrian 1 %)."
    replaced = {"class_replaced_share": 0.5}
    assert verdict(GOOD | classes | replaced)[-1] == "Class: cyclist, 97 %."


def test_a_class_without_others_is_named():
    assert verdict(GOOD | {"car_probability": 0.9})[-1] == "Class: car, 90 %."


def test_limits_are_those_of_the_table():
    for name in ("nees_position_mean", "nees_orientation_mean", "nis_mean", "band_coverage"):
        for limit, factor in zip(METRICS[name].expected, (0.99, 1.01), strict=True):
            if limit is not None:
                assert len(verdict(GOOD | {name: limit})) == 1
                assert len(verdict(GOOD | {name: limit * factor})) == 2


def test_a_target_never_measured_has_that_verdict_alone():
    (sentence,) = verdict(GOOD | {"empty_scans": 50, "nees_position_mean": 50.0})
    assert "never measured" in sentence


def test_metrics_of_older_folders_have_a_verdict():
    assert "older version" in verdict({"iou_mean": 0.5, "nis_mean": None, "scans": 3})[0]
    assert verdict({"nis_mean": 1.0, "scans": 3}) == ["No verdict: no truth."]
    assert verdict({"nees_position_mean": 7.0}) == ["Over-confident: position NEES/2 7."]


def test_a_diverged_tracker_is_warned_of_first():
    diverged = {"diverged": 1, "time_to_divergence_s": 2.34}
    warning, *others = verdict(GOOD | diverged)
    assert warning.startswith("WARNING") and "2.3 s" in warning
    assert not any("consistent" in one for one in others)
    lost = verdict(GOOD | diverged | {"track_lost": 1, "time_to_loss_s": 3.0})
    assert lost[0] == warning and lost[1] == "Track lost at 3.0 s."
    # It needs no truth.
    assert verdict({"scans": 3, **diverged}) == [warning]


def test_badges_name_what_is_not_expected():
    assert badges({"nees_position_mean": 1.0, "nis_mean": 1.0}) == {}
    assert badges({"nees_position_mean": 4.2, "nis_mean": 0.05, "time_to_loss_s": 1.23}) == {
        "centre_error": "lost at 1.2 s",
        "nees_position": "over-confident × 4.2",
        "nis": "residuals smaller × 0.05",
    }
    assert badges({}) == {}
