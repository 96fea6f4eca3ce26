"""The places that a cluster has left: free if it moves, occupied if it is a part of a structure.

A fence at a grazing angle has a cluster that slides along it: at the edge of the view, in a gap
between nearer things, or where stereo sees enough of it. Its speed tells nothing, since a car that
is followed has it, too. But the fence is still where the cluster was.
"""

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.clusters import GAP
from stixel_cli.measurements.scans import Scans

AWAY = 1.0
"""A cluster has left a place that is so far from all its points, m."""

ACROSS = 0.5
"""A ray passes a place at this distance, m."""

SHADOW = 1.0
"""Behind an object so far from its points, across the rays, m, points at its edges have a depth
between that of the object and that of the background."""


def free_and_occupied(
    scans: Scans, k: int, own: np.ndarray, before: np.ndarray, length: float
) -> tuple[int, int]:
    """How many places that a cluster had before scan `k` are seen to be free, and occupied, in it.

    A place is free if rays pass it: no point is near it, or nearer to the sensor in its direction.
    It is occupied by a point at its range that is not of the cluster. A place that is hidden, or
    outside of the field of view, is neither.

    Args:
        scans: of any sensor.
        k: the scan.
        own: rows (n,) of the cluster in it.
        before: rows (m,) of the cluster in earlier scans.
        length: of an object, m: nearer to the cluster, a point may be of the object itself.
    """
    rows, pose = np.arange(scans.rows(k).start, scans.rows(k).stop), scans.sensor_poses_world[k]
    apart = scans.points_world[before, None] - scans.points_world[own]
    left_by = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)
    before, left_by = before[left_by > AWAY], left_by[left_by > AWAY]
    places, points = (_seen_from(scans, pose, these) for these in (before, rows))
    view = scans.field_of_view
    inside = np.ones(len(before), bool)
    if view is not None:
        inside = (places[1] > view.right) & (places[1] < view.left)
    (ranges, bearings, variances), left_by = places[:, inside], left_by[inside]
    behind = points[0] - ranges[:, None]
    across = np.abs(wrap_angle(points[1] - bearings[:, None])) * ranges[:, None]
    error = np.sqrt(GAP**2 + 4.0 * (points[2] + variances[:, None]))
    is_own = np.isin(rows, own)
    free = ~np.any((across < ACROSS) & (behind < error), axis=1)
    shaded = np.any((across < SHADOW) & (behind < -error) & is_own, axis=1)
    at_place = np.any((across < ACROSS) & (np.abs(behind) < error) & ~is_own, axis=1)
    return int(free.sum()), int(np.sum(at_place & ~shaded & (left_by > length)))


def _seen_from(scans: Scans, pose_world: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Range (m), bearing from the heading (rad), variance along the ray (m²): (3, n), of rows."""
    away = scans.points_world[rows] - pose_world[:2]
    ranges = np.hypot(*away.T)
    along = away / np.maximum(ranges, 1e-9)[:, None]
    variances = np.einsum("ni,nij,nj->n", along, scans.covariances_world[rows], along)
    bearings = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - pose_world[2])
    return np.stack([ranges, bearings, variances])
