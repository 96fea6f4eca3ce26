import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.stixels.nearest_obstacle import add_temporal, cell_costs, cheapest_path, refine

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
