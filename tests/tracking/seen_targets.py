"""Scans of a moving outline as one sensor sees it."""

from dataclasses import replace

import numpy as np
from tracking_cases import FIELD, scans_of

from stixel_cli.geometry.pose import rotation, world_from_target
from stixel_cli.measurements.rays import first_crossings, spread_rays
from stixel_cli.measurements.scans import Scans, points_along
from stixel_cli.tracking.contour import ray_kernels
from stixel_cli.tracking.contour.contour_rays import Rays, rays_of
from stixel_cli.tracking.contour.residual import NODES
from stixel_cli.tracking.track import InitialState

SENSOR = np.array([0.0, 0.0, np.pi / 2])


def seen(outline, poses, noise=0.0, seed=0, rays=240, before=None):
    """Points and covariances of an `outline` (M, 2) m at `poses` (K, 3), seen from `SENSOR`.

    An object with the outline `before` (N, 2) m, in the world, has points too, and may hide it.
    """
    random = np.random.default_rng(seed)
    fan = spread_rays(rays, (FIELD.right, FIELD.left), False)
    points, covariances = [], []
    for pose in poses:
        nearest = np.full(rays, np.inf)
        for world in [world_from_target(outline, pose), *([] if before is None else [before])]:
            hit, ranges = first_crossings((world - SENSOR[:2]) @ rotation(SENSOR[2]), fan)
            nearest[hit] = np.minimum(nearest[hit], ranges)
        hit = np.flatnonzero(np.isfinite(nearest))
        ranges = nearest[hit]
        ranges = ranges + noise * random.standard_normal(len(ranges))
        across = (ranges * fan.steps[hit]) ** 2 / 12.0
        pair = points_along(SENSOR, fan.angles[hit], ranges, np.full(len(hit), 0.05**2), across)
        points.append(pair[0])
        covariances.append(pair[1])
    return points, covariances


def scans_seen(*arguments, **options) -> Scans:
    """`seen` as scans; the same arguments."""
    return scans_of(*seen(*arguments, **options))


def rays_at(points, std=0.1) -> Rays:
    """Rays from `SENSOR` to points (n, 2) m, each with the variance `std`² in all directions."""
    covariances = np.tile(std**2 * np.eye(2), (len(points), 1, 1))
    return rays_of(np.array(points, float), covariances, SENSOR)


def start_at(poses, offset=(0.15, -0.1, 0.05)) -> InitialState:
    """An initial state one sample before `poses`, off by `offset`."""
    rates = (poses[1] - poses[0]) / 0.1
    mean = np.concatenate([poses[0] - 0.1 * rates + offset, rates])
    return InitialState(mean, np.diag([0.04, 0.04, 0.01, 0.1, 0.1, 0.01]))


def turning(count, speed, rate, place=(1.0, 13.0)):
    """Poses (count, 3) of a road user that drives a circle."""
    headings = 0.3 + rate * 0.1 * np.arange(count)
    steps = 0.1 * speed * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    return np.column_stack([np.array(place) + np.cumsum(steps, axis=0), headings])


def moved(scans, initial, angle, shift):
    """The scans and the initial state in a world that is turned by `angle` rad, then shifted."""
    turn, poses = rotation(angle), scans.sensor_poses_world
    whole = np.eye(6)
    whole[:2, :2] = whole[3:5, 3:5] = turn
    at = np.column_stack([poses[:, :2] @ turn.T + shift, poses[:, 2] + angle])
    points, spread = scans.points_world @ turn.T + shift, turn @ scans.covariances_world @ turn.T
    turned = replace(scans, sensor_poses_world=at, points_world=points, covariances_world=spread)
    mean = whole @ initial.mean + np.array([*shift, angle, 0.0, 0.0, 0.0])
    return turned, InitialState(mean, whole @ initial.covariance @ whole.T)


def rows_at(state, covariance, sensor, directions, ranges, table):
    """The rows of rays from a `sensor` in ascending bearings; all variances are 1, insets 0."""
    count = len(ranges)
    one = np.ones(count)
    of_scan = sensor, directions, ranges, np.array([0, count - 1]), 0.0, np.ones(count + 2, bool)
    variances = np.ones(count + 2), one, one
    measured = ray_kernels.Measured(*of_scan, *variances, 1.0, 1.0)
    whole, spread = np.zeros(7 + NODES), np.zeros((7 + NODES, 7 + NODES))
    whole[: len(state)], spread[: len(state), : len(state)] = state, covariance
    return ray_kernels.rows_at(whole, spread, measured, table.arrays)
