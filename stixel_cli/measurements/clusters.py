"""Clusters of points that are near each other in depth and bearing."""

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans

GAP = 0.7
"""Stixels of one object have a neighbour this near, m, if nothing is uncertain."""

LARGEST = 1.6
"""A cluster of a road user is at most this many times the class's diagonal long. Where clusters are
followed, with 1 a car is not found, with 2.2 there are two false tracks."""

LEAST = 2
"""Stixels of an object."""

RAYS_APART = 2.0
"""Points of one object are this many distances of neighbouring rays apart: a sparse lidar's rays
are far apart on a distant target, and farther where they graze it. With 1, three of ten have no
start."""


def clusters_of(scans: Scans, k: int, longest: float) -> list[np.ndarray]:
    """Rows (n,) of the scans' arrays of each cluster of scan k that is at most `longest` m long."""
    rows = scans.rows(k)
    offsets = scans.points_world[rows] - scans.sensor_poses_world[k, :2]
    apart = np.diff(np.sort(np.arctan2(offsets[:, 1], offsets[:, 0])))
    ranges = np.hypot(*offsets.T)
    gap = RAYS_APART * np.median(apart) * np.median(ranges) if len(apart) else 0.0
    labels = cluster(offsets, scans.covariances_world[rows], max(gap, GAP))
    found = [np.flatnonzero(labels == one) for one in range(labels.max(initial=-1) + 1)]
    return [own + rows.start for own in found if np.hypot(*np.ptp(offsets[own], axis=0)) <= longest]


def cluster(
    points_ego: np.ndarray, covariances_ego: np.ndarray, gap: float = GAP, least: int = LEAST
) -> np.ndarray:
    """The cluster (n,) of each point, from 0; -1 without a cluster.

    Connected neighbours, `least` or more. With 1 or 2 they are the clusters of DBSCAN with the
    radius 1 (Ester, Kriegel, Sander, Xu 1996). The other arguments are those of `distances`.
    """
    if not len(points_ego):
        return np.zeros(0, np.int64)
    from scipy.sparse.csgraph import connected_components

    near = distances(points_ego, covariances_ego, gap) <= 1.0
    _, labels = connected_components(near, directed=False)
    large = np.bincount(labels) >= least
    return np.where(large, np.cumsum(large) - 1, -1)[labels]


def distances(points_ego: np.ndarray, covariances_ego: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Distances (n, n) without unit between points: up to 1, they are neighbours on one object.

    Along the ray a step counts in units of `gap` and the standard deviation of the difference,
    across it, where bearings are exact, in units of `gap`. So far objects, whose depth is
    uncertain, do not break up, and those next to each other do not merge. Points (n, 2) m are from
    the sensor, covariances (n, 2, 2) in m², `gap` in m.
    """
    ranges = np.hypot(*points_ego.T)
    bearings = np.arctan2(points_ego[:, 1], points_ego[:, 0])
    along = points_ego / np.maximum(ranges, 1e-9)[:, None]
    variances = np.einsum("ni,nij,nj->n", along, covariances_ego, along)
    steps = (ranges[:, None] - ranges) ** 2 / (gap**2 + variances[:, None] + variances)
    across = wrap_angle(bearings[:, None] - bearings) * np.minimum(ranges[:, None], ranges)
    return np.sqrt(steps + (across / gap) ** 2)
