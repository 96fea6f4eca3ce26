"""A tracker that takes one scan after the other, and what a track shows as a table."""

import numpy as np
import pytest

from stixel_cli import Scans, run, track, trackers
from stixel_cli.errors import ArgumentError, UserError
from stixel_cli.geometry.pose import wrap_angle

POSE = [0.0, 10.0, 0.0]


@pytest.fixture(scope="module")
def result():
    return run("measurement=fabricated", {"path.duration": 2}, tracker="contour")


def stepped(scans, tracker, count=None):
    poses, found = scans.sensor_poses_world, []
    for k in range(len(scans) if count is None else count):
        seen = scans.points_world[scans.rows(k)], scans.covariances_world[scans.rows(k)]
        found.append(tracker.step(*seen, poses[k], scans.times[k]))
    return found


@pytest.mark.parametrize("road_user", ["car", "unknown"])
def test_a_tracker_stepped_by_hand_is_causal_and_near_the_truth(result, road_user):
    scans, truth = result.scans, result.scenario.target_poses_world
    start = truth[0] + [0.2, -0.1, 0.05]
    found = stepped(scans, trackers.Contour(road_user, start=start, sensor="fabricated"))
    again = stepped(scans, trackers.Contour(road_user, start=start, sensor="fabricated"), 6)
    np.testing.assert_array_equal([one.pose for one in again], [one.pose for one in found[:6]])
    errors = np.array([one.pose for one in found]) - truth
    assert np.hypot(*errors[10:, :2].T).max() < 0.4
    assert np.abs(wrap_angle(errors[10:, 2])).max() < 0.1
    assert all(one.contour.shape == (240, 2) and one.covariance.shape == (3, 3) for one in found)
    assert found[-1].box == pytest.approx([4.5, 1.8], abs=0.5)
    assert len(found[-1].points) > 5 and found[-1].nis > 0.0


def test_a_scan_without_points_predicts(result):
    scans = result.scans
    tracker = trackers.Contour(start=result.scenario.target_poses_world[0], sensor="fabricated")
    before = stepped(scans, tracker, 10)[-1]
    empty = np.zeros((0, 2)), np.zeros((0, 2, 2))
    after = tracker.step(*empty, scans.sensor_poses_world[10], scans.times[9] + 0.5)
    assert np.isnan(after.nis) and len(after.points) == 0
    assert np.trace(after.covariance) > np.trace(before.covariance)
    np.testing.assert_allclose(after.pose[:2], before.pose[:2] + 0.5 * before.velocity, atol=0.3)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("start", {"start": [0.0, 1.0]}),
        ("start", {"start": [0.0, np.nan, 1.0]}),
        ("road_user", {"start": POSE, "road_user": "tram"}),
        ("seen_by", {"start": POSE, "sensor": "camera"}),
        ("slip", {"start": POSE, "slip": "low"}),
        ("noise", {"start": POSE, "noise": 1.0}),
    ],
)
def test_a_wrong_argument_is_named_in_one_line(name, arguments):
    with pytest.raises(ArgumentError, match=rf"^{name}: [^\n]+$"):
        trackers.Contour(**arguments)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("points", {"points": [[1.0, 2.0, 3.0]]}),
        ("covariances", {"covariances": np.eye(2)}),
        ("sensor_pose", {"sensor_pose": [0.0, 0.0]}),
        ("time", {"time": -0.1}),
        ("time", {"time": np.nan}),
    ],
)
def test_a_wrong_scan_is_named_in_one_line(name, changes):
    tracker = trackers.Contour(start=POSE)
    scan = {"points": [[0.0, 9.0], [1.0, 9.0]], "covariances": np.tile(0.01 * np.eye(2), (2, 1, 1))}
    scan |= {"sensor_pose": [0.0, 0.0, np.pi / 2], "time": 0.0}
    tracker.step(**scan)
    with pytest.raises(ArgumentError, match=rf"^{name}: [^\n]+$"):
        tracker.step(**(scan | changes))


def test_scans_are_tracked_in_one_call(result):
    found = track(result.scans, "car", **{"tracker.seen_by": "fabricated"})
    truth = result.scenario.target_poses_world
    assert np.hypot(*(found.poses - truth)[15:, :2].T).max() < 0.5
    with pytest.raises(UserError, match="prior"):
        track(result.scans, "tram")
    with pytest.raises(ValueError, match="no cluster"):
        track(Scans.of_each([0.0], np.zeros((1, 3)), [(np.zeros((0, 2)), np.zeros((0, 2, 2)))]))


def test_a_track_is_a_table_with_a_row_a_scan(result):
    found, table = result.track, result.track.to_frame()
    assert len(table) == len(found.times) and table["k"].tolist() == list(range(len(table)))
    np.testing.assert_array_equal(table[["x", "y", "heading"]], found.poses)
    np.testing.assert_array_equal(table[["length", "width"]], found.boxes)
    np.testing.assert_allclose(table["std_x"] ** 2, found.covariances[:, 0, 0])
    assert table["points_used"].sum() == len(found.used_points)
    box = run("measurement=fabricated", {"path.duration": 1}, tracker="box").track
    assert box.box_sizes is None
    np.testing.assert_allclose(box.boxes, [[4.52, 1.83]] * len(box.times), rtol=1e-6)
