"""Fabricated scans beside a brute force of every ray with every edge, and the fitted noise."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from stixel_cli.geometry.pose import ego_from_world, rectangle, rotation, world_from_target
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters, fabricate_scans
from stixel_cli.measurements.rays import (
    ConstantNoise,
    FittedNoise,
    StereoNoise,
    first_crossings,
    measure,
    range_sensitivity,
    range_std,
    spread_rays,
)
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario

RIG = Rig(640, 480, 60.0, None, None, None, 0.3, 1.5, 0.0, None)
RIGHT, LEFT = RIG.field_of_view
DISTURBED = {"dropout": None, "clutter_rate": 0.0}
NO_NOISE = ConstantNoise("constant", 0.0)
EXACT = FabricatedParameters("fabricated", None, "angle", NO_NOISE, 0.0, 80.0, **DISTURBED)
BOX = rectangle(4.5, 1.8)
VIEWS = (st.booleans(), st.floats(-0.5, 0.5), st.floats(0.1, 1.0))


def scenario(count=20, distance=15.0, contour=BOX):
    times = 0.1 * np.arange(count)
    target = np.stack([5.0 * times - 5.0, distance + 0.0 * times, 0.3 * times], axis=-1)
    ego = np.stack([times, 2.0 * times, 0.5 * np.pi + 0.05 * times], axis=-1)
    rates = np.tile([5.0, 0.0, 0.3], (count, 1))
    return Scenario(times, ego, target, rates, contour[None])


def distance_to_outline(points, polygon):
    """Distance of points (n, 2) to the nearest edge."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    edge = end - start
    offset = points[:, None] - start
    share = np.clip(np.sum(offset * edge, -1) / np.sum(edge**2, -1), 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * edge, axis=-1).min(axis=1)


@pytest.mark.parametrize("spacing", ["angle", "tangent"])
def test_points_without_noise_are_on_contour_and_rays(spacing):
    truth = scenario()
    scans = fabricate_scans(truth, RIG, dataclasses.replace(EXACT, spacing=spacing), seed=1)
    assert len(scans.points_world) > 500
    assert scans.field_of_view == FieldOfView(RIGHT, LEFT)
    for k in range(len(scans)):
        points = scans.points_world[scans.rows(k)]
        outline = world_from_target(BOX, truth.target_poses_world[k])
        assert distance_to_outline(points, outline).max() < 1e-9
        x, y = ego_from_world(points, truth.ego_poses_world[k]).T
        if spacing == "angle":
            position = (np.arctan2(y, x) - np.pi / 2 - RIGHT) / (LEFT - RIGHT) * 639
        else:
            position = 0.5 * 639 - (x / y) / np.tan(RIG.field_of_view[1]) * 0.5 * 639
        assert_allclose(position, np.rint(position), atol=1e-6)


def test_points_follow_the_limbs():
    thin = BOX * [1.0, 0.3]
    limbs = {"contours_target": np.stack([BOX, thin]), "limb_poses": np.array([0, 1, 1, 0])}
    truth = dataclasses.replace(scenario(count=4), **limbs)
    scans = fabricate_scans(truth, RIG, EXACT, seed=1)
    for k, contour in enumerate((BOX, thin, thin, BOX)):
        outline = world_from_target(contour, truth.target_poses_world[k])
        points = scans.points_world[scans.rows(k)]
        assert len(points) > 10 and distance_to_outline(points, outline).max() < 1e-9


def test_point_of_several_columns_is_inside_them():
    truth = scenario(count=3)
    spread = {}
    for width in (1, 5):
        noise = FittedNoise("fitted", width, *7 * [0.0], 1.0)
        scans = fabricate_scans(truth, RIG, dataclasses.replace(EXACT, noise=noise), seed=0)
        k = np.repeat(np.arange(3), np.diff(scans.offsets))
        offset = scans.points_world - scans.sensor_poses_world[k, :2]
        across = np.stack([-offset[:, 1], offset[:, 0]], axis=-1)
        across /= np.sum(offset**2, axis=1, keepdims=True)
        # In units of the angle between rays: width² / 12.
        angle = np.einsum("ni,nij,nj->n", across, scans.covariances_world, across)
        spread[width] = np.sqrt(12.0 * angle) / ((LEFT - RIGHT) / 639)
        assert_allclose(spread[width], width)
    assert len(spread[5]) > 50


def test_noise_along_the_ray_matches_its_covariance():
    truth = scenario(count=200)
    stereo = dataclasses.replace(EXACT, noise=StereoNoise("stereo", 0.3))
    exact = fabricate_scans(truth, RIG, EXACT, seed=5)
    noisy = fabricate_scans(truth, RIG, stereo, seed=5)
    assert len(exact.points_world) == len(noisy.points_world)
    errors = []
    for k in range(len(exact)):
        sensor = truth.ego_poses_world[k]
        rows = exact.rows(k)
        true, measured = (one.points_world[rows] - sensor[:2] for one in (exact, noisy))
        ranges = np.linalg.norm(true, axis=-1)
        along = true / ranges[:, None]
        across = along @ rotation(np.pi / 2).T
        assert np.all(abs(np.sum(across * (measured - true), -1)) < 1e-9)
        covariances = noisy.covariances_world[rows]
        measured_range = np.linalg.norm(measured, axis=-1)
        depth = measured_range * (along @ np.array([np.cos(sensor[2]), np.sin(sensor[2])]))
        std = depth**2 * 0.3 / (RIG.focal * 0.3) * measured_range / depth
        spread = np.einsum("ni,nij,nj->n", along, covariances, along)
        assert_allclose(spread, std**2)
        sideways = np.einsum("ni,nij,nj->n", across, covariances, across)
        assert_allclose(sideways, (measured_range * (LEFT - RIGHT) / 639) ** 2 / 12.0)
        assert_allclose(np.einsum("ni,nij,nj->n", across, covariances, along), 0.0, atol=1e-12)
        errors.append(np.sum(along * (measured - true), -1) / std)
    errors = np.concatenate(errors)
    assert abs(errors.mean()) < 5.0 / np.sqrt(len(errors))
    assert abs(errors.std() - 1.0) < 0.03


def test_random_numbers_depend_only_on_seed_and_scan_and_not_on_options():
    truth = scenario()
    plain = dataclasses.replace(EXACT, noise=ConstantNoise("constant", 0.1))
    reference = fabricate_scans(truth, RIG, plain, seed=3)
    missed = fabricate_scans(truth, RIG, dataclasses.replace(plain, missed_probability=0.3), seed=3)
    for k in range(len(reference)):
        points, left = (one.points_world[one.rows(k)] for one in (reference, missed))
        assert {tuple(p) for p in left} <= {tuple(p) for p in points}
    assert 0.65 < len(missed.points_world) / len(reference.points_world) < 0.75
    again, other = (fabricate_scans(truth, RIG, plain, seed=seed) for seed in (3, 4))
    assert reference.points_world.tobytes() == again.points_world.tobytes()
    assert not np.array_equal(reference.points_world, other.points_world)
    shorter = fabricate_scans(scenario(count=5), RIG, plain, seed=3)
    assert_array_equal(shorter.points_world, reference.points_world[: shorter.offsets[-1]])


def test_a_scan_can_be_empty_and_rays_are_no_more_than_columns():
    scans = fabricate_scans(scenario(distance=-30.0), RIG, EXACT, seed=0)
    assert len(scans) == 20
    assert scans.points_world.shape == (0, 2)
    assert scans.covariances_world.shape == (0, 2, 2)
    far = fabricate_scans(scenario(distance=90.0), RIG, EXACT, seed=0)
    assert np.all(np.diff(far.offsets) == 0)
    with pytest.raises(ValueError, match=r"measurement\.rays: must be ≤ rig\.width .*got 641"):
        dataclasses.replace(EXACT, rays=641).check(RIG)


def every_ray_with_every_edge(contour, angles):
    """Nearest entering crossing of each ray, by solving 2 x 2 systems; inf where there is none."""
    ranges = np.full(len(angles), np.inf)
    for i, angle in enumerate(angles):
        direction = np.array([np.cos(angle), np.sin(angle)])
        for start, end in zip(contour, np.roll(contour, -1, axis=0), strict=True):
            system = np.stack([direction, start - end], axis=-1)
            if np.linalg.det(system) <= 1e-12:  # parallel, or leaving the contour
                continue
            along, share = np.linalg.solve(system, start)
            if along > 0.0 and -1e-12 <= share <= 1.0 + 1e-12:
                ranges[i] = min(ranges[i], along)
    return ranges


def concave_star(seed, centre, size):
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 25))
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, count))
    gaps = np.diff(np.concatenate([angles, angles[:1] + 2.0 * np.pi]))
    if gaps.max() >= np.pi - 0.05:  # the centre would be outside
        angles = 2.0 * np.pi * np.arange(count) / count
    radii = size * random.uniform(0.2, 1.0, count)
    return centre + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@given(st.integers(0, 2**31), st.floats(0.0, 30.0), st.floats(-np.pi, np.pi), *VIEWS)
def test_crossings_match_a_brute_force_search(seed, distance, bearing, even_tangent, middle, half):
    # Near ones enclose the sensor, or reach round it past the seam behind.
    centre = distance * np.array([np.cos(bearing), np.sin(bearing)])
    contour = concave_star(seed, centre, 4.0)
    rays = spread_rays(41, (middle - half, middle + half), even_tangent)
    expected = every_ray_with_every_edge(contour, rays.angles)
    hit, ranges = first_crossings(contour, rays)
    found = np.full(41, np.inf)
    found[hit] = ranges
    assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("even_tangent", [False, True])
def test_rays_span_the_field_of_view_evenly(even_tangent):
    rays = spread_rays(11, (-0.6, 0.9), even_tangent)
    values = np.tan(rays.angles) if even_tangent else rays.angles
    assert_allclose(np.diff(values), np.diff(values)[0])
    assert_allclose(rays.angles[[0, -1]], [-0.6, 0.9])
    # The step is the derivative of the angle by the ray's index.
    assert_allclose(rays.steps[1:-1], np.gradient(rays.angles)[1:-1], rtol=0.02)


LONG_RIG = Rig(4000, 480, 60.0, None, None, None, 0.3, 1.2, 0.0, None)
RAYS = spread_rays(4000, LONG_RIG.field_of_view, True)
HIT = np.arange(500, 3500)
RANGES = 12.0 / np.cos(RAYS.angles[HIT])
NONE = FittedNoise("fitted", 3, *7 * [0.0], 3.0)
SENSITIVITY = range_sensitivity(RANGES, RAYS.angles[HIT], LONG_RIG)


def measured(hit=HIT, ranges=RANGES, seed=0, **changes):
    noise = dataclasses.replace(NONE, **changes)
    return measure(noise, hit, ranges, RAYS, LONG_RIG, generator(seed, "test"))


def test_block_without_noise_has_the_range_of_its_middle_ray_and_bias_shifts_it():
    ray, true, found = measured()
    # Blocks are of the image, not of the target: their middles are rays 1, 4, 7, …
    assert_array_equal(ray, np.arange(502, 3500, 3))
    assert_array_equal(true, RANGES[ray - 500])
    assert_array_equal(found, true)
    _, true, found = measured(range_bias=0.05)
    assert_allclose(found - true, 0.05)


def test_kinds_of_noise_agree_on_their_std_and_sensitivity():
    depth = 12.0
    step = LONG_RIG.disparity_from_depth(depth) - LONG_RIG.disparity_from_depth(depth + 1e-4)
    assert_allclose(SENSITIVITY * np.cos(RAYS.angles[HIT]), 1e-4 / step, rtol=1e-4)
    angles = RAYS.angles[HIT]
    stereo = range_std(StereoNoise("stereo", 0.2), RANGES, angles, LONG_RIG)
    fitted = dataclasses.replace(NONE, disparity_std=0.2)
    assert_allclose(range_std(fitted, RANGES, angles, LONG_RIG), stereo)
    constant = range_std(ConstantNoise("constant", 0.3), RANGES, angles, LONG_RIG)
    assert_array_equal(constant, 0.3)


def test_noise_has_the_given_std_and_correlation():
    changes = {"disparity_std": 0.1, "correlation_columns": 6.0}
    draws = [measured(seed=seed, **changes) for seed in range(8)]
    even = np.array([(found - true) / (0.1 * SENSITIVITY[ray - 500]) for ray, true, found in draws])
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
    ray, _, _ = measured(np.arange(4000), 12.0 / np.cos(RAYS.angles), edge_metres=-0.1)
    assert (ray[0], ray[-1]) == (1, 3997)


def test_missed_points_are_correlated():
    random = [measured(seed=seed, missed_share=0.2, missed_columns=12.0)[0] for seed in range(8)]
    gaps = np.concatenate([np.diff(ray) // 3 - 1 for ray in random])
    share = 1.0 - np.mean([len(ray) / 1000 for ray in random])
    assert abs(share - 0.2) < 0.03
    assert abs(gaps[gaps > 0].mean() - 4.0) < 0.5


def test_outermost_points_have_mixed_depths():
    draws = [measured(seed=seed, edge_disparity_std=0.3) for seed in range(60)]
    errors = np.array([(found - true) / SENSITIVITY[ray - 500] for ray, true, found in draws])
    assert abs(errors[:, [0, -1]].std() - 0.3) < 0.06
    assert np.all(errors[:, 1:-1] == 0.0)


@pytest.mark.parametrize("count", [0, 1])
def test_noise_accepts_few_rays(count):
    noise = {"disparity_std": 0.1, "edge_disparity_std": 0.1, "missed_share": 0.5}
    ray, true, found = measured(HIT[2 : 2 + count], RANGES[2 : 2 + count], **noise)
    assert len(ray) == len(true) == len(found) <= count
