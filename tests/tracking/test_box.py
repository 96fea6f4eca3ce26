from dataclasses import replace

import numpy as np
from tracking_cases import CAR, START, scans_of

from stixel_cli.geometry.pose import world_from_target
from stixel_cli.tracking.baselines.box import BoxParameters, track, visible_centroid

TRACKER = BoxParameters("box", use_scans=True, sigma_q=1.0, measurement_std=0.1)
HALF = np.array([2.1, 0.85])


def test_one_visible_side_has_its_middle():
    sensors = np.array([[-20.0, 0.0], [-20.0, 0.8], [0.0, 30.0], [0.5, 0.2]])
    found = [visible_centroid(HALF, sensor) for sensor in sensors]
    np.testing.assert_allclose(found, [[-2.1, 0.0], [-2.1, 0.0], [0.0, 0.85], [0.0, 0.0]])


def test_two_sides_count_with_the_angles_under_which_they_are_seen():
    sensor = np.array([-8.0, 5.0])
    # Points at even bearings on the rear and on the left side.
    corners = np.array([[-2.1, -0.85], [-2.1, 0.85], [2.1, 0.85]])
    bearings = np.unwrap(np.arctan2(*(corners - sensor).T[::-1]))
    shares = np.abs(np.diff(bearings))
    expected = np.array([-2.1, 0.85]) * shares / shares.sum()
    np.testing.assert_allclose(visible_centroid(HALF, sensor), expected)


def test_the_box_finds_the_centre_from_the_rear_and_predicts_without_scans():
    # Points on the rear of a car that drives away, and clutter beside it.
    places = np.stack([np.full(20, 0.3), 12.0 + 0.5 * np.arange(20)], axis=1)
    rear = np.stack([np.full(9, -0.5 * CAR.length), np.linspace(-0.8, 0.8, 9)], axis=1)
    cars = [world_from_target(rear, [*place, np.pi / 2]) for place in places]
    beside = places + np.array([6.0, 0.0])
    scans = scans_of([np.vstack(both) for both in zip(cars, beside, strict=True)])
    mean = np.array([*np.add(places[0], [0.2, -0.4]), np.pi / 2, 0.0, 5.0, 0.0])
    start = replace(START, mean=mean)
    found = track(scans, start, CAR, TRACKER)
    np.testing.assert_allclose(found.means[-1, :2], places[-1], atol=0.1)
    np.testing.assert_allclose(found.means[-1, 3:5], [0.0, 5.0], atol=0.2)
    assert (np.diff(found.used_offsets) == 9).all() and np.isfinite(found.nis).all()
    low, high = found.contours_world[-1].min(axis=0), found.contours_world[-1].max(axis=0)
    np.testing.assert_allclose(high - low, [CAR.width, CAR.length], atol=0.15)
    found = track(scans, start, CAR, replace(TRACKER, use_scans=False))
    # The start is one interval before the first scan.
    np.testing.assert_allclose(found.means[:, :2], places + np.array([0.2, 0.1]), atol=1e-9)
    assert len(found.used_points) == 0 and np.isnan(found.nis).all()
    assert (np.diff(found.covariances[:, 0, 0]) > 0.0).all()
