"""RQ2: what is computed, and a tiny study of it by the real command line."""

import csv
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rq2_frames import run
from scipy.stats import ttest_1samp
from study_toy import answer_of

from stixel_cli.report.statistics import t_test
from stixel_cli.report.tables import shown_table
from stixel_cli.studies.rq2.contrasts import contrasts
from stixel_cli.studies.rq2.report import answer_values

TINY = (
    "road_user=pedestrian",
    "path=crossing",
    "measurement=fabricated",
    "tracker=gp_ekf,point",
    "path.duration=0.3",
    "seed=range(0,2)",
    "executor=threads",
)

_TRACKERS = {"gp_ekf": "GP-EKF", "point": "point tracker"}


def answer(runs):
    return answer_of("rq2", answer_values(pd.DataFrame(runs)))


def test_the_answer_has_every_tracker_and_measurement():
    seeds = range(4)
    runs = [run(seed, "stixels", centre=0.5 + 0.01 * seed) for seed in seeds]
    runs += [run(seed, "lidar_9", centre=0.2) for seed in seeds]
    runs += [run(seed, "stixels", "point", centre=1.5) for seed in seeds]
    runs += [run(seed, "stixels", "new_one", centre=0.4) for seed in seeds]
    runs += [run(seed, "lidar_9", "new_one", centre=0.4) for seed in seeds]
    text = " ".join(answer(runs))
    assert "the gp_ekf is worse on stixels than on the lidar_9 for the car (centre, o" in text
    tables = answer_values(pd.DataFrame(runs))["tables"]
    header, rows, _ = shown_table(tables["answer_means"])
    assert header[:5] == ["road user", "tracker", "measurement", "n", "centre RMSE (m)"]
    assert rows[0][:5] == ["car", "gp_ekf", "stixels", "4", "0.515"]
    assert rows[1][2:5] == ["lidar_9", "4", "0.200"]
    # NEES, like every mean, of each measurement, and without a test.
    assert (header[-2], rows[0][-2]) == ("mean NEES / 2", "1.00")
    # A tracker that came later is answered for, the baseline is not.
    assert "show no difference between stixels and the lidar_9 for the new_one." in text
    # The answer in words comes first, then the values of each class, the caveat.
    first, lead, _, few = answer(runs)[:4]
    assert first == (
        "With gp_ekf, the centre RMSE on stixels, against lidar, is 0.32 m greater for the car "
        "(4 seeds). With new_one, the centre RMSE on stixels, against lidar, is not shown to "
        "differ for the car (4 seeds)."
    )
    assert few.startswith("With 4 seeds a test is hardly significant: a mean difference must")
    assert lead == (
        "Car, gp_ekf: centre RMSE 0.52\u202fm on stixels; 0.20\u202fm on the lidar_9, "
        "difference +0.315\u202fm [0.294, 0.336]."
    )
    assert "no p below 0.125 at n = 4" in text
    assert "The point is" not in text
    _, rows, _ = shown_table(tables["answer_baseline"])
    assert rows[0][:3] == ["car", "gp_ekf", "point"] and rows[0][3].startswith("−0.985 [")
    assert {row[1] for row in rows} == {"gp_ekf", "new_one"}
    assert "6 paired t-tests over n = 4 seeds" in text
    no_stixels = [one for one in runs if one["measurement_kind"] == "lidar"]
    assert "has no answer" in answer(no_stixels)[0]
    assert answer_values(pd.DataFrame(no_stixels))["tables"] == {}
    _, rows, _ = shown_table(tables["trackers"])
    assert [row[:3] for row in rows] == [
        *(["car", name, "4"] for name in ("gp_ekf", "point", "new_one"))
    ]
    assert "position NEES / 2 of the gp_ekf on stixels is 1.00 for the car" in text


def test_a_tracker_below_the_baseline_is_reported():
    runs = []
    for user, shift in {"car": -0.5, "cyclist": 0.5, "pedestrian": 0.0}.items():
        for seed in range(4):
            change = shift + 0.01 * seed * (1.0 if shift else (-1.0) ** seed)
            own = {"road_user": user, "seed": seed}
            runs.append(run(measurement="stixels", centre=1.0 + change, **own))
            runs.append(run(measurement="stixels", tracker="point", centre=1.0, **own))
            runs.append(run(seed, "lidar", centre=1.0, road_user=user))
    text = " ".join(answer(runs))
    assert (
        "By these intervals the IoU of the gp_ekf is 0.048 greater for the car, 0.052 smaller for "
        "the cyclist and not shown to differ for the pedestrian." in text
    )
    assert "[95 %, not corrected for multiplicity]: car +0.048 [" in text


def test_one_seed_allows_no_test():
    runs = [
        run(0, "stixels", centre=0.5),
        run(0, "lidar", centre=0.2),
    ]
    runs += [run(0, "stixels", "point", centre=0.6)]
    first, lead, few, *rest = answer(runs)
    assert first.endswith("is not shown to differ for the car (1 seed).")
    assert few == "With fewer than four seeds there is no interval."
    assert lead.endswith("0.20\u202fm on the lidar, difference +0.300\u202fm.")
    text = " ".join(rest)
    assert "t-tests" not in text and "no difference" not in text
    assert "the IoU of the gp_ekf is not shown to differ for the car." in text


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
    found = {(one.road_user, one.metric): one for one in contrasts(pd.DataFrame(runs))}
    assert len(found) == 9
    verdicts = {user: found[user, "centre_rmse_m"].verdict for user in shifts}
    assert verdicts == {"car": "worse", "cyclist": "leaning", "pedestrian": "alike"}
    one = found["cyclist", "centre_rmse_m"]
    raw = ttest_1samp([0.03 + value for value in noise], 0.0).pvalue
    assert t_test(one.difference) == pytest.approx(raw)
    assert one.p > 3.0 * raw and one.difference.low > 0.0
    lidar = [r for r in runs if r["measurement_kind"] == "lidar"]
    assert contrasts(pd.DataFrame(lidar)) == []


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
        assert float(row["± centre RMSE (m)"]) == pytest.approx(np.std(values, ddof=1), rel=1e-9)
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
    monkeypatch.setattr("stixel_cli.studies.run._files", lambda folder: {"a": "changed"})
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
