"""`path=recorded`: labels and ego poses of a clip without images, replayed in the scene."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from damages import put
from made_clip import HEIGHT, small_rig, small_scenario
from real_data import real_data
from refusals import refused

from stixel_cli import compose
from stixel_cli.cli.app import main
from stixel_cli.config.compose import from_resolved
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.export.export import labels_text, write_clip
from stixel_cli.recordings.replay import replayed_scenario, smoothing_spline
from stixel_cli.recordings.truth import recorded_motion

SEQUENCE = "0003"


def make_motion(folder, count=12, labels=("Car", "Pedestrian"), left_out=()):
    """Write track 0 and, 3 m to its right, track 1; return the scenario of track 0."""
    scenario = small_scenario(count)
    right = scenario.target_poses_world + np.array([3.0, 0.0, 0.0])
    rig = small_rig()
    own = labels_text(scenario, rig, labels[0], HEIGHT)
    write_clip(folder, SEQUENCE, [], scenario, rig, own)
    file = folder / "label_02" / f"{SEQUENCE}.txt"
    rows = [row for row in file.read_text().splitlines() if int(row.split()[0]) not in left_out]
    other = labels_text(replace(scenario, target_poses_world=right), rig, labels[1], 1.7)
    rows += [row.replace(" 0 ", " 1 ", 1) for row in other.splitlines()]
    file.write_text("\n".join(rows) + "\n")
    return scenario


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motion") / "training"
    make_motion(folder)
    return folder.parent


def of(folder, *more):
    given = ("path=recorded", f"path.folder={folder}", f"path.sequence={SEQUENCE}")
    typed = {one.partition("=")[0] for one in more}
    given += () if "path.target" in typed else ("path.target=0",)
    return [*(one for one in given if one.partition("=")[0] not in typed - {"path"}), *more]


def replayed(folder, *more):
    """The scenario that the stages make."""
    made = compose(of(folder, "measurement=fabricated", *more))
    stages = {one.name: one for one in pipeline_stages(made)}
    ego, truth = stages["ego_motion"], stages["scenario"]
    motion = recorded_motion(ego.files, **ego.settings)
    return replayed_scenario(motion, truth.files, **truth.settings)


def test_the_files_give_class_frames_and_ego_motion(motion):
    made = compose(of(motion))
    chosen = made.configuration
    assert made.choices["road_user"] == made.choices["prior"] == made.choices["pace"] == "car"
    assert (made.choices["rig"], made.choices["world"]) == ("kitti", "roadside")
    assert made.choices["ego"] == "source" and chosen.path.frames == "0:12"
    assert made.scan_count == 12 and chosen.path.duration == pytest.approx(1.2)
    assert compose(of(motion, "path.target=1")).choices["prior"] == "pedestrian"
    own = compose(of(motion, "road_user=cyclist", "rig=default", "world=street"))
    chosen_groups = [own.choices[group] for group in ("prior", "rig", "world")]
    assert chosen_groups == ["cyclist", "default", "street"]
    assert from_resolved(made.resolved) == chosen


def test_target_and_ego_car_move_as_they_did(motion):
    """Smoothing keeps a straight line at constant speed as it is."""
    real = make_motion(motion / "copy")
    found = replayed(motion)
    np.testing.assert_allclose(found.ego_poses_world, real.ego_poses_world, atol=1e-9)
    np.testing.assert_allclose(found.target_poses_world, real.target_poses_world, atol=1e-6)
    np.testing.assert_allclose(found.target_rates_world, real.target_rates_world, atol=1e-6)
    # The road user has its own size, not the label's.
    np.testing.assert_allclose(np.diff(found.box_target, axis=0)[0], [4.5, 1.8], atol=0.01)
    few = replayed(motion, "path.frames=2:9")
    assert len(few.times) == 7 and few.ego_poses_world[0].tolist() == [0.0, 0.0, 0.5 * np.pi]


def test_gaps_of_the_labels_are_interpolated(tmp_path):
    real = make_motion(tmp_path, left_out=(3, 4, 5, 9))
    found = replayed(tmp_path)
    np.testing.assert_allclose(found.target_poses_world, real.target_poses_world, atol=1e-6)


def test_the_smoothing_halves_its_period_and_removes_faster_noise():
    times = 0.1 * np.arange(400)
    for period, gain in ((2.0, 0.5), (4.0, 1.0 / (1.0 + 2.0**-4)), (0.5, 1.0 / (1.0 + 4.0**4))):
        wave = np.sin(2.0 * np.pi * times / period)
        smooth = smoothing_spline(times, wave, 2.0)(times)[100:300]
        assert np.ptp(smooth) / np.ptp(wave) == pytest.approx(gain, rel=0.05, abs=2e-3)
    np.testing.assert_allclose(smoothing_spline(times, wave, 0.0)(times), wave, atol=1e-9)


def test_rates_are_the_derivatives_of_the_poses(tmp_path):
    make_motion(tmp_path, 40)
    labels = tmp_path / "label_02" / f"{SEQUENCE}.txt"
    random = np.random.default_rng(4)
    for i, row in enumerate(labels.read_text().splitlines()):
        for column, std in ((13, 0.1), (16, 0.05)):
            put(i, column, str(float(row.split()[column]) + random.normal(0.0, std)))(labels)
    found = replayed(tmp_path)
    numeric = np.gradient(found.target_poses_world, 0.1, axis=0)
    np.testing.assert_allclose(numeric[1:-1], found.target_rates_world[1:-1], atol=0.02)
    length = np.trapezoid(np.hypot(*found.target_rates_world[:, :2].T), found.times)
    assert length == pytest.approx(3.0 * 3.9, abs=0.3)


WRONG = {
    "ego=parked": "ego: with path=recorded, the recording has the ego car's motion: leave it out",
    "path.duration=1": "path.duration: with path=recorded, follows from the frames of the track",
    "path.folder=nowhere": "nowhere: no such folder",
    "path.sequence=17": "0017.txt: no such file; there are 0003",
    "path.sequence=x": "path.sequence: must be a number such as 0005, got 'x'",
    "path.target=7": "has no track 7; it has 0 (Car), 1 (Pedestrian)",
    "path.target=null": "path.target: is required with path=recorded",
    "path.frames=2:5": "path.frames: track 0 of clip 0003 has 3 labelled frames with an ego pose",
    "path.frames=2:30": "has no label at an end of 2:30; 2:12 has",
    "path.smoothing=-1": "path.smoothing: -1 is out of range: must be ≥ 0 and ≤ 60",
    "source=kitti_tracking": "source.folder: is required with source=kitti_tracking",
}


@pytest.mark.parametrize(("override", "said"), WRONG.items())
def test_wrong_input_is_refused_in_one_line(override, said, motion):
    with refused(said, match="^(?!.*more fault)"):
        compose(of(motion, override))


def test_a_wrong_folder_and_a_label_without_a_class_are_named(motion, tmp_path):
    with pytest.raises(UserError, match=r"path\.folder: .*has neither a folder label_02 with"):
        compose(of(tmp_path))
    shutil.copytree(motion, tmp_path / "motion")
    (tmp_path / "motion/training/ego_poses/0003.txt").unlink()
    with pytest.raises(UserError, match=r"0003\.txt: no such file; the ego car's motion"):
        compose(of(tmp_path / "motion"))
    make_motion(tmp_path, labels=("Tram", "Car"))
    with pytest.raises(ConfigurationError, match=r"path\.target: is a Tram, which no class suits"):
        compose(of(tmp_path))
    assert compose(of(tmp_path, "road_user=car")).choices["prior"] == "car"


@pytest.mark.sketched
def test_images_are_rendered_along_the_way(motion, tmp_path, capsys):
    tiny = ("rig.width=160", "rig.height=96", "rig.focal_length=150", "stereo.nearest=1.6")
    tiny += ("occupancy.nearest=3", "path.frames=0:5", "pictures.frames=[3]")
    words = of(motion, *tiny, "executor=threads")
    code = main(["run", *words, "--results", str(tmp_path), "--name", "one"])
    assert code == 0, capsys.readouterr().err
    truth, track = (np.load(tmp_path / "one" / f"{name}.npz") for name in ("truth", "track"))
    with truth, track:
        away = np.hypot(track["means"][:, 0] - truth["x"], track["means"][:, 1] - truth["y"])
    assert away.max() < 1.0
    assert main(["run", str(tmp_path / "one"), "--results", str(tmp_path)]) == 0


def test_a_real_track_is_smooth_and_near_its_labels():
    real = real_data("kitti_tracking")
    given = ("path.sequence=0002", "path.target=7", "path.smoothing=2")
    smooth, exact = replayed(real, *given), replayed(real, *given[:2], "path.smoothing=0")
    apart = smooth.target_poses_world - exact.target_poses_world
    assert np.sqrt((apart[:, :2] ** 2).mean()) < 0.1
    acceleration = np.gradient(smooth.target_rates_world[:, :2], 0.1, axis=0)
    assert np.hypot(*acceleration.T).max() < 5.0
