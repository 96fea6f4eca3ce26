from dataclasses import replace

import numpy as np
import pytest
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st
from projection import project, unproject

from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.free_space import EDGE, LEAST_ROWS, _find_unknown, find_free_space
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

PITCHED = Rig(320, 160, None, 300.0, 150.0, 70.0, 0.5, 1.4, 3.0, None)
TALL_PIXELS = replace(PITCHED, vertical_fov=45.0)


def pixels_of_level(rig, points_level):
    """(u, v, d) of points (n, 3) in the level frame."""
    return project(rig, np.asarray(points_level) @ rig.level_from_camera)


@given(st.sampled_from([PITCHED, TALL_PIXELS]), st.floats(-0.2, 0.2), st.floats(0.5, 4.0))
def test_road_line_and_camera_pose_are_inverse(rig, pitch, height):
    assert pitch_and_height(road_line(pitch, height, rig), rig) == pytest.approx(
        (pitch, height), abs=1e-9
    )


@pytest.mark.parametrize("rig", [PITCHED, TALL_PIXELS])
def test_road_line_pitch_factors_and_base_rows_agree_with_the_projection(rig):
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    depth = np.array([6.0, 9.0, 20.0, 70.0])
    on_road = np.stack([depth * 0.1, np.full(4, rig.camera_height), depth], axis=1)
    _, v, d = pixels_of_level(rig, on_road).T
    np.testing.assert_allclose(line[0] * v + line[1], d, rtol=1e-12)
    level = rig.focal * rig.baseline / depth
    np.testing.assert_allclose(base_rows(level, line, rig), v, rtol=1e-12)
    factors = np.interp(v, np.arange(rig.height), pitch_factors(line, rig).astype(float))
    np.testing.assert_allclose(factors * d, level, rtol=1e-5)


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
    clear = (
        (np.abs(above - least) > 1e-9)
        & (np.abs(above - greatest) > 1e-9)
        & (np.abs(margin - 1.0) > 1e-9)
    )
    assert np.array_equal(got[clear], expected[clear])


def test_v_disparity_counts_every_pixel():
    rng = np.random.default_rng(3)
    columns = rng.integers(-1, 16 * 16, (20, 9)).astype(np.int16)
    expected = np.zeros((9, 64), dtype=np.int32)
    for u in range(0, 20, 3):
        for v in range(9):
            if columns[u, v] > 0:
                expected[v, columns[u, v] // 4] += 1
    assert np.array_equal(v_disparity(columns, 16, 3), expected)


@pytest.mark.parametrize("pitch, height", [(0.0, 1.4), (1.3, 1.35), (-0.8, 1.5)])
def test_road_estimate_finds_the_plane_under_noise_and_obstacles(
    rig, estimated_road, render, pitch, height
):
    true = replace(rig, pitch=pitch, camera_height=height)
    raw = render(true, boxes=[(-1.0, 12.0, 4.0, 1.5), (3.0, 20.0, 2.0, 2.0)], wall=40.0)
    rng = np.random.default_rng(5)
    noisy = raw + np.rint(rng.normal(0.0, 5.0, raw.shape)).astype(np.int16)
    noisy = np.where((rng.random(raw.shape) < 0.2) | (raw < 0), -1, np.maximum(noisy, 0))
    columns = np.ascontiguousarray(noisy.T.astype(np.int16))
    line = find_road(columns, 64, rig, estimated_road)
    found_pitch, found_height = pitch_and_height(line, rig)
    assert np.degrees(found_pitch) == pytest.approx(pitch, abs=0.1)
    assert found_height == pytest.approx(height, rel=0.02)


def test_road_of_the_rig_is_used_without_votes_or_estimate(rig, road, estimated_road):
    nothing = np.full((rig.width, rig.height), -1, dtype=np.int16)
    expected = road_line(0.0, 1.4, rig)
    assert np.array_equal(find_road(nothing, 64, rig, estimated_road), expected)
    assert np.array_equal(find_road(nothing, 64, rig, road), expected)


@pytest.fixture
def find(rig, road, occupancies, free_space):
    def run(disparities, **changed):
        ego = EgoMotion(np.zeros(1), np.array([[0.0, 0.0, np.pi / 2]]))
        parameters = replace(free_space, **changed)
        args = (road, occupancies["polar"], parameters, range(1), None)
        return find_free_space(disparities, ego, rig, *args)

    return run


def test_all_is_known_where_road_and_obstacles_have_disparities(find, render, rig, as_disparities):
    raw = render(rig, boxes=[(0.0, 10.0, 2.0, 1.5)], wall=30.0)
    found = find(as_disparities(raw))
    assert np.all(found.unknown_row == -1)
    # A few missing pixels do not matter.
    raw[np.random.default_rng(1).random(raw.shape) < 0.05] = -1
    assert np.all(find(as_disparities(raw)).unknown_row == -1)


def test_object_without_disparity_is_unknown_and_not_free(find, render, rig, as_disparities):
    """A dark box is not found, but the place where it meets the road is."""
    raw = render(rig, wall=30.0)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    disparity = rig.disparity_from_depth(8.0)
    base = round(float(base_rows(np.float64(disparity), line, rig)))
    raw[base - 40 : base, 100:140] = -1
    found = find(as_disparities(raw))
    unknown = found.unknown_row[0] >= 0
    assert np.array_equal(np.flatnonzero(unknown), np.arange(100 - EDGE, 140 + EDGE))
    assert np.all(found.unknown_row[0, unknown] == base - 1)
    # Nothing behind an obstacle is unknown: it is not free anyway.
    hidden = render(rig, boxes=[(0.0, 6.0, 12.0, 1.5)], wall=30.0)
    hidden[: base - 20, 100:140] = -1
    assert np.all(find(as_disparities(hidden)).unknown_row == -1)


def test_a_surface_that_is_neither_road_nor_obstacle_is_unknown(find, render, rig, as_disparities):
    """A glossy car mirrors the street: its disparities are those of a plane above the road."""
    raw = render(rig, wall=30.0)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    rows = slice(110, 140)
    above = 16.0 * (line[0] * np.arange(rig.height) + line[1]) / (1.0 - 0.7 / rig.camera_height)
    raw[rows, 100:140] = np.rint(above[rows, None])
    found = find(as_disparities(raw), obstacle_height=1.2)
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
