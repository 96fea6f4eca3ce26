"""Road users that move: the clusters of the scans, each scan's assigned to tracks at once.

Bar-Shalom, Li 1995, *Multitarget-Multisensor Tracking*: constant velocity, chi-square gates,
global nearest neighbour, begin by M of N.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, ego_from_world, rotate_covariances, rotation
from stixel_cli.measurements.clusters import GAP, cluster
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.centre import predict, update
from stixel_cli.tracking.contour.class_size import possible_sizes
from stixel_cli.tracking.followed import line, state_of
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.several.found import LEAST_SCANS, FoundTrack, least_speed
from stixel_cli.tracking.several.places_left import free_and_occupied
from stixel_cli.tracking.track import InitialState

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

SPEED = 10.0
"""Standard deviation of a new track's velocity along each axis, m/s."""

ACCELERATION = 3.0
"""Process noise, m/s^1.5."""


CERTAIN = 12.0
"""A road user's speed is so many times the speed's standard error."""

RECENT = 20
"""Speed and places left are those of so many of the last scans that have the cluster."""

FREE = 4.0
"""Of the places that a road user has left, so many times as many are free as are occupied."""

LARGEST = 1.6
"""A cluster of a road user is at most this many times the class's diagonal long."""

TOGETHER = 1.5
"""All clusters of one road user are in a box this many times as large as that of its class."""

USED = 1.0
"""Its initial state comes from so many of its first seconds, of scans until it is confirmed."""


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

    def within(self, scans: Scans, first: int, duration: float) -> "OpenTrack":
        """The track in scan `first` and those of the next `duration` s."""
        start, until = self.scans.index(first), scans.times[first] + duration + 1e-9
        count = int(np.sum(scans.times[self.scans[start:]] <= until))
        chosen = slice(start, start + count)
        return replace(self, scans=self.scans[chosen], rows=self.rows[chosen])


def find_tracks(scans: Scans, prior: PriorShape, std: tuple[float, ...]) -> tuple[FoundTrack, ...]:
    """The road users of the class that move, in the order of their first scans.

    Args:
        scans: of any sensor.
        prior: of the class.
        std: (6,) of the initial states, see `followed.state_of`.
    """
    sizes = possible_sizes(prior)
    length = float(np.hypot(*sizes.T).max())
    kept: list[tuple[OpenTrack, int]] = []
    for one in follow(scans, LARGEST * length):
        k = confirmed(scans, one, length) if one.begun else None
        if k is None:
            continue
        same = (i for i, (other, _) in enumerate(kept) if are_one(scans, other, one, sizes))
        i = next(same, None)
        if i is None:
            kept.append((one, k))
        else:
            kept[i] = _joined(kept[i][0], one), min(k, kept[i][1])
    return tuple(found_track(scans, one, k, sizes, std) for one, k in kept)


def are_one(scans: Scans, one: OpenTrack, other: OpenTrack, sizes: np.ndarray) -> bool:
    """Whether two tracks are of one road user: in their common scans both fit into its box.

    The box is along the last velocity of the first track. `sizes` (n, 2) m are those of the class.
    """
    rows, others = (dict(zip(track.scans, track.rows, strict=True)) for track in (one, other))
    both = [np.concatenate([rows[k], others[k]]) for k in rows.keys() & others.keys()]
    along = rotation(float(np.arctan2(one.mean[3], one.mean[2])))
    extents = [np.ptp(scans.points_world[each] @ along, axis=0) for each in both]
    fits = bool(both) and np.median(extents, axis=0) <= TOGETHER * sizes.max(axis=0)
    return bool(np.all(fits))


def _joined(one: OpenTrack, other: OpenTrack) -> OpenTrack:
    """The track `one` with the clusters of `other`."""
    rows: dict[int, np.ndarray] = dict(zip(one.scans, one.rows, strict=True))
    for k, more in zip(other.scans, other.rows, strict=True):
        rows[k] = np.sort(np.concatenate([rows[k], more])) if k in rows else more
    scans = sorted(rows)
    return replace(one, scans=scans, rows=[rows[k] for k in scans])


def found_track(
    scans: Scans, one: OpenTrack, last: int, sizes: np.ndarray, std: tuple[float, ...]
) -> FoundTrack:
    """The track, confirmed at scan `last`; the other arguments as in `find_tracks`."""
    indices = np.array(one.scans)
    used = one.within(scans, indices[0], min(USED, scans.times[last] - scans.times[indices[0]]))
    of_run = state_of(scans, used, sizes, std, "scans")
    ahead = scans.times[indices[0]] - intervals(scans.times)[indices[0]]
    step = transition(ahead - (scans.times[0] - intervals(scans.times)[0]))
    initial = InitialState(step @ of_run.mean, step @ of_run.covariance @ step.T)
    return FoundTrack(indices, tuple(one.rows), last, initial)


def confirmed(scans: Scans, one: OpenTrack, length: float) -> int | None:
    """The first scan up to which a track moves like a road user.

    It is fast enough, and the places that it left are free in `BEGIN` of the last `WINDOW` scans.
    None for a track that may be a static object, with the errors of the sensor's motion, or a part
    of one. `length` is the class's diagonal, m.
    """
    recent = [slice(max(0, n - RECENT), n) for n in range(len(one.scans) + 1)]
    numbers = range(LEAST_SCANS - 1, len(one.scans))
    fast = [n for n in numbers if _is_fast(scans, one, recent[n + 1])]
    counts = np.zeros((len(one.scans), 2), dtype=np.int64)
    for n in range(1, fast[-1] + 1 if fast else 0):
        before = np.concatenate(one.rows[recent[n]])
        counts[n] = free_and_occupied(scans, one.scans[n], one.rows[n], before, length)
        free, occupied = counts.sum(axis=0)
        scans_with_free = np.sum(counts[max(0, n + 1 - WINDOW) : n + 1, 0] > 0)
        if n in fast and scans_with_free >= BEGIN and free > FREE * occupied:
            return one.scans[n]
    return None


def _is_fast(scans: Scans, one: OpenTrack, chosen: slice) -> bool:
    """Whether a track in the chosen scans is faster than a static object with errors."""
    times, poses = scans.times[one.scans[chosen]], scans.sensor_poses_world[one.scans[chosen], :2]
    places = np.array([scans.points_world[rows].mean(axis=0) for rows in one.rows[chosen]])
    _, velocity, error = line(times, places)
    _, of_sensor, _ = line(times, poses)
    least = max(least_speed(float(np.hypot(*of_sensor))), CERTAIN * error)
    return float(np.hypot(*velocity)) >= least


def clusters_of(scans: Scans, k: int, longest: float, apart: float = 0.0) -> list[np.ndarray]:
    """Rows (n,) of the scans' arrays of each cluster of scan k that is at most `longest` m long.

    `apart`, rad, is the angle between the rays of a sparse sensor.
    """
    rows, pose = scans.rows(k), scans.sensor_poses_world[k]
    points = ego_from_world(scans.points_world[rows], pose)
    covariances = rotate_covariances(scans.covariances_world[rows], STRAIGHT_AHEAD - pose[2])
    gap = RAYS_APART * apart * float(np.median(np.hypot(*points.T))) if len(points) else 0.0
    labels = cluster(points, covariances, max(GAP, min(gap, WIDEST)))
    found = [np.flatnonzero(labels == one) for one in range(labels.max(initial=-1) + 1)]
    return [own + rows.start for own in found if np.hypot(*np.ptp(points[own], axis=0)) <= longest]


def follow(scans: Scans, longest: float, apart: float = 0.0) -> list[OpenTrack]:
    """All tracks, begun or not, in the order of their first scans.

    Of clusters at most `longest` m long; `apart` as of `clusters_of`.
    """
    tracks: list[OpenTrack] = []
    for k, interval in enumerate(intervals(scans.times)):
        follow_scan(tracks, scans, k, interval, longest, apart)
    return tracks


def follow_scan(
    tracks: list[OpenTrack],
    scans: Scans,
    k: int,
    interval: float,
    longest: float,
    apart: float = 0.0,
) -> None:
    """Change `tracks` by scan k, an `interval` in s after the one before; add those that it begins.

    Clusters are at most `longest` m long; `apart` as of `clusters_of`.
    """
    clusters = clusters_of(scans, k, longest, apart)
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
