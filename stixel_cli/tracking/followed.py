"""Clusters that are followed over the scans.

Bar-Shalom, Li 1995, *Multitarget-Multisensor Tracking*: constant velocity, chi-square gates,
global nearest neighbour, begin by M of N.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, ego_from_world, rotate_covariances
from stixel_cli.measurements.clusters import GAP, cluster
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.kalman import update
from stixel_cli.tracking.motion import intervals, predict_place

RAYS_APART, WIDEST = 2.0, 3.0
"""Points of one object are this many distances of neighbouring rays apart, at most `WIDEST` m: a
sparse lidar's rays are far apart on a distant target, and farther where they graze it."""

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

ACCELERATION = 3.0
"""Process noise, m/s^1.5."""

LARGEST = 1.6
"""A cluster of a road user is at most this many times the class's diagonal long."""

UNKNOWN_SPEED = 10.0
"""Standard deviation of a velocity that the scans do not show, m/s."""


@dataclass
class OpenTrack:
    """A cluster over time, while it is followed."""

    rows: dict[int, np.ndarray]
    """Of each scan that has the cluster, ascending, the rows (n_k,) of the scans' arrays."""
    mean: np.ndarray
    covariance: np.ndarray
    """`mean`, `covariance`: (4,), (4, 4) of place and velocity, m and m/s, at the last scan."""
    missed: int = 0
    """Scans in a row without the cluster."""
    begun: bool = False
    """Whether it has passed M of N."""
    ended: bool = False
    """Whether it gets no more clusters."""
    number: int | None = None
    """Of the road user, where tracks are numbered."""

    def at(self, ks: Sequence[int]) -> "OpenTrack":
        """The track in the scans `ks`."""
        return replace(self, rows={k: self.rows[k] for k in ks})

    def within(self, scans: Scans, first: int, duration: float) -> "OpenTrack":
        """The track in scan `first` and those of the next `duration` s."""
        until = scans.times[first] + duration + 1e-9
        return self.at([k for k in self.rows if k >= first and scans.times[k] <= until])

    def velocity(self, scans: Scans) -> tuple[np.ndarray, float]:
        """The velocity (2,) m/s of the middles of its points, and its error, see `line`."""
        places = [scans.points_world[rows].mean(axis=0) for rows in self.rows.values()]
        return line(scans.times[[*self.rows]], np.array(places))[1:]


def clusters_of(scans: Scans, k: int, longest: float) -> list[np.ndarray]:
    """Rows (n,) of the scans' arrays of each cluster of scan k that is at most `longest` m long."""
    rows, pose = scans.rows(k), scans.sensor_poses_world[k]
    points = ego_from_world(scans.points_world[rows], pose)
    covariances = rotate_covariances(scans.covariances_world[rows], STRAIGHT_AHEAD - pose[2])
    gap = GAP
    if len(points) > 1:
        apart = np.median(np.diff(np.sort(np.arctan2(points[:, 0], points[:, 1]))))
        gap = max(GAP, min(RAYS_APART * apart * np.median(np.hypot(*points.T)), WIDEST))
    labels = cluster(points, covariances, gap)
    found = [np.flatnonzero(labels == one) for one in range(labels.max(initial=-1) + 1)]
    return [own + rows.start for own in found if np.hypot(*np.ptp(points[own], axis=0)) <= longest]


def follow(scans: Scans, sizes: np.ndarray) -> list[OpenTrack]:
    """All tracks, begun or not, in the order of their first scans; `sizes` as of `follow_scan`."""
    tracks: list[OpenTrack] = []
    for k in range(len(scans)):
        follow_scan(tracks, scans, k, sizes)
    return tracks


def follow_scan(tracks: list[OpenTrack], scans: Scans, k: int, sizes: np.ndarray) -> None:
    """Change `tracks` by scan k; add those that it begins.

    `sizes` (n, 2) m are those of the class, or of each possible class.
    """
    clusters = clusters_of(scans, k, LARGEST * diagonal(sizes))
    places = [scans.points_world[rows].mean(axis=0) for rows in clusters]
    noise = [
        PLACE**2 * np.eye(2) + scans.covariances_world[rows].mean(axis=0) / len(rows)
        for rows in clusters
    ]
    alive, interval = [one for one in tracks if not one.ended], intervals(scans.times)[k]
    for one in alive:
        one.mean, one.covariance = predict_place(one.mean, one.covariance, interval, ACCELERATION)
    pairs = assign([(one.mean, one.covariance) for one in alive], places, noise)
    for i, one in enumerate(alive):
        j = pairs.get(i)
        if j is None:
            one.missed += 1
            too_late = not one.begun and k - min(one.rows) + 1 >= WINDOW
            one.ended = too_late or one.missed >= END
        else:
            innovation = places[j] - one.mean[:2]
            one.mean, one.covariance, _ = update(one.mean, one.covariance, innovation, noise[j])
            one.rows[k] = clusters[j]
            one.begun |= sum(scan > k - WINDOW for scan in one.rows) >= BEGIN
            one.missed = 0
    for j in {*range(len(clusters))} - {*pairs.values()}:
        covariance = np.diag([0.0, 0.0, UNKNOWN_SPEED**2, UNKNOWN_SPEED**2])
        covariance[:2, :2] = noise[j]
        tracks.append(OpenTrack({k: clusters[j]}, np.array([*places[j], 0.0, 0.0]), covariance))


def diagonal(sizes: np.ndarray) -> float:
    """The longest diagonal, m, of the `sizes` (n, 2) m."""
    return float(np.hypot(*sizes.T).max())


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


def line(times: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Place (2,) at the mean of `times` (n,), velocity (2,) of a straight line, and its error.

    The error is the standard error of the velocity along each axis, m/s; `inf` of one or two scans.
    """
    offsets, centre, free = times - times.mean(), places.mean(axis=0), 2 * (len(times) - 2)
    velocity = offsets @ places / max(float(offsets @ offsets), 1e-12)
    if free <= 0:
        return centre, velocity, np.inf
    residuals = places - centre - offsets[:, None] * velocity
    return centre, velocity, float(np.sqrt(np.sum(residuals**2) / free / (offsets @ offsets)))
