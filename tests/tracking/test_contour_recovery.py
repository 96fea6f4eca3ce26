"""A track that is wrong is found again; what stood elsewhere is known."""

from dataclasses import replace

import numpy as np
import pytest
from seen_targets import rays_at, scans_seen, start_at, turning
from tracking_cases import CAR

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import world_from_target, wrap_angle
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.background import Background
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour import contour, contour_filter, contour_recovery
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.contour import track
from stixel_cli.tracking.contour.contour_rays import sight_of
from stixel_cli.tracking.contour.contour_recovery import RECENT, clusters_of, is_inconsistent
from stixel_cli.tracking.contour.contour_report import box_size
from stixel_cli.tracking.contour.residual import NODES, Residual

WORDS = ["tracker=contour", "tracker.seen_by=fabricated", "tracker.road_user=fixed"]
TRACKER = compose(WORDS).configuration.tracker
OF_ANY_CLASS = replace(TRACKER, road_user="estimated")
SHAPE, CAR_SHAPE = class_shape("cyclist"), class_shape("car")
KNOWN = replace(CAR, length=4.52, width=1.83)
"""A car of the size of its class."""
CYCLIST = replace(CAR, road_user="cyclist", length=float(SHAPE.size[0]), width=float(SHAPE.size[1]))


def coming(heading, rate, count=20):
    """Poses (count, 3) of a cyclist that comes towards the sensor and turns, degrees and rad/s."""
    headings = np.radians(heading) + 0.1 * rate * np.arange(count)
    steps = 0.3 * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    return np.column_stack([np.array([0.0, 12.0]) + np.cumsum(steps, axis=0), headings])


@pytest.mark.parametrize(
    ("heading", "rate", "error"), [(-90, 0.3, 20), (-105, 0.4, -20), (-75, -0.4, 20)]
)
def test_a_cyclist_seen_from_its_end_is_found_again_on_the_other_side(heading, rate, error):
    poses = coming(heading, rate)
    scans = scans_seen(SHAPE.outline, poses, noise=0.02)
    # The heading is on the other side of the line of sight, and certain.
    covariance = np.diag([0.04, 0.04, 0.002, 0.1, 0.1, 0.002])
    initial = replace(start_at(poses, (0.0, 0.0, np.radians(error))), covariance=covariance)
    result = track(scans, initial, CYCLIST, TRACKER)
    assert np.hypot(*(result.means[10:, :2] - poses[10:, :2]).T).max() < 0.1
    assert np.abs(wrap_angle(result.means[10:, 2] - poses[10:, 2])).max() < np.radians(5)


def test_a_track_that_the_scans_do_not_contradict_is_left_as_it_is(monkeypatch):
    poses = coming(-105, 0.4)
    scans = scans_seen(SHAPE.outline, poses, noise=0.02)
    with_recovery = track(scans, start_at(poses), CYCLIST, TRACKER)
    monkeypatch.setattr(contour_filter, "is_inconsistent", lambda scans: False)
    without = track(scans, start_at(poses), CYCLIST, TRACKER)
    assert with_recovery.means.tobytes() == without.means.tobytes()


def test_a_wrong_detection_is_given_up_again(monkeypatch):
    """A target turned by 70 degrees fits one scan, and the next ones contradict it."""
    poses = turning(20, 4.0, 0.0)
    scans = scans_seen(CAR_SHAPE.outline, poses, noise=0.03)
    detect_again = contour_recovery.detect_again

    def turned(prior, *arguments):
        later, found = prior.log_likelihood != 0.0, detect_again(prior, *arguments)
        for one in found:
            one.state[0][2] += later * np.radians(70)
        return [replace(one, log_likelihood=one.log_likelihood + 15.0 * later) for one in found]

    monkeypatch.setattr(contour_filter, "is_inconsistent", lambda scans: len(scans) == 8)
    monkeypatch.setattr(contour_filter, "detect_again", turned)
    result = track(scans, start_at(poses), KNOWN, TRACKER)
    errors = np.abs(wrap_angle(result.means[:, 2] - poses[:, 2]))
    assert errors[7] > np.radians(45)
    assert errors[9:].max() < np.radians(1)


def test_a_track_is_inconsistent_after_enough_scans_with_a_great_innovation():
    great = [0.02, 2.0, 2.0, 2.0]
    assert [is_inconsistent(great[:k]) for k in range(1, 5)] == [False] * 3 + [True]
    assert not is_inconsistent([2.0] * (RECENT - 1))
    assert not is_inconsistent([0.01, 1.0, 1.0, 1.0])


def test_the_cluster_of_the_points_has_their_neighbours_but_nothing_larger_than_the_class():
    sight = sight_of("cyclist", TRACKER)
    points = np.array([[0.0, 10.0], [0.3, 10.0], [0.6, 10.2], [4.0, 10.0], [0.0, 14.0]])
    for after_gap in (False, True):
        (found,) = clusters_of(rays_at(points, 0.01), np.array([1]), sight, after_gap)
        np.testing.assert_array_equal(found, [0, 1, 2])
    wall = np.column_stack([np.arange(12) * 0.4 - 2.0, np.full(12, 10.0)])
    rays = rays_at(wall, 0.01)
    (found,) = clusters_of(rays, np.array([5, 6]), sight, False)
    np.testing.assert_array_equal(found, [5, 6])
    assert clusters_of(rays, np.array([5, 6]), sight, True) == []
    rays = rays_at(np.concatenate([wall, points[:3] - [6.0, 0.0]]), 0.01)
    (found,) = clusters_of(rays, np.array([5, 6, 13]), sight, True)
    np.testing.assert_array_equal(found, [12, 13, 14])


def test_a_target_is_found_again_that_turned_during_a_gap():
    """For 2 s without points it turned by 86 degrees, while the filter went straight on."""
    poses = turning(50, 4.0, 0.75)
    poses[:15] = poses[15] - (15 - np.arange(15))[:, None] * [*(poses[16] - poses[15])[:2], 0.0]
    scans = scans_seen(CAR_SHAPE.outline, poses, noise=0.03)
    gap, rows = slice(scans.offsets[15], scans.offsets[35]), np.arange(len(scans.points_world))
    result = track(scans.of_rows(np.delete(rows, gap)), start_at(poses), KNOWN, OF_ANY_CLASS)
    assert np.hypot(*(result.means[40:, :2] - poses[40:, :2]).T).max() < 0.3
    assert np.abs(wrap_angle(result.means[40:, 2] - poses[40:, 2])).max() < np.radians(5)


@pytest.mark.parametrize("offset", [(1.0, 1.0, 0.5), (-1.0, 0.5, -0.5), (0.5, -1.0, 0.5)])
def test_a_start_that_is_as_wrong_as_it_states_is_mended(offset):
    poses = turning(30, 4.0, 0.3)
    scans = scans_seen(CAR_SHAPE.outline, poses, noise=0.03)
    initial = replace(start_at(poses, offset), covariance=np.diag([1.0, 1.0, 0.25, 4.0, 4.0, 0.1]))
    result = track(scans, initial, KNOWN, OF_ANY_CLASS)
    assert result.class_replaced is None
    assert np.hypot(*(result.means[3:, :2] - poses[3:, :2]).T).max() < 0.15


def test_what_the_scans_say_of_the_size_fades():
    """Else the error of the shape, the same in all scans, would make the size certain."""
    poses = turning(700, 4.0, 0.3)
    scans = scans_seen(CAR_SHAPE.outline * [1.07, 1.0], poses, noise=0.03)
    scans = scans.of_rows(np.arange(scans.offsets[20]))
    result = track(scans, start_at(poses), KNOWN, TRACKER)
    assert result.means[19, 6] > 0.04
    assert result.means[-1, 6] == pytest.approx(0.0, abs=1e-3)
    assert np.sqrt(result.covariances[-1, 6, 6]) == pytest.approx(KNOWN.length_std, rel=0.01)


def test_the_box_has_room_for_the_limbs():
    """The outline of a pedestrian is that of a mean pose, the box that of all."""
    shape = class_shape("pedestrian")
    state = np.append([0.0, 10.0, 0.3, 1.0, 0.0, 0.1, -0.1], np.zeros(NODES))
    size = shape.size * np.exp([0.1, -0.1])
    assert box_size(state, shape, Residual(shape)) == pytest.approx(size)
    assert (np.ptp(shape.outline, axis=0) < shape.size).all()


@pytest.mark.parametrize(
    ("speed", "opposite"), [(4.0, True), (4.0, False), (-1.0, False), (-2.5, False), (0.0, False)]
)
def test_a_heading_against_a_fast_motion_is_turned_and_no_other(speed, opposite):
    poses = turning(30, abs(speed), 0.1)
    if speed < 0:
        poses = poses[::-1].copy()
    scans = scans_seen(CAR_SHAPE.outline, poses, noise=0.02)
    # The velocity is right, and only the heading may be wrong.
    initial = start_at(poses, (0.1, 0.1, np.pi if opposite else 0.0))
    initial = replace(initial, covariance=np.diag([0.04, 0.04, 0.01, 4.0, 4.0, 0.01]))
    result = track(scans, initial, KNOWN, TRACKER)
    errors = np.abs(wrap_angle(result.means[:, 2] - poses[:, 2]))
    assert errors[15:].max() < 0.2
    assert (errors[0] > 3.0) == opposite


def test_turned_twice_is_the_state_itself():
    random = np.random.default_rng(0)
    root = random.normal(size=(7 + NODES, 7 + NODES))
    joint = JointCovariance(root @ root.T, 3)
    joint.matrix[:7, 7:] = random.normal(size=(7, len(joint.matrix) - 7))
    state = random.normal(size=7 + NODES), root @ root.T, joint
    once = contour_recovery.turned(*state)
    again = contour_recovery.turned(*once)
    assert once[0][3] == -state[0][3] and once[1][0, 3] == -state[1][0, 3]
    for value in (again, state):
        value[0][2] = wrap_angle(value[0][2])
    np.testing.assert_allclose(again[0], state[0])
    np.testing.assert_allclose(again[1], state[1])
    np.testing.assert_allclose(again[2].matrix, joint.matrix)


def test_a_turned_outline_is_the_same_outline_seen_from_its_rear():
    residual = Residual(CAR_SHAPE)
    mean = np.zeros(7 + NODES)
    mean[7] = 0.2
    unit = np.eye(7 + NODES)
    turned, *_ = contour_recovery.turned(mean, unit, JointCovariance(unit, 3))
    plain, own, seen_from_rear = (residual.outline(one)[:, 0] for one in (0.0 * mean, mean, turned))
    assert own.max() - plain.max() == pytest.approx(0.2, abs=0.02)
    assert seen_from_rear.min() - plain.min() == pytest.approx(-0.2, abs=0.02)


PARKED = world_from_target(class_shape("car").outline, np.array([0.0, 8.0, 0.0]))
"""A car 8 m in front of the sensor."""


def test_a_search_goes_on_until_it_is_at_its_optimum():
    """Four iterations ended 13 cm off, and were sure to 4 cm."""
    poses = np.array([[1.5, y, np.pi / 2] for y in (6.5, 7.0)])
    initial = start_at(poses, (-0.46, 0.45, np.radians(-6.0)))
    initial = replace(initial, covariance=np.diag([0.5, 0.5, 0.17, 1.0, 1.0, 0.17]) ** 2)
    found = track(scans_seen(CAR_SHAPE.outline, poses, noise=0.02), initial, KNOWN, TRACKER)
    assert np.hypot(*(found.means[0, :2] - poses[0, :2])) < 0.06


@pytest.mark.parametrize("tracker", [contour, gp_ekf], ids=["contour", "gp_ekf"])
@pytest.mark.parametrize("begins_hidden", [False, True], ids=["seen first", "hidden first"])
@pytest.mark.parametrize("user", ["cyclist", "pedestrian"])
def test_a_target_that_is_hidden_is_not_the_car_that_hides_it(tracker, user, begins_hidden):
    name = tracker.__name__.rpartition(".")[2]
    p = compose(["measurement=fabricated", f"road_user={user}", f"tracker={name}"]).configuration
    # From the left to the right behind the parked car.
    count, speed = {"cyclist": (44, 4.0), "pedestrian": (64, 2.0)}[user]
    xs = 0.1 * speed * (np.arange(count) - 0.5 * count)
    poses = np.column_stack([xs, np.full(count, 16.0), np.zeros(count)])
    poses = poses[len(poses) // 2 - 5 if begins_hidden else 0 :]
    scans = scans_seen(class_shape(user).outline, poses, noise=0.02, before=PARKED)
    track = tracker.track(scans, start_at(poses), p.prior, p.tracker)
    errors = np.hypot(*(track.means[:, :2] - poses[:, :2]).T)
    spread = np.sqrt(np.trace(track.covariances[:, :2, :2], axis1=1, axis2=2))
    assert (np.diff(track.used_offsets)[np.abs(poses[:, 0]) < 2.0] == 0).all()
    assert track.class_replaced is None
    assert (errors < 3.0 * spread + 0.1).all()
    assert errors[-5:].max() < 0.3


def test_what_stood_elsewhere_is_known_and_what_reaches_the_target_is_not():
    near, far = [[0.5, 10.0], [0.7, 10.0]], [[6.0, 12.0], [6.2, 12.0]]
    rays = rays_at(near + far, 0.01)
    background, place = Background(), np.array([0.0, 10.0])
    expected = [False, False, True, True]
    np.testing.assert_array_equal(background.others(rays, place, 1.3), expected)
    np.testing.assert_array_equal(background.others(rays, place, 7.1), expected)
    # The points of one object are neighbours: a part of it is within the target's reach.
    rays = rays_at(np.column_stack([np.linspace(1.0, 6.0, 26), np.full(26, 10.0)]), 0.01)
    assert not Background().others(rays, place, 1.3).any()
