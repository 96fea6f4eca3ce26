import dataclasses

import numpy as np
import pytest
from scipy.linalg import sqrtm
from seen_targets import scans_seen, start_at, turning
from tracking_cases import CAR, scans_of

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rectangle, rotation
from stixel_cli.tracking.baselines.lidar_random_matrix import measured_centre, track
from stixel_cli.tracking.motion import MOVING, intervals, predict_place

NAMES = ("lidar_random_matrix", "li_random_matrix")
TRACKERS = {name: compose([f"tracker={name}"]).configuration.tracker for name in NAMES}
EMPTY = np.zeros((0, 2))
SENSOR = np.zeros(2)


def test_points_on_both_sides_of_the_backward_direction_are_in_order():
    """Bearings jump from π to -π behind the sensor."""
    near, left, right = [-2.0, -1.0], [-2.0, 1.0], [2.0, -1.0]
    shares = np.linspace(0.0, 1.0, 15)[:, None]
    first, second = shares * np.subtract(near, left), shares[1:] * np.subtract(right, near)
    body = np.concatenate([left + first, near + second])
    place = rotation(np.pi / 2 + 0.2) @ [2.0, 9.0]
    points = body @ rotation(np.pi / 2 + 0.2 + 0.9).T + place
    assert np.ptp(np.arctan2(points[:, 1], points[:, 0])) > 6.0
    np.testing.assert_allclose(measured_centre(points, SENSOR, "ends"), place, atol=1e-12)


def test_midpoints_by_hand():
    """Eight points, symmetric about the y axis: the line is the axis, cut at the ends' depths."""
    x = np.array([1.0, 0.75, 0.5, 0.25])
    half = np.stack([x, 8.0 + x], axis=1)
    points = np.concatenate([half, half * [-1.0, 1.0]])
    # The line across the ray (1, 9) through (1, 9) is x + 9 y = 82: it meets the axis at 82 / 9.
    np.testing.assert_allclose(measured_centre(points, SENSOR, "midpoints"), [0.0, 82.0 / 9.0])
    few = points[[0, 1, 2, 4, 5, 6]]
    np.testing.assert_allclose(measured_centre(few, SENSOR, "midpoints"), few.mean(axis=0))


def paper(scans, initial, prior, tracker):
    """x, P and X after each scan by the authors' equations, with the scale matrix V and v."""
    x, p = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    h, turn = np.eye(2, 4), rotation(initial.mean[2])
    v = tracker.prior_weight + 6.0
    scale = (v - 3.0) * turn @ np.diag([prior.length**2, prior.width**2]) @ turn.T / 4.0
    for k, interval in enumerate(intervals(scans.times)):
        x, p = predict_place(x, p, interval, tracker.sigma_q)
        before, v = v, 6.0 + np.exp(-interval / tracker.forgetting_time) * (v - 6.0)
        scale = (v - 3.0) / (before - 3.0) * scale
        y = scans.points_world[scans.rows(k)]
        if len(y):
            r = scans.covariances_world[scans.rows(k)].mean(axis=0)
            centre = measured_centre(y, scans.sensor_poses_world[k, :2], tracker.centre)
            big_x = scale / (v - 6.0)
            big_y = 2.0 / 3.0 * big_x + r
            s = h @ p @ h.T + big_y / len(y)
            gain, e = p @ h.T @ np.linalg.inv(s), centre - h @ x
            root = np.real(sqrtm(big_x))
            n_root = root @ np.linalg.inv(np.real(sqrtm(s)))
            y_root = root @ np.linalg.inv(np.real(sqrtm(big_y)))
            scatter = (y - centre).T @ (y - centre)
            x, p = x + gain @ e, p - gain @ s @ gain.T
            scale = scale + n_root @ np.outer(e, e) @ n_root.T + y_root @ scatter @ y_root.T
            v = v + len(y)
        yield x, p, scale / (v - 3.0)


@pytest.mark.parametrize("name", TRACKERS)
def test_track_is_that_of_the_authors_equations(name):
    tracker = dataclasses.replace(TRACKERS[name], gate_probability=None)
    poses = turning(25, 4.0, 0.3)
    scans, initial = scans_seen(rectangle(4.2, 1.7), poses, noise=0.05), start_at(poses)
    points = [scans.points_world[scans.rows(k)] for k in range(25)]
    points[4], points[9] = EMPTY, points[9][:1]
    scans = scans_of(points)
    result = track(scans, initial, CAR, tracker)
    for k, (x, p, extension) in enumerate(paper(scans, initial, CAR, tracker)):
        np.testing.assert_allclose(result.means[k, MOVING], x, rtol=1e-8, atol=1e-8)
        spread = result.covariances[k][np.ix_(MOVING, MOVING)]
        np.testing.assert_allclose(spread, p, rtol=1e-7, atol=1e-11)
        turn = rotation(result.means[k, 2])
        reported = turn @ np.diag(result.means[k, 6:] ** 2 / 4.0) @ turn.T
        np.testing.assert_allclose(reported, extension, rtol=1e-6, atol=1e-9)
    assert np.isnan(result.nis[4]) and np.isfinite(result.nis[9])
