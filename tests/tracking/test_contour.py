from dataclasses import replace

import numpy as np
import pytest
import seen_targets
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal
from seen_targets import SENSOR, rays_at, start_at, turning
from tracking_cases import CAR, jacobian

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import FieldOfView, SharedErrors
from stixel_cli.tracking.association import GATE_STDS, uncut
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.class_shape import class_shape, visible_shape, visible_table
from stixel_cli.tracking.contour.contour import track
from stixel_cli.tracking.contour.contour_filter import predict, start
from stixel_cli.tracking.contour.contour_rays import NEAR, rays_of, sight_of
from stixel_cli.tracking.contour.contour_report import (
    OUTLINE_STD,
    SIDEWAYS,
    contour_of,
    reported,
)
from stixel_cli.tracking.contour.contour_update import (
    Hypothesis,
    Measurement,
)
from stixel_cli.tracking.contour.forms import forms_of
from stixel_cli.tracking.contour.residual import NODES, Residual
from stixel_cli.tracking.kalman import correct, normalised_innovation_squared
from stixel_cli.tracking.track import InitialState

# Of one class: that the filters of the others change nothing is said in `test_disturbed_scans.py`.
WORDS = ["tracker=contour", "tracker.seen_by=fabricated", "tracker.road_user=fixed"]
TRACKER = compose(WORDS).configuration.tracker
SHAPES = {name: class_shape(name) for name in ("car", "cyclist", "pedestrian")}
PRIORS = {
    name: replace(CAR, road_user=name, length=float(shape.size[0]), width=float(shape.size[1]))
    for name, shape in SHAPES.items()
}
SEEDS = st.integers(0, 2**31)
SIZE = np.array([0.1, -0.05])


def seen(poses, name="car", **options):
    return seen_targets.seen(SHAPES[name].outline, poses, **options)


def scans_seen(poses, name="car", **options):
    return seen_targets.scans_seen(SHAPES[name].outline, poses, **options)


@pytest.mark.parametrize(("name", "speed"), [("car", 4.0), ("cyclist", 3.0), ("pedestrian", 1.3)])
def test_contour_follows_a_turn_of_each_class(name, speed):
    poses = turning(30, speed, 0.3)
    result = track(scans_seen(poses, name, noise=0.03), start_at(poses), PRIORS[name], TRACKER)
    errors = (result.means[:, :3] - poses)[15:]
    assert np.hypot(*errors[:, :2].T).max() < 0.1
    assert np.abs(wrap_angle(errors[:, 2])).max() < np.radians(12)
    assert_array_equal(result.nis_degrees_of_freedom, np.diff(result.used_offsets) + 2)
    assert result.means.shape == (30, 8)
    assert result.contours_world.shape == (30, TRACKER.contour_points, 2)


def test_contour_estimates_the_size():
    poses = turning(40, 4.0, 0.5)
    small = replace(PRIORS["car"], length=0.93 * PRIORS["car"].length)
    result = track(scans_seen(poses, noise=0.02), start_at(poses), small, TRACKER)
    assert abs(result.means[-1, 6]) < 0.02
    assert result.covariances[-1, 6, 6] < small.length_std**2


def position_nees(result, poses):
    errors = result.means[:, :2] - poses[:, :2]
    inverse = np.linalg.inv(result.covariances[:, :2, :2])
    return np.einsum("ki,kij,kj->k", errors, inverse, errors).mean()


def test_an_error_that_all_scans_share_widens_the_covariance_and_moves_nothing():
    poses = np.column_stack([np.full(30, 1.0), 24.0 + 0.2 * np.arange(30), np.full(30, np.pi / 2)])
    scans = scans_seen(poses, noise=0.05)
    # As of a disparity that is too small by the same amount everywhere: 0.6 m at 25 m.
    factors = 1.0 + 0.6 * np.hypot(*scans.points_world.T) / 25.0**2
    scans = replace(scans, points_world=scans.points_world * factors[:, None])
    error = SharedErrors(disparity=((0.6 / 25.0**2, 0.0, 0.0),))
    aware = replace(scans, shared_errors=error)
    initial = start_at(poses, (0.0, 0.0, 0.0))
    plain, considered = (track(s, initial, PRIORS["car"], TRACKER) for s in (scans, aware))
    assert_array_equal(considered.means, plain.means)
    assert position_nees(plain, poses) > 10.0 and position_nees(considered, poses) < 4.0
    added = considered.covariances[:, :2, :2] - plain.covariances[:, :2, :2]
    # The range alone: the error is 0.7 m at 27 m, and the sides hardly see it.
    assert 0.5 < np.sqrt(added[-1, 1, 1]) < 0.9 and np.sqrt(added[-1, 0, 0]) < 0.2


@pytest.mark.parametrize("axis", [0, 1])
def test_an_error_of_the_sensors_place_moves_the_estimate_as_is_stated(axis):
    # Points along an oblique face do not move with it across the rays: the innovation does.
    poses = turning(12, 4.0, 0.3)
    scans = scans_seen(poses, noise=0.03)
    shift = 0.1 * np.eye(2)[axis]
    moved, _ = seen_targets.moved(scans, start_at(poses), 0.0, shift)
    stated = replace(scans, shared_errors=SharedErrors(position=0.1))
    start, prior, seen = start_at(poses), PRIORS["car"], (scans, moved, stated)
    exact, wrong, wide = (track(one, start, prior, TRACKER) for one in seen)
    assert_allclose((wrong.means - exact.means)[5:, :2], [shift] * 7, atol=0.02)
    added = (wide.covariances - exact.covariances)[5:, axis, axis]
    assert_allclose(added, 0.1**2, rtol=0.2)


def test_two_scans_at_one_time_say_nothing_of_the_rates():
    poses, shared = turning(3, 4.0, 0.3), SharedErrors(range_bias=0.1)
    scans = replace(scans_seen(poses, noise=0.03), shared_errors=shared)
    twice = replace(scans, times=scans.times[[0, 1, 1]])
    assert np.isfinite(track(twice, start_at(poses), PRIORS["car"], TRACKER).covariances).all()


def test_contour_trusts_edges_less_where_they_are_uncertain():
    poses = np.column_stack([np.zeros(20), np.full(20, 20.0), np.full(20, np.pi / 2)])
    scans = scans_seen(poses, noise=0.03)
    # The edges of a matcher are moved to the left: the right edge by more.
    scans = scans.of_rows(np.flatnonzero(scans.points_world[:, 0] < 0.55))
    initial = start_at(poses, (0.0, 0.0, 0.0))
    unsure = replace(TRACKER, silhouette_std=1.0)
    plain, wide = (track(scans, initial, PRIORS["car"], t) for t in (TRACKER, unsure))
    assert abs(wide.means[-1, 0]) < 0.5 * abs(plain.means[-1, 0])
    assert position_nees(wide, poses) < 0.5 * position_nees(plain, poses)


@given(seed=SEEDS)
def test_prediction_and_report_match_their_linearisations(seed):
    random = np.random.default_rng(seed)
    mean = random.uniform([-5, 5, -3, 0.5, -1, -0.1, -0.1], [5, 15, 3, 6, 1, 0.1, 0.1])
    quiet = replace(TRACKER, acceleration=0.0, turn_acceleration=0.0, slip=0.0)
    root = random.standard_normal((7, 7))
    covariance = root @ root.T
    size = SIZE, np.array([0.07, 0.04])
    _, matrix, noise = predict(mean, 0.1, quiet, *size)
    assert_allclose(matrix, jacobian(lambda m: predict(m, 0.1, quiet, *size)[0], mean), atol=1e-6)
    assert np.trace(noise[:5, :5]) == 0.0
    whole, residual = np.zeros((7 + NODES, 7 + NODES)), Residual(SHAPES["car"])

    def state(one):
        return np.append(one, np.zeros(NODES))

    slopes = jacobian(lambda one: reported(state(one), whole, residual)[0], mean)
    expected, whole[:7, :7] = slopes @ covariance @ slopes.T, covariance
    across = np.array([-np.sin(mean[2]), np.cos(mean[2])])
    expected[3:5, 3:5] += SIDEWAYS**2 * np.outer(across, across)
    assert_allclose(reported(state(mean), whole, residual)[1], expected, atol=1e-6)


@pytest.mark.parametrize("name", SHAPES)
def test_stated_deviation_of_the_contour_is_that_of_random_states(name):
    """Along the ray from the estimated centre, over the states of the stated covariance."""
    shape = replace(SHAPES[name], outline_stds=np.zeros(len(SHAPES[name].outline)))
    mean = np.append([3.0, 9.0, 0.7, 2.0, 0.0, 0.05, -0.05], np.zeros(NODES))
    root = np.diag([0.02, 0.015, 0.03, 0.0, 0.0, 0.02, 0.02] + [0.03] * NODES)
    residual = Residual(shape)
    places, std = contour_of(mean, root @ root, shape, 90, residual)
    rays = places - mean[:2]
    random = np.random.default_rng(1)
    radii = []
    for state in mean + random.standard_normal((400, 7 + NODES)) @ root:
        contour = contour_of(state, root @ root, shape, 360, residual)[0] - mean[:2]
        bearing = np.arctan2(contour[:, 1], contour[:, 0])
        wanted = np.arctan2(rays[:, 1], rays[:, 0])
        radii.append(np.interp(wanted, bearing, np.hypot(*contour.T), period=2.0 * np.pi))
    ratio = np.std(radii, axis=0) / np.sqrt(std**2 - OUTLINE_STD**2)
    assert 0.9 < np.median(ratio) < 1.1
    assert np.mean((ratio > 0.5) & (ratio < 1.6)) > 0.8


def test_start_turns_the_heading_towards_the_velocity():
    covariance = np.diag([0.1, 0.1, 0.04, 0.01, 0.01, 0.01])
    initial = InitialState(np.array([0.0, 10.0, 0.0, 5.0, 0.5, 0.0]), covariance)
    mean, covariance = start(initial, SIZE, np.array([0.07, 0.04]))
    assert mean[2] == pytest.approx(0.1, abs=0.01)
    assert covariance[2, 2] < 0.002
    assert_allclose(mean[5:7], SIZE)
    assert_allclose(np.diag(covariance)[5:7], [0.07**2, 0.04**2])
    # Without a velocity the heading is as good as it was.
    resting = InitialState(initial.mean * [1, 1, 1, 0, 0, 1], initial.covariance)
    covariance = start(resting, SIZE, np.array([0.07, 0.04]))[1]
    assert covariance[2, 2] == pytest.approx(0.04)


def test_silhouettes_at_the_border_of_the_field_of_view_are_not_used():
    bearings, ranges = np.radians([-29.8, 10.0]), np.array([8.0, 9.0])
    view = FieldOfView(*np.radians([-30.0, 40.0]))
    assert_array_equal(uncut(bearings, ranges, view), [False, True])
    mirrored = FieldOfView(-view.left, -view.right)
    assert_array_equal(uncut(-bearings[::-1], ranges, mirrored), [True, False])
    assert_array_equal(uncut(bearings, ranges, None), [True, True])
    # 0.5 m to the right of the sensor, a camera does not see 28 degrees to the left at 9 m.
    left, pair = np.radians([10.0, 28.0]), FieldOfView(*np.radians([-30.0, 30.0]), 0.5)
    assert_array_equal(uncut(left, ranges, replace(pair, baseline=0.0)), [True, True])
    assert_array_equal(uncut(left, ranges, pair), [True, False])
    assert_array_equal(uncut(-left[::-1], ranges, pair), [True, True])


def test_a_target_cut_off_by_the_field_of_view_keeps_its_place():
    poses = np.tile([0.0, 10.0, 0.0], (10, 1))
    whole = scans_seen(poses, noise=0.02)
    cut = whole.of_rows(np.flatnonzero(whole.points_world[:, 0] < 0.0))
    cuts = [replace(cut, field_of_view=view) for view in (None, FieldOfView(0.0, 0.6))]
    results = [track(one, start_at(poses), CAR, TRACKER) for one in cuts]
    counts = np.diff(cut.offsets)
    assert_array_equal(results[0].nis_degrees_of_freedom, counts + 2)
    assert_array_equal(results[1].nis_degrees_of_freedom, counts + 1)
    errors = [np.abs(result.means[-1, :2] - poses[-1, :2]).max() for result in results]
    assert errors[1] < 0.1 < errors[0]


def test_deviation_of_a_range_is_that_along_the_ray():
    points = np.array([[0.0, 10.0], [6.0, 8.0]])
    along = points / 10.0
    covariances = 0.01 * np.eye(2) + 0.08 * along[:, :, None] * along[:, None, :]
    rays = rays_of(points, covariances, SENSOR)
    assert_allclose(rays.ranges, 10.0)
    assert_allclose(rays.stds, 0.3)
    assert_allclose(rays.bearings, [0.0, -np.arctan2(6.0, 8.0)])


@pytest.mark.parametrize("name", SHAPES)
def test_stixels_see_a_class_behind_its_outline_and_within_it(name):
    shape = SHAPES[name]
    seen = visible_shape(name, "stixels")
    table = visible_table(shape.outline, seen)
    seen_width, width = table.high - table.low, (table.highest - table.lowest) / 1.25
    assert np.all(seen_width < width + 0.15)
    assert np.all(seen_width > 0.4 * width)
    assert seen.depth_biases.mean() + 0.2 * seen.bias_per_std > 0.0  # at a range with σ = 0.2 m
    assert shapely.polygons(shape.outline).area > 0.3 * np.prod(shape.size)
    assert shapely.linearrings(shape.outline).is_ccw


@pytest.mark.parametrize("std", [0.05, 0.3, 1.0])
def test_a_point_where_it_is_expected_is_likelier_than_clutter(std):
    """Far points are uncertain by 1 m, and no reason to leave the class."""
    rays = rays_at(np.stack([np.linspace(-0.6, 0.6, 12), np.full(12, 30.0)], axis=-1), std)
    prior, sight = class_shape("car"), sight_of("car", TRACKER)
    mean, covariance = np.zeros(7 + NODES), 1e-4 * np.eye(7 + NODES)
    mean[:4] = 0.0, 30.0 + 0.5 * prior.size[0], -np.pi / 2, 5.0
    joint = JointCovariance(covariance, 0)
    start, some = Hypothesis((mean, covariance, joint)), (np.arange(6), np.arange(12))
    few, all_of_them = (Measurement(rays, one, sight, TRACKER).update(start) for one in some)
    assert all_of_them.log_likelihood > few.log_likelihood


def test_rays_that_pass_by_pull_the_target_back_where_something_low_hides_both_of_its_ends():
    """Over a parked car, a head is seen; its ranges fit half a metre beside it, too."""
    head, car = ([[x, y] for x in np.linspace(-0.15, 0.15, 7)] for y in (9.8, 6.0))
    rays, sight = rays_at(head + car, 0.02).subset(np.arange(7)), sight_of("pedestrian", TRACKER)
    assert rays.hidden == (True, True)
    mean = np.append([0.5, 10.0, 0.0, 1.0], np.zeros(3 + NODES))
    covariance = np.diag([0.3, 0.3, 0.1, 0.3, 0.1, 0.01, 0.01] + [0.01] * NODES) ** 2
    everything = np.arange(len(rays.ranges))
    found = Measurement(rays, everything, sight, TRACKER).fit(mean, covariance, mean).mean
    assert np.hypot(found[0], found[1] - 10.0) < 0.25
    # A real matcher moves edges, so such a ray says less.
    tracker = replace(TRACKER, silhouette_std=2.0)
    unsure = Measurement(rays, everything, sight, tracker).fit(mean, covariance, mean).mean
    assert np.hypot(unsure[0], unsure[1] - 10.0) > 0.3


@given(seed=SEEDS, count=st.integers(1, 30))
def test_the_information_form_is_the_kalman_update(seed, count):
    random = np.random.default_rng(seed)
    root = random.standard_normal((8, 8))
    covariance, matrix = root @ root.T, random.standard_normal((count, 8))
    noise, innovation = random.uniform(0.1, 2.0, count), random.standard_normal(count)
    correction, posterior, nis = correct(covariance, matrix, noise, innovation)
    innovation_covariance = matrix @ covariance @ matrix.T + np.diag(noise)
    gain = covariance @ matrix.T @ np.linalg.inv(innovation_covariance)
    assert_allclose(correction, gain @ innovation, rtol=1e-6, atol=1e-8)
    expected = covariance - gain @ matrix @ covariance
    assert_allclose(posterior, expected, rtol=1e-6, atol=1e-8)
    assert nis == pytest.approx(innovation @ np.linalg.solve(innovation_covariance, innovation))
    assert normalised_innovation_squared(covariance, matrix, noise, innovation)[0] == pytest.approx(
        nis
    )


@pytest.mark.parametrize("form", ["class", "rectangle"])
def test_what_a_scan_does_to_the_joint_covariance_is_the_dense_update(form):
    """With rays that pass by the shape, too."""
    random = np.random.default_rng(3)
    _, sight = forms_of("car", PRIORS["car"], TRACKER)[form]
    points = seen(np.array([[3.0, 15.0, 0.4]]), noise=0.05)[0][0]
    beside = np.array([[points[:, 0].min() - 1.0, 15.0], [points[:, 0].max() + 1.0, 15.0]])
    points = np.concatenate([points, beside])
    covariances = np.tile(0.01 * np.eye(2), (len(points), 1, 1))
    shared = 0.05 * random.standard_normal((len(points), 2, 2))
    rays = replace(rays_of(points, covariances, SENSOR), shared=shared)
    states = 7 + NODES
    root = random.standard_normal((states + 4,) * 2)
    joint = JointCovariance(np.eye(states), 4)
    joint.matrix = np.eye(len(root)) + 0.02 * root @ root.T
    mean = np.zeros(states)
    mean[:3] = 3.1, 15.1, 0.38
    measurement = Measurement(rays, np.arange(len(points)), sight, TRACKER)
    found = measurement.fit(mean, 0.05 * np.eye(states), mean)
    rows, measured, count = found.rows, measurement._measured, len(points)
    assert len(rows.errors) > count + 2

    whole, noise = measurement._stated(rows, len(root))
    assert_allclose(whole[:count, -4:-2], np.einsum("ni,nim->nm", rows.matrix[:count, :2], shared))
    own = noise[: count + 2]
    assert (own >= measured.variances).all()

    used = measured.used
    innovation_covariance = (whole @ joint.matrix @ whole.T)[: count + 2, : count + 2]
    spread = (innovation_covariance + np.diag(own))[used][:, used]
    density = multivariate_normal(np.zeros(used.sum()), spread)
    innovations = found.innovations[: count + 2][used]
    gain = np.zeros((len(root), len(noise)))
    gain[:states] = found.covariance @ (rows.matrix.T / found.noise)
    kept = np.eye(len(root)) - gain @ whole
    expected = kept @ joint.matrix @ kept.T + (gain * noise) @ gain.T
    prior = Hypothesis((mean, found.covariance, joint))
    after = measurement.posterior(prior, joint, found)
    assert_allclose(after.state[2].matrix, expected, atol=1e-12)
    assert after.degrees == used.sum()
    assert after.nis == pytest.approx(innovations @ np.linalg.solve(density.cov, innovations))
    gates = np.log(2.0 * (NEAR + GATE_STDS * rays.stds)).sum()
    assert after.log_likelihood - gates == pytest.approx(density.logpdf(innovations))
