"""Road users that move, found among the clusters of the scans."""

from dataclasses import replace

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import possible_sizes
from stixel_cli.tracking.followed import Followed, line, state_of
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.several.clusters import OpenTrack, follow
from stixel_cli.tracking.several.found import FoundTrack
from stixel_cli.tracking.several.places_left import confirmed
from stixel_cli.tracking.track import InitialState

LARGEST = 1.6
"""A cluster of a road user is at most this many times the class's diagonal long."""

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
        k = confirmed(scans, one, length)
        if k is None:
            continue
        same = (i for i, (other, _) in enumerate(kept) if are_one(scans, other, one, sizes))
        i = next(same, None)
        if i is None:
            kept.append((one, k))
        else:
            kept[i] = _joined(kept[i][0], one), min(k, kept[i][1])
    return tuple(_found(scans, one, k, sizes, std) for one, k in kept)


def are_one(scans: Scans, one: OpenTrack, other: OpenTrack, sizes: np.ndarray) -> bool:
    """Whether two tracks are of one road user: in their common scans both fit into its box.

    The box is along the velocity of the first track. `sizes` (n, 2) m are those of the class.
    """
    rows, others = (dict(zip(track.scans, track.rows, strict=True)) for track in (one, other))
    places = np.array([scans.points_world[rows[k]].mean(axis=0) for k in one.scans])
    _, velocity, _ = line(scans.times[one.scans], places)
    along = rotation(float(np.arctan2(velocity[1], velocity[0])))
    extents = [
        np.ptp(scans.points_world[np.concatenate([rows[k], others[k]])] @ along, axis=0)
        for k in rows.keys() & others.keys()
    ]
    if not extents:
        return False
    return bool((np.median(extents, axis=0) <= TOGETHER * sizes.max(axis=0)).all())


def _joined(one: OpenTrack, other: OpenTrack) -> OpenTrack:
    """The track `one` with the clusters of `other`."""
    rows: dict[int, np.ndarray] = dict(zip(one.scans, one.rows, strict=True))
    for k, more in zip(other.scans, other.rows, strict=True):
        rows[k] = np.sort(np.concatenate([rows[k], more])) if k in rows else more
    scans = sorted(rows)
    return replace(one, scans=scans, rows=[rows[k] for k in scans])


def _found(
    scans: Scans, one: OpenTrack, last: int, sizes: np.ndarray, std: tuple[float, ...]
) -> FoundTrack:
    """The track, confirmed at scan `last`."""
    indices = np.array(one.scans)
    until = min(scans.times[indices[0]] + USED + 1e-9, scans.times[last])
    count = int(np.sum(scans.times[indices] <= until))
    points = tuple(scans.points_world[rows] for rows in one.rows[:count])
    of_run = state_of(scans, Followed(tuple(one.scans[:count]), points), sizes, std, "scans")
    ahead = scans.times[indices[0]] - intervals(scans.times)[indices[0]]
    step = transition(ahead - (scans.times[0] - intervals(scans.times)[0]))
    initial = InitialState(step @ of_run.mean, step @ of_run.covariance @ step.T)
    return FoundTrack(indices, tuple(one.rows), last, initial, of_run)
