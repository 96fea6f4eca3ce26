"""RQ2: statistics of runs and scans, and the names of a frame's columns."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shapely
from rq2_frames import run, scans_of
from scipy.stats import ttest_1samp

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.report.run_frame import measurement_name, run_frame, tracker_name
from stixel_cli.report.scan_frame import gate_shares, within_bounds
from stixel_cli.report.statistics import least_effect
from stixel_cli.report.tables import difference, names
from stixel_cli.results.result import RunResult
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.rq2.figures import CONDITIONS, binned, condition_values
from stixel_cli.validation.point_statistics import contour_distances


def test_differences_are_paired_by_seed():
    offsets = (0.1, 0.2, 0.3, 0.2)
    one = [run(seed, centre=1.0 + seed + offset) for seed, offset in enumerate(offsets)]
    other = [run(seed, "lidar", centre=1.0 + seed) for seed in range(5)]
    found = difference(pd.DataFrame(one), pd.DataFrame(other), "centre_rmse_m")
    # Between seeds the errors differ by 1, between pairs by a tenth of that.
    assert found.n == 4 and found.mean == pytest.approx(0.2)
    assert found.std == pytest.approx(0.1 * np.sqrt(2 / 3))
    assert found.low == pytest.approx(0.2 - 3.182446 * found.std / np.sqrt(4), abs=1e-6)
    one, without = pd.DataFrame(one[:1]), pd.DataFrame([run(centre=np.nan)])
    assert difference(one, without, "centre_rmse_m").n == 0


def test_a_seed_with_several_paths_counts_once():
    one = [run(0, centre=2.0), run(0, path="crossing", centre=4.0)]
    other = [run(0, "lidar", centre=1.0), run(0, "lidar", path="crossing", centre=1.0)]
    found = difference(pd.DataFrame(one), pd.DataFrame(other), "centre_rmse_m")
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
        found = binned(condition, scans)
        labels = [condition.labels[b] for b in found["bin"]]
        assert dict(zip(labels, found["scans"], strict=True)) == counts
    one = found.iloc[0]
    assert one["seeds"] == 2 and one["centre"].n == 2 and one["centre"].mean == 1.0


def test_a_caption_has_the_number_of_seeds_of_a_condition():
    near = {"range": 5.0}
    for changes, told in (
        ([{}, {}, {}], "n = 3 seeds"),
        ([{}, {}, near], "n = 2 to 3 seeds"),
        ([{}, near, near], "n = 1 (without a bar) to 3"),
    ):
        scans = pd.concat([scans_of(seed, **own) for seed, own in enumerate(changes)])
        found = condition_values("by_range", CONDITIONS[0], scans, ["stixels"])
        assert told in f"n = {found['seeds']} seeds"


def test_distances_from_the_contour():
    contour = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
    pose = np.array([5.0, 10.0, 0.5])
    poses = np.stack([pose, pose])
    scenario = Scenario(np.arange(2.0), poses, poses, poses, contour[None])
    points = world_from_target(np.array([[2.5, 0.0], [0.0, 0.9], [0.0, -1.3]]), pose)
    scans = Scans(np.arange(2.0), poses, np.array([0, 0, 3]), points, np.zeros((3, 2, 2)))
    assert contour_distances(scans, scenario) == pytest.approx([0.5, -0.1, 0.3])
    assert shapely.Polygon(contour).area == 8.0


def test_the_least_significant_difference():
    for seeds, tests in ((2, 6), (5, 18)):
        edge = least_effect(seeds, tests)
        values = np.linspace(-1.0, 1.0, seeds)
        values /= values.std(ddof=1)
        for factor, shown in ((1.001, True), (0.999, False)):
            p = ttest_1samp(values + factor * edge, 0.0).pvalue
            assert (tests * p < 0.05) == shown


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
    assert measurement_name("stixels", compose().configuration) == "stixels"
    assert tracker_name("gp_ekf", compose().configuration) == "GP-EKF"


def test_a_frame_without_runs_has_its_columns():
    assert names(run_frame([]), "tracker") == []


def test_a_swept_parameter_is_in_the_tracker_s_or_the_measurement_s_name():
    def study_run(**setting):
        overrides = [f"{key.replace('__', '.')}={value}" for key, value in setting.items()]
        setting = {text.partition("=")[0]: text.partition("=")[2] for text in overrides}
        return RunResult(
            manifest={"swept": setting, "seed": 3},
            composition=compose(overrides),
            metrics={"iou_mean": None, "scans": 4},
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
