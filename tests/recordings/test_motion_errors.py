"""The disparity error of a rig from the motion of its camera."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest
from made_street import poses_ahead, stereo_view, street_rig
from scipy.spatial.transform import Rotation

from stixel_cli import compose
from stixel_cli.calibration.motion_fit import calibrate_rig
from stixel_cli.calibration.track_points import track_points
from stixel_cli.calibration.tracks import Tracks, gathered, places_of, points_at
from stixel_cli.cli.app import main
from stixel_cli.config.folders import real_image_parameters
from stixel_cli.experiment.stages import computed_stages
from stixel_cli.export.export import calibration_text
from stixel_cli.geometry.rig_calibration import UNKNOWN_STD
from stixel_cli.live.stream import StixelStream
from stixel_cli.recordings.types import Tables
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import encode_png

RIG = street_rig()
CURVE = (-0.5, 0.3, -2.0)
STEREO = replace(real_image_parameters().stereo, nearest=4.0)


def tracks_of(curve, noise=0.0, outliers=0, columns=(10, RIG.width - 10), count=12, far=0.0):
    """Tracks of a cloud of points, one pair of images two metres; far points have `far` px more.

    The `noise`, px, is of places and of disparities.
    """
    random = np.random.default_rng(2)
    found = []
    for k in range(count):
        at = random.uniform([columns[0], 10], [columns[1], RIG.height - 10], (60, 2))
        true = random.uniform(2.5, 20.0, 60)
        turn, shift = random.normal(0.0, 0.01, 3), np.array([0.02, -0.03, -2.0])
        ahead = Rotation.from_rotvec(turn).apply(points_at(at, true, RIG))
        moved = places_of(ahead + shift, RIG)
        moved += random.normal(0.0, 1.0, moved.shape) * noise
        moved[:outliers] += 9.0
        measured = true + RIG.disparity_error_basis(at[:, 0]) @ curve + far * (true < 8.0)
        measured += random.normal(0.0, 1.0, 60) * noise
        start = np.eye(3), 1.05 * shift
        found.append((k, 1, np.column_stack([at, moved, measured]), *start))
    return gathered(found)


def poses_file(folder, step, count=14, factor=1.0):
    """A file of poses whose ways are too long by the `factor`."""
    poses = poses_ahead(count, step) * [1.0, 1.0, 1.0, factor]
    np.savetxt(folder / "poses.txt", poses.reshape(count, 12), "%.17g")
    return (folder / "poses.txt",)


def calibrated(tracks, files=()):
    return calibrate_rig(tracks, files, RIG, Tables(), by_motion=True)


def test_a_drawn_curve_is_found_and_so_is_the_length_of_the_way(tmp_path):
    found = calibrated(tracks_of(CURVE, outliers=3), poses_file(tmp_path, 2.1))
    columns = RIG.disparity_error_basis(np.arange(RIG.width))
    np.testing.assert_allclose(columns @ found.rig.disparity_error, columns @ CURVE, atol=0.01)
    assert found.median_after < 0.01 < found.median_before
    assert found.length_ratio == pytest.approx(2.0 / 2.1, abs=2e-3)
    too_long = 100.0 / found.length_ratio - 100.0
    assert f"poses are {too_long:.1f} % too long" in found.text
    assert f"source.pose_scale={found.length_ratio:.3f}" in found.text
    assert calibrated(tracks_of(CURVE), poses_file(tmp_path, 2.01)).length_text == ""


def test_noise_of_disparities_makes_no_way_shorter_than_its_interval_says(tmp_path):
    noisy = calibrated(tracks_of(CURVE, noise=0.5, count=60), poses_file(tmp_path, 2.0, 62))
    assert noisy.length_ratio == pytest.approx(1.0, abs=0.005)
    assert abs(noisy.length_ratio - 1.0) < 2.0 * noisy.length_ratio_std
    # Shorter and longer ways with another disparity error are in it, too.
    exact = calibrated(tracks_of(CURVE), poses_file(tmp_path, 2.0))
    assert noisy.length_ratio_std > exact.length_ratio_std > 0.001


def test_standard_deviations_cover_the_error_and_a_contradiction_is_said():
    found = calibrated(tracks_of(CURVE, noise=0.3)).rig
    columns = RIG.disparity_error_basis(RIG.disparity_error_columns)
    errors = columns @ (np.array(found.disparity_error) - CURVE)
    assert (np.abs(errors) < 2.5 * np.array(found.disparity_error_std)).all()
    assert max(found.disparity_error_std) < 0.4
    same, other = calibrated(tracks_of(CURVE)), calibrated(tracks_of(CURVE, far=0.8))
    assert not same.note and "near and far points" in other.note
    assert min(other.rig.disparity_error_std) > 2.0 * max(same.rig.disparity_error_std)


@pytest.mark.parametrize(
    ("tracks", "reason"),
    [
        ({"curve": CURVE, "count": 5}, "6 pairs of images are needed"),
        ({"curve": CURVE, "columns": (120, 310)}, "left third of the image has too few points"),
        ({"curve": (0.0, 0.0, 0.0), "noise": 0.3}, "held out fit no better"),
    ],
)
def test_a_rig_is_left_alone_and_the_line_says_why(tracks, reason):
    found = calibrated(tracks_of(**tracks))
    assert reason in found.text and "not corrected" in found.text
    assert found.rig.disparity_error == (0.0, 0.0, 0.0)
    assert np.all(np.array(found.rig.disparity_error_std) <= UNKNOWN_STD)
    assert min(found.rig.disparity_error_std) > 0.0


def street(poses, rig=RIG, plain=False):
    """Pairs of images of the street, or of one without any texture."""
    if plain:
        return [(np.full((rig.height, rig.width), 90, np.uint8),) * 2 for _ in poses]
    return [stereo_view(rig, pose, [(-0.9, 0.9, 24.0, 1.5)])[:2] for pose in poses]


@pytest.mark.parametrize(
    ("count", "step", "plain"),
    [(7, 0.0, False), (7, 1.0, True), (3, 1.0, False)],
    ids=["standing camera", "featureless road", "three frames"],
)
def test_images_that_show_nothing_change_nothing(count, step, plain):
    pairs = [StereoPairs(0, *zip(*street(poses_ahead(count, step), plain=plain), strict=True))]
    tracks = track_points(pairs, STEREO, RIG, by_motion=True)
    found = calibrated(tracks)
    assert "6 pairs of images are needed" in found.text
    assert found.rig == replace(RIG, disparity_error_std=UNKNOWN_STD)


def test_nothing_is_tracked_on_request_or_with_a_rig_that_states_its_error():
    pairs = [StereoPairs(0, *zip(*street(poses_ahead(3, 2.0)), strict=True))]
    stated = replace(RIG, disparity_error=CURVE)
    for rig, by_motion in ((RIG, False), (stated, True)):
        assert isinstance(tracks := track_points(pairs, STEREO, rig, by_motion), Tracks)
        assert len(tracks.pairs) == 0
        assert calibrate_rig(tracks, (), rig, Tables(), by_motion).rig == rig


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A folder in KITTI's layout, of a rig with an error, whose poses are 4 % too long."""
    folder = tmp_path_factory.mktemp("street") / "clip"
    for name in ("image_0", "image_1"):
        (folder / name).mkdir(parents=True)
    for k, views in enumerate(street(poses_ahead(10, 1.0), replace(RIG, disparity_error=CURVE))):
        for name, image in zip(("image_0", "image_1"), views, strict=True):
            (folder / name / f"{k:06d}.png").write_bytes(encode_png(image))
    (folder / "calib.txt").write_text(calibration_text(RIG))
    poses_file(folder, 1.0, 10, factor=1.04)
    return folder


def given(clip, *more):
    return [f"source.folder={clip}", "executor=threads", "stereo.nearest=4", *more]


def test_the_command_writes_a_rig_for_the_next_recording(clip, tmp_path, capsys, told):
    found = json.loads(told("assess", "--calibrate", *given(clip), "--json"))
    columns = RIG.disparity_error_basis(RIG.disparity_error_columns)
    errors = columns @ (np.array(found["disparity_error"]) - CURVE)
    assert (np.abs(errors) < 2.0 * np.array(found["disparity_error_std"])).all()
    assert max(found["disparity_error_std"]) < 0.25
    assert found["length_ratio"] == pytest.approx(1.0 / 1.04, abs=0.015)
    file = tmp_path / "rig.yaml"
    assert main(["assess", "--calibrate", *given(clip), "--output", str(file)]) == 0
    overrides = shlex.split(capsys.readouterr().out.splitlines()[0])
    scans = ["road_user=car", "start.range=[8,20]"]
    stated = compose(given(clip, *scans, *overrides)).configuration.rig
    read = compose(given(clip, *scans, f"source.calibration={file}")).configuration.rig
    assert stated == read and list(read.disparity_error) == found["disparity_error"]
    # What is stated is used, and calibrated anew by the command alone.
    with computed_stages(compose(given(clip, *scans, *overrides)), ["rig"]) as (_, load):
        assert load("rig") == [stated]
    assert main(["assess", "--calibrate", *given(clip, *overrides), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["disparity_error"] == found["disparity_error"]


def test_the_command_names_no_residual_that_it_has_not(clip, told):
    few = ["assess", "--calibrate", *given(clip), "source.frames=0:3"]
    assert "median_after" not in json.loads(told(*few, "--json"))
    lines = told(*few).splitlines()
    assert len(lines) == 2 and "not corrected" in lines[1]


def test_a_run_corrects_the_error_scales_the_poses_and_says_so(clip, tmp_path, capsys):
    more = ["road_user=car", "start.range=[8,40]", "pictures.frames=[]"]
    more += ["source.pose_scale=estimated"]
    assert main(["run", "--json", "--results", str(tmp_path), *given(clip, *more)]) == 0
    text = json.loads(capsys.readouterr().out)["correction"]
    assert text.startswith("disparity error corrected") and "the poses are" in text
    with computed_stages(compose(given(clip, *more)), ["ego_motion", "rig"]) as (_, load):
        (motion,), (rig,) = load("ego_motion"), load("rig")
    way = np.linalg.norm(motion.poses_world[-1, :2] - motion.poses_world[0, :2])
    assert way == pytest.approx(9.0, rel=0.015)
    assert rig.disparity_error[0] == pytest.approx(CURVE[0], abs=0.1)


def test_poses_cannot_be_scaled_by_a_recording_that_shows_no_length(clip, tmp_path, capsys):
    more = ("road_user=car", "start.range=[8,40]", "source.frames=0:3")
    more += ("source.pose_scale=estimated",)
    assert main(["run", "--results", str(tmp_path), *given(clip, *more)]) == 2
    assert "source.pose_scale: cannot be estimated" in capsys.readouterr().err


def test_rendered_images_need_no_calibration(told):
    assert "source: rendered is exact" in told("assess", "--calibrate", "seed=0", code=2)


def test_a_stream_calibrates_its_rig_as_it_drives(monkeypatch):
    monkeypatch.setattr("stixel_cli.live.stream.CALIBRATED", (2,))
    tracks = tracks_of(CURVE)
    monkeypatch.setattr("stixel_cli.calibration.tracks.gathered", lambda _: tracks)
    views = street(poses_ahead(4, 1.0), replace(RIG, disparity_error=CURVE))
    frames = list(StixelStream(RIG).steps(views))
    assert [one.calibration is not None for one in frames] == [False, False, True, True]
    assert frames[-1].calibration.rig.disparity_error == pytest.approx(CURVE, abs=0.01)
    stated = StixelStream(replace(RIG, disparity_error=CURVE))
    assert [one.calibration for one in stated.steps(views)] == [None] * 4
