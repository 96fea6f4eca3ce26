"""Runs on scans from a file and of a lidar, through the real command line."""

import csv
import json
import shutil

import numpy as np
import pandas as pd
import pytest
from boxes import write_box
from run_cli import SMALL, run_json

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.experiment.stages import experiment_graph
from stixel_cli.results.result import read_scored_run
from stixel_cli.sweeps.graphs import planned_run

QUICK = ("executor=threads", "seed=1003")


def pictured_frames(composition):
    return composition.configuration.pictures.frames_of(composition.scan_count)


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def made(shared):
    """The folder of a run of 15 scans, seen by a sensor that moves."""
    words = ("measurement=fabricated", "measurement.rays=200")
    path = ("path=crossing", "path.duration=1.5", "ego=straight", "pictures.frames=[3]")
    arguments = ["run", "--results", str(shared), "--name", "made", *words, *path, *QUICK]
    assert main(arguments) == 0
    return shared / "made"


def from_files(folder, truth="truth.npz"):
    names = {"path": "scans.csv", "ego": "ego.csv", **({"truth": truth} if truth else {})}
    files = [f"measurement.{key}={folder / name}" for key, name in names.items()]
    # A run's own files have no error that their points share, and the view of its rig.
    exact = ["measurement.range_bias_std=0", "measurement.ego_std=[0,0]", "measurement.time_std=0"]
    return ["measurement=file", *files, *exact, "measurement.horizontal_fov=60", *QUICK]


@pytest.mark.parametrize(("error", "lines"), [(np.pi, 0), (1.7, 1)])
def test_headings_far_from_the_motion_are_named_in_one_line(error, lines, made, tmp_path, capfd):
    folder = tmp_path / "from"
    shutil.copytree(made, folder)
    table = pd.read_csv(folder / "truth.csv")
    table.assign(heading=error + table["heading"]).to_csv(folder / "truth.csv", index=False)
    words = [*from_files(folder, "truth.csv"), "pictures.frames=[]"]
    assert main(["run", "--results", str(tmp_path / "results"), *words]) == 0
    said = [one for one in capfd.readouterr().err.splitlines() if "direction of motion" in one]
    assert len(said) == lines
    assert all(line.startswith("stixel: measurement.truth: headings are ") for line in said)


def arrays(folder, name):
    with np.load(folder / name) as found:
        return dict(found)


@pytest.mark.parametrize(
    "words",
    [
        ("measurement=fabricated", "path=turn"),
        ("measurement=lidar", "path=crossing", "ego=turning"),
        ("road_user=pedestrian", "path=approach"),
    ],
    ids=lambda words: words[0],
)
def test_a_run_from_the_files_of_any_run_gives_the_same_tracks_and_scores(words, shared, capsys):
    name = words[0].partition("=")[2]
    user = [word for word in words if word.startswith("road_user")]
    # A file does not say which sensor its points are of.
    user.append("tracker.seen_by=fabricated")
    few = ["path.duration=0.4", *SMALL, *QUICK, "--name", name]
    run_json(capsys, shared, *words, *user[-1:], *few)
    if name == "lidar":
        # The column z of its points is their height above the road.
        user.append("measurement.road_z=0")
    back = [*from_files(shared / name), *user, "pictures.frames=[1]", "--name", f"{name}-back"]
    run_json(capsys, shared, *back)
    for file in ("scans.csv", "ego.csv", "truth.csv", "track.csv", "scores.csv"):
        before, after = shared / name / file, shared / f"{name}-back" / file
        assert before.read_bytes() == after.read_bytes(), file
    before, after = (shared / folder / "metrics.json" for folder in (name, f"{name}-back"))
    assert json.loads(after.read_text()) == json.loads(before.read_text())


def test_the_truths_table_has_the_box_of_the_contour(made, shared, capsys):
    answer = run_json(capsys, shared, *from_files(made, "truth.csv"), "pictures.frames=[]")
    box = json.loads((made / "metrics.json").read_text())
    assert answer["metrics"]["centre_rmse_m"] == box["centre_rmse_m"]
    assert answer["metrics"]["iou_box_mean"] == pytest.approx(box["iou_box_mean"], abs=1e-3)
    assert answer["metrics"]["iou_mean"] is None


@pytest.mark.sketched
def test_without_truth_scores_are_left_out_and_the_start_comes_from_the_scans(made, shared, capsys):
    words = from_files(made, None)
    answer = run_json(capsys, shared, *words, "pictures.frames=[1]", "--name", "blind")
    known = {"diverged", "nis_mean", "scans", "empty_scans"}
    assert {*answer["metrics"]} == known | {"points_per_scan_mean", "points_used_mean"}
    folder = shared / "blind"
    assert json.loads((folder / "manifest.json").read_text())["choices"]["start"] == "scans"
    assert (folder / "scores.csv").read_text().splitlines()[0] == "k,t,nis"
    assert not (folder / "truth.csv").exists()
    pictures = {file.name for file in (folder / "figures").rglob("*.*")}
    assert {"birds_eye.png", "path.png", "errors.svg"} <= pictures
    track, truth = arrays(folder, "track.npz"), arrays(made, "truth.npz")
    error = np.hypot(track["means"][:, 0] - truth["x"], track["means"][:, 1] - truth["y"])
    assert error[-1] < 1.0
    assert np.isnan(read_scored_run(folder).scores.iou).all()


def test_a_run_without_truth_is_a_run_like_any_other(made, shared, tmp_path, capsys):
    run_json(capsys, shared, *from_files(made, None), "pictures.frames=[]", "--name", "any")
    for command in ("ls", "verify --cached", f"run --results {tmp_path}", "explain"):
        assert main([*command.split(), str(shared / "any")]) == 0, capsys.readouterr().err


def test_runs_with_and_without_truth_are_compared_and_played(made, shared, tmp_path, capsys):
    names = ("seen", "blind2", "blind3")
    blind = from_files(made, None)
    given = from_files(made, "truth.csv"), blind, [*blind, "tracker=point"]
    for name, words in zip(names, given, strict=True):
        run_json(capsys, shared, *words, "pictures.frames=[]", "--name", name)
    folders = [str(shared / name) for name in names]
    assert main(["ls", *folders]) == 0
    assert main(["report", *folders, "--output", str(tmp_path / "a.html")]) == 0
    assert main(["report", "--play", *folders[1:], "--output", str(tmp_path / "b.html")]) == 0
    assert main(["report", "--play", *folders[:2], "--output", str(tmp_path / "c.html")]) == 2
    assert "measurement.truth is" in capsys.readouterr().err


@pytest.mark.sketched
def test_a_truth_of_some_scans_scores_those_scans(made, tmp_path, shared, capsys):
    rows = (made / "truth.csv").read_text().splitlines()
    (tmp_path / "some.csv").write_text("\n".join([rows[0], *rows[5:9]]) + "\n")
    words = [*from_files(made, None), f"measurement.truth={tmp_path / 'some.csv'}"]
    answer = run_json(capsys, shared, *words, "pictures.frames=[0,5]", "--name", "some")
    assert answer["metrics"]["iou_box_mean"] > 0.0
    iou = arrays(shared / "some", "scores.npz")["iou_box"]
    assert np.array_equal(np.flatnonzero(np.isfinite(iou)), [4, 5, 6, 7])
    assert answer["metrics"]["iou_box_mean"] == pytest.approx(iou[4:8].mean())
    assert arrays(shared / "some", "truth.npz")["k"].tolist() == [4, 5, 6, 7]


@pytest.mark.summed
def test_a_sweep_of_files_without_truth_has_statistics_of_what_is_known(made, shared, capsys):
    words = [*from_files(made, None), "tracker=gp_ekf,point"]
    assert main(["sweep", "--results", str(shared), "--name", "sweep", *words]) == 0
    assert "nis_mean" in (shared / "sweep" / "summary.csv").read_text()
    assert "iou_mean" not in (shared / "sweep" / "summary.csv").read_text()


def keys(words):
    graph = experiment_graph(compose(words))
    return {name: nodes[0].key for name in graph.stages if (nodes := graph.of_stage(name))}


def test_the_content_of_each_file_is_in_the_keys_that_need_it(made, tmp_path):
    for name in ("scans.csv", "ego.csv", "truth.csv"):
        shutil.copy(made / name, tmp_path)
    words = from_files(tmp_path, "truth.csv")
    before = keys(words)
    truth = tmp_path / "truth.csv"
    truth.write_text(truth.read_text().replace("\n0,", "\n0 ,", 1))
    after = keys(words)
    assert before["scans"] == after["scans"]
    assert before["scenario"] != after["scenario"]
    scans = tmp_path / "scans.csv"
    scans.write_text(scans.read_text() + "\n")
    assert keys(words)["scans"] != before["scans"]


def test_scans_class_and_start_are_those_of_the_file(made):
    composition = compose(from_files(made))
    assert composition.scan_count == 15
    assert pictured_frames(composition)[-1] < 15
    late = compose([*from_files(made), "pictures.frames=[15]"])
    with pytest.raises(UserError, match="must be <= 14, the last frame, got 15"):
        pictured_frames(late)
    with pytest.raises(UserError, match="must be <= 49, the last frame, got 50"):
        planned_run(compose(["path.duration=5", "pictures.frames=[0,50]"]))
    composed = compose([*from_files(made, None), "road_user=cyclist"])
    assert (composed.choices["prior"], composed.choices["start"]) == ("cyclist", "scans")
    assert compose(from_files(made)).choices["start"] == "default"
    with pytest.raises(ConfigurationError, match="start: there is no truth to start from"):
        compose([*from_files(made, None), "start=default"])


OF_SCENE = ["path=turn", "path.speed=3", "ego=straight", "rig=kitti", "renderer=raycast"]


@pytest.mark.parametrize("word", [*OF_SCENE, "stereo=bm", "rig.width=320", "road_user.length=3"])
def test_settings_of_a_scene_are_refused(word, made):
    with pytest.raises(ConfigurationError, match=f"{word.partition('=')[0]}: has no effect"):
        compose([*from_files(made), word])


def lidar_keys(*words: str) -> tuple[str, str]:
    """The keys of the returns and of the scans."""
    found = keys(["measurement=lidar", *words])
    return found["cast_lidar"], found["scans"]


def test_the_returns_are_those_of_what_the_beams_meet():
    """Seeds, noise, gates and stereo share them."""
    returns, scans = lidar_keys()
    for word in ("seed=1", "measurement.range_std=0.03", "measurement.height_min=0.5"):
        assert lidar_keys(word)[0] == returns and lidar_keys(word)[1] != scans, word
    assert lidar_keys("rig.baseline=1.0") == (returns, scans)
    for word in ("rig.horizontal_fov=40.0", "measurement.scanner.layers=5", "world.seed=2"):
        assert lidar_keys(word)[0] != returns, word
    assert lidar_keys("ego=straight")[0] != returns


def test_two_sensors_and_two_trackers_of_a_mesh_of_ones_own_from_a_car_that_turns(capsys, tmp_path):
    mesh = write_box(tmp_path / "barrow.obj", 3.0, 1.4, 1.4)
    words = ["measurement=fabricated,lidar", "tracker=gp_ekf,point", "path.duration=0.3"]
    words += [f"road_user.mesh={mesh}", "ego=turning", "path.start=[-1.0,9.0]"]
    code = main(["sweep", "--results", str(tmp_path), "--name", "both", *words])
    assert code == 0, capsys.readouterr().err
    with (tmp_path / "both" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert len({row["centre_rmse_m"] for row in rows}) == 4
    assert all(float(row["points_used_mean"]) > 10 for row in rows)
    assert all(float(row["low_overlap_share"]) == 0.0 for row in rows)
