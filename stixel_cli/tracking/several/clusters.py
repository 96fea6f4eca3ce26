"""Road users that move: which of the clusters that are followed are road users."""

from dataclasses import replace

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import possible_sizes
from stixel_cli.tracking.followed import (
    BEGIN,
    LARGEST,
    WINDOW,
    OpenTrack,
    follow,
    line,
    state_of,
)
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.several.found import LEAST_SCANS, FoundTrack, least_speed
from stixel_cli.tracking.several.places_left import free_and_occupied
from stixel_cli.tracking.track import InitialState

CERTAIN = 12.0
"""A road user's speed is so many times the speed's standard error."""

RECENT = 20
"""Speed and places left are those of so many of the last scans that have the cluster."""

FREE = 4.0
"""Of the places that a road user has left, so many times as many are free as are occupied."""

TOGETHER = 1.5
"""All clusters of one road user are in a box this many times as large as that of its class."""

USED = 1.0
"""Its initial state comes from so many of its first seconds, of scans until it is confirmed."""


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
    recent = replace(one, scans=one.scans[chosen], rows=one.rows[chosen])
    velocity, error = recent.velocity(scans)
    of_sensor = line(scans.times[recent.scans], scans.sensor_poses_world[recent.scans, :2])[1]
    least = max(least_speed(float(np.hypot(*of_sensor))), CERTAIN * error)
    return float(np.hypot(*velocity)) >= least
