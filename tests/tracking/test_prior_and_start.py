import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tracking_cases import CAR

from stixel_cli import compose
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.start import TruthStart, noisy_start

ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)


def points(prior):
    radii = prior_radii(prior, ANGLES)
    return radii[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.85])
def test_rectangle_prior_has_its_size_and_rounded_corners(radius):
    outline = points(dataclasses.replace(CAR, corner_radius=radius))
    assert np.abs(outline).max(axis=0) == pytest.approx([2.1, 0.85], abs=1e-3)
    # The signed distance to a rounded rectangle is zero all round.
    inner = np.abs(outline) - (np.array([2.1, 0.85]) - radius)
    outside = np.hypot(*np.maximum(inner, 0.0).T)
    distance = outside + np.minimum(inner.max(axis=1), 0.0) - radius
    assert_allclose(distance, 0.0, atol=1e-12)


def test_ellipse_prior_is_an_ellipse():
    ellipse = PriorShape(1.8, 0.6, "ellipse", 0.0, 0.1, 0.1, 0.1, 0.3, "car", 0.06, 0.06, None)
    x, y = points(ellipse).T
    assert_allclose((x / 0.9) ** 2 + (y / 0.3) ** 2, 1.0)


def scenario():
    times = 0.2 * np.arange(5)
    rates = np.tile([3.0, -1.0, 0.4], (5, 1))
    poses = np.array([4.0, 9.0, 0.3]) + times[:, None] * rates
    outline = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)
    return Scenario(times, np.zeros((5, 3)), poses, rates, outline[None])


NOISE = TruthStart("truth", "truth", position=0.3, heading=0.1, velocity=0.5, heading_rate=0.05)


def test_start_noise_matches_its_covariance_and_may_be_that_of_the_pose_alone():
    exact = dict.fromkeys(("position", "heading", "velocity", "heading_rate"), 1e-12)
    quiet = TruthStart("truth", "truth", **exact)
    start = noisy_start(scenario(), quiet, seed=3)
    first = transition(0.2) @ start.mean
    assert_allclose(first, [4.0, 9.0, 0.3, 3.0, -1.0, 0.4], atol=1e-9)
    exact = transition(-0.2) @ np.array([4.0, 9.0, 0.3, 3.0, -1.0, 0.4])
    starts = [noisy_start(scenario(), NOISE, seed) for seed in range(800)]
    normal = np.array([s.mean - exact for s in starts]) / [0.3, 0.3, 0.1, 0.5, 0.5, 0.05]
    assert np.all(np.abs(normal.mean(axis=0)) < 5.0 / np.sqrt(800))
    assert np.all(np.abs(normal.std(axis=0) - 1.0) < 0.12)
    assert_allclose(np.diag(starts[0].covariance), np.array([0.3, 0.3, 0.1, 0.5, 0.5, 0.05]) ** 2)
    again = noisy_start(scenario(), NOISE, 7)
    assert_array_equal(again.mean, starts[7].mean)
    zero = dataclasses.replace(NOISE, rates="zero", velocity=4.0, heading_rate=0.5)
    starts = [noisy_start(scenario(), zero, seed) for seed in range(3)]
    for seed, start in enumerate(starts):
        true_rates = noisy_start(scenario(), NOISE, seed)
        moved = transition(0.2) @ true_rates.mean
        noise_of_rates = true_rates.mean[3:] - [3.0, -1.0, 0.4]
        assert_array_equal(start.mean[3:], 0.0)
        assert_allclose(start.mean[:3], moved[:3] - 0.2 * noise_of_rates, atol=1e-12)
        assert_allclose(np.diag(start.covariance)[3:], [16.0, 16.0, 0.25])


@pytest.mark.parametrize(("user", "std"), [("car", 0.3), ("cyclist", 0.15), ("pedestrian", 0.1)])
@pytest.mark.parametrize("start", ["default", "zero_rates"])
def test_the_initial_noise_of_the_position_is_that_of_the_class(user, std, start):
    chosen = compose([f"road_user={user}", f"start={start}"]).configuration
    assert chosen.prior.start_position == chosen.start.position == std
    assert chosen.start.heading == 0.1
    own = compose([f"road_user={user}", f"start={start}", "start.position=0.7"]).configuration
    assert own.start.position == 0.7
