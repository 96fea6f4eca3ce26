"""Clusters of points and stixels: which belong together, and their boxes."""

import numpy as np
import pytest
from made_stixels import made_stixels
from sklearn.cluster import DBSCAN

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_target
from stixel_cli.measurements.clusters import cluster, distances
from stixel_cli.measurements.objects import find_objects, smallest_rectangle
from stixel_cli.results.tables import object_columns

GATES = (0.3, 2.5, 1.0, 80.0)
FOCAL = 700.0
WIDTH = 4


def rear(middle, depth, width=1.8, relief=0.0):
    """Points (n, 2) m on the rear of a car, one for each stixel of `WIDTH` px, left to right."""
    count = max(1, round(width * FOCAL / depth / WIDTH))
    x = middle + width * (np.arange(count) + 0.5) / count - 0.5 * width
    y = depth + relief * (-1.0) ** np.arange(count)
    return np.stack([x, y], axis=1)


def stixels(points_of_each, heights=None):
    """The stixels of frames from 3 on whose points (n, 2) m are given; no error across the ray."""
    points = np.concatenate([np.zeros((0, 2)), *points_of_each])
    # 0.3 px of 380 m px: as uncertain as stixels are.
    std = 0.3 * points[:, 1] ** 2 / 380.0
    middle = np.rint(600 + FOCAL * points[:, 0] / np.maximum(points[:, 1], 1.0)).astype(np.int32)
    covariances = np.zeros((len(points), 2, 2))
    covariances[:, 1, 1], covariances[:, 0, 0] = std**2, 1e-4
    base = np.rint(170 + FOCAL * 1.65 / np.maximum(points[:, 1], 1.0)).astype(np.int32)
    frames = np.cumsum([0, *map(len, points_of_each)], dtype=np.int64)
    at = {"left": middle - WIDTH // 2, "right": middle + WIDTH // 2, "top": base - 20, "base": base}
    at |= {"points_ego": points, "covariances_ego": covariances, "depth": points[:, 1]}
    heights = np.ones(len(points)) if heights is None else np.asarray(heights, float)
    return made_stixels(3, frames, height=heights, **at)


def test_cars_next_to_each_other_and_in_a_row_are_objects_of_their_own():
    cars = [rear(-3.0, 20.0), rear(0.0, 12.0), rear(0.9, 30.0), rear(3.0, 20.0)]
    order = np.random.default_rng(4).permutation(sum(map(len, cars)))
    chunk = stixels([np.concatenate(cars)[order], np.zeros((0, 2)), rear(2.0, 15.0)])
    found = find_objects(chunk, GATES, range(3, 6))
    assert found.offsets.tolist() == [0, 4, 4, 5]
    assert found.counts.tolist() == [len(car) for car in (*cars, rear(2.0, 15.0))]
    of_car = np.repeat(np.arange(4), [len(car) for car in cars])
    assert found.of_stixels[: len(order)].tolist() == of_car[order].tolist()
    assert set(found.of_stixels[len(order) :]) == {4}
    # From the leftmost column on.
    assert np.all(np.diff(found.boxes[:4, 0]) > 0)
    for box, car in zip(found.boxes, cars, strict=False):
        own = stixels([car])
        assert box.tolist() == [own.left.min(), own.right.max(), own.top.min(), own.base.max()]
    np.testing.assert_allclose(found.corners_ego[1].mean(axis=0), [0.0, 12.0], atol=1e-5)


def test_a_far_object_does_not_break_up_where_its_depth_is_uncertain():
    near, far = rear(0.0, 10.0, relief=0.5), rear(0.0, 60.0, relief=0.5)
    for points, objects in ((near, 2), (far, 1)):
        chunk = stixels([points])
        assert cluster(chunk.points_ego, chunk.covariances_ego).max() + 1 == objects


def test_a_single_stixel_and_what_the_gates_refuse_are_in_no_object():
    points = np.concatenate([rear(0.0, 12.0), [[5.0, 12.0]], rear(3.0, 20.0)])
    heights = np.ones(len(points))
    heights[len(rear(0.0, 12.0)) + 1 :] = 4.0
    found = find_objects(stixels([points], heights), GATES, range(3, 4))
    assert found.counts.tolist() == [len(rear(0.0, 12.0))]
    assert (found.of_stixels >= 0).sum() == found.counts[0]


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
def test_the_rectangle_on_the_ground_is_the_smallest(angle):
    along, across = np.linspace(-2.1, 2.1, 9), np.linspace(-0.9, 0.9, 5)
    sides = [[x, 0.9] for x in along] + [[2.1, y] for y in across]
    corners = smallest_rectangle(world_from_target(sides, (4.0, 50.0, angle)))
    sizes = np.sort(np.hypot(*np.diff(corners[:3], axis=0).T))
    # The diagonal between the far ends closes the hull, so no rectangle is smaller.
    np.testing.assert_allclose(sizes, [1.8, 4.2], atol=1e-4)
    np.testing.assert_allclose(corners.mean(axis=0), [4.0, 50.0], atol=1e-4)


def test_the_table_has_image_and_world():
    chunk = stixels([rear(0.0, 12.0), np.zeros((0, 2)), rear(2.0, 15.0)])
    found = find_objects(chunk, GATES, range(3, 6))
    # The ego car at the last frame is at (5, 1) and looks along +x.
    poses = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (6, 1))
    poses[5] = 5.0, 1.0, 0.0
    first = find_objects(stixels([np.zeros((0, 2))] * 3), GATES, range(3))
    table = object_columns([first, found], 0.1 * np.arange(6), poses)
    assert table["k"].tolist() == [3, 5] and table["object"].tolist() == [0, 0]
    np.testing.assert_allclose(table["t"], [0.3, 0.5])
    np.testing.assert_allclose(table["x"], [0.0, 5.0 + 15.0], atol=1e-4)
    np.testing.assert_allclose(table["y"], [12.0, 1.0 - 2.0], atol=1e-4)
    assert table["length"] == pytest.approx([np.ptp(rear(0, d)[:, 0]) for d in (12, 15)], abs=1e-4)
    assert table["width"] == pytest.approx(0.0, abs=1e-4)
    assert np.abs(np.sin(table["heading"])) == pytest.approx([0.0, 1.0], abs=1e-4)
    empty = object_columns([first], 0.1 * np.arange(3), poses[:3])
    assert all(len(column) == 0 for column in empty.values())


@pytest.mark.parametrize("least", [1, 2])
def test_clusters_are_those_of_dbscan(least):
    random, single = np.random.default_rng(0), 0
    for count in [1, *random.integers(2, 60, 40)]:
        points = random.uniform([-8.0, 7.0], [8.0, 23.0], (count, 2))
        covariances = np.tile(random.uniform(0.0, 0.3) * np.eye(2), (count, 1, 1))
        found = cluster(points, covariances, least=least)
        near = distances(points, covariances)
        expected = DBSCAN(eps=1.0, min_samples=least, metric="precomputed").fit_predict(near)
        np.testing.assert_array_equal(found, expected)
        single += int(np.sum(found < 0))
    assert (single > 0) == (least == 2)
    assert len(cluster(np.zeros((0, 2)), np.zeros((0, 2, 2)))) == 0
