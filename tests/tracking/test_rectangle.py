import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from seen_targets import SENSOR, scans_seen, seen, start_at, turning
from tracking_cases import CAR, jacobian, scans_of

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rotation, target_from_world, wrap_angle
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.tracking.baselines.rectangle import (
    CORNERS,
    measure,
    sides_of,
    track,
    visible_sides,
)
from stixel_cli.tracking.baselines.rectangle_contour import contours_of
from stixel_cli.tracking.kalman import correct
from stixel_cli.tracking.prior import fullness_of

TRACKER = compose(["tracker=rectangle"]).configuration.tracker
EXACT = dataclasses.replace(TRACKER, measurement_std=0.05, side_std=0.02, corner_std=0.03)
OUTLINE = 0.5 * CORNERS * [CAR.length, CAR.width]
OVAL = dataclasses.replace(CAR, shape="ellipse", corner_radius=0.0, length=1.8, width=0.6)
SEEDS = st.integers(0, 2**31)
FRONT, REAR, LEFT, RIGHT = range(4)


@pytest.mark.parametrize(
    ("pose", "sides"),
    [
        ((0.0, 10.0, np.pi / 2), {REAR}),
        ((0.0, 10.0, -np.pi / 2), {FRONT}),
        ((0.0, 10.0, 0.0), {RIGHT}),
        ((0.0, 10.0, np.pi), {LEFT}),
        ((5.0, 10.0, np.pi / 2), {REAR, LEFT}),
        ((-5.0, 10.0, 0.0), {FRONT, RIGHT}),
        ((0.2, 0.3, 1.0), {FRONT, REAR, LEFT, RIGHT}),
    ],
)
def test_sides_that_the_sensor_sees(pose, sides):
    mean = np.array([*pose, 0.0, 0.0, 0.0, 4.2, 1.7])
    assert set(np.flatnonzero(visible_sides(mean, SENSOR[:2]))) == sides


def test_points_belong_to_the_nearest_side_that_is_seen():
    points = np.array([[-2.0, 0.1], [-2.2, 0.8], [-1.0, 0.9], [0.5, 0.4], [2.3, 0.2]])
    seen_sides = np.array([False, True, True, False])
    sides = sides_of(points, np.array([4.2, 1.7]), seen_sides)
    # The last one is at the front, which is not seen.
    assert sides.tolist() == [REAR, REAR, LEFT, LEFT, LEFT]


def rows_at(state, points, noises):
    return measure(state, points, noises, SENSOR, 0.9, TRACKER.corner_std, None)


@given(seed=SEEDS)
def test_jacobian_matches_finite_differences(seed):
    random = np.random.default_rng(seed)
    pose = [*random.uniform([-4, 8], [4, 20]), random.uniform(-3, 3)]
    mean = np.array([*pose, *random.uniform(-4, 4, 3), 4.2, 1.7])
    points = seen(OUTLINE, np.array([pose]), noise=0.05, seed=seed)[0][0]
    noises = np.tile(0.01 * np.eye(2), (len(points), 1, 1))
    rows = rows_at(mean, points, noises)
    assert len(rows.innovations) == len(points) + 2
    # Innovations are measured minus predicted.
    slopes = -jacobian(lambda state: rows_at(state, points, noises).innovations, mean)
    np.testing.assert_allclose(rows.matrix[:, :8], slopes, atol=1e-5)
    sides = sides_of(target_from_world(points, pose), mean[6:], visible_sides(mean, SENSOR[:2]))
    np.testing.assert_array_equal(rows.matrix[: len(points), 8:], -np.eye(4)[sides])
    assert not rows.matrix[len(points) :, 8:].any()


@given(seed=SEEDS)
def test_update_is_that_of_the_textbook_with_sides_that_share_an_error(seed):
    random = np.random.default_rng(seed)
    mean, root = np.array([1.0, 12.0, 0.4, 3.0, 1.0, 0.1, 4.2, 1.7]), random.standard_normal((8, 8))
    covariance = 0.05 * root @ root.T + 0.01 * np.eye(8)
    points = seen(OUTLINE, mean[None, :3] + [[0.2, -0.1, 0.05]], noise=0.05, seed=seed, rays=60)
    rows = rows_at(mean, points[0][0], points[1][0] + 0.01 * np.eye(2))
    matrix, errors = rows.matrix[:, :8], rows.matrix[:, 8:]
    noise = np.diag(rows.variances) + 0.1**2 * errors @ errors.T
    spread = matrix @ covariance @ matrix.T + noise
    gain = np.linalg.solve(spread, matrix @ covariance).T
    whole = np.pad(covariance, (0, 4)) + np.diag([0.0] * 8 + [0.1**2] * 4)
    found = correct(whole, rows.matrix, rows.variances, rows.innovations)
    np.testing.assert_allclose(found[0][:8], gain @ rows.innovations, atol=1e-7)
    np.testing.assert_allclose(found[1][:8, :8], covariance - gain @ spread @ gain.T, atol=1e-7)
    nis = rows.innovations @ np.linalg.solve(spread, rows.innovations)
    assert found[2] == pytest.approx(nis, rel=1e-6)


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_a_car_seen_as_an_l_is_followed(rate):
    poses = turning(50, 2.0, rate, (-4.0, 12.0))
    scans = scans_seen(OUTLINE, poses, noise=0.03)
    result = track(scans, start_at(poses, (0.3, -0.2, 0.1)), CAR, TRACKER)
    late = slice(15, None)
    assert np.hypot(*(result.means[late, :2] - poses[late, :2]).T).max() < 0.2
    assert np.abs(wrap_angle(result.means[late, 2] - poses[late, 2])).max() < np.radians(5)
    true = [shapely.polygons(OUTLINE @ rotation(p[2]).T + p[:2]) for p in poses[late]]
    overlap = shapely.intersection(shapely.polygons(result.contours_world[late]), true)
    assert min(one.area for one in overlap) > 0.85 * CAR.length * CAR.width
    used = np.diff(result.used_offsets)
    assert used.min() > 20
    assert np.all(result.nis_degrees_of_freedom - used <= 2)


def test_the_size_is_estimated():
    poses = turning(60, 4.0, 0.5)
    wrong = dataclasses.replace(CAR, length=0.92 * CAR.length, width=1.06 * CAR.width)
    result = track(scans_seen(OUTLINE, poses, noise=0.02), start_at(poses), wrong, EXACT)
    np.testing.assert_allclose(result.means[-1, 6:], [CAR.length, CAR.width], atol=0.1)
    assert result.covariances[-1, 6, 6] < (0.5 * CAR.length_std * CAR.length) ** 2


def test_the_sides_of_an_oval_class_are_nearer_to_its_middle_than_those_of_its_box():
    assert fullness_of(OVAL) == pytest.approx(np.pi / 4.0)
    assert fullness_of(dataclasses.replace(CAR, corner_radius=0.0)) == pytest.approx(1.0, abs=1e-3)
    angles = 2.0 * np.pi * np.arange(90) / 90
    outline = np.stack([0.9 * np.cos(angles), 0.3 * np.sin(angles)], axis=1)
    # It passes by, and shows its right side.
    poses = np.column_stack([np.linspace(-1.5, 1.5, 30), np.full(30, 12.0), np.zeros(30)])
    scans, errors = scans_seen(outline, poses, noise=0.02), []
    for prior in (OVAL, dataclasses.replace(OVAL, shape="rectangle")):
        result = track(scans, start_at(poses, (0.0, 0.0, 0.0)), prior, TRACKER)
        errors.append(result.means[15:, 1].mean() - 12.0)
    assert abs(errors[0]) < 0.03
    # A box of the same size is put where its side is on the points: too far away.
    assert errors[1] - errors[0] == pytest.approx(0.3 * (1.0 - np.pi / 4.0), rel=0.3)


@pytest.mark.parametrize("count", [1, 2])
def test_few_points_move_the_pose_and_hardly_the_size(count):
    poses = turning(15, 4.0, 0.2)
    scans = scans_seen(OUTLINE, poses, noise=0.03)
    scans = scans.of_rows((scans.offsets[:-1, None] + 20 + np.arange(count)).ravel())
    result = track(scans, start_at(poses), CAR, TRACKER)
    np.testing.assert_allclose(result.means[:, 6:], [[CAR.length, CAR.width]] * 15, rtol=0.1)
    assert np.isfinite(result.covariances).all() and np.isfinite(result.contour_std).all()
    assert np.hypot(*(result.means[-1, :2] - poses[-1, :2])) < 1.0
    # No end of the target.
    np.testing.assert_array_equal(result.nis_degrees_of_freedom, np.diff(result.used_offsets))


def test_points_of_another_object_in_the_gate_are_not_used():
    poses = turning(20, 4.0, 0.2)
    points, covariances = seen(OUTLINE, poses, noise=0.03)
    # Behind the far side of the car, as seen from the sensor.
    clutter = [p[:2] * (1.0 + 2.5 / np.hypot(*p[:2])) for p in poses]
    mixed = [np.concatenate([[one], scan]) for one, scan in zip(clutter, points, strict=True)]
    scans = scans_of(mixed, [np.concatenate([0.0025 * np.eye(2)[None], c]) for c in covariances])
    result = track(scans, start_at(poses), CAR, TRACKER)
    starts = scans.offsets[5:-1]
    assert not np.isin(starts, result.used_points).any()
    assert np.hypot(*(result.means[-1, :2] - poses[-1, :2])) < 0.2


def test_an_end_at_the_border_of_the_field_of_view_is_not_used():
    poses = np.array([[0.0, 10.0, 0.0]])
    points, noises = (one[0] for one in seen(OUTLINE, poses))
    mean = np.array([*poses[0], 4.0, 0.0, 0.0, 4.2, 1.7])
    half = np.arctan2(2.1, 9.15)
    ends = (-half - 0.1, half + 0.1), (-half, half + 0.1), (-half, half)
    for view, count in zip((None, *(FieldOfView(*end) for end in ends)), (2, 2, 1, 0), strict=True):
        rows = measure(mean, points, noises, SENSOR, 1.0, TRACKER.corner_std, view)
        assert len(rows.innovations) - len(points) == count


@settings(max_examples=10)
@given(seed=SEEDS)
def test_stated_deviation_is_that_along_rays_to_first_order(seed):
    random = np.random.default_rng(seed)
    mean = np.array([3.0, 9.0, random.uniform(-3, 3), 2.0, 0.0, 0.1, 4.4, 1.8])
    root = 0.02 * random.standard_normal((8, 8))
    covariance = root @ root.T
    sharp = dataclasses.replace(CAR, corner_radius=0.0)
    contours, std = contours_of(mean[None], covariance[None], sharp, points=24)

    def ranges(state):
        ring = shapely.LinearRing(0.5 * CORNERS * state[6:] @ rotation(state[2]).T + state[:2])
        ends = mean[:2] + 9.0 * (contours[0] - mean[:2])
        rays = shapely.linestrings(np.stack([np.broadcast_to(mean[:2], ends.shape), ends], axis=1))
        met = shapely.get_coordinates(shapely.intersection(rays, ring))
        return np.hypot(*(met - mean[:2]).T)

    slopes = jacobian(ranges, mean)
    wanted = np.sqrt(np.einsum("mi,ij,mj->m", slopes, covariance, slopes))
    np.testing.assert_allclose(std[0], wanted, rtol=1e-3, atol=1e-5)
