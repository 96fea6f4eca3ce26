"""Errors of contours and their upper bounds against public code (SciPy, shapely)."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.linalg import sqrtm
from scipy.spatial.distance import directed_hausdorff

from stixel_cli import compose
from stixel_cli.evaluation.contour_errors import (
    area_moments,
    areas,
    best_star_convex_iou,
    boundary_distances,
    boxes,
    differences_along_rays,
    even_points,
    gaussian_wasserstein,
    overlaps,
    seen_points,
    star_convex_upper_bound,
)
from stixel_cli.evaluation.evaluate import normalised_errors
from stixel_cli.geometry.pose import rotation, target_from_world, world_from_target
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.scenario import Scenario

SQUARE = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)


def contours(seed, count=6, points=40):
    """Random star-convex contours (count, points, 2), and their poses."""
    random = np.random.default_rng(seed)
    angles = 2.0 * np.pi * np.arange(points) / points
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    poses = random.uniform([-2, 18, -4], [2, 22, 4], (count, 3))
    radii = random.uniform(0.5, 3.0, (count, points, 1))
    pairs = zip(radii, poses, strict=True)
    return np.array([world_from_target(r * directions, pose) for r, pose in pairs]), poses


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
    nothing = np.tile([[3.0, 4.0]], (4, 1))
    means, covariances = area_moments(np.stack([turned, turned[::-1], nothing]))
    np.testing.assert_allclose(means, [[7, -3], [7, -3], [3, 4]], atol=1e-12)
    expected = rotation(0.3) @ np.diag([4.0 / 3.0, 0.25 / 3.0]) @ rotation(0.3).T
    np.testing.assert_allclose(covariances, [expected, expected, np.zeros((2, 2))], atol=1e-12)
    centroids = shapely.centroid(areas(contours(4)[0]))
    points = np.stack([shapely.get_x(centroids), shapely.get_y(centroids)], axis=-1)
    np.testing.assert_allclose(area_moments(contours(4)[0])[0], points, atol=1e-9)


def test_distances_of_outlines_agree_with_shapely_and_scipy():
    (one, _), (other, _) = contours(5), contours(6)
    dense, sparse = even_points(one, 2000), even_points(other, 50)
    for k, found in enumerate(boundary_distances(sparse, one)):
        ring = shapely.LinearRing(one[k])
        expected = [ring.distance(shapely.Point(p)) for p in sparse[k]]
        np.testing.assert_allclose(found, expected, atol=1e-9)
        # Against SciPy's distance of point sets: the outline's samples are 2 cm apart.
        assert directed_hausdorff(sparse[k], dense[k])[0] == pytest.approx(found.max(), abs=0.03)
    assert np.isnan(boundary_distances(sparse[:1], one[:1] * np.nan)).all()


def test_the_sensor_sees_the_sides_that_face_it_and_are_not_hidden():
    """From straight below, one side of a square; from the corner, two; from inside, none."""
    points = even_points(SQUARE[None], 40)
    sensors = np.array([[0.0, -10.0], [10.0, -10.0], [0.2, 0.1]])
    below, corner, inside = seen_points(points, SQUARE[None], np.zeros(3, int), sensors)
    x, y = points[0].T
    np.testing.assert_array_equal(below, y == -1.0)
    np.testing.assert_array_equal(corner, (y == -1.0) | (x == 1.0))
    assert not inside.any()
    # An L: the arm at the front hides the left half of the back.
    shape = np.array([[0, 0], [2, 0], [2, 2], [1, 2], [1, 1], [0, 1]], float)
    points = even_points(shape[None], 80)
    sensor = np.array([[-50.0, 0.5]])
    from_left = seen_points(points, shape[None], np.zeros(1, int), sensor)[0]
    x, y = points[0].T
    np.testing.assert_array_equal(from_left[(x == 0.0) & (y > 0.1) & (y < 0.9)], True)
    np.testing.assert_array_equal(from_left[x == 2.0], False)


def test_difference_along_rays_of_known_contours():
    """A square about (2, 3): points on its axes and diagonals, inside and outside."""
    centre = np.array([2.0, 3.0])
    directions = SQUARE / np.sqrt(2.0)
    points = centre + np.array([[1.5, 0], [0, -0.25], [2, 2], [1, 0.5], [-3, -1]], float)
    std = np.array([0.1, 0.1, 0.3, 0.3])
    given = centre, directions, SQUARE + centre, std, points
    (found,), (deviations,) = differences_along_rays(*(value[None] for value in given))
    expected = [0.5, -0.75, np.sqrt(2), 0.0, np.sqrt(10) * 2 / 3]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    # Straight right and down are half way between vertices of std 0.1 and 0.1, 0.3 and 0.1.
    np.testing.assert_allclose(deviations[[0, 1, 2]], [0.1, 0.2, 0.1], atol=1e-12)
    assert deviations[4] == pytest.approx(0.3, abs=1e-12)


def test_polygons_next_to_each_other_do_not_overlap_at_all():
    """Whether they do decides whether a track is off its target."""
    poses = np.array([[0.3, 2.3, angle] for angle in np.linspace(-0.1, 0.1, 20)])
    beside = np.array([world_from_target(SQUARE, pose) for pose in poses])
    squares = np.broadcast_to(SQUARE, beside.shape)
    np.testing.assert_array_equal(overlaps(areas(beside), areas(squares)), 0.0)


def test_distance_of_a_point_on_an_outline_without_length_or_area():
    """All vertices of an estimate may be one point; the first edge of another has no length."""
    polygons = np.array([np.tile([3.0, 4.0], (4, 1)), SQUARE[[0, 0, 1, 2]]])
    points = np.array([[[0.0, 0.0]], [[1.0, -1.0]]])
    np.testing.assert_allclose(boundary_distances(points, polygons), [[5.0], [0.0]], atol=1e-15)


def test_points_and_boxes_agree_with_shapely():
    polygons, poses = contours(9)
    for k, found in enumerate(even_points(polygons)):
        ring = shapely.LinearRing(polygons[k])
        expected = shapely.line_interpolate_point(ring, np.arange(72) / 72, normalized=True)
        np.testing.assert_allclose(found, shapely.get_coordinates(expected), rtol=0, atol=1e-12)
    corners, sides = boxes(polygons, poses)
    for k, (box, pose) in enumerate(zip(corners, poses, strict=True)):
        expected = shapely.bounds(shapely.Polygon(target_from_world(polygons[k], pose)))
        found = target_from_world(box, pose)[[0, 2]].ravel()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(sides[k], expected[2:] - expected[:2], atol=1e-12)


def test_thin_parts_of_an_outline_hide_none_of_its_points():
    """Outlines of two poses of the limbs; the second is in several parts once it is shrunk."""
    left = [[-2, -1], [-1, -1], [-1, -0.005], [1, -0.005], [1, -1], [2, -1]]
    dumbbell = np.concatenate([left, -np.array(left)])
    shapes = np.stack([np.repeat(2.0 * SQUARE, 3, axis=0), dumbbell])
    points, limbs = even_points(shapes), np.array([1, 0])
    dumbbells, square = seen_points(points, shapes, limbs, np.array([[0.0, -200.0], [0.0, -200.0]]))
    x, y = points[1].T
    corner = np.abs(np.abs(x) - 1.5) > 0.49
    # The two blocks hide their far sides, the bridge between them does not hide its own.
    np.testing.assert_array_equal(dumbbells[~corner], y[~corner] < 0.0)
    assert dumbbells[np.abs(x) < 0.9].all()
    low = points[0, :, 1].min()
    assert square[points[0, :, 1] == low].all() and not square[points[0, :, 1] > -low - 1e-9].any()


def test_errors_of_one_scan_do_not_depend_on_the_others():
    """An estimate that is not finite and a covariance that is not valid are NaN on their own."""
    (one, poses), (other, _) = contours(11, 9), contours(12, 9)
    one[4, 7], covariances = np.nan, np.tile(np.eye(3), (9, 1, 1))
    covariances[[0, 5]] = -np.eye(3)
    given = boundary_distances(even_points(other), one), gaussian_wasserstein(one, other)
    for found in (*given, boundary_distances(even_points(one), other)):
        assert np.isnan(found[4]).all() and np.isfinite(np.delete(found, 4, axis=0)).all()
    found = normalised_errors(poses, covariances)
    expected = (poses**2).mean(axis=1)
    expected[[0, 5]] = np.nan
    np.testing.assert_allclose(found, expected, rtol=1e-12)


CORNER = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)


@pytest.mark.parametrize(
    ("true", "estimated", "score"),
    [
        (CORNER, CORNER, 1.0),
        (CORNER, CORNER[::-1], 1.0),
        (CORNER, np.add(CORNER, [1, 0]), 1.0 / 3.0),
        (CORNER, np.add(CORNER, [1, 1]), 1.0 / 7.0),
        (CORNER, CORNER * 0.5, 0.25),
        (CORNER, np.add(CORNER, [5, 0]), 0.0),
        (CORNER, np.add(CORNER, [2, 0]), 0.0),
        (CORNER, CORNER * 0.0, 0.0),
        (CORNER, CORNER * np.nan, 0.0),
        # A pedestrian's area is well below 1 m².
        (0.01 * CORNER, 0.01 * np.add(CORNER, [1, 1]), 1.0 / 7.0),
        # A bow tie is two triangles of area 1.
        (CORNER, CORNER[[0, 1, 3, 2]], 0.5),
        # An L of area 3.
        (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float), CORNER, 0.75),
    ],
)
def test_iou_of_known_polygons(true, estimated, score):
    found = overlaps(areas(estimated[None]), areas(true[None]))
    np.testing.assert_allclose(found, [score], rtol=0, atol=1e-12)


def test_a_star_convex_contour_has_no_upper_bound_and_a_stride_has_one():
    assert best_star_convex_iou(SQUARE) == pytest.approx(1.0, abs=1e-12)
    assert best_star_convex_iou(SQUARE[:, ::-1] * [3.0, 1.0]) == pytest.approx(1.0, abs=1e-12)
    p = compose(["road_user=pedestrian", "path.duration=0.2"]).configuration
    scenario = build_scenario(ego_motion(p.ego, 0.2, 0.1), p.road_user, p.path)
    # A stride is not star-convex.
    assert 0.9 < star_convex_upper_bound(scenario) < 0.999
    assert np.isnan(star_convex_upper_bound(replace(scenario, only_box=True)))


def test_the_best_star_convex_contour_fills_a_small_gap_and_leaves_out_a_far_part():
    """A bar along +x from a unit square; a slot cuts it, and its far part is kept or given up.

    Filling the slot, of area g, wins the far part, of area f: (A) / (A + g) against (A - f) / A.
    """
    bar = np.array([[0.5, -0.1], [4.0, -0.1], [4.0, 0.1], [0.5, 0.1]])
    for slot, kept in ((0.02, True), (3.4, False)):
        # The slot is open at the top, and only a thread of 1e-6 m at the bottom joins the parts.
        first, last = 0.55, 0.55 + slot
        gap = [[last, 0.1], [last, -0.1 + 1e-6], [first, -0.1 + 1e-6], [first, 0.1]]
        cut = np.array([*bar[:3], *gap, bar[3]])
        shape = np.concatenate([[[0.5, -0.5]], cut, [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]])
        assert not Scenario(np.zeros(1), *np.zeros((3, 1, 3)), shape[None]).star_convex
        near, far = 1.0 + 0.05 * 0.2, 0.2 * (4.0 - 0.55 - slot)
        filled = (near + far) / (near + far + 0.2 * slot)
        dropped = near / (near + far)
        assert (filled > dropped) == kept
        assert best_star_convex_iou(shape) == pytest.approx(max(filled, dropped), abs=0.02)
