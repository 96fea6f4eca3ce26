from dataclasses import replace

import numpy as np
import pytest
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.stixels.nearest_obstacle import add_temporal, cell_costs, cheapest_path, refine
from stixel_cli.stixels.occupancy import (
    BINS_PER_PIXEL,
    accumulate,
    column_histograms,
    fill,
    layout,
    picture_grid,
    spread_laterally,
    to_polar,
)
from stixel_cli.stixels.road import road_line
from stixel_cli.stixels.types import FreeSpace


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
    for u in range(7):
        for v in range(30):
            if lowest[v] <= columns[u, v] <= highest[v]:
                expected[u, min(int(np.floor(columns[u, v] * scale[v] + np.float32(0.5))), 32)] += 1
    assert np.array_equal(column_histograms(columns, lowest, highest, scale, 33), expected)


@pytest.mark.parametrize("kind", ["polar", "column_disparity"])
def test_occupancy_is_the_sum_of_the_likelihoods(rig, occupancies, kind):
    """Against equation (6) itself, pixel by pixel, averaged over the cell by sampling."""
    rng = np.random.default_rng(1)
    grid = layout(with_constants(occupancies[kind], relief=0.0), rig, 64)
    histogram = np.zeros((3, len(grid.likelihoods)), dtype=np.uint16)
    bins = rng.integers(8, 100, (3, 15))
    for u in range(3):
        np.add.at(histogram[u], bins[u], 1)
    got = fill(histogram, grid.likelihoods, grid.first, grid.last)
    for j in rng.integers(0, len(grid.depths), 12):
        half = grid.reaches[j] - 2.0 * 0.5
        z = grid.depths[j]
        middle = grid.disparities[j]
        if kind == "polar":
            ends = rig.focal * rig.baseline / np.array([z + 0.125, z - 0.125], dtype=np.float64)
        else:
            ends = np.array([middle - half, middle + half], dtype=np.float64)
        samples = np.linspace(*ends, 2001)[:-1] + 0.5 * np.diff(ends) / 2000
        expected = normal(samples[None, None] - bins[..., None] / BINS_PER_PIXEL, 0.5)
        np.testing.assert_allclose(got[:, j], expected.sum(axis=1).mean(axis=1), atol=1e-3)


def test_relief_widens_only_near_cells(rig, occupancies):
    flat = layout(with_constants(occupancies["polar"], relief=0.0), rig, 64)
    rough = layout(with_constants(occupancies["polar"], relief=0.3), rig, 64)
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
    for i in range(8):
        for j in range(3):
            ends = edges[i, j], edges[i + 1, j]
            samples = np.linspace(*ends, 2001)[:-1] + 0.5 * (ends[1] - ends[0]) / 2000
            density = normal(samples[:, None] - np.arange(40), 1.3).mean(axis=0)
            assert got[i, j] == pytest.approx(density @ polar[:, j], abs=1e-3)


def test_cartesian_grid_is_resampled_to_the_columns(rig, road, occupancies, render):
    columns = np.ascontiguousarray(render(rig, boxes=[(-1.0, 12.0, 3.0, 1.5)], wall=30.0).T)
    line = road_line(0.0, rig.camera_height, rig)
    grids = {k: layout(o, rig, 64) for k, o in occupancies.items()}
    _, polar = accumulate(columns, line, road, grids["polar"])
    _, cartesian = accumulate(columns, line, road, grids["cartesian"])
    back = to_polar(cartesian, grids["cartesian"])
    u = 140
    assert np.argmax(back[u]) == np.argmax(polar[u])
    assert back[u].max() == pytest.approx(polar[u].max(), rel=0.05)


@pytest.mark.parametrize("kind", ["polar", "column_disparity", "cartesian"])
def test_displayed_grid_shows_the_box_at_its_place(
    rig, road, occupancies, render, as_disparities, kind
):
    empty, box = render(rig), render(rig, boxes=[(1.0, 12.0, 2.0, 1.5)])
    free = FreeSpace(
        4,
        np.full((2, rig.width), np.nan, dtype=np.float32),
        np.full((2, rig.width), -1, dtype=np.int32),
        np.tile(road_line(0.0, rig.camera_height, rig), (2, 1)),
    )
    disparities = as_disparities(empty, box, first=4)
    arguments = (disparities, free, rig, road, occupancies[kind])
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


def test_occupancy_rejects_an_inconsistent_range(occupancies):
    for occupancy in occupancies.values():
        occupancy.check()
        with pytest.raises(ValueError, match=r"occupancy\.nearest: must be < .*got 60\.0"):
            replace(occupancy, nearest=60.0).check()


ONE = np.float32(1.0)


def path_cost(path, costs, depths, cost, limit):
    z = depths[path]
    steps = cost * np.minimum(np.abs(np.diff(z)), limit)
    return costs[np.arange(len(path)), path].sum(dtype=np.float64) + steps.sum(dtype=np.float64)


def least_cost(costs, depths, cost, limit):
    """Dynamic programming in O(W R²), straight from the definition."""
    step = cost * np.minimum(np.abs(depths[:, None] - depths[None, :]), limit)
    total = costs[0].astype(np.float64)
    for u in range(1, len(costs)):
        total = costs[u] + (step + total).min(axis=1)
    return total.min()


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 30),
    st.integers(1, 24),
    st.sampled_from([0.0, 0.05, 0.3, 5.0]),
    st.sampled_from([0.5, 3.0, 100.0]),
)
def test_path_has_the_least_cost(seed, width, rows, cost, limit):
    rng = np.random.default_rng(seed)
    costs = rng.random((width, rows)).astype(np.float32)
    depths = np.sort(rng.uniform(3.0, 30.0, rows)).astype(np.float32)
    path = cheapest_path(costs, depths, np.float32(cost), np.float32(limit))
    assert path_cost(path, costs, depths, cost, limit) == pytest.approx(
        least_cost(costs, depths, cost, limit), rel=1e-5
    )


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
    np.testing.assert_allclose(costs, expected, rtol=1e-6)


def test_temporal_cost_is_the_truncated_distance():
    rng = np.random.default_rng(7)
    costs = rng.random((5, 12)).astype(np.float32)
    depths = np.sort(rng.uniform(3, 9, 12)).astype(np.float32)
    expected = np.array([4.0, np.nan, 8.0, 3.0, np.nan], dtype=np.float32)
    added = costs.copy()
    add_temporal(added, depths, expected, np.float32(0.3), np.float32(2.0))
    away = np.nan_to_num(np.minimum(np.abs(depths - expected[:, None]), 2.0), nan=0.0)
    np.testing.assert_allclose(added, costs + 0.3 * away, rtol=1e-6)


def test_refine_averages_the_disparities_near_the_path():
    histogram = np.zeros((4, 41), dtype=np.uint16)
    histogram[0, [19, 20, 21]] = [1, 5, 4]
    histogram[0, 30] = 100
    histogram[2, 0] = 9
    disparities = np.array([10.0, 5.0], dtype=np.float32)
    reach = np.array([1.0, 5.0], dtype=np.float32)
    path = np.array([0, 0, 1, 2], dtype=np.int32)
    refined = refine(path, histogram, disparities, reach, 2)
    np.testing.assert_allclose(refined, [(19 + 100 + 84) / 20, 10.0, 5.0, np.nan], rtol=1e-6)
