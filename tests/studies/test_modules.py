"""What the studies' own modules compute, of small inputs and labels made by hand."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from stixel_cli.answers.runs import Runs
from stixel_cli.config.compose import compose
from stixel_cli.errors import MissingData
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.studies import motions, robustness, rq1, rq3
from stixel_cli.studies.file import read_study
from stixel_cli.studies.report import StudyData, data_folder
from stixel_cli.studies.wrong_poses import wrong_poses
from stixel_cli.sweeps.design import find_file
from stixel_cli.validation.point_errors import PointErrors

sys.path.append(str(Path(__file__).parents[1] / "recordings"))
from made_argoverse import TARGET, make_motion


def frame(**columns):
    """Runs whose axes are the columns."""
    return Runs(pd.DataFrame(columns).assign(status="done"), tuple(columns))


def test_metrics_of_the_stages_of_rq1():
    stixels = pd.DataFrame(
        {"error": [0.3, -0.1, 9.0], "square": [0.1, np.nan, 9.0], "disparity": [0.6, 0.8, 5.0],
         "sigma": [0.3, 0.1 / np.sqrt(3.0), 1.0], "height": [0.1, 0.3, 9.0],
         "lateral": [0.0, 0.2, 9.0]}
    )  # fmt: skip
    frames = pd.DataFrame(
        {"columns": [10, 0, 30], "uncovered": [1, 0, 3], "missed": [15, 0, 5], "valid": [80, 0, 0],
         "pixels": [100, 0, 0], "gross": [20, 0, 0], "total": [30.0, 0.0, 0.0],
         "squares": [15.0, 0.0, 0.0]}
    )  # fmt: skip
    expected = {"depth_bias_m": 0.1, "depth_rms_m": np.sqrt(0.05), "own_pixels_rms_m": 0.1}
    expected |= {"stixel_disparity_rms_px": np.sqrt(0.5), "stixel_gross_share": 1 / 3}
    expected |= {"squared_error_over_variance": 2.0, "height_bias_m": 0.2}
    expected |= {"missed_columns_share": 0.5, "pixel_density_share": 0.8}
    expected |= {"pixel_rms_px": 0.5, "columns_without_stixel_share": 0.1}
    assert rq1.stage_metrics(frames, stixels) == pytest.approx(expected)
    nothing = rq1.stage_metrics(frames[:0], stixels[:0])
    assert np.isnan([*nothing.values()]).all()


def test_the_required_disparity_depends_on_the_rig():
    rig = Rig(640, 480, 60.0, None, None, None, 0.3, 1.2, 0.0, None)
    runs = [SimpleNamespace(configuration=SimpleNamespace(rig=rig))] * 2
    data = StudyData({"rigs": SimpleNamespace(runs=runs)})
    (table,) = rq1.material(data).tables.values()
    (row,) = table.to_dict("records")
    needed = row["needed σ of the disparity (px)"]
    assert needed == pytest.approx(0.0212, abs=1e-4) and row["image (px)"] == "640 × 480"
    disparity = rig.disparity_from_depth(28.0)
    assert rig.depth_from_disparity(disparity - needed) - 28.0 == pytest.approx(0.1, rel=0.01)


def test_sweeps_that_do_not_want_errors_of_stages_keep_their_scores():
    """They have images, and could have them."""
    stages = {"scores": ("s",), "stage_errors": ("a", "b")}
    run = SimpleNamespace(graph=SimpleNamespace(stages=stages), targets=("s",))
    runs = frame(seed=["0"])
    assert rq1.columns("widths", runs, [run]) is runs


def errors_of(bias, count=400, scans=4):
    """Points 10 m away whose ranges are `bias` off, with noise of 0.1 px."""
    rng = np.random.default_rng(int(100 * bias))
    scan = np.repeat(np.arange(scans), count // scans)
    disparities = rng.normal(0.0, 0.1, count)
    columns = np.tile(np.arange(count // scans, dtype=float), scans)
    of_points = {"scans": scan, "columns": columns, "covered": np.ones(count, bool)}
    of_points |= {"disparities": disparities, "along": bias - 0.4 * disparities}
    of_points |= {"range_sensitivities": np.full(count, -0.4)}
    of_points |= {"inside": np.minimum(columns, columns[::-1]) + 1.0}
    of_scans = {"times": 0.1 * np.arange(scans), "columns_per_metre": np.full(scans, 40.0)}
    of_scans |= dict.fromkeys(("reach_left", "reach_right"), np.zeros(scans))
    return PointErrors(spacing=1.0, clutter=np.array([0, 1, 0, 1]), **of_points, **of_scans)


def test_noise_is_fitted_to_the_other_paths_of_a_road_user():
    biases = {("car", "turn"): 0.1, ("car", "crossing"): 0.5, ("bus", "turn"): 0.9}
    noises = rq3.held_out_noises({key: [errors_of(bias)] for key, bias in biases.items()})
    found = {key: noise.range_bias for key, noise in noises.items()}
    # One path alone is fitted to itself.
    expected = {("car", "turn"): 0.5, ("car", "crossing"): 0.1, ("bus", "turn"): 0.9}
    assert found == pytest.approx(expected, abs=0.05)


def test_runs_of_rq3_have_the_statistics_of_their_points():
    loaded = []

    def run(bias):
        return SimpleNamespace(load=lambda stage: loaded.append(stage) or errors_of(bias))

    trackers = {"tracker": ["a", "b", "a"], "seed": ["0", "0", "1"]}
    runs = frame(road_user=["car"] * 3, path=["turn"] * 3, **trackers)
    found = rq3.columns("simulated", runs, [run(0.1), run(0.1), run(0.3)])
    # Trackers share the points, which are read once.
    assert loaded == ["point_errors"] * 2
    bias = found.frame["bias_along_the_ray_m"]
    assert bias[0] == bias[1] and list(bias) == pytest.approx([0.1, 0.1, 0.3], abs=0.02)
    assert list(found.frame["points_per_scan"]) == [100.0] * 3
    assert list(found.frame["clutter_points_per_scan"]) == [0.5] * 3
    assert found.axes == runs.axes


@pytest.mark.parametrize(
    ("column", "key", "value", "text"),
    [
        ("shape", "road_user.mesh", "/x/shapes/car/l_shape.obj", "l shape, car"),
        ("gap", "measurement.dropout", "[1.5,3.5]", "2 s"),
        ("error", "sensor.disparity_error", "-0.3", "-0.3 px"),
        ("target", "source.target", "31", "31"),
        ("recording", "measurement.path", "/x/pedestrian-b/scans.csv", "pedestrian-b"),
        ("scans", "measurement.path", "/x/default-00/scans.csv", "default"),
    ],
)
def test_columns_of_robustness_stand_for_their_keys(column, key, value, text, monkeypatch):
    monkeypatch.setattr(robustness, "_found_again", lambda run: 1.0)
    runs = frame(tracker=["box"], **{key: [value]}, seed=["0"])
    found = robustness.columns("any", runs, [None])
    assert found.frame[column][0] == text and column in found.axes and key not in found.axes
    assert ("found_again" in found.metrics) == (column == "gap")


def test_a_target_is_found_again_one_second_after_a_gap():
    configuration = compose(["measurement=stixels", "measurement.dropout=[0.5,1.0]"]).configuration
    times = 7.0 + 0.5 * np.arange(6)
    overlaps = np.array([0.9, 0.9, 0.1, 0.1, 0.4, 0.1])
    scores = SimpleNamespace(times=times, iou_box=overlaps)
    run = SimpleNamespace(configuration=configuration, scores=scores)
    assert robustness._found_again(run) == 1.0
    overlaps[4] = 0.39
    assert robustness._found_again(run) == 0.0


def test_a_real_track_is_a_motion_and_a_hand_made_path_is_one():
    def run(**path):
        return SimpleNamespace(configuration=SimpleNamespace(path=SimpleNamespace(**path)))

    log = run(sequence=None, folder="/x/7fab2350-7eaf", target="022c398c-d1d2")
    results = [run(sequence="0001", folder="/x/kitti", target=3), log]
    settings = {"path": ["recorded"] * 2, "path.target": ["3", "0"], "tracker": ["point"] * 2}
    runs = frame(**settings, seed=["0", "1"])
    found = motions.columns("real", runs, results)
    assert list(found.frame["motion"]) == ["0001/3", "7fab2350/022c398c"]
    assert found.axes == ("tracker", "motion")
    runs = frame(path=["turn", "circle"], seed=["0", "0"])
    found = motions.columns("hand_made", runs, [run(), run()])
    assert list(found.frame["motion"]) == ["turn", "circle"] and found.axes == ("seed", "motion")


def test_few_tracks_of_each_class_are_spread_evenly(monkeypatch):
    track = motions.RealTrack(None, "0", 0, "Car", range(30))
    tracks = [replace(track, target=k, kind="Van" if k % 2 else "Car") for k in range(7)]
    tracks.append(replace(track, target=7, kind="Pedestrian"))
    monkeypatch.setattr(motions, "MOST_SIMULATED", 3)
    assert [one.target for one in motions.simulated_subset(tracks)] == [0, 2, 4, 7]


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    """A folder of data with tables of two targets of a lidar, and of one run of a scenario."""
    for name in ("pandaset/car-a", "pandaset/pedestrian-b", "lidarrm/default-00"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "scans.csv").touch()
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    return tmp_path


def test_recordings_are_those_of_the_users_data(recordings):
    (axes,) = robustness.pandaset()
    assert axes["road_user"] == ["car", "pedestrian"]
    folders = [recordings / "pandaset" / name for name in ("car-a", "pedestrian-b")]
    assert axes["measurement.truth"] == [str(folder / "truth.csv") for folder in folders]
    assert {*axes} == {"road_user", *(f"measurement.{name}" for name in ("path", "ego", "truth"))}
    (axes,) = robustness.lidarrm()
    assert axes["measurement.path"] == [str(recordings / "lidarrm/default-00/scans.csv")]
    (axes,) = robustness.clip()
    assert axes["source.target"] == [31, 0, 1] and len(axes["source.folder"]) == 3


def test_shapes_are_shipped_meshes_of_their_class():
    (axes,) = robustness.shapes()
    names = [(user, Path(mesh).stem) for user, mesh in zip(*axes.values(), strict=True)]
    assert ("car", "trapezium") in names and ("cyclist", "cargo_bike") in names
    assert len(robustness.held_out()[0]["road_user"]) >= 3
    odd = {Path(mesh).stem for mesh in robustness.odd()[0]["road_user.mesh"]}
    assert {"truck", "stroller"} <= odd


def test_without_data_one_line_names_the_variable(studies, recordings, monkeypatch):
    (recordings / "lidarrm/default-00/scans.csv").unlink()
    with pytest.raises(MissingData, match="lidarrm has no folder"):
        robustness.lidarrm()
    monkeypatch.delenv("STIXEL_DATA")
    assert "STIXEL_DATA: must name a folder that has pandaset" in studies.refused("robustness_real")


OVERRIDES = ("measurement=fabricated", "measurement/noise=constant", "path=depart", "ego=straight")
SPEED = 5.0


@pytest.fixture(scope="module")
def scenario():
    p = compose((*OVERRIDES, f"ego.speed={SPEED}", "path.duration=0.6")).configuration
    return build_scenario(ego_motion(p.ego, 0.6, 0.1), p.road_user, p.path)


@pytest.fixture(scope="module")
def true(scenario):
    p = compose(OVERRIDES).configuration
    return fabricate_scans(scenario, p.rig, p.measurement, seed=3)


def test_right_poses_change_nothing_but_what_is_stated(scenario, true):
    found = wrong_poses(scenario, 3)
    np.testing.assert_allclose(found.points_world, true.points_world, atol=1e-12)
    np.testing.assert_allclose(found.covariances_world, true.covariances_world, atol=1e-12)
    np.testing.assert_array_equal(found.sensor_poses_world, true.sensor_poses_world)
    file = compose(("measurement=file", "measurement.path=scans.csv")).configuration.measurement
    assert found.shared_errors == file.shared_errors != true.shared_errors


def test_each_error_moves_the_points_as_it_should(scenario, true):
    poses, rows = true.sensor_poses_world, true.rows(4)
    offsets = true.points_world[rows] - poses[4, :2]
    turned = wrong_poses(scenario, 3, yaw_deg=90.0)
    moved = turned.points_world[rows] - poses[4, :2]
    np.testing.assert_allclose(moved, offsets[:, ::-1] * [-1.0, 1.0], atol=1e-9)
    variances = turned.covariances_world[rows, 0, 0]
    np.testing.assert_allclose(variances, true.covariances_world[rows, 1, 1], atol=1e-12)
    farther = wrong_poses(scenario, 3, range_m=0.25).points_world[rows] - poses[4, :2]
    along = offsets / np.hypot(*offsets.T)[:, None]
    np.testing.assert_allclose(farther - offsets, 0.25 * along, atol=1e-9)
    # The ego car drives along y; the first pose has no earlier one.
    late = wrong_poses(scenario, 3, late_s=0.1)
    shift = late.points_world - true.points_world
    np.testing.assert_allclose(shift[rows], [[0.0, -0.1 * SPEED]] * len(offsets), atol=1e-9)
    np.testing.assert_allclose(shift[true.rows(0)], 0.0, atol=1e-9)
    drifting = wrong_poses(scenario, 3, drift_m_s=0.5)
    np.testing.assert_allclose(drifting.sensor_poses_world[4] - poses[4], [0.2, 0.0, 0.0])
    shift = drifting.points_world[rows] - true.points_world[rows]
    np.testing.assert_allclose(shift, [[0.2, 0.0]] * len(offsets), atol=1e-9)


SIZES = {"Car": "1.5 1.8 4.2", "Cyclist": "1.7 0.6 1.8", "Pedestrian": "1.7 0.6 0.7"}


def label(frame, target, kind, x, z, truncated=0, occluded=0):
    place = f"{SIZES[kind]} {x} 1.65 {z} -1.5"
    return f"{frame} {target} {kind} {truncated} {occluded} 0 0 0 9 9 {place}"


def row(*rows):
    return " ".join(repr(value) for line in rows for value in line)


LOG = "7fab2350-7eaf"

FEW = 6
"""Frames of the made tracks, in the place of 30."""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Clips 0000 with cars and 0001 with a cyclist and a pedestrian, and an ego car that drives;
    beside them a log with a bicycle, which the ego car no longer sees at the end."""
    folder = tmp_path_factory.mktemp("data")
    make_motion(folder / motions.LOGS / LOG, mounted=True)
    root = folder / "kitti_tracking" / "training"
    few = FEW
    clips = {
        "0000": [label(k, 3, "Car", 0.5, 9.0 + 0.1 * k) for k in range(few)]
        # Too far, too short, hidden, cut; and one whose middle frame is.
        + [label(k, 4, "Car", 1.0, 41.0) for k in range(few)]
        + [label(k, 5, "Car", 1.0, 12.0) for k in range(few - 1)]
        + [label(k, 6, "Car", 1.0, 12.0, occluded=3) for k in range(few)]
        + [label(k, 7, "Car", 1.0, 12.0, truncated=1) for k in range(few)]
        + [label(k, 8, "Car", 3.0, 10.0, occluded=3 * (k == 2)) for k in range(few + 1)],
        "0001": [label(k, 0, "Cyclist", 1.0, 8.0) for k in range(few)]
        + [label(k, 1, "Pedestrian", -1.0, 7.0) for k in range(few)],
    }
    others = "0 150 40 0 0 0 1 0"
    calibration = [f"P2: 150 0 78 0 {others}", f"P3: 150 0 78 -75 {others}"]
    ways = [[0, 0, 1.0, 0.2 * k] for k in range(few + 5)]
    poses = [row([1.0, 0, 0, 0], [0, 1.0, 0, 0], way) for way in ways]
    for name, rows in clips.items():
        for kind, lines in (("label_02", rows), ("calib", calibration), ("ego_poses", poses)):
            (root / kind).mkdir(parents=True, exist_ok=True)
            (root / kind / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_tracks_that_count(data, monkeypatch):
    assert motions.LEAST_FRAMES == 30
    monkeypatch.setattr(motions, "LEAST_FRAMES", FEW)
    monkeypatch.setenv("STIXEL_DATA", str(data))
    found = motions.real_tracks(data_folder(motions.NEEDED, motions.CLIPS))
    named = [(one.sequence, one.target, one.kind, len(one.frames)) for one in found]
    assert named == [
        ("0000", 3, "Car", 6),
        ("0000", 8, "Car", 7),
        ("0001", 0, "Cyclist", 6),
        ("0001", 1, "Pedestrian", 6),
        (None, TARGET, "Cyclist", 9),
    ]
    (axes,) = motions.every_track()
    assert axes["path.target"] == [3, 8, 0, 1, TARGET] and axes["seed"] == [0, 1, 2, 3, 4]
    assert axes["path.frames"][1] == "0:7" and axes["path.frames"][-1] == "0:9"
    assert [Path(folder).name for folder in axes["path.folder"][3:]] == [motions.CLIPS, LOG]
    monkeypatch.setattr(motions, "MOST_SIMULATED", 1)
    (some,) = motions.some_tracks()
    assert some["path.target"] == [3, 0, 1] and some["seed"] == [0, 2, 3]


def test_without_data_it_is_refused_in_one_line_and_left_out_of_all(studies, monkeypatch, tmp_path):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    assert "STIXEL_DATA: must name a folder that has kitti_tracking" in studies.refused("motions")
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    with pytest.raises(MissingData):
        motions.every_track()
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    monkeypatch.setattr("stixel_cli.cli.study.STUDIES", ["motions"])
    (answer,) = studies.run("all")["studies"]
    assert not answer["complete"] and "STIXEL_DATA" in answer["error"]


def test_the_shipped_study_has_the_eight_paths_and_a_shape_for_each_seed():
    study = read_study(find_file("motions", study=True))
    assert len(study.sweeps[0].content["axes"]["path"]) == 8
    for sweep in study.sweeps:
        assert sweep.content["fixed"]["road_user.shape_seed"] == "${seed}"
