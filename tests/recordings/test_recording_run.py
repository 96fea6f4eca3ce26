"""A recording through the pipeline: the real command line on a look-alike, and the real clip."""

import json
import shutil
from collections import Counter

import numpy as np
import pytest
from made_clip import make_clip, small_scenario
from real_data import real_data
from refusals import refused

from stixel_cli import compose
from stixel_cli.cli.app import main
from stixel_cli.config.compose import from_resolved
from stixel_cli.config.folders import use_presets
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.recordings import find

SMALL = ("stereo.nearest=1.6", "occupancy.nearest=3")
HERE = "executor=threads"


def of(folder, *more, sequence="0003", target=0):
    given = ("source=kitti_tracking", f"source.folder={folder}", f"source.sequence={sequence}")
    return [*given, f"source.target={target}", *more]


def run(capsys, results, *overrides, small=SMALL):
    capsys.readouterr()
    code = main(["run", "--json", "--results", str(results), HERE, *small, *overrides])
    said = capsys.readouterr()
    assert code == 0, said.err
    return json.loads(said.out)


def test_the_recording_gives_rig_times_class_and_what_suits_real_images(clip):
    made = compose(of(clip))
    chosen = made.configuration
    rig = chosen.rig
    assert (rig.width, rig.height, rig.focal, rig.u0, rig.v0) == (160, 96, 150.0, 78.0, 40.0)
    assert (rig.baseline, rig.camera_height, rig.pitch) == (0.5, 1.65, 0.0)
    assert rig.focal_v == rig.focal
    assert made.scan_count == 5 and chosen.path.sample_time == 0.1
    assert made.choices["road_user"] == made.choices["prior"] == "car"
    assert made.choices["road"] == "estimated" and chosen.road.pitch_range == 4.0
    assert chosen.stereo.nearest == chosen.occupancy.nearest == 2.0
    assert made.resolved["source"]["frames"] == "0:5"
    # It halves the time of matching.
    assert chosen.stereo.disparities_at_full_size == 64
    # The labels' cars are smaller than the drawn ones.
    assert (chosen.prior.length, chosen.prior.width_std) == (4.0, 0.086)
    assert [made.choices[group] for group in ("path", "ego", "rig")] == ["source"] * 3


@pytest.fixture
def heads(monkeypatch):
    """The number of times that the head of each image is read."""
    counts, read = Counter(), find.image_size
    monkeypatch.setattr(find, "image_size", lambda file: counts.update([file]) or read(file))
    return counts


@pytest.mark.parametrize(
    "command",
    [
        ("run", "start=default"),
        ("run", "--dry-run"),
        ("sweep", "--dry-run", "tracker=box,point", "seed=range(0,2)"),
        ("explain",),
        ("assess", "--calibrate"),
        ("assess",),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_a_command_reads_the_head_of_each_image_once(
    command, clip, heads, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)  # where `assess` writes its page
    main([*command, *of(clip), *SMALL, HERE])
    capsys.readouterr()
    assert set(heads.values()) == {1} and len(heads) == 10


def test_a_stored_run_opens_its_recording_once(clip, heads, tmp_path, capsys):
    run(capsys, tmp_path, *of(clip), "pictures.frames=[]", "--name", "made")
    for command in (["run", "--results", str(tmp_path)], ["verify"]):
        heads.clear()
        assert main([*command, str(tmp_path / "made")]) == 0
        assert set(heads.values()) == {1} and len(heads) == 10
    capsys.readouterr()


def test_a_recording_that_changes_between_two_runs_is_opened_anew(clip, tmp_path):
    folder = shutil.copytree(clip, tmp_path / "clip")
    before = compose(of(folder))
    for camera in ("image_02", "image_03"):
        (folder / camera / "0003" / "000004.png").unlink()
    assert (before.recording.count, compose(of(folder)).recording.count) == (5, 4)


def test_what_the_user_sets_stays(clip):
    own = ("road=rig", "rig.pitch=1", "stereo.nearest=4", "road_user=pedestrian")
    chosen = compose(of(clip, *own, "source.sample_time=0.2", "source.frames=1:4"))
    assert chosen.configuration.road.kind == "rig"
    assert chosen.configuration.rig.pitch == 1.0 and chosen.configuration.rig.focal == 150.0
    assert chosen.configuration.stereo.nearest == 4.0
    assert chosen.choices["prior"] == "pedestrian"
    assert (chosen.configuration.path.sample_time, chosen.scan_count) == (0.2, 3)


def test_what_an_experiment_sets_stays(clip, tmp_path):
    (tmp_path / "experiment").mkdir()
    head = "# @package _global_\ndefaults:\n  - override /stereo: "
    far = f"{head}sgm\nstereo: {{nearest: 3.0, disparities_at_full_size: 128}}\n"
    (tmp_path / "experiment" / "far.yaml").write_text(far)
    (tmp_path / "experiment" / "blocks.yaml").write_text(f"{head}bm\n")
    use_presets(tmp_path)
    try:
        chosen = compose(of(clip, "experiment=far")).configuration.stereo
        blocks = compose(of(clip, "experiment=blocks")).configuration.stereo
        typed = compose(of(clip, "experiment=far", "stereo.nearest=5")).configuration.stereo
    finally:
        use_presets(None)
    assert (chosen.nearest, chosen.disparities_at_full_size) == (3.0, 128)
    assert typed.nearest == 5.0
    assert (blocks.kind, blocks.nearest) == ("bm", 2.0)


def test_the_errors_of_a_real_rig_are_those_of_its_calibration(clip):
    chosen = compose(of(clip, "tracker=contour")).configuration
    tracker = chosen.tracker
    # 4 px of 150.
    assert tracker.silhouette_std == pytest.approx(np.degrees(4 / 150), abs=1e-3)
    assert chosen.prior.length_std == 0.133
    own = compose(of(clip, "tracker=contour", "tracker.silhouette_std=0", "prior=cyclist"))
    assert own.configuration.tracker.silhouette_std == 0.0
    assert own.configuration.prior.length == 1.77
    rendered = compose(["tracker=contour"]).configuration.tracker
    assert rendered.silhouette_std == 0.0
    assert compose(of(clip, "stereo=bm")).configuration.stereo.kind == "bm"


@pytest.mark.parametrize(
    ("label", "road_user"),
    [("Van", "car"), ("Cyclist", "cyclist"), ("Person_sitting", "pedestrian"), ("Tram", None)],
)
def test_the_class_follows_the_label(label, road_user, tmp_path):
    make_clip(tmp_path, small_scenario(3), label=label)
    if road_user is None:
        with pytest.raises(ConfigurationError, match=r"source\.target: is a Tram, which no class"):
            compose(of(tmp_path))
        assert compose(of(tmp_path, "road_user=car")).choices["prior"] == "car"
    else:
        assert compose(of(tmp_path)).choices["prior"] == road_user


WRONG = {
    "path=turn": "path: is of the rendered scene",
    "ego=straight": "ego: straight is of the rendered scene",
    "sensor.read_noise=1": "sensor.read_noise: is of the rendered scene",
    "measurement=lidar": "measurement: lidar is of the rendered scene",
    "source.frames=3": "source.frames: 3 is a whole number",
    "source.frames=3:1": "source.frames: must be first:stop with first < stop, got '3:1'",
    "source.frames=3:9": "source.frames: 3:9 is not within 0:5",
}


@pytest.mark.parametrize(("override", "said"), WRONG.items())
def test_what_does_not_go_with_a_recording_is_refused(override, said, clip):
    with refused(said):
        compose(of(clip, override))


@pytest.mark.parametrize("missing", ["folder", "sequence"])
def test_what_a_recording_needs_is_named(missing, clip):
    given = [one for one in of(clip) if not one.startswith(f"source.{missing}=")]
    with pytest.raises(ConfigurationError, match=f"source.{missing}: is required with source=kit"):
        compose(given)


def test_without_a_target_class_and_start_are_required(clip):
    given = [one for one in of(clip) if not one.startswith("source.target=")]
    for more, said in (
        ([], r"road_user: is required, because the recording has no labelled target"),
        ([], r"; also start\.bearing: is required, .* or source\.target=auto to track every"),
        (["ego=parked", "road_user=car"], r"^start\.bearing: is required, .*moving object$"),
        (["road_user=car", "start=default"], r"start: default needs a label"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            compose([*given, *more])


@pytest.mark.sketched
def test_without_a_target_there_is_a_track_and_no_score(clip, tmp_path, capsys):
    folder = odometry(clip, tmp_path / "odometry")
    given = ("source=kitti_odometry", f"source.folder={folder}", "road_user=car")
    chosen = (*given, "start.range=[4,12]", "pictures.frames=[1]")
    answer = run(capsys, tmp_path, *chosen, "--name", "untold")
    assert answer["metrics"]["scored_scans"] == 0 and answer["metrics"]["scans"] == 5
    assert "iou_mean" not in answer["metrics"]
    assert answer["metrics"]["points_used_mean"] > 5
    # The middle of the car that is there.
    with np.load(tmp_path / "untold" / "track.npz") as track:
        place = small_scenario().target_poses_world[-1, :2]
        np.testing.assert_allclose(track["means"][-1, :2], place, atol=1.0)
    guessed = compose([*given[1:], "start.range=[4,12]"])
    assert guessed.choices["source"] == "kitti_odometry" and guessed.choices["start"] == "scans"


def odometry(clip, folder):
    """The clip in the layout of the odometry benchmark, its calibration without names."""
    for camera, name in (("image_02", "image_0"), ("image_03", "image_1")):
        shutil.copytree(clip / camera / "0003", folder / name)
    shutil.copy(clip / "ego_poses" / "0003.txt", folder / "poses.txt")
    rows = (clip / "calib" / "0003.txt").read_text().splitlines()
    (folder / "calib.txt").write_text("\n".join(row.partition(": ")[2] for row in rows))
    return folder


def test_a_path_needs_a_recording_and_an_ego_car_that_drives_its_poses(clip, tmp_path):
    resolved = compose([]).resolved
    resolved["path"] = {"kind": "source", "duration": 1.0, "sample_time": 0.1}
    with pytest.raises(ConfigurationError, match="path: source needs a recording"):
        from_resolved(resolved)
    shutil.copytree(clip, tmp_path / "clip")
    shutil.rmtree(tmp_path / "clip" / "ego_poses")
    with pytest.raises(ConfigurationError, match="ego: the recording has no poses"):
        compose(of(tmp_path / "clip"))
    parked = compose(of(tmp_path / "clip", "ego=parked"))
    assert parked.recording.pose_files == ()


def test_the_true_class_is_that_of_the_label(clip, tmp_path, capsys):
    given = of(clip, "road_user=pedestrian", "prior=unknown", "tracker=contour")
    metrics = run(capsys, tmp_path, *given, "pictures.frames=[]")["metrics"]
    cyclist, pedestrian = (metrics[f"{name}_probability"] for name in ("cyclist", "pedestrian"))
    assert metrics["class_error"] == float(metrics["car_probability"] < max(cyclist, pedestrian))
    no_target = (*given[:3], "road_user=pedestrian", "start.range=[5,15]")
    for overrides, expected in ((given, "car"), (no_target, None), ((), "car")):
        stages = pipeline_stages(compose(overrides))
        (scores,) = (stage for stage in stages if stage.name == "scores")
        assert scores.settings["road_user"] == expected


@pytest.mark.sketched
def test_a_clip_is_tracked_and_scored_and_keys_hold_no_path(clip, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    own = tmp_path / "own"
    shutil.copytree(clip, own)
    answer = run(capsys, tmp_path, *of(own), "pictures.frames=[1]", "--name", "one")
    metrics = answer["metrics"]
    assert metrics["scans"] == metrics["scored_scans"] == 5
    assert metrics["points_used_mean"] > 5 and metrics["iou_box_mean"] > 0.5
    figures = {str(file.relative_to(tmp_path / "one")) for file in tmp_path.rglob("one/figures/*")}
    assert "figures/path.png" in figures and "figures/k0001" in figures
    assert not list((tmp_path / "one").rglob("00000*.png"))
    with np.load(tmp_path / "one" / "stixels.npz") as stixels:
        assert set(stixels["k"]) == set(range(5)) and (stixels["depth"] > 0.0).all()
    with np.load(tmp_path / "one" / "objects.npz") as objects:
        # The car is an object in every frame, near its rear's place.
        truth = small_scenario().target_poses_world
        for k in range(5):
            places = np.stack([objects["x"], objects["y"]], axis=1)[objects["k"] == k]
            assert np.hypot(*(places - truth[k, :2]).T).min() < 3.0
    # Another place of the same files: nothing is computed again.
    own.rename(tmp_path / "moved")
    moved = run(capsys, tmp_path, *of(tmp_path / "moved"), "pictures.frames=[1]", "--name", "two")
    assert {stage["status"] for stage in moved["stages"]} == {"cached"}
    assert moved["metrics"] == metrics
    # Another image: what depends on images is computed again, also the motion, whose length the
    # calibration may scale.
    images = tmp_path / "moved/image_02/0003"
    (images / "000004.png").unlink()
    shutil.copy(images / "000003.png", images / "000004.png")
    other = run(capsys, tmp_path, *of(tmp_path / "moved"), "pictures.frames=[1]", "--name", "three")
    status = {stage["name"]: stage["status"] for stage in other["stages"]}
    for name in ("pairs", "calibration", "ego_motion", "track"):
        assert status[name] == "computed", name


def test_no_stage_past_the_images_gets_labels_and_a_start_from_scans_the_first_box_only(clip):
    stages = {one.name: one for one in pipeline_stages(compose(of(clip)))}
    for name in ("match", "free_space", "stixels", "scans", "track"):
        assert "scenario" not in stages[name].inputs.values()
        assert not stages[name].gives_files
    stages = {s.name: s for s in pipeline_stages(compose(of(clip, "start=scans")))}
    assert stages["start"].inputs == {"scans": "scans"}
    start = stages["start"].settings["start"]
    assert start.motion == "sensor"
    # The car is 0.4 m to the right, 0.9 m to each side of its middle, 6.9 m ahead.
    lowest, highest = np.degrees(np.arctan([-1.35 / 6.9, 0.52 / 6.9]))
    assert start.bearing == (pytest.approx(lowest, abs=2.0), pytest.approx(highest, abs=2.0))
    typed = compose(of(clip, "start=scans", "start.bearing=[-3,4]")).configuration
    assert typed.start.bearing == (-3.0, 4.0)


def auto(folder, *more):
    words = [one for one in of(folder, *more) if not one.startswith("source.target=")]
    return [*words, "source.target=auto", "road_user=car", "tracker=box"]


@pytest.mark.sketched
def test_all_that_moves_is_tracked(tmp_path_factory, tmp_path, capsys, told):
    # Eight frames are enough to see that the car moves.
    long_clip = tmp_path_factory.mktemp("long")
    make_clip(long_clip, small_scenario(8))
    given = auto(long_clip, "pictures.frames=[4]")
    answer = run(capsys, tmp_path, *given, "--name", "auto")
    assert answer["metrics"]["scans"] == 8 and "iou_mean" not in answer["metrics"]
    truth = small_scenario(8).target_poses_world
    with np.load(tmp_path / "auto" / "tracks.npz") as tracks:
        # The far wall stands still.
        assert set(tracks["track"]) == {0} and tracks["k"][-1] == 7
        last = np.stack([tracks["x"], tracks["y"]], axis=1)[-1]
        np.testing.assert_allclose(last, truth[-1, :2], atol=1.2)
        assert tracks["y_rate"][-1] == pytest.approx(3.0, abs=1.5)
    # Scores of the tracks against the labels, which no stage before them has read.
    metrics = answer["metrics"]
    assert (metrics["labels_expected"], metrics["labels_tracked"]) == (1, 1)
    numbers = ("tracks_found", "tracks_false", "label_switches")
    assert [metrics[name] for name in numbers] == [1, 0, 0]
    assert metrics["labels_iou_box_mean"] > 0.4 and metrics["labels_centre_mean_m"] < 1.2
    assert answer["verdict"][0].startswith("1 of 1 labels that move are tracked")
    # Seven scans make its motion certain.
    assert metrics["labels_found_scans_mean"] == 6.0
    label, *cells = (tmp_path / "auto" / "labels.csv").read_text().splitlines()[1].split(",")
    assert label == '"0"' and cells[2:5] == ["1", "8", "8"]
    assert "Labels that move" in (tmp_path / "auto" / "index.html").read_text()
    # There is no track beside them. The truth of every label is on the page.
    files = {path.name for path in (tmp_path / "auto").rglob("*.*")}
    assert "birds_eye.png" in files and not files & {"track.csv", "track.npz", "path.png"}
    assert '"truths":[{"name":"0","boxes":[[' in (tmp_path / "auto" / "index.html").read_text()
    assert main(["verify", str(tmp_path / "auto")]) == 0
    assert "has no track to export" in told("export", tmp_path / "auto", "--format", "csv", code=2)


def test_auto_needs_a_class_and_no_label(clip):
    words = [one for one in auto(clip) if not one.startswith("road_user=")]
    with pytest.raises(ConfigurationError, match="road_user: is required"):
        compose(words)
    with pytest.raises(ConfigurationError, match="start: default needs a label"):
        compose(auto(clip, "start=default"))
    stages = {one.name: one for one in pipeline_stages(compose(auto(clip)))}
    assert stages["scenario"].files == ()
    assert set(stages["scores"].inputs) == {"tracks", "truths", "scans"}
    assert not {"start", "track"} & set(stages)
    with pytest.raises(UserError, match="metrics: score one track"):
        pipeline_stages(compose(auto(clip, "metrics=[json:dumps]")))
    # The key of the tracks has the code of the tracker.
    assert "stixel_cli.tracking.baselines.box" in stages["tracks"].modules
    for value, fault in (("some", "'some' is not known"), ("-1", "-1 is out of range")):
        words = [*(one for one in of(clip) if "target" not in one), f"source.target={value}"]
        with pytest.raises(ConfigurationError, match=rf"source\.target: {fault}: must be .*auto"):
            compose(words)


def test_the_real_clip_is_tracked(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    few = ("source.frames=0:3", "pictures.frames=[]", "stereo.subpixel=parabola")
    words = of(real_data("kitti_tracking"), *few, sequence="0005", target=31)
    metrics = run(capsys, tmp_path, *words, small=())["metrics"]
    assert metrics["scored_scans"] == 3
    assert metrics["points_used_mean"] > 5 and metrics["centre_rmse_m"] < 2.0
