from dataclasses import replace

import numpy as np
import pytest
from boxed_road import (
    BOXES,
    ESTIMATED_ROAD,
    FREE_SPACE,
    OCCUPANCIES,
    ROAD,
    as_disparities,
    columns_of,
    find,
    parked,
    render,
)
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from projection import project, unproject

from stixel_cli.geometry.pose import ego_from_world, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.free_space import (
    EDGE,
    LEAST_ROWS,
    _find_unknown,
    expected_depth,
    obstacle_base,
)
from stixel_cli.stixels.nearest_obstacle import add_temporal, cell_costs, cheapest_path, refine
from stixel_cli.stixels.occupancy import (
    BINS_PER_PIXEL,
    column_histograms,
    fill,
    layout,
    picture_grid,
    spread_laterally,
)
from stixel_cli.stixels.parameters import RigRoad
from stixel_cli.stixels.road import (
    base_rows,
    find_road,
    obstacle_limits,
    pitch_and_height,
    pitch_factors,
    road_line,
    v_disparity,
)
from stixel_cli.stixels.types import FreeSpace


def test_the_road_follows_the_pitch_and_the_height_of_each_frame(rig):
    raw = np.full((rig.height, rig.width), -1, dtype=np.int16)
    ego = replace(parked(2), pitches=np.radians([0.0, 1.5]), heights=np.array([0.0, 0.05]))
    found = find(as_disparities(raw, raw), rig, ego)
    expected = road_line(rig.pitch_radians + ego.pitches, rig.camera_height + ego.heights, rig)
    assert_allclose(found.road, expected)


@pytest.mark.parametrize("kind", ["polar", "column_disparity", "cartesian"])
@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_free_space_finds_boxes_and_wall(rig, kind, pitch):
    rig = replace(rig, pitch=pitch)
    raw = render(rig, boxes=BOXES, wall=30.0)
    found = find(as_disparities(raw), rig, occupancy=OCCUPANCIES[kind])
    depth = rig.focal * rig.baseline / found.disparity[0]
    u = np.arange(rig.width)
    lone = np.ones(rig.width, dtype=bool)
    for at, distance, width, tall in BOXES:
        edges = columns_of(rig, (at, distance, width, tall))
        lone &= (u < edges[0] - 4) | (u > edges[1] + 4)
        inside = (u > edges[0] + 2) & (u < edges[1] - 2)
        assert_allclose(depth[inside], distance, rtol=0.02)
        (foot,) = pixels_of_level(rig, [[at, rig.camera_height, distance]])
        assert np.all(np.abs(found.base_row[0][inside] - foot[1]) <= 2)
    assert_allclose(depth[lone], 30.0, rtol=0.02)


def test_columns_without_obstacle_are_free_and_no_frames_are_no_columns(rig):
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
def test_smallest_obstacle_depends_on_height_and_pixels(rig, depth, tall, stands):
    """Of 0.4 m at 5 m nine rows stand above `road.least_height`: pixels enough, not 0.3 m."""
    found = find(as_disparities(render(rig, boxes=[(0.0, depth, 1.0, tall)])), rig)
    assert np.isfinite(found.disparity[0, int(rig.u0)]) == stands


def test_chunks_give_the_same_free_space_as_one_pass(rig):
    rng = np.random.default_rng(0)
    strong = replace(FREE_SPACE, temporal_cost=1.0)
    headings = np.pi / 2 + 0.02 * np.arange(6)
    steps = 0.5 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    places = np.cumsum([[0.0, 0.0], *steps[:-1]], axis=0)
    ego = EgoMotion(np.arange(6) * 0.1, np.column_stack([places, headings]))
    images = []
    for k in range(6):
        raw = render(rig, boxes=[(-1.0, 14.0 - 0.5 * k, 2.0, 1.5)], wall=40.0 - 0.5 * k)
        noisy = raw + np.rint(rng.normal(0, 12, raw.shape)).astype(np.int16)
        images.append(np.where(raw < 0, -1, np.maximum(noisy, 0)).astype(np.int16))
    whole = find(as_disparities(*images), rig, ego, free_space=strong)
    first = find(as_disparities(*images[:4]), rig, ego, free_space=strong)
    second = find(as_disparities(*images[4:], first=4), rig, ego, first, free_space=strong)
    assert second.first == 4
    assert_array_equal(whole.disparity, np.concatenate([first.disparity, second.disparity]))
    alone = find(as_disparities(*images[4:], first=4), rig, ego, free_space=strong)
    assert not np.array_equal(alone.disparity[0], second.disparity[0], equal_nan=True)


def test_temporal_term_keeps_an_obstacle_without_measurement(rig):
    """In the second frame the middle of the box has no disparities, nor has what is behind it."""
    raw = render(rig, boxes=[(0.0, 12.0, 3.0, 1.5)])
    holed = raw.copy()
    holed[:, 150:170] = -1
    for cost, expected in ((0.0, np.nan), (0.3, 12.0)):
        changed = replace(FREE_SPACE, temporal_cost=cost)
        found = find(as_disparities(raw, holed), rig, free_space=changed)
        depth = rig.focal * rig.baseline / found.disparity[1, 152:168]
        assert_allclose(depth, expected, rtol=0.03)


@pytest.mark.parametrize("step", [(0.0, -0.5), (0.0, 0.5), (0.5, 0.0)])
def test_temporal_term_does_not_delay_a_moving_target(rig, step):
    """It expects a world that stands still; a box at 5 m/s at 10 Hz is measured where it is."""
    places = [np.array([-1.0, 14.0]) + k * np.array(step) for k in range(5)]
    images = [render(rig, boxes=[(*place, 2.0, 1.5)], wall=30.0) for place in places]
    settings = (FREE_SPACE, replace(FREE_SPACE, temporal_cost=0.0))
    with_term, without = (find(as_disparities(*images), rig, free_space=one) for one in settings)
    assert_array_equal(with_term.disparity, without.disparity)
    for (at, distance), disparity in zip(places[1:], with_term.disparity[1:], strict=True):
        edges = columns_of(rig, (at, distance, 2.0, 1.5))
        depth = rig.focal * rig.baseline / disparity[int(edges[0]) + 2 : int(edges[1]) - 1]
        assert_allclose(depth, distance, rtol=0.03)


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
    assert_allclose(expected[seen], on_wall, atol=0.06)


def test_expected_depth_of_a_static_scene_is_unchanged_up_to_the_borders(rig):
    line = road_line(0.0, rig.camera_height, rig)
    depth = np.linspace(5.0, 40.0, rig.width)
    obstacle = (rig.focal * rig.baseline / depth).astype(np.float32)
    pose = np.array([1.0, 2.0, 1.5])
    expected = expected_depth(obstacle, obstacle_base(obstacle, line, rig), line, rig, pose, pose)
    # Rounded to either side, the point is the neighbour's as well: the nearer one's counts.
    assert_allclose(expected, depth, atol=depth[1] - depth[0])


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
    (foot,) = pixels_of_level(rig, [[x, rig.camera_height, y]])
    expected = expected_depth(obstacle, base, line, rig, before, now)
    at = np.flatnonzero(np.isfinite(expected))
    assert len(at) == 2 and np.all(np.abs(at - foot[0]) < 1.1)
    assert_allclose(expected[at], y, rtol=1e-5)


def test_estimated_road_compensates_a_wrong_rig(rig):
    true = replace(rig, pitch=1.0)
    raw = render(true, boxes=[(0.0, 12.0, 2.0, 1.5)])
    found = find(as_disparities(raw), rig, road=ESTIMATED_ROAD)
    box = ~np.isnan(found.disparity[0])
    assert np.count_nonzero(box) == pytest.approx(2.0 * rig.focal / 12.0, abs=2)
    assert_allclose(rig.focal * rig.baseline / found.disparity[0][box], 12.0, rtol=0.02)


def normal(x, std):
    """Equation (7) in one dimension, with the root of |Γ|."""
    return np.exp(-0.5 * (x / std) ** 2) / np.sqrt(2 * np.pi * std**2)


@given(st.integers(0, 2**32 - 1))
def test_histograms_count_the_obstacle_pixels(seed):
    rng = np.random.default_rng(seed)
    columns = rng.integers(-1, 256, (7, 30)).astype(np.int16)
    lowest = rng.integers(1, 200, 30).astype(np.int32)
    highest = lowest + rng.integers(-50, 150, 30).astype(np.int32)
    scale = rng.uniform(0.11, 0.13, 30).astype(np.float32)
    expected = np.zeros((7, 33))
    for u, v in np.argwhere((lowest <= columns) & (columns <= highest)):
        expected[u, min(int(np.floor(columns[u, v] * scale[v] + np.float32(0.5))), 32)] += 1
    assert np.array_equal(column_histograms(columns, lowest, highest, scale, 33), expected)


@pytest.mark.parametrize("kind", ["polar", "column_disparity"])
def test_occupancy_is_the_sum_of_the_likelihoods(rig, kind):
    """Against equation (6) itself, pixel by pixel, averaged over the cell by sampling."""
    rng = np.random.default_rng(1)
    grid = layout(with_constants(OCCUPANCIES[kind], relief=0.0), rig, 64)
    histogram = np.zeros((3, len(grid.likelihoods)), dtype=np.uint16)
    bins = rng.integers(8, 100, (3, 15))
    np.add.at(histogram, (np.arange(3)[:, None], bins), 1)
    got = fill(histogram, grid.likelihoods, grid.first, grid.last)
    for j in rng.integers(0, len(grid.depths), 12):
        half = grid.reaches[j] - 2.0 * 0.5
        z = grid.depths[j]
        middle = grid.disparities[j]
        ends = np.array([middle - half, middle + half], dtype=np.float64)
        if kind == "polar":
            ends = rig.focal * rig.baseline / np.array([z + 0.125, z - 0.125], dtype=np.float64)
        samples = np.linspace(*ends, 2001)[:-1] + 0.5 * np.diff(ends) / 2000
        expected = normal(samples[None, None] - bins[..., None] / BINS_PER_PIXEL, 0.5)
        assert_allclose(got[:, j], expected.sum(axis=1).mean(axis=1), atol=1e-3)


def test_relief_widens_only_near_cells(rig):
    flat = layout(with_constants(OCCUPANCIES["polar"], relief=0.0), rig, 64)
    rough = layout(with_constants(OCCUPANCIES["polar"], relief=0.3), rig, 64)
    assert rough.peaks[0] < 0.6 * flat.peaks[0]
    assert rough.peaks[-1] == pytest.approx(flat.peaks[-1], rel=1e-2)
    # A peak is the most that a pixel gives.
    assert np.all(rough.likelihoods.max(axis=0) <= rough.peaks * (1 + 1e-5))


def test_lateral_spread_sums_over_the_columns():
    rng = np.random.default_rng(5)
    polar = rng.random((40, 3)).astype(np.float32)
    starts, widths = np.array([-5.0, 3.2, 10.1]), np.array([7.0, 4.3, 0.6])
    edges = starts + widths * np.arange(9)[:, None]
    got = spread_laterally(polar, starts, widths, 8, 1.3)
    for i, j in np.ndindex(8, 3):
        ends = edges[i, j], edges[i + 1, j]
        samples = np.linspace(*ends, 2001)[:-1] + 0.5 * (ends[1] - ends[0]) / 2000
        density = normal(samples[:, None] - np.arange(40), 1.3).mean(axis=0)
        assert got[i, j] == pytest.approx(density @ polar[:, j], abs=1e-3)


@pytest.mark.parametrize("kind", ["polar", "column_disparity", "cartesian"])
def test_displayed_grid_shows_the_box_at_its_place(rig, kind):
    empty, box = render(rig), render(rig, boxes=[(1.0, 12.0, 2.0, 1.5)])
    nothing = np.full((2, rig.width), np.nan, np.float32), np.full((2, rig.width), -1, np.int32)
    road = np.tile(road_line(0.0, rig.camera_height, rig), (2, 1))
    free = FreeSpace(4, *nothing, road, nothing[1])
    disparities = as_disparities(empty, box, first=4)
    arguments = (disparities, free, rig, ROAD, OCCUPANCIES[kind])
    grid = picture_grid(*arguments, frame=5)
    assert grid.kind == kind
    assert grid.values.shape == (len(grid.depths), len(grid.laterals))
    assert grid.values.dtype == np.float32
    row, column = np.unravel_index(np.argmax(grid.values), grid.values.shape)
    assert grid.depths[row] == pytest.approx(12.0, abs=0.3)
    lateral = grid.laterals[column]
    lateral = lateral if kind == "cartesian" else (lateral - rig.u0) * 12.0 / rig.focal
    assert 0.0 <= lateral <= 2.0
    assert picture_grid(*arguments, frame=4).values.max() == 0.0


ONE = np.float32(1.0)
COSTS = (st.sampled_from([0.0, 0.05, 0.3, 5.0]), st.sampled_from([0.5, 3.0, 100.0]))


def least_cost(costs, depths, cost, limit):
    """Dynamic programming in O(W R²), straight from the definition."""
    step = cost * np.minimum(np.abs(depths[:, None] - depths[None, :]), limit)
    total = costs[0].astype(np.float64)
    for u in range(1, len(costs)):
        total = costs[u] + (step + total).min(axis=1)
    return total.min()


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 24), *COSTS)
def test_path_has_the_least_cost(seed, width, rows, cost, limit):
    rng = np.random.default_rng(seed)
    costs = rng.random((width, rows)).astype(np.float32)
    depths = np.sort(rng.uniform(3.0, 30.0, rows)).astype(np.float32)
    path = cheapest_path(costs, depths, np.float32(cost), np.float32(limit))
    steps = cost * np.minimum(np.abs(np.diff(depths[path])), limit)
    found = costs[np.arange(width), path].sum(dtype=np.float64) + steps.sum(dtype=np.float64)
    assert found == pytest.approx(least_cost(costs, depths, cost, limit), rel=1e-5)


def brute_costs(column, inverse_requirement, bound, free_cost):
    evidence = column * inverse_requirement
    rows = len(evidence)
    end = rows
    for j in range(rows):
        later = evidence[j + 1] if j + 1 < rows else -np.inf
        if evidence[j] >= 1 and later < evidence[j]:
            end = j + 1
            while end < rows and evidence[end] <= evidence[end - 1]:
                end += 1
            break
    costs = [min(bound, 1 / e) if e > 0 and j < end else bound for j, e in enumerate(evidence)]
    return [*costs, free_cost]


@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_cell_costs_subtract_the_background(seed, rows):
    rng = np.random.default_rng(seed)
    occupancy = (rng.random((6, rows)) ** 3 * rng.integers(0, 2, (6, rows)) * 40).astype(np.float32)
    inverse = rng.uniform(0.05, 0.2, rows).astype(np.float32)
    costs = cell_costs(occupancy, inverse, np.float32(1.5), ONE)
    expected = [brute_costs(column, inverse, 1.5, 1.0) for column in occupancy]
    assert_allclose(costs, expected, rtol=1e-6)


def test_temporal_cost_is_the_truncated_distance():
    rng = np.random.default_rng(7)
    costs = rng.random((5, 12)).astype(np.float32)
    depths = np.sort(rng.uniform(3, 9, 12)).astype(np.float32)
    expected = np.array([4.0, np.nan, 8.0, 3.0, np.nan], dtype=np.float32)
    added = costs.copy()
    add_temporal(added, depths, expected, np.float32(0.3), np.float32(2.0))
    away = np.nan_to_num(np.minimum(np.abs(depths - expected[:, None]), 2.0), nan=0.0)
    assert_allclose(added, costs + 0.3 * away, rtol=1e-6)


def test_refine_averages_the_disparities_near_the_path():
    histogram = np.zeros((4, 41), dtype=np.uint16)
    histogram[0, [19, 20, 21]] = [1, 5, 4]
    histogram[0, 30] = 100
    histogram[2, 0] = 9
    disparities = np.array([10.0, 5.0], dtype=np.float32)
    reach = np.array([1.0, 5.0], dtype=np.float32)
    path = np.array([0, 0, 1, 2], dtype=np.int32)
    refined = refine(path, histogram, disparities, reach, 2)
    assert_allclose(refined, [(19 + 100 + 84) / 20, 10.0, 5.0, np.nan], rtol=1e-6)


PITCHED = Rig(320, 160, None, 300.0, 150.0, 70.0, 0.5, 1.4, 3.0, None)
TALL_PIXELS = replace(PITCHED, vertical_fov=45.0)


def pixels_of_level(rig, points_level):
    """(u, v, d) of points (n, 3) in the level frame."""
    return project(rig, np.asarray(points_level) @ rig.level_from_camera)


@given(st.sampled_from([PITCHED, TALL_PIXELS]), st.floats(-0.2, 0.2), st.floats(0.5, 4.0))
def test_road_line_and_camera_pose_are_inverse(rig, pitch, height):
    found = pitch_and_height(road_line(pitch, height, rig), rig)
    assert found == pytest.approx((pitch, height), abs=1e-9)


@pytest.mark.parametrize("rig", [PITCHED, TALL_PIXELS])
def test_road_line_pitch_factors_and_base_rows_agree_with_the_projection(rig):
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    depth = np.array([6.0, 9.0, 20.0, 70.0])
    on_road = np.stack([depth * 0.1, np.full(4, rig.camera_height), depth], axis=1)
    _, v, d = pixels_of_level(rig, on_road).T
    assert_allclose(line[0] * v + line[1], d, rtol=1e-12)
    level = rig.focal * rig.baseline / depth
    assert_allclose(base_rows(level, line, rig), v, rtol=1e-12)
    factors = np.interp(v, np.arange(rig.height), pitch_factors(line, rig).astype(float))
    assert_allclose(factors * d, level, rtol=1e-5)


@pytest.mark.parametrize("least, greatest", [(0.25, 3.0), (0.25, 1.0), (1.6, 2.0)])
@pytest.mark.parametrize("rig", [PITCHED, replace(PITCHED, pitch=0.0), TALL_PIXELS])
def test_obstacle_limits_match_heights_of_unprojected_pixels(rig, least, greatest):
    road = with_constants(RigRoad(kind="rig"), least_height=least, greatest_height=greatest)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    lowest, highest = obstacle_limits(line, rig, road, 64)
    v, raw = np.mgrid[: rig.height, 1 : 64 * 16]
    measured = np.stack([np.full(v.size, rig.u0), v.ravel(), raw.ravel() / 16.0], axis=1)
    level = unproject(rig, measured) @ rig.level_from_camera.T
    above = (rig.camera_height - level[:, 1]).reshape(v.shape)
    margin = raw / 16.0 - (line[0] * v + line[1])
    expected = (above > least) & (above < greatest) & (margin > 1.0)
    got = (raw >= lowest[:, None]) & (raw <= highest[:, None])
    # At equality rounding decides.
    clear = np.min([abs(above - least), abs(above - greatest), abs(margin - 1.0)], axis=0) > 1e-9
    assert np.array_equal(got[clear], expected[clear])


def test_v_disparity_counts_every_pixel():
    rng = np.random.default_rng(3)
    columns = rng.integers(-1, 16 * 16, (20, 9)).astype(np.int16)
    expected = np.zeros((9, 64), dtype=np.int32)
    for u, v in np.argwhere(columns > 0):
        expected[v, columns[u, v] // 4] += u % 3 == 0
    assert np.array_equal(v_disparity(columns, 16, 3), expected)


@pytest.mark.parametrize("pitch, height", [(0.0, 1.4), (1.3, 1.35), (-0.8, 1.5)])
def test_road_estimate_finds_the_plane_under_noise_and_obstacles(rig, pitch, height):
    true = replace(rig, pitch=pitch, camera_height=height)
    raw = render(true, boxes=[(-1.0, 12.0, 4.0, 1.5), (3.0, 20.0, 2.0, 2.0)], wall=40.0)
    rng = np.random.default_rng(5)
    noisy = raw + np.rint(rng.normal(0.0, 5.0, raw.shape)).astype(np.int16)
    noisy = np.where((rng.random(raw.shape) < 0.2) | (raw < 0), -1, np.maximum(noisy, 0))
    columns = np.ascontiguousarray(noisy.T.astype(np.int16))
    line = find_road(columns, 64, rig, ESTIMATED_ROAD)
    found_pitch, found_height = pitch_and_height(line, rig)
    assert np.degrees(found_pitch) == pytest.approx(pitch, abs=0.1)
    assert found_height == pytest.approx(height, rel=0.02)


def test_road_of_the_rig_is_used_without_votes_or_estimate(rig):
    nothing = np.full((rig.width, rig.height), -1, dtype=np.int16)
    expected = road_line(0.0, 1.4, rig)
    assert np.array_equal(find_road(nothing, 64, rig, ESTIMATED_ROAD), expected)
    assert np.array_equal(find_road(nothing, 64, rig, ROAD), expected)


def test_all_is_known_where_road_and_obstacles_have_disparities(rig):
    raw = render(rig, boxes=[(0.0, 10.0, 2.0, 1.5)], wall=30.0)
    assert np.all(find(as_disparities(raw), rig).unknown_row == -1)
    # A few missing pixels do not matter.
    raw[np.random.default_rng(1).random(raw.shape) < 0.05] = -1
    assert np.all(find(as_disparities(raw), rig).unknown_row == -1)


def test_object_without_disparity_is_unknown_and_not_free(rig):
    """A dark box is not found, but the place where it meets the road is."""
    raw = render(rig, wall=30.0)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    disparity = rig.disparity_from_depth(8.0)
    base = round(float(base_rows(np.float64(disparity), line, rig)))
    raw[base - 40 : base, 100:140] = -1
    found = find(as_disparities(raw), rig)
    unknown = found.unknown_row[0] >= 0
    assert np.array_equal(np.flatnonzero(unknown), np.arange(100 - EDGE, 140 + EDGE))
    assert np.all(found.unknown_row[0, unknown] == base - 1)
    # Nothing behind an obstacle is unknown: it is not free anyway.
    hidden = render(rig, boxes=[(0.0, 6.0, 12.0, 1.5)], wall=30.0)
    hidden[: base - 20, 100:140] = -1
    assert np.all(find(as_disparities(hidden), rig).unknown_row == -1)


def test_a_surface_that_is_neither_road_nor_obstacle_is_unknown(rig):
    """A glossy car mirrors the street: its disparities are those of a plane above the road."""
    raw = render(rig, wall=30.0)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    rows = slice(110, 140)
    above = 16.0 * (line[0] * np.arange(rig.height) + line[1]) / (1.0 - 0.7 / rig.camera_height)
    raw[rows, 100:140] = np.rint(above[rows, None])
    high = replace(FREE_SPACE, obstacle_height=1.2)
    found = find(as_disparities(raw), rig, free_space=high)
    assert np.isnan(found.disparity[0, 105:135]).all() or (found.base_row[0, 105:135] < 110).all()
    assert np.all(found.unknown_row[0, 105:135] == 139)
    assert np.all(found.unknown_row[0, : 100 - EDGE] == -1)


def test_unknown_rows_match_a_brute_force_search():
    rng = np.random.default_rng(4)
    for _ in range(30):
        columns = np.where(rng.random((8, 30)) < rng.uniform(0.2, 0.9), 5, -1).astype(np.int16)
        base = rng.integers(-1, 30, 8).astype(np.int32)
        extents = rng.integers(5, 25, 30).astype(np.int32)
        end = int(rng.integers(0, 15))
        expected = np.full(8, -1)
        for u in range(8):
            first = max(base[u] + 1, end)
            for v in range(first, 30):
                window = columns[u, max(v - extents[v] + 1, first) : v + 1]
                if len(window) < LEAST_ROWS or 2 * len(window) < extents[v]:
                    continue
                if np.sum(window >= 0) < 0.5 * len(window):
                    expected[u] = max(w for w in range(v + 1) if columns[u, w] < 0)
        limits = np.zeros(30, dtype=np.int32), np.full(30, 9, dtype=np.int32)
        found, before = np.full(8, -1, dtype=np.int32), np.zeros(31, dtype=np.int32)
        _find_unknown(found, before, columns, base, extents, end, 0.5, *limits)
        assert found.tolist() == expected.tolist()
