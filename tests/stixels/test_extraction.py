from dataclasses import replace

import cv2
import numpy as np
import pytest
from boxed_road import BOXES, EXTRACTION, TOPS, as_disparities, columns_of, find, render
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from projection import project

from stixel_cli.stixels.extraction import (
    BINS_PER_PIXEL,
    UNEVEN_REACH,
    extract_stixels,
    rows_at_height,
    smoothing_kernel,
    surroundings,
    unevenness,
)
from stixel_cli.stixels.grouping import (
    LEAST_ROWS,
    Grouping,
    Layer,
    group_columns,
    histogram_peak,
)
from stixel_cli.stixels.height import (
    Frame,
    cheapest_tops,
    depth_windows,
    membership_costs,
    top_rows,
)
from stixel_cli.stixels.refinement import TOLERANCE, aligned
from stixel_cli.stixels.road import base_rows, road_line
from stixel_cli.stixels.types import SAME_OBJECT


def pipeline(disparities, rig, extraction=EXTRACTION, height=TOPS):
    frames = range(disparities.first, disparities.first + len(disparities))
    found = find(disparities, rig)
    return extract_stixels(disparities, found, None, rig, height, extraction, frames)


@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_boxes_give_stixels(rig, pitch):
    rig = replace(rig, pitch=pitch)
    stixels = pipeline(as_disparities(render(rig, boxes=BOXES, wall=30.0)), rig)
    for box in BOXES:
        at, distance, _, tall = box
        edges = columns_of(rig, box)
        inside = np.flatnonzero((stixels.left >= edges[0]) & (stixels.right - 1 <= edges[1]))
        assert len(inside) >= 4
        assert_allclose(stixels.depth[inside], distance, rtol=0.005)
        assert_allclose(stixels.points_ego[inside, 1], distance, rtol=0.005)
        heights = rig.camera_height - np.array([tall, 0.0])
        ends = np.array([[at, height, distance] for height in heights])
        top, base = project(rig, ends @ rig.level_from_camera)[:, 1]
        assert np.all(np.abs(stixels.top[inside] - top) <= 1)
        assert np.all(np.abs(stixels.base[inside] - base) <= 1)
        assert_allclose(stixels.height[inside], tall, atol=0.06)
        assert np.all(np.abs(stixels.points_ego[inside, 0] - at) < 1.0)
        assert_allclose(np.diff(stixels.points_ego[inside, 0]), 5 * distance / 300, rtol=0.02)
    wall = stixels.left > columns_of(rig, BOXES[1])[1] + 5
    assert_allclose(stixels.depth[wall], 30.0, rtol=0.005)


@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_with_many_layers_columns_have_what_is_visible_behind_the_nearest_obstacle(rig, pitch):
    rig, many = replace(rig, pitch=pitch), replace(EXTRACTION, layers="many")
    low, tall = (0.0, 8.0, 3.0, 0.8), (0.2, 16.0, 2.0, 1.8)
    disparities = as_disparities(render(rig, boxes=[low, tall], wall=40.0))
    one, both = pipeline(disparities, rig), pipeline(disparities, rig, many)
    first = np.flatnonzero(np.diff(both.left, prepend=-1))
    for name in ("left", "top", "base", "depth", "points_ego", "covariances_ego"):
        assert getattr(both, name)[first].tobytes() == getattr(one, name).tobytes()
    edges = columns_of(rig, tall)
    inside = (both.left >= edges[0]) & (both.right - 1 <= edges[1])
    nearest = np.isin(np.arange(len(both.left)), first)
    behind = inside & ~nearest & (both.depth < 20.0)
    assert behind.sum() == (inside & nearest).sum() >= 4
    assert_allclose(both.depth[behind], tall[1], rtol=0.005)
    assert_allclose(both.height[behind], tall[3], atol=0.1)
    assert_allclose(both.depth[inside & nearest], low[1], rtol=0.005)
    # What is seen of it ends at the low box's upper edge, and beside it is the wall.
    edge = both.top[inside & nearest].min()
    assert np.all(np.abs(both.base[behind] - edge) <= 2)
    beside = ~inside & ~nearest & (np.abs(both.points_ego[:, 0]) < 3.0)
    assert_allclose(both.depth[beside & (both.depth > 20)], 40.0, rtol=0.01)


def test_a_surface_less_than_the_depth_margin_behind_is_no_layer_and_road_is_none(rig):
    many = replace(EXTRACTION, layers="many")
    for further in ([], [(0.0, 8.0 + 0.9 * TOPS.depth_margin, 1.0, 1.8)]):
        boxes = [(0.0, 8.0, 3.0, 0.8), *further]
        stixels = pipeline(as_disparities(render(rig, boxes=boxes)), rig, many)
        assert len(stixels.left) > 4 and np.all(np.diff(stixels.left) > 0)


def test_covariances_follow_from_disparity_variance_surroundings_and_width(rig):
    raw = render(rig, boxes=BOXES, wall=30.0)
    # A sixteenth of a pixel up and down, from stixel to stixel.
    raw += (raw > 0) & (np.arange(rig.width) // 5 % 2 == 1)
    stixels = pipeline(as_disparities(raw), rig)
    assert np.all(np.linalg.eigvalsh(stixels.covariances_ego) > 0)
    count, scatter = surroundings(stixels.left, stixels.depth, 5)
    uneven = unevenness(stixels.left, stixels.depth, 5)
    assert uneven.max() > 0.01
    scatter = scatter + uneven
    # Stixels at the edge of an object add `edge_std`, here as large as `least_std`.
    edge = stixels.disparity_variance > 1.5 * 0.1**2
    assert np.array_equal(edge, count < 3) and edge.any() and not edge.all()
    assert_allclose(stixels.disparity_variance, np.where(edge, 2, 1) * 0.1**2)
    sigma = stixels.depth**2 * np.sqrt(stixels.disparity_variance) / (rig.focal * rig.baseline)
    sigma = np.sqrt(sigma**2 + 0.05**2 + scatter)
    assert_allclose(stixels.covariances_ego[:, 1, 1], sigma**2, rtol=1e-9)
    bearing = stixels.points_ego[:, 0] / stixels.points_ego[:, 1]
    width = stixels.depth * (stixels.right - stixels.left) / rig.focal
    across = (sigma * bearing) ** 2 + width**2 / 12
    assert_allclose(stixels.covariances_ego[:, 0, 0], across, rtol=1e-6)
    assert_allclose(stixels.covariances_ego[:, 0, 1], sigma**2 * bearing, rtol=1e-6)


@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_points_are_in_the_middle_of_their_columns(rig, pitch):
    rig = replace(rig, pitch=pitch, principal_u=140.25)
    stixels = pipeline(as_disparities(render(rig, boxes=BOXES, wall=30.0)), rig)
    points = stixels.points_ego
    # Of a high wall only the lowest 2 m count.
    first = np.maximum(stixels.top, stixels.base - 2.0 * stixels.disparity / rig.baseline)
    down = (0.5 * (first + stixels.base) - rig.v0) / rig.focal
    # What has one depth along the road has another along the optical axis in every row.
    depth_camera = points[:, 1] / (rig.level_from_camera[2] @ [0.0 * down, down, 0.0 * down + 1.0])
    middles = [np.mean(range(a, b)) for a, b in zip(stixels.left, stixels.right, strict=True)]
    assert len(middles) > 50
    columns = rig.u0 + rig.focal * points[:, 0] / depth_camera
    assert_allclose(columns, middles, atol=1e-6 if pitch == 0.0 else 0.3)


def test_surroundings_match_a_brute_force_search():
    rng = np.random.default_rng(2)
    for _ in range(20):
        left = 3 * np.flatnonzero(rng.random(30) < 0.7)
        depth = rng.choice([10.0, 12.0], len(left)) + rng.normal(0.0, 0.5, len(left))
        count, scatter = surroundings(left, depth, 3)
        for i in range(len(left)):
            columns, apart = abs(left - left[i]), depth - depth[i]
            apart = apart[(columns > 0) & (columns <= 6) & (abs(apart) < SAME_OBJECT)]
            assert count[i] == len(apart)
            assert scatter[i] == pytest.approx(0.125 * np.sum(apart**2) / max(len(apart), 1))


def test_unevenness_matches_a_brute_force_search():
    rng = np.random.default_rng(3)
    for n in (0, 1, 2, 3, 40, 40, 40):
        left = 3 * np.sort(rng.choice(60, n, replace=False))
        depth = rng.choice([10.0, 14.0], n) + np.sort(rng.normal(0.0, 0.5, n))
        tied = (np.diff(left) <= 6) & (abs(np.diff(depth)) < SAME_OBJECT)
        found = unevenness(left, depth, 3)
        for i in range(n):
            first = last = i
            while first > max(i - UNEVEN_REACH, 0) and tied[first - 1]:
                first -= 1
            while last < min(i + UNEVEN_REACH, n - 1) and tied[last]:
                last += 1
            middles = range(max(first, 1), min(last, n - 2) + 1)
            middles = np.array([j for j in middles if tied[j - 1] and tied[j]], int)
            bent = (depth[middles - 1] - 2 * depth[middles] + depth[middles + 1]) ** 2 / 6
            assert found[i] == pytest.approx(np.sum(bent) / max(len(bent), 1), abs=1e-12)


def test_histogram_peak_is_the_parabola_through_the_smoothed_maximum():
    rng = np.random.default_rng(3)
    kernel = smoothing_kernel(0.2)
    for _ in range(20):
        histogram = rng.integers(0, 9, rng.integers(1, 30)).astype(np.int32)
        smooth = np.convolve(np.pad(histogram, 10), kernel, mode="same")
        best = np.argmax(smooth)
        y = smooth[best - 1 : best + 2]
        a, b, _ = np.polyfit([-1, 0, 1], y, 2)
        expected = best - 10 + (-b / (2 * a) if a < 0 else 0.0)
        assert histogram_peak(histogram, kernel) == pytest.approx(expected, abs=1e-6)


SCALE = np.full(40, 1 / 16, dtype=np.float32)
GROUPING = Grouping(5, smoothing_kernel(0.35), 10, front_rows=0.6, front_margin=0.3)


def brute_front(pixels, columns, extent):
    """The nearest mean disparity of all windows of rows, of those that are at least half full."""
    rows = [v for _, v in pixels]
    face = max(LEAST_ROWS, int(extent + 0.5))
    extent = min(face, max(rows) - min(rows) + 1)
    starts = range(min(rows), max(rows) - extent + 2)
    inside = [[d for d, v in pixels if start <= v < start + extent] for start in starts]
    full = [np.mean(window) for window in inside if 2 * len(window) >= extent * columns]
    return (max(full) if full else np.mean([d for d, _ in pixels])), face


def brute_groups(columns, layer, grouping):
    """The stixels one by one, straight from the definition: the rows of areas and of values."""
    obstacle, window, tops, head, foot, base = layer
    found = []
    for left in range(0, len(columns), grouping.stixel_width):
        group = np.arange(left, min(left + grouping.stixel_width, len(columns)))
        standing = group[base[group] >= 0]
        if 2 * len(standing) < len(group) or len(standing) == 0:
            continue
        order = sorted(standing, key=lambda u: obstacle[u])
        middle = order[len(order) // 2]
        members = [u for u in standing if abs(obstacle[u] - obstacle[middle]) <= window[middle]]
        for first in (head, tops):
            places = [(u, v) for u in members for v in range(first[u], foot[u] + 1)]
            pixels = [(columns[u, v] * SCALE[v], v) for u, v in places if columns[u, v] >= 0]
            pixels = [(d, v) for d, v in pixels if abs(d - obstacle[middle]) < window[middle]]
            if len(pixels) >= grouping.least_pixels:
                break
        if len(pixels) < grouping.least_pixels:
            continue
        front = brute_front(pixels, len(members), obstacle[middle] * grouping.front_rows)
        rows = [v for _, v in pixels]
        start = int(np.ceil((front[0] - grouping.front_margin) * BINS_PER_PIXEL))
        near = [(d, v) for d, v in pixels if int(d * BINS_PER_PIXEL + 0.5) >= start]
        pixels = near if 2 * len(near) >= front[1] * len(members) else pixels
        bins = np.array([int(d * BINS_PER_PIXEL + 0.5) for d, _ in pixels])
        histogram = np.bincount(bins - bins.min()).astype(np.int32)
        disparity = (histogram_peak(histogram, grouping.kernel) + bins.min()) / BINS_PER_PIXEL
        top = sorted(tops[members])[len(members) // 2]
        area = (group[0], group[-1] + 1, top, base[middle])
        found.append((area, (disparity, np.mean(rows))))
    return found


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 23))
def test_groups_match_a_brute_force_search(seed, stixel_width, width):
    rng = np.random.default_rng(seed)
    columns = rng.integers(16 * 8, 16 * 14, (width, 40)).astype(np.int16)
    columns[rng.random(columns.shape) < 0.2] = -1
    obstacle = rng.uniform(9.0, 13.0, width).astype(np.float32)
    window = rng.uniform(0.5, 3.0, width).astype(np.float32)
    tops = rng.integers(0, 15, width).astype(np.int32)
    foot = rng.integers(10, 38, width).astype(np.int32)
    head = (tops + rng.integers(0, 25, width)).astype(np.int32)
    base = (foot + 2).astype(np.int32)
    free = rng.random(width) < 0.3
    obstacle[free], tops[free], foot[free], base[free] = np.nan, -1, -1, -1
    grouping = GROUPING._replace(stixel_width=stixel_width)
    layer = Layer(obstacle, window, tops, head, foot, base)
    areas, values = group_columns(columns, SCALE, 32, layer, grouping)
    expected = brute_groups(columns, layer, grouping)
    assert areas.tolist() == [list(area) for area, _ in expected]
    assert_allclose(values, np.reshape([v for _, v in expected], (-1, 2)), rtol=1e-6)


@pytest.mark.parametrize(("pitch", "vertical_fov"), [(0.0, None), (3.0, None), (0.0, 60.0)])
def test_foot_blended_with_the_road_is_ignored(rig, pitch, vertical_fov):
    """Rows of an upright obstacle that `rows_at_height` leaves out are those below the height."""
    rig = replace(rig, pitch=pitch, vertical_fov=vertical_fov)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    depth = np.array([5.0, 9.0, 20.0])
    obstacle = (rig.focal * rig.baseline / depth).astype(np.float32)
    base = np.rint(base_rows(obstacle, line, rig)).astype(np.int32)
    at_height = np.stack([0 * depth, np.full(3, rig.camera_height - 0.25), depth], axis=1)
    _, rows, _ = project(rig, at_height @ rig.level_from_camera).T
    found = rows_at_height(np.append(obstacle, np.nan), np.append(base, -1), rig, 0.25)
    assert np.all(np.abs(found[:3] - rows) <= 1.5)
    assert found[3] == -1
    assert np.array_equal(rows_at_height(obstacle, base, rig, 0.0), base)


def test_blended_foot_does_not_move_the_stixel(rig):
    box = (0.0, 15.0, 2.0, 1.5)
    raw = render(rig, boxes=[box])
    left, right = np.rint(columns_of(rig, box)).astype(int)
    base = round(rig.v0 + rig.focal * rig.camera_height / 15.0)
    blended = raw.copy()
    # Over 0.25 m the disparity falls to that of the road one metre behind.
    rows = round(0.25 * rig.focal / 15.0)
    fall = np.linspace(0.0, 16.0 * rig.focal * rig.baseline * (1 / 15 - 1 / 16), rows)
    blended[base - rows + 1 : base + 1, left:right] -= np.rint(fall)[:, None].astype(np.int16)
    sharp, soft = (pipeline(as_disparities(image), rig) for image in (raw, blended))
    assert np.array_equal(sharp.left, soft.left)
    assert_allclose(soft.depth, sharp.depth, rtol=1e-3)


def test_hidden_rows_raise_the_tops(rig):
    disparities = as_disparities(render(rig, boxes=BOXES))
    low = pipeline(disparities, rig)
    high = pipeline(disparities, rig, height=replace(TOPS, hidden_rows=2))
    assert np.array_equal(high.top, np.maximum(low.top - 2, 0))
    assert np.array_equal(high.depth, low.depth) and np.array_equal(high.base, low.base)
    # Two rows at that depth; the camera looks along the road.
    rise = (low.top - high.top) * low.depth / rig.focal
    assert_allclose(high.height - low.height, rise, rtol=1e-6)


def test_depth_windows_end_behind_the_obstacle(rig):
    obstacle = np.array([20.0, np.nan, 5.0], dtype=np.float32)
    focal_baseline = rig.focal * rig.baseline
    depth = focal_baseline / obstacle
    windows = obstacle - focal_baseline / (depth + 2.0)
    assert_allclose(depth_windows(obstacle, rig, 2.0), windows, rtol=1e-5)


def test_height_costs_follow_from_the_membership():
    """C(u, v) = Σ_{i < v} M - Σ_{v <= i <= base} M, in plain sums."""
    rng = np.random.default_rng(0)
    columns = rng.integers(-1, 320, (6, 25)).astype(np.int16)
    columns[:, ::7] = -1
    obstacle = rng.uniform(5, 15, 6).astype(np.float32)
    window = rng.uniform(0.5, 4, 6).astype(np.float32)
    base = np.array([24, 3, -1, 10, 0, 17], dtype=np.int32)
    scale = rng.uniform(0.06, 0.065, 25).astype(np.float32)
    costs = membership_costs(columns, obstacle, window, base, scale)
    for u in range(6):
        member = np.exp2(1 - ((columns[u] * scale - obstacle[u]) / window[u]) ** 2) - 1
        member[columns[u] < 0] = 0
        for v in range(base[u] + 1):
            expected = member[:v].sum() - member[v : base[u] + 1].sum()
            assert costs[u, v] == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    ("beyond", "smoothness", "top"),
    [(0.0, 3.0, 60), (0.0, 0.9, 50), (0.0, 1.1, 60), (3.0, 3.0, 60), (3.6, 3.0, 50)],
)
def test_smoothness_depends_on_the_depth_difference_of_neighbours(rig, beyond, smoothness, top):
    """Ten more rows of one column gain 20 and cost 10 C_s (1 - |z_u - z_v| / 5 m) on each side."""
    depth = np.full(rig.width, 10.0 + beyond)
    depth[100] = 10.0
    obstacle = (rig.focal * rig.baseline / depth).astype(np.float32)
    base = np.full(rig.width, 120, dtype=np.int32)
    columns = np.full((rig.width, rig.height), 16 * 4, dtype=np.int16)
    columns[:, 60:121] = np.rint(16.0 * obstacle)[:, None]
    columns[100, 50:60] = columns[100, 60]
    line = road_line(0.0, rig.camera_height, rig)
    changed = with_constants(TOPS, smoothness=smoothness)
    tops = top_rows(Frame(columns, 64, obstacle, base, line, rig), changed)
    assert tops[100] == top
    assert np.all(np.delete(tops, 100) == 60)


def total_cost(tops, cost, tied):
    used = tops >= 0
    kept = cost[used, tops[used]].sum(dtype=np.float64)
    steps = tied * abs(np.diff(tops.astype(float)))
    return kept + steps[used[1:] & used[:-1]].sum()


def least_cost(cost, base, tied):
    """Dynamic programming in O(W H²), chain after chain."""
    total, done = None, 0.0
    for u in range(len(cost)):
        if base[u] < 0:
            done, total = done + (total.min() if total is not None else 0.0), None
            continue
        now = cost[u, : base[u] + 1].astype(np.float64)
        if total is not None:
            away = np.abs(np.arange(len(now))[:, None] - np.arange(len(total))[None])
            now = now + (tied[u - 1] * away + total).min(axis=1)
        total = now
    return done + (total.min() if total is not None else 0.0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 25), st.integers(1, 30))
def test_tops_have_the_least_cost(seed, width, rows):
    rng = np.random.default_rng(seed)
    cost = rng.normal(0, 5, (width, rows)).astype(np.float32)
    base = rng.integers(-1, rows, width).astype(np.int32)
    tied = (rng.random(width - 1) * rng.integers(0, 3, width - 1)).astype(np.float32)
    tops = cheapest_tops(cost.copy(), base, tied)
    assert np.array_equal(tops >= 0, base >= 0)
    assert np.all(tops <= base)
    assert total_cost(tops, cost, tied) == pytest.approx(least_cost(cost, base, tied), abs=1e-3)


HEIGHT, WIDTH = 60, 80
AREA = np.array([[40, 43, 10, 49]])


def shifted(disparity, seed=0, noise=0.0):
    """Left and right images (H, W) uint8 of a smooth texture `disparity` px away."""
    random = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(random.uniform(0, 255, (HEIGHT, 4 * WIDTH)), (0, 0), 7.0)
    texture = 128 + 10.0 * (texture - texture.mean())
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    images = []
    for offset in (0.0, disparity):
        at = (4.0 * (u + offset) - 200.0 + 240.0).astype(np.float32) % (4 * WIDTH - 8)
        image = cv2.remap(texture.astype(np.float32), at, v.astype(np.float32), cv2.INTER_CUBIC)
        image = image + noise * random.normal(size=image.shape)
        images.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    return images


def align(left, right, start, scale=None, columns=None, error=0.0, area=AREA):
    scale = np.full(HEIGHT, 1 / 16, dtype=np.float32) if scale is None else scale
    if columns is None:
        columns = np.rint(start / scale).astype(np.int16)[None, :].repeat(WIDTH, axis=0)
    return aligned(left, right, columns, area, np.array([start]), scale, np.full(WIDTH, error))[0]


@pytest.mark.parametrize("fraction", [0.0, 0.13, 0.3, 0.5, 0.77])
def test_alignment_finds_the_shift_of_the_images(fraction):
    true = 7.0 + fraction
    left, right = shifted(true)
    for away in (-0.2, -0.1, 0.0, 0.15):
        assert align(left, right, true + away) == pytest.approx(true, abs=0.02)


def test_pitch_and_the_errors_of_the_rig_are_in_the_disparity_as_they_should():
    left, right = shifted(7.3)
    scale = np.full(HEIGHT, 1.25 / 16, dtype=np.float32)
    assert align(left, right, 7.2 * 1.25, scale) == pytest.approx(7.3 * 1.25, abs=0.03)
    left, right = shifted(7.5)
    without = align(left, right, 7.4) - 0.5
    assert align(left, right, 6.9, error=0.5) == pytest.approx(without, abs=0.02)


def test_what_is_behind_the_face_does_not_count():
    """The stixel's own columns show a face; those next to it what is 0.6 px behind."""
    for seed in range(3):
        (left, right), (_, behind) = shifted(7.4, seed), shifted(6.8, seed)
        right[:, 36:], right[:, :31] = behind[:, 36:], behind[:, :31]
        columns = np.full((WIDTH, HEIGHT), round(16 * 6.8), dtype=np.int16)
        columns[40:43] = round(16 * 7.4)
        assert align(left, right, 7.35, columns=columns) == pytest.approx(7.4, abs=0.06)


def test_disparity_stays_where_the_images_say_nothing_better():
    left, right = shifted(7.3)
    # No texture; no row with the disparity; and a shift that is too far away to be reached.
    flat = np.full_like(left, 90)
    assert align(flat, flat, 7.2) == 7.2
    none = np.full((WIDTH, HEIGHT), -1, dtype=np.int16)
    assert align(left, right, 7.2, columns=none) == 7.2
    assert abs(align(left, right, 8.3) - 8.3) <= TOLERANCE
    # At the image's border there is nothing to align with.
    assert align(left, right, 7.2, area=np.array([[0, 3, 10, 49]])) == 7.2
