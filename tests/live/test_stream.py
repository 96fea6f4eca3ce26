"""Image pairs one after the other: the stixels of `stixel run`, and the tracks of its clusters."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rendered_clip import assert_same, results_of_run

from stixel_cli import StixelStream, compose
from stixel_cli.errors import ArgumentError
from stixel_cli.live.pairs import FRAME
from stixel_cli.recordings.image_files import grey, read_image
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.tracking.followed import LEAST_SCANS
from stixel_cli.tracking.several import RECENT


@pytest.fixture
def pairs(clip):
    """The images of three frames, each with the pose of the camera."""
    poses = np.loadtxt(clip / "ego_poses/0000.txt").reshape(-1, 3, 4)
    sides = (clip / "image_02/0000", clip / "image_03/0000")
    left, right = ([grey(read_image(side / f"00000{k}.png")) for k in range(3)] for side in sides)
    return [*zip(left, right, poses[:3], strict=True)]


def test_a_rendered_clip_has_the_stixels_of_stixel_run(clip, pairs):
    of_clip = ["source=kitti_tracking", f"source.folder={clip}", "source.sequence=0000"]
    run = compose([*of_clip, "road_user=car", "start.range=[1,80]", "executor=threads"])
    free_space, stixels, scans = results_of_run(run, "free_space", "stixels", "scans")
    stream = StixelStream(clip / "calib/0000.txt")
    for k, pair in enumerate(pairs):
        frame = stream.step(*pair)
        found, rows = frame.stixels, stixels.rows(k)
        assert frame.k == k and len(found) == rows.stop - rows.start > 20
        assert_array_equal(found.free_space.disparity[0], free_space.disparity[k])
        for name in ("left", "right", "top", "base", "disparity", "points_ego", "covariances_ego"):
            ours, theirs = getattr(found.stixels, name), getattr(stixels, name)[rows]
            assert ours.tobytes() == theirs.tobytes(), name
        assert_allclose(frame.scan.points_world, scans.points_world[scans.rows(k)], atol=1e-9)
        assert frame.objects.counts.sum() <= len(found)


def test_pairs_that_are_matched_ahead_give_the_same(clip, pairs):
    calibration = clip / "calib/0000.txt"
    one, ahead = StixelStream(calibration), StixelStream(calibration)
    expected = [one.step(*pair) for pair in pairs]
    for known, frame in zip(expected, ahead.steps(iter(pairs)), strict=True):
        assert_same(frame.stixels.stixels, known.stixels.stixels)
    parked = list(StixelStream(calibration).steps(pair[:2] for pair in pairs))
    by_poses = [StixelStream(calibration).step(*pairs[0][:2], [0.0, 0.0, np.pi / 2])]
    assert_same(parked[0].stixels.stixels, by_poses[0].stixels.stixels)
    # The free space of the frame before is moved by the car's motion.
    ours, theirs = (one.stixels.free_space.disparity for one in (parked[2], frame))
    assert not np.array_equal(ours, theirs, equal_nan=True)


def disparities_of_a_wall(rig, distance):
    """Raw ones of the road, the far sky, and a wall 1.6 m wide at this `distance`, m."""
    v = np.arange(rig.height)[:, None] + np.zeros((1, rig.width))
    raw = np.maximum(16.0 * rig.baseline / rig.camera_height * (v - rig.v0), 8.0)
    d = rig.disparity_from_depth(distance)
    columns = np.abs(np.arange(rig.width) - rig.u0) < 0.8 * rig.focal / distance
    rows = slice(int(rig.v0), int(rig.v0 + rig.camera_height * d / rig.baseline))
    raw[rows, columns] = 16.0 * d
    return np.rint(raw).astype(np.int16)


def test_a_wall_that_drives_away_gets_a_track_and_one_that_stands_does_not(monkeypatch):
    rig = {"focal_length": 300.0, "baseline": 0.5, "camera_height": 1.5}
    images = np.zeros((2, 240, 320), np.uint8)
    for speed, expected in ((0.0, 0), (8.0, 1)):
        stream = StixelStream(rig)
        for k in range(RECENT + 5):

            def match(pair, rig, place=8.0 + 0.1 * speed * k):
                raw = disparities_of_a_wall(rig, place)
                return Disparities.in_memory(FRAME.start, 160, [raw])

            monkeypatch.setattr("stixel_cli.live.stream.matched", match)
            frame = stream.step(*images)
            assert len(frame.tracks) == (expected if k >= LEAST_SCANS - 1 else 0)
    (one,) = frame.tracks
    assert one.number == 0 and len(one.points) > 5
    assert_allclose(one.mean, [0.0, 8.0 + 0.8 * k, 0.0, speed], atol=0.5)
    assert_allclose(one.points[:, 1], 8.0 + 0.8 * k, atol=0.5)
    # The wall is the rear of a road user whose middle is farther ahead.
    assert one.estimate.pose[1] > 8.5 + 0.8 * k
    assert one.estimate.pose[2] == pytest.approx(np.pi / 2, abs=0.2)
    assert one.estimate.contour[:, 1].min() == pytest.approx(8.0 + 0.8 * k, abs=0.5)


MIRROR = np.diag([1.0, 1.0, -1.0, 0.0])[:3]


@pytest.mark.parametrize(
    "pose",
    [
        *([1.0, 2.0], np.eye(4), [0.0, np.nan, 0.0], [1e200, 0.0, 0.0]),
        *(np.zeros((3, 4)), MIRROR, 2.0 * np.eye(4)[:3], np.full((3, 4), 1e200)),
    ],
)
def test_a_wrong_pose_is_named(pose):
    stream = StixelStream({"focal_length": 200.0, "baseline": 0.4, "camera_height": 1.5})
    with pytest.raises(ArgumentError, match=r"^pose: "):
        stream.step(*np.zeros((2, 160, 240), np.uint8), pose)


def test_wrong_sample_times_and_numbers_of_threads_are_named():
    for seconds in (0, -1, float("nan"), 1e9):
        with pytest.raises(ArgumentError, match=r"^sample_time: must be from 0.001 to 10 s"):
            StixelStream({}, seconds)
    for threads in (0, -3, 10**6):
        with pytest.raises(ArgumentError, match=r"^threads: must be from 1 to 64"):
            next(StixelStream({}).steps([], threads))
