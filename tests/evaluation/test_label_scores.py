"""The tracks of moving objects against the labels: assignment, and what counts for what."""

import numpy as np
import pytest

from stixel_cli.evaluation.label_scores import score_tracks
from stixel_cli.evaluation.metric_table import OF_LABELS
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.geometry.pose import rectangle
from stixel_cli.measurements.scans import Scans
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import ObjectTrack, Track

COUNT = 10
TIMES = 0.1 * np.arange(COUNT)
CAR = rectangle(4.0, 2.0)


def line(x, speed):
    """Poses (K, 3) that begin at (x, 20) and go ahead along x."""
    return np.stack([x + speed * TIMES, np.full(COUNT, 20.0), np.zeros(COUNT)], axis=1)


def label(name, poses, road_user="car", hidden=()):
    scored = np.ones(COUNT, dtype=bool)
    scored[list(hidden)] = False
    still = np.zeros((COUNT, 3))
    truth = Scenario(TIMES, still, poses, still, CAR[None], only_box=True, scored=scored)
    return LabelTruth(name, road_user, truth)


def scans_on(*objects, since=0):
    """Scans with a point in the middle of each of the `objects` (K, 3), from scan `since` on."""
    each = []
    for k in range(COUNT):
        points = np.array([one[k, :2] for one in objects if k >= since]).reshape(-1, 2)
        each.append((points, np.tile(np.eye(2), (len(points), 1, 1))))
    return Scans.of_each(TIMES, np.zeros((COUNT, 3)), each)


def track(poses, first=0, stop=COUNT, confirmed=5, nis=1.0):
    poses, count = poses[first:stop], stop - first
    states = np.pad(poses, ((0, 0), (0, 3))), np.tile(np.eye(6), (count, 1, 1))
    contours = np.array([CAR + pose[:2] for pose in poses])
    outlines, unused = (contours, np.zeros((count, 4))), [np.zeros(0, int)] * count
    scaled, degrees = np.full(count, 2.0 * nis), np.full(count, 2)
    own = Track.of_scans(TIMES[first:stop], states, outlines, unused, scaled, degrees)
    return ObjectTrack(first, confirmed, own)


def test_a_label_that_changes_its_track():
    truth = label("7", line(0.0, 5.0), hidden=[0, 1])
    off = [0.0, 0.5, 0.0]
    tracks = (track(line(0.0, 5.0) + off, 3, 6), track(line(0.0, 5.0), 7, nis=3.0))
    scores = score_tracks(tracks, (truth,), scans_on(line(0.0, 5.0), since=1), "car")
    (one,) = scores.labels
    assert (one.frames, one.tracked_frames, one.tracks, one.switches) == (8, 6, 2, 1)
    assert one.expected == 1 and one.speed_m_s == pytest.approx(5.0)
    # Scans 1 to 5: the first with a point, and that which confirms the first track.
    assert one.found_scans == 5
    # Half of the frames are 0.5 m off across a car of 2 m: 1.5 / 2.5.
    assert one.iou_box == pytest.approx(0.5 * (1.0 + 0.6))
    assert one.centre_m == pytest.approx(0.25)
    np.testing.assert_array_equal(scores.nis, [np.nan] * 3 + [1.0] * 3 + [np.nan] + [3.0] * 3)
    expected = {"nis_mean": 2.0, "scans": 10, "empty_scans": 1, "points_per_scan_mean": 0.9}
    expected |= {"labels_expected": 1, "labels_tracked": 1, "labels_found_scans_mean": 5.0}
    expected |= {"labels_tracked_share": 6 / 8, "labels_iou_box_mean": 0.8}
    expected |= {"labels_centre_mean_m": 0.25, "label_switches": 1}
    assert scores.metrics == pytest.approx(expected | {"tracks_found": 2, "tracks_false": 0})
    assert set(OF_LABELS) <= set(scores.metrics)


def test_the_assignment_is_global_and_ends_at_half_the_length():
    labels = (label("1", line(0.0, 5.0)), label("2", line(1.5, 5.0)))
    # The nearest label of both tracks is the first one; a pair farther than 2 m is not allowed.
    tracks = (track(line(0.5, 5.0)), track(line(-0.3, 5.0)), track(line(-9.0, 5.0)))
    scores = score_tracks(tracks, labels, scans_on(), "car")
    assert [one.centre_m for one in scores.labels] == pytest.approx([0.3, 1.0])
    assert (scores.metrics["tracks_found"], scores.metrics["tracks_false"]) == (3, 1)
    # Without a point of the label nothing is known of the time until it is found.
    assert np.isnan([one.found_scans for one in scores.labels]).all()
    assert scores.metrics["labels_found_scans_mean"] is None


def test_only_what_moves_is_expected_and_other_classes_are_not_false_tracks():
    parked, walking = label("3", line(0.0, 0.1)), label("4", line(9.0, 2.0), "pedestrian")
    tracks, scans = (track(line(9.0, 2.0)),), scans_on(line(9.0, 2.0))
    scores = score_tracks(tracks, (parked, walking), scans, "car")
    (one,) = scores.labels
    assert (one.label, one.expected, one.tracked_frames) == ("3", 0, 0) and np.isnan(one.iou_box)
    assert scores.metrics["tracks_false"] == 0 and scores.metrics["labels_iou_box_mean"] is None
    assert verdict(scores.metrics)[0].startswith("0 of 0 labels that move are tracked; 0 of 1")


def test_a_recording_without_labels_has_no_such_scores():
    scores = score_tracks((track(line(0.0, 5.0)),), (), scans_on(line(0.0, 5.0)), "car")
    assert scores.labels == () and scores.metrics["tracks_found"] == 1
    assert not any(name.startswith("label") for name in scores.metrics)
    assert verdict(scores.metrics)[0].startswith("1 moving objects are tracked")
