"""The fitted noise: what each of its parameters does, in long rows of points."""

import dataclasses

import numpy as np
import pytest

from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.rays import (
    ConstantNoise,
    FittedNoise,
    StereoNoise,
    measure,
    range_sensitivity,
    range_std,
    spread_rays,
)
from stixel_cli.randomness import generator

RIG = Rig(4000, 480, 60.0, None, None, None, 0.3, 1.2, 0.0, None)
RAYS = spread_rays(4000, RIG.field_of_view, True)
HIT = np.arange(500, 3500)
RANGES = 12.0 / np.cos(RAYS.angles[HIT])
NONE = FittedNoise("fitted", 3, *7 * [0.0], 3.0)
SENSITIVITY = range_sensitivity(RANGES, RAYS.angles[HIT], RIG)


def measured(hit=HIT, ranges=RANGES, seed=0, **changes):
    noise = dataclasses.replace(NONE, **changes)
    return measure(noise, hit, ranges, RAYS, RIG, generator(seed, "test"))


def test_block_without_noise_has_the_range_of_its_middle_ray_and_bias_shifts_it():
    ray, true, found = measured()
    # Blocks are of the image, not of the target: their middles are rays 1, 4, 7, …
    np.testing.assert_array_equal(ray, np.arange(502, 3500, 3))
    np.testing.assert_array_equal(true, RANGES[ray - 500])
    np.testing.assert_array_equal(found, true)
    _, true, found = measured(range_bias=0.05)
    np.testing.assert_allclose(found - true, 0.05)


def test_kinds_of_noise_agree_on_their_std_and_sensitivity():
    depth = 12.0
    step = RIG.disparity_from_depth(depth) - RIG.disparity_from_depth(depth + 1e-4)
    np.testing.assert_allclose(SENSITIVITY * np.cos(RAYS.angles[HIT]), 1e-4 / step, rtol=1e-4)
    angles = RAYS.angles[HIT]
    stereo = range_std(StereoNoise("stereo", 0.2), RANGES, angles, RIG)
    fitted = dataclasses.replace(NONE, disparity_std=0.2)
    np.testing.assert_allclose(range_std(fitted, RANGES, angles, RIG), stereo)
    constant = range_std(ConstantNoise("constant", 0.3), RANGES, angles, RIG)
    np.testing.assert_array_equal(constant, 0.3)


def test_noise_has_the_given_std_and_correlation():
    changes = {"disparity_std": 0.1, "correlation_columns": 6.0}
    rows = []
    for seed in range(8):
        ray, true, found = measured(seed=seed, **changes)
        rows.append((found - true) / (0.1 * SENSITIVITY[ray - 500]))
    even = np.array(rows)
    assert abs(even.std() - 1.0) < 0.05
    assert abs(np.mean(even[:, 1:] * even[:, :-1]) - np.exp(-0.5)) < 0.06
    assert abs(np.mean(even[:, 4:] * even[:, :-4]) - np.exp(-2.0)) < 0.06


def test_ends_extend_or_shorten_the_silhouette_but_at_the_image_border():
    # What 9 columns are at the ends, which are about 13 m away, of rays 0.3 mrad apart.
    metres = 9.0 * RANGES[0] * RAYS.steps[HIT[0]]
    ray, true, _ = measured(edge_metres=metres)
    assert (ray[0], ray[-1]) == (493, 3508)
    assert true[0] == RANGES[0]
    ray, _, _ = measured(edge_metres=-metres)
    assert (ray[0], ray[-1]) == (511, 3490)
    # Nothing is left of a target that is narrower than what its ends fall short by.
    assert len(measured(hit=HIT[:12], ranges=RANGES[:12], edge_metres=-metres)[0]) == 0
    hit = np.arange(4000)
    ranges = 12.0 / np.cos(RAYS.angles)
    ray, _, _ = measured(hit, ranges, edge_metres=-0.1)
    assert (ray[0], ray[-1]) == (1, 3997)


def test_missed_points_are_correlated():
    random = [measured(seed=seed, missed_share=0.2, missed_columns=12.0)[0] for seed in range(8)]
    gaps = np.concatenate([np.diff(ray) // 3 - 1 for ray in random])
    share = 1.0 - np.mean([len(ray) / 1000 for ray in random])
    assert abs(share - 0.2) < 0.03
    assert abs(gaps[gaps > 0].mean() - 4.0) < 0.5


def test_outermost_points_have_mixed_depths():
    errors = np.array(
        [
            (found - true) / SENSITIVITY[ray - 500]
            for ray, true, found in (
                measured(seed=seed, edge_disparity_std=0.3) for seed in range(60)
            )
        ]
    )
    assert abs(errors[:, [0, -1]].std() - 0.3) < 0.06
    assert np.all(errors[:, 1:-1] == 0.0)


@pytest.mark.parametrize("count", [0, 1])
def test_noise_accepts_few_rays(count):
    ray, true, found = measured(
        HIT[2 : 2 + count],
        RANGES[2 : 2 + count],
        disparity_std=0.1,
        edge_disparity_std=0.1,
        missed_share=0.5,
    )
    assert len(ray) == len(true) == len(found) <= count
