"""Road users that move: which of the clusters that are followed are road users.

A cluster that moves leaves free places behind. A fence at a grazing angle has a cluster that slides
along it: at the edge of the view, in a gap between nearer things, or where stereo sees enough of
it. Its speed tells nothing, since a car that is followed has it, too. But the fence is still where
the cluster was.
"""

from dataclasses import replace

import numpy as np

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.clusters import GAP
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import possible_sizes
from stixel_cli.tracking.followed import (
    BEGIN,
    LARGEST,
    LEAST_SCANS,
    WINDOW,
    OpenTrack,
    ScansStart,
    diagonal,
    follow,
    state_of,
)
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import FoundTrack, InitialState

RECENT = 20
"""Speed and places left are those of so many of the last scans that have the cluster."""

FREE = 4.0
"""Of the places that a road user has left, so many times as many are free as are occupied. With
1, six clips of tuning data have two more tracks."""

ACROSS = 0.5
"""A ray passes a place at this distance, m. With 0.7 a car that comes towards the ego is found 3 to
7 scans later."""

SHADOW = 1.0
"""Behind an object so far from its points, across the rays, m, points at its edges have a depth
between that of the object and that of the background. With 0 no car that comes towards the ego is
found."""


def find_tracks(scans: Scans, prior: PriorShape, start: ScansStart) -> tuple[FoundTrack, ...]:
    """The road users of the class that move, in the order of their first scans."""
    sizes = possible_sizes(prior)
    kept: list[tuple[OpenTrack, int]] = []
    for one in follow(scans, sizes):
        k = confirmed(scans, one, sizes)
        if k is None:
            continue
        same = (i for i, (other, _) in enumerate(kept) if are_one(scans, other, one, sizes))
        i = next(same, None)
        if i is None:
            kept.append((one, k))
        else:
            kept[i] = _joined(kept[i][0], one), min(k, kept[i][1])
    return tuple(
        FoundTrack(one.rows, k, initial_state(scans, one, k, sizes, start)) for one, k in kept
    )


def initial_state(
    scans: Scans, one: OpenTrack, last: int, sizes: np.ndarray, start: ScansStart
) -> InitialState:
    """State one sample before the first scan of a track that was confirmed in scan `last`.

    From its first scans up to that; the other arguments as of `state_of`.
    """
    first = min(one.rows)
    duration = min(start.duration, scans.times[last] - scans.times[first])
    return state_of(scans, one.within(scans, first, duration), sizes, start, first)


def are_one(scans: Scans, one: OpenTrack, other: OpenTrack, sizes: np.ndarray) -> bool:
    """Whether two tracks are of one road user: in their common scans both fit into its box.

    The box is along the last velocity of the first track. `sizes` (n, 2) m are those of the class.
    """
    common = one.rows.keys() & other.rows.keys()
    both = [np.concatenate([one.rows[k], other.rows[k]]) for k in common]
    along = rotation(float(np.arctan2(one.mean[3], one.mean[2])))
    extents = [np.ptp(scans.points_world[each] @ along, axis=0) for each in both]
    fits = bool(both) and np.median(extents, axis=0) <= LARGEST * sizes.max(axis=0)
    return bool(np.all(fits))


def _joined(one: OpenTrack, other: OpenTrack) -> OpenTrack:
    """The track `one` with the clusters of `other`."""
    rows = dict(one.rows)
    for k, more in other.rows.items():
        rows[k] = np.sort(np.concatenate([rows[k], more])) if k in rows else more
    return replace(one, rows=dict(sorted(rows.items())))


def confirmed(scans: Scans, one: OpenTrack, sizes: np.ndarray) -> int | None:
    """The first scan up to which a track moves like a road user.

    It is fast enough, and the places that it left are free in `BEGIN` of the last `WINDOW` scans.
    None for a track that may be a static object, with the errors of the sensor's motion, or a part
    of one. `sizes` (n, 2) m are those of the class.
    """
    ks, rows = [*one.rows], [*one.rows.values()]
    recent = [slice(max(0, n - RECENT), n) for n in range(len(ks) + 1)]
    fast = [n for n in range(LEAST_SCANS - 1, len(ks)) if one.at(ks[recent[n + 1]]).is_fast(scans)]
    counts = np.zeros((len(ks), 2), dtype=np.int64)
    for n in range(1, fast[-1] + 1 if fast else 0):
        before = np.concatenate(rows[recent[n]])
        counts[n] = free_and_occupied(scans, ks[n], rows[n], before, diagonal(sizes))
        free, occupied = counts.sum(axis=0)
        scans_with_free = np.sum(counts[max(0, n + 1 - WINDOW) : n + 1, 0] > 0)
        if n in fast and scans_with_free >= BEGIN and free > FREE * occupied:
            return ks[n]
    return None


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
    # A cluster has left the places that would not belong to it now.
    before, left_by = before[left_by > GAP], left_by[left_by > GAP]
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
