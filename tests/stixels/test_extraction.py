from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.extraction import BINS_PER_PIXEL, extract_stixels, smoothing_kernel
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.stixels.grouping import group_columns, histogram_peak

BOXES = [(-2.0, 9.0, 1.6, 1.5), (2.5, 16.0, 2.0, 1.7)]


@pytest.fixture
def pipeline(road, occupancies, free_space, height, extraction):
    def run(disparities, rig):
        frames = range(disparities.first, disparities.first + len(disparities))
        poses = np.tile([0.0, 0.0, np.pi / 2], (frames.stop, 1))
        found = find_free_space(
            disparities,
            EgoMotion(np.arange(frames.stop) * 0.1, poses),
            rig,
            road,
            occupancies["polar"],
            free_space,
            frames,
            None,
        )
        return extract_stixels(disparities, found, rig, height, extraction, frames)

    return run


def columns_of(rig, box):
    at, distance, width, _ = box
    return rig.u0 + rig.focal * (at + np.array([-0.5, 0.5]) * width) / distance


@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_boxes_become_stixels(pipeline, rig, render, as_disparities, pitch):
    rig = replace(rig, pitch=pitch)
    stixels = pipeline(as_disparities(render(rig, boxes=BOXES, wall=30.0)), rig)
    for box in BOXES:
        at, distance, _, tall = box
        edges = columns_of(rig, box)
        inside = np.flatnonzero((stixels.left >= edges[0]) & (stixels.right - 1 <= edges[1]))
        assert len(inside) >= 4
        np.testing.assert_allclose(stixels.depth[inside], distance, rtol=0.005)
        np.testing.assert_allclose(stixels.points_ego[inside, 1], distance, rtol=0.005)
        ends = np.array(
            [[at, rig.camera_height - tall, distance], [at, rig.camera_height, distance]]
        )
        top, base = rig.project(ends @ rig.level_from_camera)[:, 1]
        assert np.all(np.abs(stixels.top[inside] - top) <= 1)
        assert np.all(np.abs(stixels.base[inside] - base) <= 1)
        np.testing.assert_allclose(stixels.height[inside], tall, atol=0.06)
        assert np.all(np.abs(stixels.points_ego[inside, 0] - at) < 1.0)
        np.testing.assert_allclose(
            np.diff(stixels.points_ego[inside, 0]), 5 * distance / 300, rtol=0.02
        )
    wall = stixels.left > columns_of(rig, BOXES[1])[1] + 5
    np.testing.assert_allclose(stixels.depth[wall], 30.0, rtol=0.005)


def test_free_columns_have_no_stixel(pipeline, rig, render, as_disparities):
    box = (0.0, 10.0, 2.0, 1.5)
    stixels = pipeline(as_disparities(render(rig), render(rig, boxes=[box])), rig)
    assert stixels.offsets[:2].tolist() == [0, 0]
    assert stixels.rows(1) == slice(0, len(stixels.depth))
    edges = columns_of(rig, box)
    assert np.all(stixels.right > edges[0])
    assert np.all(stixels.left < edges[1])
    assert len(stixels.depth) == pytest.approx(2.0 * rig.focal / 10.0 / 5, abs=2)


def test_covariances_are_those_of_the_disparity_and_the_width(
    pipeline, rig, render, as_disparities
):
    stixels = pipeline(as_disparities(render(rig, boxes=BOXES, wall=30.0)), rig)
    assert np.all(np.linalg.eigvalsh(stixels.covariances_ego) > 0)
    assert np.all(stixels.disparity_variance >= 0.1**2)
    sigma = stixels.depth**2 * np.sqrt(stixels.disparity_variance) / (rig.focal * rig.baseline)
    sigma = np.hypot(sigma, 0.05)
    np.testing.assert_allclose(stixels.covariances_ego[:, 1, 1], sigma**2, rtol=1e-9)
    bearing = stixels.points_ego[:, 0] / stixels.points_ego[:, 1]
    width = stixels.depth * (stixels.right - stixels.left) / rig.focal
    np.testing.assert_allclose(
        stixels.covariances_ego[:, 0, 0], (sigma * bearing) ** 2 + width**2 / 12, rtol=1e-6
    )
    np.testing.assert_allclose(stixels.covariances_ego[:, 0, 1], sigma**2 * bearing, rtol=1e-6)


def test_no_stixels_are_arrays_of_the_right_shape(pipeline, rig, as_disparities):
    nothing = np.full((rig.height, rig.width), -1, dtype=np.int16)
    for disparities in (as_disparities(), as_disparities(nothing, nothing)):
        stixels = pipeline(disparities, rig)
        assert stixels.points_ego.shape == (0, 2)
        assert stixels.covariances_ego.shape == (0, 2, 2)
        assert np.all(stixels.offsets == 0)
        assert len(stixels.offsets) == len(disparities) + 1
        assert stixels.left.dtype == np.int32


@pytest.mark.parametrize("fraction", [0.0, 0.1, 0.25, 0.4, 0.5, 0.8])
def test_peak_of_a_single_value_is_that_value(fraction):
    """Votes shared by two bins stand for a value between them."""
    kernel = smoothing_kernel(0.35)
    histogram = np.zeros(20, dtype=np.int32)
    histogram[7], histogram[8] = round(100 * (1 - fraction)), round(100 * fraction)
    assert histogram_peak(histogram, kernel) == pytest.approx(7 + fraction, abs=0.05)


def test_peak_is_the_parabola_through_the_smoothed_maximum():
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


def test_a_group_follows_its_median_column():
    """Two columns of a near box, three of what stands behind: the far ones make the stixel."""
    columns = np.full((5, 40), -1, dtype=np.int16)
    columns[:2, 10:35], columns[2:, 8:30] = 16 * 20, 16 * 10 + 4
    obstacle = np.array([20, 20, 10, 10, 10], dtype=np.float32)
    base = np.array([34, 34, 29, 29, 29], dtype=np.int32)
    areas, values = group_columns(
        columns,
        obstacle,
        np.full(5, 2.0, dtype=np.float32),
        np.array([10, 10, 8, 9, 8], dtype=np.int32),
        base,
        np.full(40, 1 / 16, dtype=np.float32),
        5,
        32 * BINS_PER_PIXEL + 1,
        BINS_PER_PIXEL,
        smoothing_kernel(0.35),
        10,
    )
    assert areas.tolist() == [[0, 5, 8, 29]]
    assert values[0, 0] == pytest.approx(10.25, abs=1e-3)
    assert values[0, 2] == 22 + 21 + 22
    base[1:4] = -1
    obstacle[1:4] = np.nan
    few, _ = group_columns(
        columns, obstacle, np.full(5, 2.0, dtype=np.float32), base - 20, base,
        np.full(40, 1 / 16, dtype=np.float32), 5, 32 * BINS_PER_PIXEL + 1, BINS_PER_PIXEL,
        smoothing_kernel(0.35), 10,
    )  # fmt: skip
    assert len(few) == 0
