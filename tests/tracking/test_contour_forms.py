"""`contour` where the visible shape was not learned: other sensors, sizes that the user states."""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from seen_targets import rays_at, rows_at, scans_seen, seen, start_at, turning
from tracking_cases import CAR, jacobian

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rectangle, rotation, world_from_target
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.scene.parameters import ROAD_USER_CLASSES
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour import forms
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.class_size import CLASS_SHAPES, class_size
from stixel_cli.tracking.contour.contour import may_be, track
from stixel_cli.tracking.contour.contour_rays import (
    associate,
    sampling_inset,
    sight_of,
)
from stixel_cli.tracking.contour.contour_report import contour_of, reported
from stixel_cli.tracking.contour.contour_update import Hypothesis, Measurement
from stixel_cli.tracking.contour.forms import forms_of
from stixel_cli.tracking.contour.ray_table import first_depths, outline_table
from stixel_cli.tracking.contour.residual import NODES, Residual
from stixel_cli.tracking.track import OTHER, contour_directions

FILE = replace(compose(["tracker=contour"]).configuration.tracker, seen_by="file")
FABRICATED = replace(FILE, seen_by="fabricated")
SHAPE = class_shape("car")
PRIOR = replace(CAR, road_user="car", length=float(SHAPE.size[0]), width=float(SHAPE.size[1]))
STATED = replace(PRIOR, length=4.5, width=1.8)
BOX = rectangle(4.5, 1.8)
TRAPEZIUM = np.array([[2.25, 0.5], [-2.25, 0.9], [-2.25, -0.9], [2.25, -0.5]])


def overlap(result, outline, poses, k=-1):
    estimated = shapely.Polygon(result.contours_world[k]).buffer(0)
    true = shapely.Polygon(world_from_target(outline, poses[k]))
    return estimated.intersection(true).area / estimated.union(true).area


@given(seed=st.integers(0, 2**31))
def test_slopes_by_the_pose_are_those_of_what_is_predicted(seed):
    random = np.random.default_rng(seed)
    angles = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    oval = np.column_stack([2.2 * np.cos(angles), 0.9 * np.sin(angles)])
    state = np.concatenate([random.uniform(-1.0, 1.0, 2), random.uniform(-np.pi, np.pi, 1)])
    state = np.concatenate([state, [3.0, 0.1], random.uniform(-0.2, 0.2, 2)])
    bearing = random.uniform(-np.pi, np.pi)
    sensor = np.array([*(state[:2] - 15.0 * np.array([np.cos(bearing), np.sin(bearing)])), 0.0])
    bearings = bearing + np.linspace(-0.03, 0.03, 7)
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])

    def rows(pose):
        at = np.concatenate([pose, state[3:]])
        return rows_at(at, 1e-4 * np.eye(7), sensor, directions, np.ones(7), outline_table(oval))

    matrix = rows(state[:3]).matrix[:9]
    for column, step in ((0, 0.02), (1, 0.02), (2, 0.01)):
        slopes = -jacobian(lambda pose: rows(pose).errors[:9], state[:3], step)[:, column]
        np.testing.assert_allclose(matrix[:, column], slopes, atol=0.02 * (1 + abs(slopes).max()))


@given(seed=st.integers(0, 2**31))
def test_slopes_of_the_residual_are_those_of_rays_cast_on_the_outline(seed):
    random = np.random.default_rng(seed)
    residual = Residual(SHAPE)
    aspect, size = random.uniform(-np.pi, np.pi), random.uniform(-0.1, 0.1, 2)
    state = np.concatenate([np.zeros(5), size, np.zeros(NODES)])
    ray = -np.array([np.cos(aspect), np.sin(aspect)])
    sensor = -20.0 * ray
    # Even rays that are parallel enough, through the middle half of what the sensor sees.
    scaled = SHAPE.outline * np.exp(size)
    across = scaled @ np.array([-ray[1], ray[0]])
    offsets = np.linspace(0.6 * across.min(), 0.6 * across.max(), 9)
    directions = ray + np.outer(offsets, [-ray[1], ray[0]]) / 20.0
    directions /= np.hypot(*directions.T)[:, None]

    def ranges(nodes):
        outline = residual.outline(np.concatenate([state[:7], nodes]))
        angles = np.arctan2(-directions[:, 1], -directions[:, 0])
        offset = directions[:, 0] * -sensor[1] - directions[:, 1] * -sensor[0]
        depths = first_depths(outline, angles, -offset[:, None])[:, 0]
        return depths + directions @ -sensor

    predicted = ranges(np.zeros(NODES))
    table = outline_table(SHAPE.outline)
    rows = rows_at(state, np.zeros((23, 23)), sensor, directions, predicted, table)
    slopes = rows.matrix[:9, 7:]
    nodes = 0.002 * random.standard_normal(NODES)
    changes = ranges(nodes) - predicted
    # At a corner the ray leaves the side whose normal was taken.
    assert np.median(np.abs(changes - slopes @ nodes)) < 0.05 * np.abs(changes).max() + 1e-4


@given(seed=st.integers(0, 2**31))
def test_reported_centre_is_the_middle_of_the_box_and_linear_in_the_residual(seed):
    random = np.random.default_rng(seed)
    residual = Residual(SHAPE)
    mean = np.concatenate([[3.0, 9.0, 0.7, 2.0, 0.1, 0.05, -0.05], np.zeros(NODES)])
    mean[7:] = 0.05 * random.standard_normal(NODES)
    moved, before = residual.outline(mean), residual.outline(np.r_[mean[:7], np.zeros(NODES)])
    middle = 0.5 * (moved.max(axis=0) + moved.min(axis=0) - before.max(axis=0) - before.min(axis=0))
    root = np.diag(np.r_[np.zeros(7), np.full(NODES, 0.03)])
    state, spread = reported(mean, root @ root, residual)
    np.testing.assert_allclose(state[:2], mean[:2] + rotation(0.7) @ middle)
    slopes = jacobian(lambda m: reported(m, root, residual)[0][:2], mean, 1e-7)
    slopes = slopes[:, 7:]
    np.testing.assert_allclose(spread[:2, :2], 0.03**2 * slopes @ slopes.T, atol=1e-7)


def test_the_contour_is_at_even_angles_from_the_centre_that_is_reported():
    """A residual at the front moves the middle of the box, and the contour's rays with it."""
    residual = Residual(SHAPE)
    mean = np.concatenate([[1.0, 9.0, 0.7, 2.0, 0.0, 0.05, -0.05], np.zeros(NODES)])
    mean[7:10] = 0.3
    covariance = np.eye(len(mean))
    contour, _ = contour_of(mean, covariance, SHAPE, 90, residual)
    centre = reported(mean, covariance, residual)[0][:2]
    assert np.hypot(*(centre - mean[:2])) > 0.1
    rays = contour - centre
    _, even = contour_directions(mean[2:3], 90)
    np.testing.assert_allclose(rays / np.hypot(*rays.T)[:, None], even[0], atol=1e-9)


@pytest.mark.parametrize("prior", [STATED, PRIOR])
@pytest.mark.parametrize(("outline", "least"), [(BOX, 0.95), (TRAPEZIUM, 0.68)])
def test_shapes_that_are_no_drawn_car_are_followed(outline, least, prior):
    poses = turning(25, 4.0, 0.3)
    result = track(scans_seen(outline, poses, noise=0.1), start_at(poses), prior, FABRICATED)
    # Of a single scan, the form is a matter of noise: so all scans count.
    assert np.mean([overlap(result, outline, poses, k) for k in range(len(poses))]) > least
    assert result.class_replaced is None


def test_a_drawn_car_stays_one():
    poses = turning(25, 4.0, 0.3)
    scans, start = scans_seen(SHAPE.outline, poses, noise=0.03), start_at(poses)
    plain, bank = track(scans, start, PRIOR, FABRICATED), track(scans, start, PRIOR, FILE)
    assert overlap(bank, SHAPE.outline, poses) > overlap(plain, SHAPE.outline, poses) - 0.07


@pytest.mark.parametrize("prior", [PRIOR, STATED])
def test_the_forms_depend_on_the_sensor_and_not_on_the_stated_size(prior):
    """A size that is stated is no reason to see another shape."""
    for sensor in ("stixels", "lidar"):
        assert list(forms_of("car", prior, replace(FILE, seen_by=sensor))) == ["class"]
    for tracker in (FABRICATED, FILE):
        assert list(forms_of("car", prior, tracker)) == ["class", "rectangle"]


@pytest.mark.parametrize(
    ("tracker", "road_user", "size", "turn"),
    [(FABRICATED, "pedestrian", (1.3, 0.7), 0.3)]
    + [(FILE, "car", size, turn) for size in ((7.5, 2.4), (6.5, 2.2)) for turn in (0.3, 0.34)],
)
def test_a_target_of_no_class_is_followed_by_the_free_form(tracker, road_user, size, turn):
    """A pushchair and a truck are of no class, and have their own size.

    Once a class that is stretched to a truck ruled the free form out, by its own likelihood.
    """
    of_class = class_size(road_user).mean.tolist()
    prior = replace(PRIOR, road_user=road_user, length=of_class[0], width=of_class[1])
    outline, poses = rectangle(*size), turning(40, 4.0, turn)
    scans, start = scans_seen(outline, poses, noise=0.03), start_at(poses)
    found = track(scans, start, prior, tracker)
    assert found.class_probabilities[OTHER][-1] > 0.99
    np.testing.assert_allclose(np.median(found.box_sizes[10:], axis=0), size, rtol=0.25)
    assert overlap(found, outline, poses) > 0.75
    fixed = track(scans, start, prior, replace(tracker, road_user="fixed"))
    assert fixed.class_probabilities is None


@pytest.mark.parametrize("offset", [(0.3, 0.0, 0.0), (-0.3, 0.3, 0.1)])
def test_a_truck_that_comes_nearer_is_not_what_stood_elsewhere(offset):
    """Its front is 2 m before a car's: out of a car's gate, and once remembered as background."""
    size, (length, width) = (8.4, 2.5), class_size("car").mean.tolist()
    poses = np.column_stack(
        [np.full(20, -2.0), 34.0 - 0.5 * np.arange(20), np.full(20, -np.pi / 2)]
    )
    scans = scans_seen(rectangle(*size), poses, 0.03)
    prior = replace(PRIOR, length=length, width=width)
    errors = track(scans, start_at(poses, offset), prior, FILE).means[:, :2] - poses[:, :2]
    assert np.hypot(*errors.T).max() < 1.0


def test_a_size_that_was_well_seen_is_not_unlearned_as_something_hides_an_end():
    """What hides it is not in the scans: they are cut out around the target."""
    poses = np.column_stack([np.zeros(60), 10.0 + 0.2 * np.arange(60), np.full(60, np.pi / 2)])
    scans = scans_seen(rectangle(4.4, 1.8), poses, noise=0.03)
    shown = 0.06 * (np.repeat(np.arange(60), np.diff(scans.offsets)) - 25) - 0.9
    shown = scans.of_rows(np.flatnonzero(scans.points_world[:, 0] > np.minimum(shown, 0.3)))
    errors = track(shown, start_at(poses), PRIOR, FILE).means[:, :2] - poses[:, :2]
    assert np.hypot(*errors.T).max() < 0.25


def test_a_rectangle_is_the_box():
    box = forms.rectangle(SHAPE).outline
    np.testing.assert_allclose(np.ptp(box, axis=0), SHAPE.size, rtol=2e-2)
    assert shapely.Polygon(box).area == pytest.approx(SHAPE.size.prod(), rel=0.02)


def test_a_stated_size_excludes_the_classes_that_it_does_not_fit():
    cargo_bike = replace(PRIOR, road_user="cyclist", length=2.2, width=0.6)
    fits = [name for name in ROAD_USER_CLASSES if may_be(name, cargo_bike, "estimated")]
    assert fits == ["cyclist"]
    assert all(may_be(name, PRIOR, "estimated") for name in ROAD_USER_CLASSES)
    length, width = class_size("car").mean
    car_like = replace(PRIOR, road_user="cyclist", length=1.02 * length, width=width)
    assert may_be("car", car_like, "estimated")
    assert not may_be("pedestrian", car_like, "estimated")
    # Three deviations of both: a size that the user hardly knows fits more classes.
    unsure = replace(cargo_bike, length_std=0.4, width_std=0.7)
    assert may_be("car", unsure, "estimated")
    unknown = replace(PRIOR, road_user="unknown")
    for choice in ("estimated", "fixed"):
        assert all(may_be(name, unknown, choice) for name in ROAD_USER_CLASSES)


@pytest.mark.parametrize("seen_by", ["stixels", "fabricated", "file"])
def test_a_fixed_class_and_a_stated_one_are_not_replaced(seen_by):
    # A car's outline, with the class and, then, the size of a cyclist.
    poses = turning(15, 4.0, 0.3)
    scans, start = scans_seen(SHAPE.outline, poses, noise=0.05), start_at(poses)
    length, width = class_size("cyclist").mean.tolist()
    cyclist = replace(
        PRIOR, road_user="cyclist", length=length, width=width, length_std=0.03, width_std=0.1
    )
    tracker = replace(FILE, seen_by=seen_by)
    assert track(scans, start, cyclist, tracker).class_replaced[-1]
    fixed = replace(tracker, road_user="fixed")
    assert track(scans, start, cyclist, fixed).class_replaced is None
    stated = replace(cyclist, length=2.2, width=0.6)
    assert track(scans, start, stated, tracker).class_replaced is None


def test_a_given_outline_is_followed_where_the_bank_has_none_like_it(tmp_path):
    # An L, whose notch no other form has.
    notched = [[-2.25, -0.9], [2.25, -0.9], [2.25, 0.0], [0.2, 0.0], [0.2, 0.9], [-2.25, 0.9]]
    file = tmp_path / "outline.csv"
    file.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in notched), encoding="utf-8")
    given = replace(STATED, outline=str(file))
    assert set(forms_of("car", given, FILE)) == {"outline", "class", "rectangle"}
    assert "outline" not in forms_of("cyclist", given, FILE)
    stixels = replace(FILE, seen_by="stixels")
    assert set(forms_of("car", given, stixels)) == {"class", "outline"}
    poses = turning(25, 4.0, 0.3)
    scans, start = scans_seen(np.array(notched), poses, noise=0.05), start_at(poses)
    with_it, without = (track(scans, start, prior, FILE) for prior in (given, STATED))
    assert overlap(with_it, notched, poses) > 0.93
    assert overlap(with_it, notched, poses) > overlap(without, notched, poses) + 0.1


def test_a_class_of_a_file_tracks_as_the_class_that_it_copies(tmp_path):
    file = tmp_path / "copy.json"
    file.write_text(json.dumps(CLASS_SHAPES["car"]), encoding="utf-8")
    poses = turning(20, 4.0, 0.3)
    scans, start = scans_seen(SHAPE.outline, poses, noise=0.03), start_at(poses)
    own = replace(PRIOR, road_user=str(file))
    fixed = replace(FABRICATED, road_user="fixed")
    of_file, ours = track(scans, start, own, FABRICATED), track(scans, start, PRIOR, fixed)
    np.testing.assert_array_equal(of_file.means, ours.means)
    assert of_file.class_replaced is None


def test_ends_are_hidden_beside_a_nearer_point():
    target = [[x, 20.0] for x in np.linspace(-1.0, 1.0, 9)]
    near, far = [[1.1, 12.0]], [[-1.4, 30.0]]
    rays = rays_at(target + near + far)
    # Bearings grow to the left: the first ray is the rightmost.
    assert rays.subset(np.arange(9)).hidden == (False, False)
    rays = rays_at([*target, [1.1, 19.0], *far])
    assert rays.subset(np.arange(9)).hidden == (True, False)
    # 120 m away, a lidar's next ray passes 0.35 m beside the end, and meets what hides the rest.
    rays = rays_at([[x, 120.0] for x in np.linspace(-1.4, 1.4, 9)] + [[0.875, 60.0]])
    assert rays.subset(np.arange(9)).hidden == (True, False)
    # A car's left side passes a pair of cameras by 0.9 m: the right one sees little of it.
    rays = rays_at([[x, 6.0] for x in (1.8, 1.4)] + [[0.9, y] for y in np.linspace(6.0, 10.0, 7)])
    for baseline, lost in ((0.3, False), (0.54, True)):
        pair = replace(rays, field_of_view=FieldOfView(-0.7, 0.7, baseline))
        assert pair.subset(np.arange(9)).hidden == (False, lost)


def test_points_of_a_neighbour_are_not_the_targets():
    poses = np.array([[0.0, 15.0, 0.0]] * 2)
    (own, _), _ = seen(SHAPE.outline, poses)
    wall = np.column_stack([np.linspace(3.6, 9.0, 60), np.full(60, 14.3)])
    rays = rays_at(np.concatenate([own, wall]))
    assert len(np.unique(rays.labels)) >= 2
    _, sight = forms_of("car", PRIOR, FILE)["class"]
    state, covariance = np.array([0.0, 15.0, 0.0, 0.0, 0.0]), np.diag([0.3, 0.3, 0.01, 0.0, 0.0])
    taken = associate(rays, state, covariance, sight)
    assert taken.max() < len(own) and len(taken) > 0.9 * len(own)


def test_a_front_alone_does_not_measure_the_length():
    # Seen from the front, a change of the length moves every ray as a change of the place does.
    state = np.concatenate([[0.0, 15.0, -0.5 * np.pi, 0.0, 0.0, 0.0, 0.0], np.zeros(NODES)])
    rays = rays_at(np.column_stack([np.linspace(-0.6, 0.6, 9), np.full(9, 12.7)]))
    measured = rays.sensor, rays.directions, rays.ranges, outline_table(SHAPE.outline)
    slopes = rows_at(state, 0.01 * np.eye(len(state)), *measured).matrix[:9]
    np.testing.assert_allclose(slopes[:, 5], -0.5 * SHAPE.size[0] * slopes[:, 1], rtol=0.02)


@pytest.mark.parametrize(("y", "least", "most"), [(12.0, 0.0, 0.0), (120.0, 0.1, 0.18)])
def test_far_from_a_lidar_the_ends_are_between_its_rays(y, least, most):
    """Rays 0.17 degrees apart: near the sensor, the visible shape has learned where they end."""
    sight = sight_of("car", replace(FILE, seen_by="lidar"))
    rays = rays_at([[y * bearing, y] for bearing in np.radians(0.17) * np.arange(-4, 5)])
    inset, variance = sampling_inset(rays, sight)
    assert least <= inset <= most
    assert variance == pytest.approx(inset**2 / 3.0)


def test_uneven_points_hardly_show_the_ends_and_a_single_one_does_not():
    even = rays_at([[x, 20.0] for x in np.linspace(-1.0, 1.0, 6)])
    uneven = rays_at([[x, 20.0] for x in (-1.0, -0.95, -0.9, -0.1, 0.95, 1.0)])
    _, sight = forms_of("car", PRIOR, FILE)["class"]
    assert sampling_inset(uneven, sight)[1] > 10.0 * sampling_inset(even, sight)[1]
    state = np.concatenate([[0.0, 22.0, 0.0, 0.0, 0.0, 0.0, 0.0], np.zeros(NODES)])
    covariance = 0.1 * np.eye(len(state))
    joint = JointCovariance(covariance, 0)
    prior, rays = Hypothesis((state, covariance, joint)), rays_at([[-0.8, 21.0], [0.8, 21.0]])
    for count, degrees in ((1, 1), (2, 4)):
        measurement = Measurement(rays, np.arange(count), sight, FILE)
        assert measurement.update(prior).degrees == degrees
