from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.free_space import EDGE, LEAST_ROWS, _find_unknown, find_free_space
from stixel_cli.stixels.road import base_rows, road_line


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
