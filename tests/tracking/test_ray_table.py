from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seen_targets import rows_at

from stixel_cli.geometry.pose import rectangle, rotation, world_from_target
from stixel_cli.measurements.rays import first_crossings, spread_rays
from stixel_cli.tracking.contour.ray_kernels import expected
from stixel_cli.tracking.contour.ray_table import first_depths, outline_table, widths

RECTANGLE = rectangle(4.0, 1.6)
RIGHT = np.array([[2, -1], [2, 1], [0.5, 1], [0.5, 0.2]])
NOTCHED = np.vstack([RIGHT, RIGHT[::-1] * [-1, 1]])
SEEDS = st.integers(0, 2**31)


def rays_at(outline, state, sensor):
    """Directions (n, 2) and ranges (n,) of the rays that meet the scaled outline at `state`."""
    world = world_from_target(outline * np.exp(state[3:]), state[:3])
    rays = spread_rays(200, (-0.6, 0.6), False)
    seen = (world - sensor[:2]) @ rotation(sensor[2])
    hit, ranges = first_crossings(seen, rays)
    return rays.directions[hit] @ rotation(sensor[2]).T, ranges


def some_state(random):
    """A state at 8 to 20 m in front of a sensor, and the sensor's pose."""
    sensor = np.array([*random.uniform(-3, 3, 2), random.uniform(-np.pi, np.pi)])
    ahead = sensor[2] + random.uniform(-0.3, 0.3)
    away = random.uniform(8, 20) * np.array([np.cos(ahead), np.sin(ahead)])
    heading = random.uniform(-np.pi, np.pi)
    return np.array([*(sensor[:2] + away), heading, *random.uniform(-0.2, 0.2, 2)]), sensor


@given(seed=SEEDS)
def test_expected_ranges_are_those_of_rays_cast_on_the_scaled_outline(seed):
    state, sensor = some_state(np.random.default_rng(seed))
    directions, ranges = rays_at(RECTANGLE, state, sensor)
    table = outline_table(RECTANGLE)
    table = replace(table, stds=np.full_like(table.stds, 0.02)).arrays
    found, misses, stds = expected(state, sensor, directions, table)
    # The table is linear between its nodes, so it is coarse at the corners.
    errors = np.abs(found - ranges)
    assert np.median(errors) < 0.02
    assert np.sum(errors > 0.1) <= max(2, 0.05 * len(errors))
    assert misses.max() < 0.05
    np.testing.assert_allclose(stds, 0.02)


def test_rays_of_one_aspect_meet_a_notch_at_its_floor():
    depths = first_depths(NOTCHED, np.array([np.pi / 2]), np.array([[-1.0, 0.0, 1.0, 9.0]]))[0]
    np.testing.assert_allclose(depths, [-1.0, -0.2, -1.0, -1.0], atol=1e-6)
    low, high = widths(NOTCHED, np.array([0.0, np.pi / 2]))
    np.testing.assert_allclose(low, [-1.0, -2.0], atol=1e-12)
    np.testing.assert_allclose(high, [1.0, 2.0], atol=1e-12)


@pytest.mark.parametrize("factors", [(1.0, 1.0), (2.0, 1.0), (1.0, 2.0), (0.5, 1.3)])
def test_distances_across_a_ray_are_metres_of_the_world(factors):
    table = outline_table(RECTANGLE)
    state = np.array([0.0, 0.0, 0.0, *np.log(factors)])
    half = np.array([2.0, 0.8]) * factors
    for along, beside in ((0, 1), (1, 0)):
        sensor, direction = np.full(2, -30.0), np.zeros((1, 2))
        sensor[beside], direction[0, along] = half[beside] + 0.3, 1.0
        assert expected(state, sensor, direction, table.arrays)[1] == pytest.approx(0.3, abs=1e-9)
        whole = np.insert(state, 3, [0.0, 0.0])
        rows = rows_at(whole, 0.01 * np.eye(7), sensor, direction, np.zeros(1), table)
        assert sorted(rows.errors[1:3]) == pytest.approx([-0.3, 2.0 * half[beside] + 0.3])


def test_a_point_at_the_sensor_has_no_range_and_changes_no_other():
    table = outline_table(RECTANGLE).arrays
    directions = np.array([[0.0, 1.0], [0.0, 0.0], [0.01, 1.0]])
    state, sensor = np.array([0.0, 10.0, 0.3, 0.0, 0.0]), np.zeros(2)
    found = expected(state, sensor, directions, table)
    alone = expected(state, sensor, directions[[0, 2]], table)
    assert np.isnan(found[:, 1]).all()
    np.testing.assert_array_equal(found[:, [0, 2]], alone)
