from dataclasses import replace

import numpy as np
import pytest
from projection import project, unproject

from stixel_cli.geometry.pose import ego_from_world, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.free_space import expected_depth, find_free_space, obstacle_base
from stixel_cli.stixels.road import road_line

BOXES = [(-2.0, 9.0, 1.6, 1.5), (2.5, 16.0, 2.0, 1.7)]


def parked(count):
    return EgoMotion(np.arange(count) * 0.1, np.tile([0.0, 0.0, np.pi / 2], (count, 1)))


def driving(count, speed=1.0, turn=0.0):
    poses = [np.array([0.0, 0.0, np.pi / 2])]
    for _ in range(count - 1):
        x, y, heading = poses[-1]
        poses.append(
            np.array([x + speed * np.cos(heading), y + speed * np.sin(heading), heading + turn])
        )
    return EgoMotion(np.arange(count) * 0.1, np.array(poses))


@pytest.fixture
def find(road, occupancies, free_space):
    def run(disparities, rig, ego_motion=None, previous=None, **changed):
        frames = range(disparities.first, disparities.first + len(disparities))
        arguments = {"road": road, "occupancy": occupancies["polar"], "free_space": free_space}
        return find_free_space(
            disparities,
            ego_motion or parked(frames.stop),
            rig,
            frames=frames,
            previous=previous,
            **(arguments | changed),
        )

    return run


def test_the_road_follows_the_pitch_and_the_height_of_each_frame(find, rig, as_disparities):
    raw = np.full((rig.height, rig.width), -1, dtype=np.int16)
    ego = replace(parked(2), pitches=np.radians([0.0, 1.5]), heights=np.array([0.0, 0.05]))
    found = find(as_disparities(raw, raw), rig, ego)
    expected = road_line(rig.pitch_radians + ego.pitches, rig.camera_height + ego.heights, rig)
    np.testing.assert_allclose(found.road, expected)


@pytest.mark.parametrize("kind", ["polar", "column_disparity", "cartesian"])
@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_free_space_finds_boxes_and_wall(
    find, rig, render, as_disparities, occupancies, kind, pitch
):
    rig = replace(rig, pitch=pitch)
    raw = render(rig, boxes=BOXES, wall=30.0)
    found = find(as_disparities(raw), rig, occupancy=occupancies[kind])
    depth = rig.focal * rig.baseline / found.disparity[0]
    u = np.arange(rig.width)
    for at, distance, width, _ in BOXES:
        edges = rig.u0 + rig.focal * (at + np.array([-0.5, 0.5]) * width) / distance
        inside = (u > edges[0] + 2) & (u < edges[1] - 2)
        np.testing.assert_allclose(depth[inside], distance, rtol=0.02)
        foot = project(rig, np.array([[at, rig.camera_height, distance]]) @ rig.level_from_camera)[
            0, 1
        ]
        assert np.all(np.abs(found.base_row[0][inside] - foot) <= 2)
    lone = np.ones(rig.width, dtype=bool)
    for at, distance, width, _ in BOXES:
        edges = rig.u0 + rig.focal * (at + np.array([-0.5, 0.5]) * width) / distance
        lone &= (u < edges[0] - 4) | (u > edges[1] + 4)
    np.testing.assert_allclose(depth[lone], 30.0, rtol=0.02)


def test_columns_without_obstacle_are_free_and_no_frames_are_no_columns(
    find, rig, render, as_disparities
):
    found = find(as_disparities(render(rig), render(rig, boxes=[(0.0, 10.0, 2.0, 1.5)])), rig)
    assert np.all(np.isnan(found.disparity[0]))
    assert np.all(found.base_row[0] == -1)
    box = ~np.isnan(found.disparity[1])
    assert np.array_equal(box, found.base_row[1] >= 0)
    assert np.count_nonzero(box) == pytest.approx(2.0 * rig.focal / 10.0, abs=2)
    bridge = render(rig, wall=20.0)
    row = rig.v0 - (3.0 - rig.camera_height) * rig.focal / 20.0
    bridge[int(row) - 1 :] = render(rig)[int(row) - 1 :]
    assert np.all(np.isnan(find(as_disparities(bridge), rig).disparity))
    invalid = np.full((rig.height, rig.width), -1, dtype=np.int16)
    assert np.all(np.isnan(find(as_disparities(invalid), rig).disparity))
    empty = find(as_disparities(), rig)
    assert empty.disparity.shape == empty.base_row.shape == (0, rig.width)
    assert empty.road.shape == (0, 2)


@pytest.mark.parametrize(("depth", "tall", "stands"), [(5.0, 0.4, False), (5.0, 0.7, True)])
def test_smallest_obstacle_depends_on_height_and_pixels(
    find, rig, render, as_disparities, depth, tall, stands
):
    """Of 0.4 m at 5 m nine rows stand above `road.least_height`: pixels enough, not 0.3 m."""
    found = find(as_disparities(render(rig, boxes=[(0.0, depth, 1.0, tall)])), rig)
    assert np.isfinite(found.disparity[0, int(rig.u0)]) == stands


def test_chunks_give_the_same_free_space_as_one_pass(find, rig, render, as_disparities, free_space):
    rng = np.random.default_rng(0)
    strong = replace(free_space, temporal_cost=1.0)
    ego = driving(6, speed=0.5, turn=0.02)
    images = []
    for k in range(6):
        raw = render(rig, boxes=[(-1.0, 14.0 - 0.5 * k, 2.0, 1.5)], wall=40.0 - 0.5 * k)
        noisy = raw + np.rint(rng.normal(0, 12, raw.shape)).astype(np.int16)
        images.append(np.where(raw < 0, -1, np.maximum(noisy, 0)).astype(np.int16))
    whole = find(as_disparities(*images), rig, ego, free_space=strong)
    first = find(as_disparities(*images[:4]), rig, ego, free_space=strong)
    second = find(as_disparities(*images[4:], first=4), rig, ego, first, free_space=strong)
    assert second.first == 4
    np.testing.assert_array_equal(
        whole.disparity, np.concatenate([first.disparity, second.disparity])
    )
    alone = find(as_disparities(*images[4:], first=4), rig, ego, free_space=strong)
    assert not np.array_equal(alone.disparity[0], second.disparity[0], equal_nan=True)


def test_temporal_term_keeps_an_obstacle_without_measurement(
    find, rig, render, as_disparities, free_space
):
    """In the second frame the middle of the box has no disparities, nor has what is behind it."""
    raw = render(rig, boxes=[(0.0, 12.0, 3.0, 1.5)])
    holed = raw.copy()
    holed[:, 150:170] = -1
    for cost, expected in ((0.0, np.nan), (0.3, 12.0)):
        changed = replace(free_space, temporal_cost=cost)
        found = find(as_disparities(raw, holed), rig, free_space=changed)
        depth = rig.focal * rig.baseline / found.disparity[1, 152:168]
        np.testing.assert_allclose(depth, expected, rtol=0.03)


@pytest.mark.parametrize("step", [(0.0, -0.5), (0.0, 0.5), (0.5, 0.0)])
def test_temporal_term_does_not_delay_a_moving_target(
    find, rig, render, as_disparities, free_space, step
):
    """It expects a world that stands still; a box at 5 m/s at 10 Hz is measured where it is."""
    places = [np.array([-1.0, 14.0]) + k * np.array(step) for k in range(5)]
    images = [render(rig, boxes=[(*place, 2.0, 1.5)], wall=30.0) for place in places]
    with_term, without = (
        find(as_disparities(*images), rig, free_space=replace(free_space, temporal_cost=cost))
        for cost in (free_space.temporal_cost, 0.0)
    )
    np.testing.assert_array_equal(with_term.disparity, without.disparity)
    for (at, distance), disparity in zip(places[1:], with_term.disparity[1:], strict=True):
        edges = rig.u0 + rig.focal * (at + np.array([-1.0, 1.0])) / distance
        depth = rig.focal * rig.baseline / disparity[int(edges[0]) + 2 : int(edges[1]) - 1]
        np.testing.assert_allclose(depth, distance, rtol=0.03)


@pytest.mark.parametrize("pitch", [0.0, 2.0])
def test_expected_depth_equals_the_wall_seen_from_the_next_pose(pitch):
    rig = Rig(320, 160, None, 300.0, None, None, 0.5, 1.4, pitch, None)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    before, now = np.array([1.0, 2.0, 1.5]), np.array([1.3, 3.5, 1.55])
    obstacle = np.full(rig.width, rig.focal * rig.baseline / 20.0, dtype=np.float32)
    obstacle[:40] = np.nan
    base = obstacle_base(obstacle, line, rig)
    expected = expected_depth(obstacle, base, line, rig, before, now)
    # Two points of the wall fix its line in the new frame.
    wall = ego_from_world(world_from_ego(np.array([[-3.0, 20.0], [3.0, 20.0]]), before), now)
    slope = (wall[1, 1] - wall[0, 1]) / (wall[1, 0] - wall[0, 0])
    seen = np.flatnonzero(np.isfinite(expected))
    assert len(seen) > 200
    lateral = (seen - rig.u0) / rig.focal * expected[seen]
    on_wall = wall[0, 1] + slope * (lateral - wall[0, 0])
    np.testing.assert_allclose(expected[seen], on_wall, atol=0.06)


def test_expected_depth_of_a_static_scene_is_unchanged_up_to_the_borders(rig):
    line = road_line(0.0, rig.camera_height, rig)
    depth = np.linspace(5.0, 40.0, rig.width)
    obstacle = (rig.focal * rig.baseline / depth).astype(np.float32)
    pose = np.array([1.0, 2.0, 1.5])
    expected = expected_depth(obstacle, obstacle_base(obstacle, line, rig), line, rig, pose, pose)
    # Rounded to either side, the point is the neighbour's as well: the nearer one's counts.
    np.testing.assert_allclose(expected, depth, atol=depth[1] - depth[0])


@pytest.mark.parametrize("column", [60, 110, 220])
def test_obstacle_is_expected_in_the_column_of_its_foot(column):
    """Pitched by 8 degrees, a row says by how much depth along the road is not that of the image:
    5 px here."""
    rig = Rig(320, 160, None, 300.0, 150.0, None, 0.5, 1.4, 8.0, None)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    before, now = np.array([1.0, 2.0, 1.5]), np.array([1.1, 4.5, 1.6])
    obstacle = np.full(rig.width, np.nan, dtype=np.float32)
    obstacle[column] = rig.focal * rig.baseline / 9.0
    base = obstacle_base(obstacle, line, rig)
    ray = rig.level_from_camera @ unproject(rig, np.array([[column, base[column], 1.0]]))[0]
    place = ray[[0, 2]] * 9.0 / ray[2]
    x, y = ego_from_world(world_from_ego(place[None], before), now)[0]
    foot = np.array([[x, rig.camera_height, y]]) @ rig.level_from_camera
    expected = expected_depth(obstacle, base, line, rig, before, now)
    at = np.flatnonzero(np.isfinite(expected))
    assert len(at) == 2 and np.all(np.abs(at - project(rig, foot)[0, 0]) < 1.1)
    np.testing.assert_allclose(expected[at], y, rtol=1e-5)


def test_estimated_road_compensates_a_wrong_rig(find, rig, estimated_road, render, as_disparities):
    true = replace(rig, pitch=1.0)
    raw = render(true, boxes=[(0.0, 12.0, 2.0, 1.5)])
    found = find(as_disparities(raw), rig, road=estimated_road)
    box = ~np.isnan(found.disparity[0])
    assert np.count_nonzero(box) == pytest.approx(2.0 * rig.focal / 12.0, abs=2)
    np.testing.assert_allclose(rig.focal * rig.baseline / found.disparity[0][box], 12.0, rtol=0.02)
