"""Errors of contours against public code (PyRecEst, SciPy, shapely) and known values."""

import numpy as np
import pytest
import shapely
from scipy.linalg import sqrtm
from scipy.spatial.distance import directed_hausdorff

from stixel_cli.evaluation.contour_errors import (
    area_moments,
    areas,
    boundary_distances,
    boxes,
    differences_along_rays,
    even_points,
    gaussian_wasserstein,
    overlaps,
    seen_points,
)
from stixel_cli.evaluation.evaluate import intersections_over_unions, normalised_errors
from stixel_cli.geometry.pose import world_from_target

SQUARE = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)


def contours(seed, count=6, points=40):
    """Random star-convex contours (count, points, 2), and their poses."""
    random = np.random.default_rng(seed)
    angles = 2.0 * np.pi * np.arange(points) / points
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    poses = random.uniform([-2, 18, -4], [2, 22, 4], (count, 3))
    radii = random.uniform(0.5, 3.0, (count, points, 1))
    return np.array(
        [world_from_target(r * directions, p) for r, p in zip(radii, poses, strict=True)]
    ), poses


def test_overlaps_nees_and_wasserstein_agree_with_pyrecest():
    # PyRecEst 2.4.2 has a circular import unless this comes first.
    import pyrecest.distributions  # noqa: F401
    from pyrecest.utils import metrics

    (one, poses), (other, others) = contours(0), contours(1)
    expected = [metrics.iou_polygon(a, b) for a, b in zip(one, other, strict=True)]
    np.testing.assert_allclose(intersections_over_unions(one, other), expected, atol=1e-9)

    moments = zip(*area_moments(one), *area_moments(other), strict=True)
    expected = [metrics.gaussian_wasserstein_distance(*pair) for pair in moments]
    np.testing.assert_allclose(gaussian_wasserstein(one, other), expected, atol=1e-9)

    _, covariances = area_moments(one)
    expected = metrics.normalized_estimation_error_squared(poses[:, :2], covariances, others[:, :2])
    found = normalised_errors(poses[:, :2] - others[:, :2], covariances)
    np.testing.assert_allclose(found, expected / 2.0, rtol=1e-9)


def test_wasserstein_distance_agrees_with_scipy_far_from_the_origin():
    one, other = contours(2)[0] + 1e5, contours(3)[0] + 1e5
    (m1, c1), (m2, c2) = area_moments(one), area_moments(other)
    for k, found in enumerate(gaussian_wasserstein(one, other)):
        root = sqrtm(c1[k])
        trace = np.trace(c1[k] + c2[k] - 2.0 * sqrtm(root @ c2[k] @ root).real)
        expected = np.sqrt(np.sum((m1[k] - m2[k]) ** 2) + trace)
        assert found == pytest.approx(expected, abs=1e-9)


def test_area_moments_of_a_rectangle_and_of_nothing():
    turned = world_from_target(SQUARE * [2.0, 0.5], np.array([7.0, -3.0, 0.3]))
    nothing = np.tile([[3.0, 4.0]], (5, 1))
    means, covariances = area_moments([turned, turned[::-1], nothing])
    np.testing.assert_allclose(means, [[7, -3], [7, -3], [3, 4]], atol=1e-12)
    axes = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    expected = axes @ np.diag([4.0 / 3.0, 0.25 / 3.0]) @ axes.T
    np.testing.assert_allclose(covariances, [expected, expected, np.zeros((2, 2))], atol=1e-12)
    centroids = shapely.centroid(areas(contours(4)[0]))
    points = np.stack([shapely.get_x(centroids), shapely.get_y(centroids)], axis=-1)
    np.testing.assert_allclose(area_moments(contours(4)[0])[0], points, atol=1e-9)


def test_box_follows_the_heading_and_has_its_sides():
    pose = np.array([3.0, 4.0, 0.7])
    triangle = np.array([[2.0, 0.0], [-1.0, 1.0], [-1.0, -0.5]])
    corners, sides = boxes([world_from_target(triangle, pose)], pose[None])
    np.testing.assert_allclose(sides, [[3.0, 1.5]], atol=1e-12)
    expected = world_from_target(np.array([[-1, -0.5], [2, -0.5], [2, 1], [-1, 1]], float), pose)
    np.testing.assert_allclose(corners[0], expected, atol=1e-12)
    bounds = shapely.bounds(areas([triangle]))[0]
    flat, _ = boxes([triangle], np.zeros((1, 3)))
    np.testing.assert_allclose(overlaps(areas(flat), np.array([shapely.box(*bounds)])), [1.0])


def test_distances_of_outlines_agree_with_shapely_and_scipy():
    (one, _), (other, _) = contours(5), contours(6)
    dense, sparse = even_points(one, 2000), even_points(other, 50)
    for k, found in enumerate(boundary_distances(sparse, one)):
        ring = shapely.LinearRing(one[k])
        expected = [ring.distance(shapely.Point(p)) for p in sparse[k]]
        np.testing.assert_allclose(found, expected, atol=1e-9)
        # Against SciPy's distance of point sets: the outline's samples are 2 cm apart.
        assert directed_hausdorff(sparse[k], dense[k])[0] == pytest.approx(found.max(), abs=0.03)
    assert np.isnan(boundary_distances(sparse[:1], [one[0] * np.nan])).all()


def test_points_are_even_in_arc_length():
    points = even_points([SQUARE], 16)[0]
    np.testing.assert_allclose(points[:3], [[1, -1], [1, -0.5], [1, 0]], atol=1e-12)
    lengths = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    np.testing.assert_allclose(lengths, 0.5, atol=1e-12)


def test_the_sensor_sees_the_sides_that_face_it():
    """From straight below, one side of a square; from the corner, two; from inside, none."""
    points = np.repeat(even_points([SQUARE], 40), 3, axis=0)
    sensors = np.array([[0.0, -10.0], [10.0, -10.0], [0.2, 0.1]])
    below, corner, inside = seen_points(points, [SQUARE] * 3, sensors)
    x, y = points[0].T
    np.testing.assert_array_equal(below, y == -1.0)
    np.testing.assert_array_equal(corner, (y == -1.0) | (x == 1.0))
    assert not inside.any()


def test_a_part_that_sticks_out_hides_what_is_behind_it():
    """An L: the arm at the front hides the left half of the back."""
    shape = np.array([[0, 0], [2, 0], [2, 2], [1, 2], [1, 1], [0, 1]], float)
    points = even_points([shape], 80)
    from_left = seen_points(points, [shape], np.array([[-50.0, 0.5]]))[0]
    x, y = points[0].T
    np.testing.assert_array_equal(from_left[(x == 0.0) & (y > 0.1) & (y < 0.9)], True)
    np.testing.assert_array_equal(from_left[x == 2.0], False)


def test_difference_along_rays_of_known_contours():
    """A square about (2, 3): points on its axes and diagonals, inside and outside."""
    centre = np.array([2.0, 3.0])
    directions = SQUARE / np.sqrt(2.0)
    points = centre + np.array([[1.5, 0], [0, -0.25], [2, 2], [1, 0.5], [-3, -1]], float)
    std = np.array([0.1, 0.1, 0.3, 0.3])
    found, deviations = differences_along_rays(centre, directions, SQUARE + centre, std, points)
    expected = [0.5, -0.75, np.sqrt(2), 0.0, np.sqrt(10) * 2 / 3]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    # Straight right and down are half way between vertices of std 0.1 and 0.1, 0.3 and 0.1.
    np.testing.assert_allclose(deviations[[0, 1, 2]], [0.1, 0.2, 0.1], atol=1e-12)
    assert deviations[4] == pytest.approx(0.3, abs=1e-12)


def test_difference_along_rays_agrees_with_shapely():
    (one, poses), (other, _) = contours(7), contours(8)
    for k, contour in enumerate(one):
        centre = poses[k, :2]
        directions = contour - centre
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        points = other[k]
        found, _ = differences_along_rays(centre, directions, contour, np.ones(40), points)
        for point, difference in zip(points, found, strict=True):
            ray = centre + 100.0 * (point - centre) / np.linalg.norm(point - centre)
            met = shapely.intersection(
                shapely.LineString([centre, ray]), shapely.LinearRing(contour)
            )
            expected = np.linalg.norm(point - centre) - shapely.distance(met, shapely.Point(centre))
            assert difference == pytest.approx(expected, abs=1e-9)
