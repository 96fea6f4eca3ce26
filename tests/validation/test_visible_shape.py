import dataclasses
import json

import numpy as np
import pytest
import trimesh

from stixel_cli.config.compose import compose
from stixel_cli.engine.code import CodeIndex
from stixel_cli.experiment.class_shapes import SEEDS, entry
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rectangle
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.mesh import Part
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.contour.class_shape import HEIGHTS, visible_table
from stixel_cli.tracking.contour.class_size import CLASS_SHAPES, ClassSize
from stixel_cli.validation.visible_shape import (
    class_shape_of,
    height_insets_of,
    outline_modes_of,
    radii_of,
    visible_outline_of,
    visible_shape_of,
)

BOX = rectangle(4.0, 1.8)
BEHIND, PER_STD = 0.2, 0.5


@pytest.fixture(scope="module")
def sample():
    """A box that turns, seen from all sides, `BEHIND` m + `PER_STD` std behind its outline."""
    count = 60
    sensor = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1))
    headings = np.linspace(0.0, 2.0 * np.pi, count)
    away = 10.0 + 4.0 * np.cos(7.0 * headings)
    poses = np.column_stack([np.zeros(count), away, headings])
    scenario = Scenario(0.1 * np.arange(count), sensor, poses, 0.0 * poses, BOX[None])
    p = compose(["measurement=fabricated", "measurement/noise=stereo"]).configuration
    scans = fabricate_scans(scenario, p.rig, dataclasses.replace(p.measurement, rays=320), 1000)
    along = scans.points_world / np.hypot(*scans.points_world.T)[:, None]
    stds = np.sqrt(np.einsum("ni,nij,nj->n", along, scans.covariances_world, along))
    behind = scans.points_world + (BEHIND + PER_STD * stds)[:, None] * along
    return scenario, dataclasses.replace(scans, points_world=behind)


@pytest.fixture(scope="module")
def shape(sample):
    return class_shape_of([sample[0]])


def test_visible_shape_is_found_behind_the_outline(sample, shape):
    seen = visible_shape_of([sample], shape)
    assert np.abs(seen.depth_biases[..., 2:-2] - BEHIND).max() < 0.06
    assert seen.bias_per_std == pytest.approx(PER_STD, abs=0.3)
    assert 0.7 < seen.std_factor < 1.3
    assert np.abs(seen.insets).max() < 0.08


def test_one_end_may_be_seen_farther_out_than_the_other(sample, shape):
    """A stereo matcher does so. Seen from one side alone, the other side has it, too."""
    scenario, scans = sample
    half = scans.of_rows(np.arange(scans.offsets[len(scans) // 2]))
    aside = np.stack([-half.points_world[:, 1], half.points_world[:, 0]], axis=-1)
    aside *= 0.05 / np.hypot(*aside.T)[:, None]
    moved = dataclasses.replace(half, points_world=half.points_world + aside)
    plain, left = (visible_shape_of([(scenario, each)], shape) for each in (half, moved))
    apart = (left.insets - plain.insets).mean(axis=1)
    np.testing.assert_allclose(apart, [0.05, -0.05], atol=0.01)


def test_outline_of_one_road_user_is_its_own(shape):
    np.testing.assert_allclose(shape.size, [4.0, 1.8], rtol=0.02)
    np.testing.assert_allclose(np.ptp(shape.outline, axis=0), [4.0, 1.8], rtol=0.02)
    np.testing.assert_array_equal(shape.outline_stds, 0.0)


def walker(stride, scale):
    """A road user whose length is 0.4 m, at half of the instants that plus its stride."""
    half = rectangle(0.4, 0.5)
    contours, still = scale * np.stack([half, half * [1.0 + stride / 0.4, 1.0]]), np.zeros((2, 3))
    return Scenario(np.arange(2.0), still, still, still, contours, np.array([0, 1]))


def test_one_that_walks_has_the_size_of_its_box_and_is_seen_at_its_mean_with_its_swing():
    walkers = [walker(0.16, 1.0), walker(0.16, 1.5)]
    shape = class_shape_of(walkers)
    np.testing.assert_allclose(shape.size, [0.7, 0.625])
    # The outlines of that size are 0.5 and 0.7 m long.
    np.testing.assert_allclose(np.ptp(shape.outline, axis=0), [0.6 + 0.2 / 3.0, 0.625], rtol=0.01)
    table = visible_table(shape.outline, visible_outline_of(walkers, shape))
    depths, stds = table.depths, table.stds
    middle, side = depths.shape[1] // 2, len(depths) // 4
    assert depths[0, middle] == pytest.approx(-0.3, abs=0.02)
    assert stds[0, middle] == pytest.approx(0.05, abs=0.02)
    # From the side the swing moves the ends and not the depth.
    assert depths[side, middle] == pytest.approx(-0.3125, abs=0.02)
    assert stds[side, middle] < 0.045
    assert table.high[side] == pytest.approx(0.3, abs=0.02)
    assert table.high_stds[side] == pytest.approx(0.05, abs=0.03)


def test_points_of_the_background_do_not_change_the_visible_shape(sample, shape):
    scenario, scans = sample
    wall, unit = [[0.0, 40.0], [3.0, 40.0]], np.tile(np.eye(2), (2, 1, 1))
    own = [(scans.points_world[r], scans.covariances_world[r]) for r in map(scans.rows, range(60))]
    parts = [(np.vstack([points, wall]), np.vstack([spread, unit])) for points, spread in own]
    mixed = Scans.of_each(scans.times, scans.sensor_poses_world, parts)
    plain, among = (visible_shape_of([each], shape) for each in (sample, (scenario, mixed)))
    np.testing.assert_allclose(among.depth_biases, plain.depth_biases, atol=1e-9)


def test_radii_are_those_along_and_across_the_heading():
    ahead, left = radii_of([BOX, 1.2 * BOX])[:, [0, 90]].T
    assert [*ahead, *left] == pytest.approx([2.0, 2.4, 0.9, 1.08])


def test_modes_are_the_covariance_of_the_outlines():
    """Of walkers whose arms are at two places, and of one who swings them from pose to pose."""
    pair = [walker(0.16, 1.0), walker(0.16, 1.5)]
    size = class_shape_of(pair).size
    modes = outline_modes_of(pair, size)
    assert modes.fixed.shape == (12, 120) and modes.limbs.shape == (6, 120)
    # The mirrored walker counts as much, so the covariance is symmetric about the heading.
    covariance = modes.fixed.T @ modes.fixed
    mirrored = -np.arange(120) % 120
    np.testing.assert_allclose(covariance, covariance[np.ix_(mirrored, mirrored)], atol=1e-9)
    alone = outline_modes_of(pair[:1], size)
    np.testing.assert_allclose(alone.radius_stds**2, (alone.limbs**2).sum(axis=0), atol=1e-9)


def body_of(*boxes):
    """A mesh of boxes, each by its two opposite corners, m."""
    solids = [trimesh.creation.box(bounds=one) for one in boxes]
    part = trimesh.util.concatenate(solids)
    corners, texture = np.zeros((len(part.faces), 3, 2)), np.zeros((1, 1, 3), np.uint8)
    return (Part(np.array(part.vertices), np.array(part.faces), corners, texture, "body"),)


def test_above_its_bonnet_a_car_ends_farther_inside():
    low = [[-2.0, -0.9, 0.2], [2.0, 0.9, 0.68]]
    mirrors = [[0.5, -1.0, 0.9], [0.6, 1.0, 1.0]]
    saloon = body_of(low, [[-1.0, -0.7, 0.68], [0.8, 0.7, 1.4]], mirrors)
    van = body_of(low, [[-2.0, -0.9, 0.68], [0.8, 0.9, 1.4]])
    rear, front, sides = height_insets_of([[saloon]])
    assert not rear[1].any() and not front[1].any() and not sides[1].any()
    mirror, closed = np.abs(HEIGHTS - 0.95) < 0.01, HEIGHTS > 1.4
    of_cabin = np.where(HEIGHTS < 0.7, 0.0, np.where(closed, 0.9, 0.2))
    np.testing.assert_allclose(sides[0], np.where(mirror, 0.0, of_cabin), atol=1e-9)
    # Where it has no body, its roof was the last that was seen of it.
    for face, inset in ((rear, 1.0), (front, 1.2)):
        of_cabin = np.where(HEIGHTS < 0.7, 0.0, np.where(closed, 2.0, inset))
        np.testing.assert_allclose(face[0], of_cabin, atol=1e-9)
    # Of both, half are so far inside; and of two poses of the limbs, the mean counts.
    rear, front, _ = height_insets_of([[saloon], [van]])
    np.testing.assert_allclose(rear[:, 8], [0.5, 0.5], atol=1e-9)
    np.testing.assert_allclose(front[:, 8], [1.2, 0.0], atol=1e-9)
    of_all = height_insets_of([[saloon, van]])
    np.testing.assert_allclose(of_all[0, :, 8], [0.5, 0.0], atol=1e-9)


def test_a_face_that_slopes_is_as_far_inside_as_at_the_height_itself():
    """A windscreen rises by .26 m a metre: the outermost of a slab is .2 m farther out."""
    base = [[-2.0, -0.9, 0.35], [2.0, -0.9, 0.35], [2.0, 0.9, 0.35], [-2.0, 0.9, 0.35]]
    roof = [[-2.0, -0.9, 1.3], [-1.6, -0.9, 1.3], [-1.6, 0.9, 1.3], [-2.0, 0.9, 1.3]]
    solid = trimesh.convex.convex_hull(np.array(base + roof))
    corners, texture = np.zeros((len(solid.faces), 3, 2)), np.zeros((1, 1, 3), np.uint8)
    wedge = Part(np.array(solid.vertices), np.array(solid.faces), corners, texture, "body")
    _, front, _ = height_insets_of([[(wedge,)]])
    below = HEIGHTS < 1.3
    np.testing.assert_allclose(front[0, below], (HEIGHTS[below] - 0.35) * 3.6 / 0.95, atol=1e-9)
    # A van is taller: above the wedge it alone counts.
    _, front, _ = height_insets_of([[(wedge,)], [body_of([[-2.0, -0.9, 0.2], [2.0, 0.9, 1.9]])]])
    assert front[:, -1].tolist() == [0.0, 0.0]
    # A class lower than a bumper is as far out at all heights.
    assert not height_insets_of([[body_of([[-0.5, -0.3, 0.0], [0.5, 0.3, 0.3]])]]).any()
    assert front.size * 3 == len(CLASS_SHAPES["car"]["height_insets"])


def test_knowledge_comes_from_tuning_seeds_and_survives_its_text(sample, shape):
    assert min(SEEDS) >= 1000
    seen = visible_shape_of([sample], shape)
    size = ClassSize(np.array([4.52, 1.83]), np.array([0.07, 0.04]))
    modes = outline_modes_of([sample[0]], shape.size)
    known = json.loads(json.dumps(entry(size, shape, modes, {"lidar": seen})))
    assert (known["size"], known["size_stds"]) == ([4520, 1830], [70, 40])
    radii = np.array(known["radii"]) / 1000.0
    np.testing.assert_allclose(radii, np.hypot(*shape.outline.T), atol=5.1e-4)
    depths = np.array(known["lidar"]["depth_stds"]) / 1000.0
    np.testing.assert_allclose(depths, seen.depth_stds.ravel(), atol=5.1e-4)


def test_the_file_of_class_shapes_counts_in_the_keys_of_what_reads_it():
    for module in ("stixel_cli.tracking.contour.contour", "stixel_cli.tracking.several"):
        modules = CodeIndex().code([module]).modules
        assert "stixel_cli.tracking.contour.class_size/class_shapes.json" in modules
