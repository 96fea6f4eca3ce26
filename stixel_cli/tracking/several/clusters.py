"""Road users that move: the clusters of the scans, each scan's assigned to tracks at once.

Bar-Shalom, Li 1995, *Multitarget-Multisensor Tracking*: constant velocity, chi-square gates,
global nearest neighbour, begin by M of N.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, ego_from_world, rotate_covariances
from stixel_cli.measurements.clusters import cluster
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.centre import predict, update
from stixel_cli.tracking.motion import intervals

GATE = 9.21
"""Squared distance of a cluster to a prediction: 99 % of a chi-square with two degrees."""

BEGIN, WINDOW = 3, 4
"""A track begins if so many of so many scans in a row have its cluster."""

END = 5
"""A track ends after so many scans in a row without its cluster."""

PAIR = 1e3
"""More than the costs of any assignment."""

PLACE = 0.3
"""Standard deviation of a cluster's centroid from scan to scan, m: another part is seen."""

SPEED = 10.0
"""Standard deviation of a new track's velocity along each axis, m/s."""

ACCELERATION = 3.0
"""Process noise, m/s^1.5."""


@dataclass
class OpenTrack:
    """A cluster over time, while it is followed.

    Attributes:
        scans: those that have the cluster, ascending.
        rows: for each of them the rows (n_k,) of the scans' arrays.
        mean, covariance: (4,), (4, 4) of place and velocity, m and m/s, at the last scan.
        missed: scans in a row without the cluster.
        begun: whether it has passed M of N.
        ended: whether it gets no more clusters.
        number: of the road user, where tracks are numbered.
    """

    scans: list[int]
    rows: list[np.ndarray]
    mean: np.ndarray
    covariance: np.ndarray
    missed: int = 0
    begun: bool = False
    ended: bool = False
    number: int | None = None


def clusters_of(scans: Scans, k: int, longest: float) -> list[np.ndarray]:
    """Rows (n,) of the scans' arrays of each cluster of scan k that is at most `longest` m long."""
    rows, pose = scans.rows(k), scans.sensor_poses_world[k]
    points = ego_from_world(scans.points_world[rows], pose)
    covariances = rotate_covariances(scans.covariances_world[rows], STRAIGHT_AHEAD - pose[2])
    labels = cluster(points, covariances)
    found = [np.flatnonzero(labels == one) for one in range(labels.max(initial=-1) + 1)]
    return [own + rows.start for own in found if np.hypot(*np.ptp(points[own], axis=0)) <= longest]


def follow(scans: Scans, longest: float) -> list[OpenTrack]:
    """All tracks of clusters at most `longest` m long, in the order of their first scans."""
    tracks: list[OpenTrack] = []
    for k, interval in enumerate(intervals(scans.times)):
        follow_scan(tracks, scans, k, interval, longest)
    return [one for one in tracks if one.begun]


def follow_scan(
    tracks: list[OpenTrack], scans: Scans, k: int, interval: float, longest: float
) -> None:
    """Change `tracks` by scan k, an `interval` in s after the one before; add those that it begins.

    Clusters are at most `longest` m long.
    """
    clusters = clusters_of(scans, k, longest)
    places = [scans.points_world[rows].mean(axis=0) for rows in clusters]
    noise = [
        PLACE**2 * np.eye(2) + scans.covariances_world[rows].mean(axis=0) / len(rows)
        for rows in clusters
    ]
    alive = [one for one in tracks if not one.ended]
    for one in alive:
        one.mean, one.covariance = predict(one.mean, one.covariance, interval, ACCELERATION)
    pairs = assign([(one.mean, one.covariance) for one in alive], places, noise)
    for i, one in enumerate(alive):
        j = pairs.get(i)
        if j is None:
            _miss(one, k)
        else:
            innovation = places[j] - one.mean[:2]
            one.mean, one.covariance, _ = update(one.mean, one.covariance, innovation, noise[j])
            one.scans.append(k)
            one.rows.append(clusters[j])
            recent = sum(scan > k - WINDOW for scan in one.scans)
            one.begun |= recent >= BEGIN
            one.missed = 0
    taken = set(pairs.values())
    for j, rows in enumerate(clusters):
        if j not in taken:
            covariance = np.diag([0.0, 0.0, SPEED**2, SPEED**2])
            covariance[:2, :2] = noise[j]
            mean = np.array([*places[j], 0.0, 0.0])
            tracks.append(OpenTrack([k], [rows], mean, covariance))


def assign(
    states: Sequence[tuple[np.ndarray, np.ndarray]],
    places: Sequence[np.ndarray],
    noise: Sequence[np.ndarray],
) -> dict[int, int]:
    """The place of each state, by index: the global nearest neighbours inside the gates.

    The most pairs, and of these the least sum of costs: the squared Mahalanobis distance and
    log |S|, as in the density, so that an uncertain state does not win.

    Args:
        states: means (4,) and covariances (4, 4), predicted.
        places: (2,) m, and noise (2, 2) m², of each cluster.
    """
    if not states or not places:
        return {}
    from scipy.optimize import linear_sum_assignment

    costs = np.zeros((len(states), len(places)))
    for row, (mean, covariance) in zip(costs, states, strict=True):
        spread = covariance[:2, :2] + np.array(noise)
        away = np.array(places) - mean[:2]
        squared = np.sum(away * np.linalg.solve(spread, away[..., None])[..., 0], axis=1)
        near = squared <= GATE
        row[near] = squared[near] + np.log(np.linalg.det(spread[near])) - PAIR
    found = zip(*linear_sum_assignment(costs), strict=True)
    return {int(i): int(j) for i, j in found if costs[i, j] < 0.0}


def _miss(one: OpenTrack, k: int) -> None:
    """Count a scan without the cluster; the track ends if it has not begun and cannot any more."""
    one.missed += 1
    late = not one.begun and k - one.scans[0] + 1 >= WINDOW
    one.ended = late or one.missed >= END
