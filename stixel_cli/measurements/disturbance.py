"""Add clutter and dropouts to the scans of any sensor."""

from dataclasses import replace

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans, points_along
from stixel_cli.randomness import generator

CLUTTER_HEIGHT = 0.5
"""Of a clutter point above the road, m."""


def disturb_scans(
    scans: Scans,
    dropout: tuple[float, float] | None,
    clutter_rate: float,
    range_max: float | None,
    seed: int,
) -> Scans:
    """The scans with clutter points after their own, and empty during the dropout.

    The number of clutter points of a scan is Poisson distributed; their places are uniform over the
    area of field of view and range. Where the field of view is unknown, its borders are the
    outermost points of all scans. A clutter point has the variances, along and across its ray, of
    the measured point of any scan whose range is nearest, the variance across scaled to its range;
    so scans without any point have no clutter.

    Args:
        scans: of any sensor.
        dropout, clutter_rate: see `Disturbance`.
        range_max: m; None: the range of the farthest point of all scans.
        seed: of the random numbers, drawn from (seed, "clutter", k).
    """
    elapsed = scans.times - scans.times[0]
    hidden = np.zeros(len(scans), bool)
    if dropout is not None:
        # Times are multiples of the sample time, up to rounding.
        hidden = (elapsed >= dropout[0] - 1e-9) & (elapsed <= dropout[1] + 1e-9)
    each, heights = [], []
    for k, (points, covariances) in enumerate(_clutter(scans, clutter_rate, range_max, seed)):
        rows = scans.rows(k)
        if hidden[k]:
            rows, points, covariances = slice(0), points[:0], covariances[:0]
        points = np.concatenate([scans.points_world[rows], points])
        each.append((points, np.concatenate([scans.covariances_world[rows], covariances])))
        if scans.heights is not None:
            of_clutter = np.full(len(covariances), CLUTTER_HEIGHT)
            heights.append(np.append(scans.heights[rows], of_clutter))
    shared = scans.field_of_view, scans.shared_errors, heights or None
    found = Scans.of_each(scans.times, scans.sensor_poses_world, each, *shared)
    return replace(found, epoch=scans.epoch)


def _clutter(
    scans: Scans, rate: float, range_max: float | None, seed: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points (n, 2) m and covariances (n, 2, 2) m² of the clutter of each scan, in the world."""
    if rate == 0.0 or len(scans.points_world) == 0:
        return [(np.zeros((0, 2)), np.zeros((0, 2, 2)))] * len(scans)
    poses = np.repeat(scans.sensor_poses_world, np.diff(scans.offsets), axis=0)
    offsets = scans.points_world - poses[:, :2]
    ranges = np.maximum(np.hypot(offsets[:, 0], offsets[:, 1]), 1e-9)
    along = offsets / ranges[:, None]
    along_variances = np.einsum("ni,nij,nj->n", along, scans.covariances_world, along)
    across = np.trace(scans.covariances_world, axis1=1, axis2=2) - along_variances
    if scans.field_of_view is None:
        bearings = wrap_angle(np.arctan2(offsets[:, 1], offsets[:, 0]) - poses[:, 2])
        borders = bearings.min(), bearings.max()
    else:
        borders = scans.field_of_view.right, scans.field_of_view.left
    farthest = float(ranges.max()) if range_max is None else range_max
    order = np.argsort(ranges, kind="stable")
    middles = 0.5 * (ranges[order][1:] + ranges[order][:-1])
    found = []
    for k, pose in enumerate(scans.sensor_poses_world):
        random = generator(seed, "clutter", k)
        count = random.poisson(rate)
        angles = random.uniform(*borders, count)
        # Even over the area, so the range is a square root.
        distances = farthest * np.sqrt(random.random(count))
        like = order[np.searchsorted(middles, distances)]
        across_variances = across[like] * (distances / ranges[like]) ** 2
        variances = along_variances[like], across_variances
        found.append(points_along(pose, angles, distances, *variances))
    return found
