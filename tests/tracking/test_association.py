import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2
from tracking_cases import poses_of_turn, scans_of, seen_car

from stixel_cli.geometry.pose import rotation, world_from_target
from stixel_cli.tracking.association import associate, contour_moments
from stixel_cli.tracking.gp_ekf import track
from stixel_cli.tracking.prior import PriorShape, prior_radii

ANGLES = 2.0 * np.pi * np.arange(2000) / 2000
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)


def test_moments_of_ellipse_and_rectangle_are_exact():
    radii = 2.0 * 0.5 / np.hypot(0.5 * np.cos(ANGLES), 2.0 * np.sin(ANGLES))
    centroid, moments = contour_moments(DIRECTIONS, radii)
    np.testing.assert_allclose(centroid, 0.0, atol=1e-12)
    np.testing.assert_allclose(moments, np.diag([2.0**2 / 4, 0.5**2 / 4]), atol=1e-6)
    sharp = PriorShape(4.5, 1.8, "rectangle", 0.0, 1.0, 1.0, 0.1, 0.3, "car", 0.06, 0.06, None)
    _, moments = contour_moments(DIRECTIONS, prior_radii(sharp, ANGLES))
    np.testing.assert_allclose(moments, np.diag([4.5**2 / 12, 1.8**2 / 12]), rtol=1e-3, atol=1e-9)


def test_moments_use_the_centroid_of_an_asymmetric_contour():
    # A circle of radius 2 seen from a point 1 m from its centre.
    radii = np.cos(ANGLES) + np.sqrt(4.0 - np.sin(ANGLES) ** 2)
    centroid, moments = contour_moments(DIRECTIONS, radii)
    np.testing.assert_allclose(centroid, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(moments, np.eye(2), atol=1e-9)


def test_contour_without_area_has_no_moments():
    centroid, moments = contour_moments(DIRECTIONS, -np.ones(2000))
    assert not centroid.any()
    assert not moments.any()


@given(seed=st.integers(0, 2**31), probability=st.floats(0.01, 0.999), each=st.booleans())
def test_gate_matches_the_normal_density(seed, probability, each):
    random = np.random.default_rng(seed)
    points = 3.0 * random.standard_normal((30, 2))
    roots = random.standard_normal((30 if each else 1, 2, 2))
    spread = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(2)
    expected = [
        i
        for i, z in enumerate(points)
        if (z - 1.0) @ np.linalg.solve(spread[i % len(spread)], z - 1.0) <= chi2.ppf(probability, 2)
    ]
    found = associate(points, np.ones(2), spread if each else spread[0], probability)
    assert found.tolist() == expected


def test_no_gate_accepts_all_points_and_an_empty_scan_gives_no_point():
    assert associate(np.ones((3, 2)), np.zeros(2), 1e-9 * np.eye(2), None).tolist() == [0, 1, 2]
    assert associate(np.zeros((0, 2)), np.zeros(2), np.eye(2), 0.99).tolist() == []


@pytest.mark.parametrize("size", [(4.5, 1.8), (1.8, 0.6), (0.6, 0.35), (12.0, 2.5)])
@pytest.mark.parametrize("shape", ["rectangle", "ellipse"])
def test_contour_is_inside_its_own_gate(size, shape):
    prior = PriorShape(*size, shape, 0.0, 1.0, 1.0, 0.1, 0.3, "car", 0.06, 0.06, None)
    radii = prior_radii(prior, ANGLES)
    centroid, moments = contour_moments(DIRECTIONS, radii)
    outline = radii[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)
    assert len(associate(outline, centroid, moments, 0.99)) == len(outline)


def test_gate_accepts_target_points_and_rejects_a_wall_behind(tracker):
    scans = seen_car(40, 60)
    behind = np.stack([np.linspace(-4.5, 4.5, 30), np.full(30, 0.9 + 3.0)], axis=-1)
    with_wall = [
        np.concatenate([points, world_from_target(behind, pose)])
        for points, pose in zip(scans, poses_of_turn(40), strict=True)
    ]
    found = track(scans_of(with_wall), *tracker)
    for k in range(10, 40):
        used = found.used_points[found.used_offsets[k] : found.used_offsets[k + 1]] - 90 * k
        assert set(range(60)) <= set(used.tolist())
        assert used.max() < 60


def test_gate_rotates_with_the_target(tracker):
    """3 m from the centre is inside before the car (2.1 m to its front), outside beside it."""
    initial, prior, parameters = tracker
    centre = initial.mean[:2]
    points = centre + np.array([[3.0, 0.0], [0.0, 3.0]]) @ rotation(initial.mean[2]).T
    # A single scan has no sample time: it is not predicted.
    found = track(scans_of([points]), initial, prior, parameters)
    assert found.used_points.tolist() == [0]
