"""RQ2: what is computed, and a tiny study of it by the real command line."""

import csv
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shapely
from scipy.stats import ttest_1samp
from study_toy import answer_of

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.data import StudyRun, measurement_name, names, run_frame, tracker_name
from stixel_cli.studies.rq2.answer import answer_tables, answer_values
from stixel_cli.studies.rq2.conditions import CONDITIONS, condition_statistics
from stixel_cli.studies.rq2.contrasts import family, least_effect, p_value
from stixel_cli.studies.rq2.figures import by_condition
from stixel_cli.studies.rq2.report import gate_shares
from stixel_cli.studies.runs import contour_distances, paired_difference, within_bounds
from stixel_cli.studies.tables import shown_table

TINY = (
    "road_user=pedestrian",
    "path=crossing",
    "measurement=fabricated",
    "tracker=gp_ekf,point",
    "path.duration=0.3",
    "seed=range(0,2)",
    "executor=threads",
)


def answer(runs):
    return answer_of("rq2", answer_values(pd.DataFrame(runs)))


def run(seed=0, measurement="simulated", tracker="gp_ekf", centre=1.0, **changes):
    """A row of a frame of runs."""
    kind = {"stixels": "simulated"}.get(measurement, measurement.partition("_")[0])
    return {
        "road_user": "car",
        "path": "turn",
        "measurement": measurement,
        "tracker": tracker,
        "measurement_kind": kind,
        "tracker_kind": tracker,
        "seed": seed,
        "centre_rmse_m": centre,
        "orientation_rmse_deg": 2.0 * centre,
        "iou_mean": 0.9 - 0.1 * centre,
        "iou_hull_mean": 0.9 - 0.1 * centre,
        "iou_box_mean": 0.9 - 0.1 * centre,
        "low_overlap_share": 0.0,
        "track_lost": 0.0,
        "nees_position_mean": 1.0,
        "nis_mean": 1.0,
    } | changes


def scans_of(seed=0, count=4, **changes):
    """The frame of the scans of one run."""
    return pd.DataFrame(
        {
            "road_user": "car",
            "path": "turn",
            "measurement": "simulated",
            "tracker": "gp_ekf",
            "seed": seed,
            "k": np.arange(count),
            "t": np.arange(count) * 0.1,
            "centre": 1.0,
            "orientation": 2.0,
            "iou": 0.5,
            "nees": 1.0,
            "nis": 1.0,
            "nis_degrees": 10,
        }
        | ({} if count != 4 else FOUR_SCANS)
        | changes
    )


FOUR_SCANS = {
    "range": [5.0, 9.0, 9.5, 50.0],
    "aspect": [0.0, 50.0, 90.0, 180.0],
    "used": [0, 1, 2, 50],
    "points": [0, 2, 2, 60],
}


def test_differences_are_paired_by_seed():
    one = [run(seed, centre=1.0 + seed + offset) for seed, offset in ((0, 0.1), (1, 0.2), (2, 0.3))]
    other = [run(seed, "lidar", centre=1.0 + seed) for seed in (0, 1, 2, 3)]
    found = paired_difference(pd.DataFrame(one), pd.DataFrame(other), "centre_rmse_m")
    # Between seeds the errors differ by 1, between pairs by a tenth of that.
    assert found.n == 3 and found.mean == pytest.approx(0.2)
    assert found.std == pytest.approx(0.1)
    assert found.low == pytest.approx(0.2 - 4.302653 * 0.1 / np.sqrt(3), abs=1e-6)
    one, without = pd.DataFrame(one[:1]), pd.DataFrame([run(centre=np.nan)])
    assert paired_difference(one, without, "centre_rmse_m").n == 0


def test_a_seed_with_several_paths_counts_once():
    one = [run(0, centre=2.0), run(0, path="crossing", centre=4.0)]
    other = [run(0, "lidar", centre=1.0), run(0, "lidar", path="crossing", centre=1.0)]
    found = paired_difference(pd.DataFrame(one), pd.DataFrame(other), "centre_rmse_m")
    assert (found.n, found.mean) == (1, 2.0)


def test_only_a_consistent_filter_is_within_the_bounds():
    draw = np.random.default_rng(3)
    count, degrees = 2000, 10

    def made(seed, scale):
        return scans_of(
            seed,
            count,
            nees=scale * draw.chisquare(2, count) / 2,
            nis=scale * draw.chisquare(degrees, count) / degrees,
            nis_degrees=degrees,
        )

    nees, nis = within_bounds(pd.concat([made(seed, 1.0) for seed in range(5)]))
    assert nees == pytest.approx(0.95, abs=0.02) and nis == pytest.approx(0.95, abs=0.02)
    nees, nis = within_bounds(pd.concat([made(seed, 4.0) for seed in range(5)]))
    assert nees < 0.2 and nis < 0.01
    assert within_bounds(scans_of(nis=np.nan, nis_degrees=0))[1] is None


def test_scans_are_sorted_into_bins():
    by_name = {condition.name: condition for condition in CONDITIONS}
    scans = pd.concat([scans_of(seed) for seed in (0, 1)])
    expected = {
        "range": {"< 8": 2, "8–12": 4, "≥ 40": 2},
        "aspect": {"0–15": 2, "45–75": 2, "75–105": 2, "165–180": 2},
        "points": {"0": 2, "1–2": 4, "> 40": 2},
    }
    for name, counts in expected.items():
        condition = by_name[name]
        assert len(condition.labels) == len(condition.edges) + 1
        found = condition_statistics(condition, scans)
        assert {condition.labels[key[2]]: one.scans for key, one in found.items()} == counts
    (one, *_) = found.values()
    assert one.seeds == 2
    assert one.errors["centre"].n == 2 and one.errors["centre"].mean == 1.0


def test_a_caption_has_the_number_of_seeds_of_a_condition():
    near = {"range": 5.0}
    for changes, told in (
        ([{}, {}, {}], "n = 3 seeds"),
        ([{}, {}, near], "n = 2 to 3 seeds"),
        ([{}, near, near], "n = 1 (without a bar) to 3"),
    ):
        scans = pd.concat([scans_of(seed, **own) for seed, own in enumerate(changes)])
        figure = by_condition("by_range", CONDITIONS[0], scans, ["simulated"])
        assert told in figure.caption


def test_distances_from_the_contour():
    contour = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
    pose = np.array([5.0, 10.0, 0.5])
    poses = np.stack([pose, pose])
    scenario = Scenario.rigid(np.arange(2.0), poses, poses, poses, contour)
    points = world_from_target(np.array([[2.5, 0.0], [0.0, 0.9], [0.0, -1.3]]), pose)
    scans = Scans(np.arange(2.0), poses, np.array([0, 0, 3]), points, np.zeros((3, 2, 2)))
    assert contour_distances(scans, scenario) == pytest.approx([0.5, -0.1, 0.3])
    assert shapely.Polygon(contour).area == 8.0


def test_the_answer_has_every_tracker_and_measurement():
    seeds = range(3)
    runs = [run(seed, "stixels", centre=0.5 + 0.01 * seed) for seed in seeds]
    runs += [run(seed, "lidar_9", centre=0.2) for seed in seeds]
    runs += [run(seed, "stixels", "point", centre=1.5) for seed in seeds]
    runs += [run(seed, "stixels", "new_one", centre=0.4) for seed in seeds]
    runs += [run(seed, "lidar_9", "new_one", centre=0.4) for seed in seeds]
    text = " ".join(answer(runs))
    assert "the gp_ekf is worse on stixels than on the lidar_9 for the car (centre, o" in text
    beside_lidar, beside_baseline = answer_tables(pd.DataFrame(runs))
    header, rows, _ = shown_table(beside_lidar)
    assert header[3:] == ["stixels", "lidar_9", "stixels − lidar_9 [95 %]"]
    assert rows[0] == [
        "car", "gp_ekf", "centre RMSE, m", "0.510", "0.200", "0.310 [0.285, 0.335]"
    ]  # fmt: skip
    # NEES, like every mean, of both measurements, and without a test.
    assert rows[7][2:] == ["mean NEES / 2", "1.00", "1.00", "–"]
    assert [row[2] for row in rows[3:7]] == [
        *("mean IoU, hull", "mean IoU, box", "share of low overlap", "track loss rate")
    ]
    # A tracker that came later is answered for, the baseline is not.
    assert "show no difference between stixels and the lidar_9 for the new_one." in text
    # One sentence for each class comes first, then all effects with their intervals.
    few, lead, _, first = answer(runs)[:4]
    assert few.startswith("With 3 seeds a test is hardly significant: a mean difference must")
    assert lead == (
        "Car, gp_ekf: centre RMSE 0.51\u202fm on stixels; 0.20\u202fm on the lidar_9, "
        "difference +0.310\u202fm [0.285, 0.335]."
    )
    assert first.startswith(
        "Gp_ekf: mean difference, stixels minus lidar_9 [95 %]. Car: centre RMSE +0.310\u202fm "
        "[0.285, 0.335]"
    )
    assert "no p below 0.250 at n = 3" in text
    assert "The point is" not in text
    _, rows, _ = shown_table(beside_baseline)
    assert rows[0][:6] == ["car", "gp_ekf", "point", "centre RMSE, m", "0.510", "1.50"]
    assert rows[0][6].startswith("−0.990 [")
    assert {row[1] for row in rows} == {"gp_ekf", "new_one"}
    assert "6 paired t-tests over n = 3 seeds" in text
    no_stixels = [one for one in runs if one["measurement_kind"] == "lidar"]
    assert "has no answer" in answer(no_stixels)[0]
    assert answer_tables(pd.DataFrame(no_stixels)) == ()
    assert "position NEES / 2 of the gp_ekf on stixels is 1.00 for the car" in text


def test_a_tracker_below_the_baseline_is_reported():
    runs = []
    for user, shift in {"car": -0.5, "cyclist": 0.5, "pedestrian": 0.0}.items():
        for seed in range(3):
            change = shift + 0.01 * seed * (1.0 if shift else (-1.0) ** seed)
            own = {"road_user": user, "seed": seed}
            runs.append(run(measurement="stixels", centre=1.0 + change, **own))
            runs.append(run(measurement="stixels", tracker="point", centre=1.0, **own))
            runs.append(run(seed, "lidar", centre=1.0, road_user=user))
    text = " ".join(answer(runs))
    assert (
        "better for the car; worse for the cyclist; not shown to differ for the pedestrian." in text
    )
    assert "[95 %, not corrected for multiplicity]: car +0.049 [" in text


def test_one_seed_allows_no_test():
    runs = [
        run(0, "stixels", centre=0.5),
        run(0, "lidar", centre=0.2),
    ]
    runs += [run(0, "stixels", "point", centre=0.6)]
    few, lead, effects, _, *rest = answer(runs)
    assert few.startswith("With one seed there is no test and no interval")
    assert lead.endswith("0.20\u202fm on the lidar, difference +0.300\u202fm.")
    assert "centre RMSE +0.300\u202fm, orientation" in effects
    text = " ".join(rest)
    assert "t-tests" not in text and "no difference" not in text
    assert "the gp_ekf is not comparable (no interval) for the car." in text


def test_the_least_significant_difference():
    for seeds, tests in ((2, 6), (5, 18)):
        edge = least_effect(seeds, tests)
        values = np.linspace(-1.0, 1.0, seeds)
        values /= values.std(ddof=1)
        for factor, shown in ((1.001, True), (0.999, False)):
            p = ttest_1samp(values + factor * edge, 0.0).pvalue
            assert (tests * p < 0.05) == shown


def test_only_a_significant_difference_is_called_worse():
    seeds = range(5)
    # Far apart, by a little, and not at all: 0.03 is told by its interval alone.
    shifts = {"car": 0.5, "cyclist": 0.03, "pedestrian": 0.0}
    noise = (0.01, -0.02, 0.02, -0.01, 0.0)
    runs = []
    for user, shift in shifts.items():
        for seed in seeds:
            centre = 0.5 + shift + noise[seed] * (1.0 if shift else 0.0)
            runs.append(run(seed, "stixels", centre=centre, road_user=user))
            runs.append(run(seed, "lidar", centre=0.5, road_user=user))
    found = {(one.road_user, one.metric): one for one in family(pd.DataFrame(runs))}
    assert len(found) == 9
    verdicts = {user: found[user, "centre_rmse_m"].verdict for user in shifts}
    assert verdicts == {"car": "worse", "cyclist": "leaning", "pedestrian": "alike"}
    one = found["cyclist", "centre_rmse_m"]
    raw = ttest_1samp([0.03 + value for value in noise], 0.0).pvalue
    assert p_value(one.difference) == pytest.approx(raw)
    assert one.p > 3.0 * raw and one.difference.low > 0.0
    lidar = [r for r in runs if r["measurement_kind"] == "lidar"]
    assert family(pd.DataFrame(lidar)) == []


def test_gating_loses_points_of_the_target_and_lets_others_in():
    contour = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.array([[0.5, 0.1], [0.5, 0.9], [0.5, 2.5], [9.0, 9.0], [8.0, 9.0]])
    results = {
        "scans": Scans.of_each(np.zeros(1), np.zeros((1, 3)), [(points, np.zeros((5, 2, 2)))]),
        "scenario": SimpleNamespace(contour_world=lambda k: contour),
        "track": SimpleNamespace(used_points=np.array([0, 2, 3])),
    }
    lost, others = gate_shares([SimpleNamespace(load=results.__getitem__)])
    assert (lost, others) == (pytest.approx(1 / 3), pytest.approx(1 / 3))
    assert gate_shares([]) == (None, None)


def test_measurements_and_trackers_have_the_names_of_the_field():
    configuration = compose(["measurement=lidar_64", "tracker=point"]).configuration
    assert measurement_name("lidar_64", configuration) == "64-layer lidar"
    assert tracker_name("point", configuration) == "point tracker"
    assert measurement_name("simulated", compose().configuration) == "stixels"
    assert tracker_name("gp_ekf", compose().configuration) == "GP-EKF"


_TRACKERS = {"gp_ekf": "GP-EKF", "point": "point tracker"}


@pytest.fixture
def tiny(studies):
    answer = studies.run("rq2", *TINY)
    assert answer["complete"] and answer["sweeps"]["tracking"]["runs"] == 2 * 2
    return Path(answer["folder"])


def test_a_tiny_study_from_the_command_line(tiny):
    html = (tiny / "report.html").read_text(encoding="utf-8")
    for title in (
        "Pedestrian",
        "Fabricated measurements",
        "Over time",
    ):
        assert re.search(rf"<h[23]>[\d.]+ {title}</h", html), title
    # What was not run by this study is not in its report.
    for words in ("Published", "model.md", "lost"):
        assert words not in html
    with (tiny / "sweeps/tracking/runs.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    with (tiny / "tables/pedestrian_tracking.csv").open(encoding="utf-8") as file:
        rows = {row["tracker"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"GP-EKF", "point tracker"}
    for tracker, row in rows.items():
        values = [
            float(one["centre_rmse_m"]) for one in runs if _TRACKERS[one["tracker"]] == tracker
        ]
        assert float(row["centre RMSE (m)"]) == pytest.approx(np.mean(values), rel=1e-12)
        assert float(row["± centre"]) == pytest.approx(np.std(values, ddof=1), rel=1e-9)
    names_of_figures = {path.stem for path in (tiny / "figures").iterdir()}
    assert {
        "pedestrian_boxes",
        "pedestrian_crossing_over_time_centre",
        "pedestrian_by_range",
    } <= names_of_figures


def test_the_report_is_read_from_the_cache_unless_its_code_or_template_changes(
    tiny, studies, monkeypatch
):
    def report(data):
        raise AssertionError("computed again")

    before = {path: path.read_bytes() for path in tiny.glob("[ft]*/*")}
    monkeypatch.setattr("stixel_cli.studies.rq2.report.report", report)
    studies.run("rq2", *TINY)
    assert before == {path: path.read_bytes() for path in tiny.glob("[ft]*/*")}
    monkeypatch.setattr("stixel_cli.studies.findings._files", lambda folder: {"a": "changed"})
    with pytest.raises(AssertionError, match="computed again"):
        studies.run("rq2", *TINY)


def test_the_page_of_a_tiny_study_fits_its_screen(tiny, open_page):
    for width, dark in ((1280, False), (390, True)):
        opened = open_page(tiny / "report.html", width=width, height=844, dark=dark)
        assert opened.problems == [] and opened.overflow() == 0
        # A wide table moves in its own box, and no figure is wider than the page.
        boxes = opened.page.locator(".scroll")
        assert boxes.count() > 5
        wider = boxes.evaluate_all("all => all.filter(b => b.scrollWidth > b.clientWidth).length")
        assert wider > 0 if width == 390 else wider >= 0
        widest = opened.page.locator("figure").evaluate_all(
            "all => Math.max(...all.map(f => f.getBoundingClientRect().right))"
        )
        assert widest <= width


def test_a_frame_without_runs_has_its_columns():
    assert names(run_frame([]), "tracker") == []


def test_a_swept_parameter_is_in_the_tracker_s_or_the_measurement_s_name():
    def study_run(**setting):
        overrides = [f"{key.replace('__', '.')}={value}" for key, value in setting.items()]
        return StudyRun(
            0,
            {text.partition("=")[0]: text.partition("=")[2] for text in overrides},
            3,
            compose(overrides).configuration,
            {"iou_mean": None, "scans": 4},
            None,
            {},
            None,
        )

    frame = run_frame(
        [
            study_run(measurement="lidar", tracker__sigma_f="0.1"),
            study_run(measurement="lidar_64", tracker__sigma_f="0.2"),
        ]
    )
    assert names(frame, "tracker") == [
        "GP-EKF, tracker.sigma_f 0.1",
        "GP-EKF, tracker.sigma_f 0.2",
    ]
    assert names(frame, "measurement")[1] == "64-layer lidar"
    assert names(frame, "road_user") == ["car"] and names(frame, "seed") == [3]
    assert frame["iou_mean"].isna().all() and frame["scans"].dtype == float
