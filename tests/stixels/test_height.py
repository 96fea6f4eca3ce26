import numpy as np
import pytest
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from stixel_cli.stixels.height import (
    Frame,
    _power_of_two,
    cheapest_tops,
    depth_windows,
    membership_costs,
    top_rows,
)
from stixel_cli.stixels.road import road_line


@njit
def powers(exponents):
    values = np.empty_like(exponents)
    for i in range(len(exponents)):
        values[i] = _power_of_two(exponents[i])
    return values


def test_powers_approximate_exp2():
    y = np.linspace(-16, 1, 5000, dtype=np.float32)
    np.testing.assert_allclose(powers(y), np.exp2(y), atol=3e-6)


def test_depth_windows_end_behind_the_obstacle(rig):
    obstacle = np.array([20.0, np.nan, 5.0], dtype=np.float32)
    focal_baseline = rig.focal * rig.baseline
    depth = focal_baseline / obstacle
    np.testing.assert_allclose(
        depth_windows(obstacle, rig, 2.0), obstacle - focal_baseline / (depth + 2.0), rtol=1e-5
    )


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
            assert costs[u, v] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("beyond", "smoothness", "top"),
    [(0.0, 3.0, 60), (0.0, 0.9, 50), (0.0, 1.1, 60), (3.0, 3.0, 60), (3.6, 3.0, 50)],
)
def test_smoothness_depends_on_the_depth_difference_of_neighbours(
    rig, height, beyond, smoothness, top
):
    """Ten more rows of one column gain 20 and cost 10 C_s (1 - |z_u - z_v| / 5 m) on each side."""
    depth = np.full(rig.width, 10.0 + beyond)
    depth[100] = 10.0
    obstacle = (rig.focal * rig.baseline / depth).astype(np.float32)
    base = np.full(rig.width, 120, dtype=np.int32)
    columns = np.full((rig.width, rig.height), 16 * 4, dtype=np.int16)
    columns[:, 60:121] = np.rint(16.0 * obstacle)[:, None]
    columns[100, 50:60] = columns[100, 60]
    line = road_line(0.0, rig.camera_height, rig)
    changed = with_constants(height, smoothness=smoothness)
    tops = top_rows(Frame(columns, 64, obstacle, base, line, rig), changed)
    assert tops[100] == top
    assert np.all(np.delete(tops, 100) == 60)


def total_cost(tops, cost, tied):
    kept = sum(cost[u, v] for u, v in enumerate(tops) if v >= 0)
    steps = [
        tied[u] * abs(int(tops[u]) - int(tops[u + 1]))
        for u in range(len(tops) - 1)
        if tops[u] >= 0 and tops[u + 1] >= 0
    ]
    return float(kept) + float(sum(steps))


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
    tied = (rng.random(max(width - 1, 0)) * rng.integers(0, 3, max(width - 1, 0))).astype(
        np.float32
    )
    tops = cheapest_tops(cost.copy(), base, tied)
    assert np.array_equal(tops >= 0, base >= 0)
    assert np.all(tops <= base)
    assert total_cost(tops, cost, tied) == pytest.approx(least_cost(cost, base, tied), abs=1e-3)
