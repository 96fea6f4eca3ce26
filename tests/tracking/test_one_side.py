"""`gp_ekf` of a sensor that sees one side: near side, neighbours, outline of the class, heading."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seen_targets import SENSOR, scans_of, scans_seen, start_at, turning

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rectangle, rotation
from stixel_cli.measurements.scans import FieldOfView, Scans, SharedErrors
from stixel_cli.tracking.contour.class_shape import HEIGHTS, class_shape, height_insets
from stixel_cli.tracking.contour.contour_rays import rays_of
from stixel_cli.tracking.gp_ekf import track
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.loop import Scan
from stixel_cli.tracking.motion import tied_to_velocity
from stixel_cli.tracking.one_side import END_SHARE, OneSide

CAR = rectangle(4.4, 1.8)
POSES = turning(40, 4.0, 0.1, (-6.0, 12.0))


NO_INSETS = np.zeros(9)


def configured(*overrides):
    return compose(["tracker=gp_ekf", "measurement=fabricated", *overrides]).configuration


def followed(scans, *overrides):
    configuration = configured(*overrides)
    return track(scans, start_at(POSES), configuration.prior, configuration.tracker)


def centre_errors(followed_track):
    return np.hypot(*(followed_track.means[:, :2] - POSES[:, :2]).T)


def beside(scans, shift):
    """The scans with a neighbour's points: those of the target, moved by `shift` (2,) m.

    The sensor does not see those behind the target.
    """
    both = []
    for k in range(len(scans)):
        rows = scans.rows(k)
        points, covariances = scans.points_world[rows], scans.covariances_world[rows]
        own, others = (np.arctan2(*(one - SENSOR[:2]).T) for one in (points, points + shift))
        seen = (others < own.min()) | (others > own.max())
        all_covariances = np.concatenate([covariances, covariances[seen]])
        both.append((np.vstack([points, (points + shift)[seen]]), all_covariances))
    return Scans.of_each(scans.times, scans.sensor_poses_world, both)


def test_a_neighbour_behind_a_car_is_left_out():
    scans = scans_seen(CAR, POSES, noise=0.03)
    # Only the uncertain start takes points of the neighbour.
    mixed, alone = beside(scans, [0.3, 2.6]), centre_errors(followed(scans))
    tracks = [followed(mixed, f"tracker.seen_by={by}") for by in ("fabricated", "null")]
    of_side, of_contour = (centre_errors(one)[5:].max() for one in tracks)
    assert of_side < alone.max() + 0.1
    assert of_contour > 2.0 * of_side


def side_of(prior, seen_by="stixels", field_of_view=None):
    """Its contour process, and the side of a sensor with one scan and no points."""
    process = ContourProcess(50, np.pi / 8, 0.1, 0.05, 1e-6)
    scans = replace(scans_of([np.zeros((0, 2))]), field_of_view=field_of_view)
    tracker = configured(f"tracker.seen_by={seen_by}").tracker
    return process, OneSide(prior, tracker, process, scans, 0.01 * np.eye(6))


def row_of_points(side, mean, shift):
    """Rays through nine points on the near side of the contour, moved to the right."""
    points = np.stack([np.linspace(-0.9, 0.9, 9) + shift, np.full(9, 9.8)], axis=-1)
    return side.rays(scan_of(points), mean)[0]


def scan_of(points):
    """The scan of a sensor at the origin that looks along y."""
    ahead = np.array([0.0, 0.0, 0.5 * np.pi])
    return Scan(0, 0.1, points, np.tile(0.01 * np.eye(2), (len(points), 1, 1)), ahead, None)


def across(side):
    """The mean (56,) of a cyclist that rides across, its covariance and the moved points' rays."""
    mean = np.concatenate([[0.0, 10.0, 0.0, 3.0, 0.0, 0.0], side.radii])
    return mean, np.diag(np.concatenate([[0.1, 0.1], np.full(54, 1e-4)]))


def test_a_contour_beside_its_points_moves_to_their_ends():
    """The narrower, the surer: with .2 m, right for a car, a pedestrian was too uncertain."""
    prior = configured("road_user=cyclist").prior
    _, side = side_of(prior, "fabricated")
    mean, covariance = across(side)
    rays = row_of_points(side, mean, 0.0)
    middle = side.between_ends(rays, NO_INSETS, mean, covariance)
    beside = row_of_points(side, mean, 0.4)
    side.matrix = covariance.copy()
    placed = side.between_ends(beside, NO_INSETS, mean, covariance)
    share = 0.1 / (0.1 + (END_SHARE * prior.width) ** 2)
    assert side.matrix[0, 0] == pytest.approx(0.1 * (1.0 - share), rel=0.1)
    assert side.matrix[1, 1] == pytest.approx(0.1, rel=0.01)
    assert (placed - middle)[0] == pytest.approx(0.4 * share, rel=0.1)
    assert placed[1:] == pytest.approx(mean[1:], abs=0.02)
    # A matcher sees the left end farther out.
    left_out = np.where(rays.bearings == rays.bearings.max(), -0.1, 0.0)
    inwards = side.between_ends(rays, left_out, mean, covariance) - middle
    assert inwards[0] == pytest.approx(0.05 * share, rel=0.1)


@pytest.mark.parametrize("hidden", ["border", "nearer object"])
def test_an_end_that_is_not_seen_is_not_used(hidden):
    view = FieldOfView(-0.5, 0.075) if hidden == "border" else None
    _, side = side_of(configured("road_user=cyclist").prior, "fabricated", view)
    mean, covariance = across(side)
    rays = row_of_points(side, mean, 0.0)
    if hidden != "border":
        nearer = [[-0.9, 8.0], [0.9, 8.0]]
        points = np.vstack([rays.points_world, nearer])
        rays = side.rays(scan_of(points), mean)[0]
        used = rays.subset(np.arange(9))
        assert side.between_ends(used, NO_INSETS, mean, covariance) is mean
    else:
        # The right end alone.
        ends = (rays.bearings == rays.bearings.max(), rays.bearings == rays.bearings.min())
        left, right, none = (
            side.between_ends(rays, 0.1 * one, mean, covariance) for one in (*ends, NO_INSETS)
        )
        assert left == pytest.approx(none)
        assert abs(right[0] - none[0]) > 0.02


def test_points_are_those_of_the_side_that_the_sensor_sees():
    """On the far side of a contour that is too near, by its width, they do not fit."""
    _, side = side_of(configured("road_user=car").prior, "fabricated")
    mean, _ = across(side)
    rays, width = row_of_points(side, mean, 0.0), 2.0 * side.radii[12:14].mean()
    far = replace(rays, ranges=rays.ranges + width + (10.0 - width / 2 - 9.8))
    side.matrix[:2, :2] = np.eye(2)
    model = side.linearised(far, mean)
    slopes = (model.gradients * far.directions).sum(axis=1)
    assert (slopes < -0.9).all()
    assert model.residuals / slopes == pytest.approx(width, abs=0.25)


@pytest.mark.parametrize("road_user", ["car", "cyclist", "pedestrian"])
def test_the_radii_start_as_the_outline_of_the_class(road_user):
    prior = configured(f"road_user={road_user}").prior
    process, side = side_of(prior)
    shape = class_shape(road_user)
    corners = side.radii[:, None] * process.basis_directions
    expected = shape.outline * np.array([prior.length, prior.width]) / shape.size
    nearest = np.hypot(*(corners[:, None] - expected[None]).transpose(2, 0, 1)).min(axis=1)
    assert nearest.max() < 0.06


def test_an_unknown_class_has_the_prior_s_shape_and_its_own_points():
    prior = replace(configured().prior, road_user="unknown")
    _, side = side_of(prior)
    points = np.array([[0.5, 9.0], [-0.5, 9.1]])
    mean = np.concatenate([np.zeros(6), side.radii])
    rays, stds = side.rays(scan_of(points), mean)
    assert not stds.any()
    assert rays.points_world == pytest.approx(points)


def test_what_stands_elsewhere_is_remembered_where_it_was_measured():
    """High points move with the place of the target: as moved, they were new ones each time."""
    _, side = side_of(configured().prior, "lidar")
    hedge = np.stack([np.linspace(-1.0, 1.0, 21), np.full(21, 10.0)], axis=-1)
    scan = scan_of(hedge)._replace(heights=np.full(21, 1.2))
    for place in (30.0, 12.0):
        mean = np.concatenate([[0.0, place, -0.5 * np.pi, 0.0, 0.0, 0.0], side.radii])
        rays, _ = side.rays(scan, mean)
        assert rays.others.all()
    # Points do move: those at the sides of the front by 1.6 m.
    assert np.hypot(*(rays.points_world - hedge).T).max() > 0.5


@given(
    heading=st.floats(-3.0, 3.0),
    speed=st.floats(0.0, 20.0),
    direction=st.floats(-3.0, 3.0),
    slip=st.floats(0.01, 10.0),
)
def test_heading_and_velocity_are_drawn_together(heading, speed, direction, slip):
    mean = np.array([0, 0, heading, speed * np.cos(direction), speed * np.sin(direction), 0.0])
    covariance = np.diag([0.1, 0.1, 0.05, 0.5, 0.5, 0.1])
    after, spread, gain, _ = tied_to_velocity(mean, covariance, slip)
    sideways = np.cos(heading) * mean[4] - np.sin(heading) * mean[3]
    assert after == pytest.approx(mean - gain * sideways)

    def across(state):
        # At the heading of the linearisation, and so is its derivative.
        cosine, sine = np.cos(heading), np.sin(heading)
        forward = cosine * mean[3] + sine * mean[4]
        return cosine * state[4] - sine * state[3] - forward * (state[2] - heading)

    assert abs(across(after)) <= abs(across(mean)) + 1e-12
    assert np.linalg.eigvalsh(covariance - spread).min() > -1e-9
    assert np.linalg.eigvalsh(spread).min() > -1e-9


@pytest.mark.parametrize("heading", [0.0, 2.0])
@pytest.mark.parametrize("height", [0.95, 1.35])
def test_a_high_point_moves_straight_outwards_onto_the_face_that_it_is_on(height, heading):
    """Along oblique rays, bonnets got to the side: a car behind a hedge turned away from them."""
    _, side = side_of(configured("road_user=car").prior, "lidar")
    mean = np.concatenate([[20.0, 20.0, heading, 0.0, 0.0, 0.0], side.radii])
    turn, half = rotation(heading), side.radii[[0, 12]]
    _, front, sides = height_insets("car")
    (ends, ends_std), (beside, side_std) = (
        [np.interp(height, HEIGHTS, one) for one in face] for face in (front, sides)
    )
    faces = half - [ends, beside]
    points = np.array([[faces[0], 0.3], [faces[0], -0.4], [-0.5, faces[1]], [-1.0, faces[1]]])
    covariances = np.tile(1e-4 * np.eye(2), (4, 1, 1))
    sensor = np.append(mean[:2] + turn @ [15.0, 15.0], 0.0)
    rays = rays_of(mean[:2] + points @ turn.T, covariances, sensor, None, np.full(4, height))
    moves, shared = side._outwards(rays, mean)
    straight = np.repeat(np.diag([ends, beside]), 2, axis=0)
    np.testing.assert_allclose(moves @ turn, straight, atol=0.06)
    inwards = -np.diag([ends_std, side_std])
    np.testing.assert_allclose(turn.T @ shared, np.tile(inwards, (4, 1, 1)), atol=1e-9)


def test_the_radii_are_as_uncertain_as_sizes_of_the_class_and_the_report_has_its_shapes():
    """The visible shape has the shapes, too: counted twice, a NIS was .44."""
    prior = configured().prior
    _, side = side_of(prior)
    front = side.radii_covariance[0, 0] ** 0.5
    assert front == pytest.approx(0.5 * prior.length * prior.length_std, rel=0.1)
    # Front and rear grow together: the size is that of the whole class.
    assert side.radii_covariance[0, 25] > 0.9 * front**2
    assert np.linalg.matrix_rank(side.radii_covariance, tol=1e-6) == 2
    walker = side_of(configured("road_user=pedestrian").prior)[1].shape_covariance
    assert walker.diagonal().max() > 0.02**2
    # Between the basis angles, a cyclist's wheels and handlebars.
    rider = side_of(configured("road_user=cyclist").prior)[1]
    assert rider.shape_covariance.diagonal().min() > 0.99 * rider.roughness**2


def test_an_error_that_all_scans_share_stays_in_the_stated_covariance():
    scans = scans_seen(CAR, POSES, noise=0.03)
    uncertain = replace(scans, shared_errors=SharedErrors(range_bias=0.3))
    alone, shared = followed(scans), followed(uncertain)
    np.testing.assert_array_equal(shared.means, alone.means)
    away = POSES[-1, :2] / np.hypot(*POSES[-1, :2])
    variances = [away @ one.covariances[-1, :2, :2] @ away for one in (alone, shared)]
    assert variances[0] < 0.15**2
    assert variances[1] - variances[0] > 0.2**2


def test_the_stated_covariance_is_that_of_the_errors():
    """Over noises: mean NEES / 2 and NIS near 1."""
    nees, nis = [], []
    for seed in range(1000, 1006):
        result = followed(scans_seen(CAR, POSES, noise=0.05, seed=seed))
        errors = result.means[:, :2] - POSES[:, :2]
        scaled = np.linalg.solve(result.covariances[:, :2, :2], errors[..., None])[..., 0]
        nees.append((errors * scaled).sum(axis=1).mean() / 2.0)
        nis.append(np.nanmean(result.normalised_nis))
    assert 0.3 < np.mean(nees) < 2.0
    assert 0.5 < np.mean(nis) < 1.5
