"""The disparity error of a rig from the motion of its camera."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest
from made_street import poses_ahead, stereo_view, street_rig

from stixel_cli.calibration.motion_errors import (
    MOST_PAIRS,
    Tracks,
    fit_motion_error,
    image_pairs,
    motion_between,
    places_after,
)
from stixel_cli.cli.app import main
from stixel_cli.export.kitti_folder import calibration_text
from stixel_cli.images import encode_png

RIG = street_rig()


def tracks_of(offset, slope, scale=1.0, outliers=0):
    """Exact tracks of a cloud of points, with errors of disparity, pose scale and tracking."""
    random = np.random.default_rng(2)
    poses = poses_ahead(6, 1.0, sway=0.01)
    pairs, places, moved, measured, motions = [], [], [], [], []
    for k, step in image_pairs(poses[:, :, 3]):
        motion = motion_between(poses[k], poses[k + step])
        n = 60
        at = random.uniform([10, 10], [RIG.width - 10, RIG.height - 10], (n, 2))
        true = random.uniform(2.5, 20.0, n)
        pairs.append(np.full(n, len(motions)))
        places.append(at)
        moved.append(places_after(at, true, np.tile(motion, (n, 1)), RIG))
        measured.append(true + offset + slope * (at[:, 0] - RIG.u0))
        motions.append(motion * [1, 1, 1, scale, scale, scale])
    moved = np.concatenate(moved)
    moved[:outliers] += 9.0
    return Tracks(
        np.concatenate(pairs),
        np.concatenate(places),
        moved,
        np.concatenate(measured),
        np.array(motions),
    )


@pytest.mark.parametrize("scale", [1.0, 1.04])
def test_offset_and_slope_are_found_whatever_the_scale_of_the_poses(scale):
    found = fit_motion_error(tracks_of(-0.4, 0.001, scale, outliers=20), RIG)
    assert found.offset == pytest.approx(-0.4, abs=0.01)
    assert found.slope == pytest.approx(0.001, abs=1e-4)
    assert found.median_after < 0.05 < found.median_before
    assert (found.method, found.count) == ("ego motion", 420)


def test_the_fit_includes_the_present_correction():
    corrected = replace(RIG, disparity_offset=-0.3, disparity_slope=0.0005)
    found = fit_motion_error(tracks_of(-0.1, 0.0005), corrected)
    assert found.offset == pytest.approx(-0.4, abs=0.01)
    assert found.slope == pytest.approx(0.001, abs=1e-4)


def test_a_camera_that_does_not_move_shows_nothing():
    assert image_pairs(np.zeros((5, 3))) == []
    empty = Tracks(np.zeros(0, int), *np.zeros((2, 0, 2)), np.zeros(0), np.zeros((0, 6)))
    with pytest.raises(ValueError, match="must move"):
        fit_motion_error(empty, RIG)


def test_pairs_of_images_are_far_enough_apart():
    places = np.array([[0.0, 0.0, z] for z in (0.0, 1.0, 2.0, 3.0)])
    assert image_pairs(places) == [(0, 2), (0, 3), (1, 2)]


def test_a_long_recording_has_no_more_pairs_than_one_equation_can_have():
    places = np.stack([np.zeros(900), np.zeros(900), np.arange(900.0)], axis=1)
    found = image_pairs(places)
    assert len(found) == len(set(found)) == MOST_PAIRS
    assert found[0][0] == 0 and found[-1][0] >= 890 and {step for _, step in found} == {2, 3}


def test_the_command_finds_the_error_of_a_clip_without_labels(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    wrong = replace(RIG, disparity_offset=0.5)
    folder = tmp_path / "clip"
    for name in ("image_0", "image_1"):
        (folder / name).mkdir(parents=True)
    poses = poses_ahead(4, 1.0)
    for k, pose in enumerate(poses):
        left, right, _ = stereo_view(wrong, pose, [(-0.9, 0.9, 14.0, 1.5)])
        for name, image in (("image_0", left), ("image_1", right)):
            (folder / name / f"{k:06d}.png").write_bytes(encode_png(image))
    (folder / "calib.txt").write_text(calibration_text(RIG))
    rows = [" ".join(str(float(value)) for value in pose.ravel()) for pose in poses]
    (folder / "poses.txt").write_text("\n".join(rows))
    given = ["calibrate", f"source.folder={folder}", "executor=threads", "stereo.nearest=4"]
    assert main([*given, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["offset"] == pytest.approx(0.5, abs=0.1) and abs(found["slope"]) < 5e-4
    assert found["correction"].startswith("ego motion of clip clip, frames 0 to 4")
    assert main([*given, "--from", "labels"]) == 2
    assert "has no labels to compare with" in capsys.readouterr().err
    # The printed overrides are overrides, and the scores name the correction.
    assert main(given) == 0
    overrides = shlex.split(capsys.readouterr().out.splitlines()[0])
    more = ["road_user=car", "start.range=[8,20]", "pictures.frames=[]", "source.frames=0:1"]
    shown = ["run", "--json", "--results", str(tmp_path), *given[1:], *more, *overrides]
    assert main(shown) == 0
    assert found["correction"] in json.loads(capsys.readouterr().out)["correction"]
