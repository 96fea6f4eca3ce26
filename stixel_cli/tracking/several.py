"""Road users among the clusters that are followed: the one of a start, all that move, their tracks.

A cluster that moves leaves free places behind. A fence at a grazing angle has a cluster that slides
along it: at the edge of the view, in a gap between nearer things, or where stereo sees enough of
it. Its speed tells nothing, since a car that is followed has it, too. But the fence is still where
the cluster was.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pkgutil import resolve_name
from typing import Any

import numpy as np

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.clusters import GAP, LARGEST
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import SIZES, possible_sizes
from stixel_cli.tracking.followed import BEGIN, ClusterTrack, ScansStart, follow, state_of
from stixel_cli.tracking.motion import LEAST_SPEED
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, ObjectTrack

RECENT = 20
"""Speed and places left are those of so many of the last scans that have the cluster: with all, a
car that stood for long would have no speed. With 12 a cyclist is found 17 scans later."""

FREE = 4.0
"""Of the places that a road user has left, so many times as many are free as are occupied. With 1
KITTI's clip 0005 has a false track."""

ACROSS = 0.5
"""A place that no ray passes this near, m, is free. With 0.7 there is a false track."""


def start_from_scans(scans: Scans, start: ScansStart, prior: PriorShape) -> InitialState:
    """State one sample before the first scan: the class's rectangle on a cluster, and its motion.

    The tracker then uses these scans a second time. If no cluster has the size of the prior's
    class, it may be a road user of another class: the start is then that of an unknown class.

    Raises:
        ValueError: if no cluster fits.
    """
    units = (("bearing", start.bearing, "degrees"), ("range", start.range, "m"))
    bounds = " and ".join(f"{name} {list(one)} {unit}" for name, one, unit in units if one)
    for sizes in (possible_sizes(prior), SIZES):
        target = _target(scans, start, follow(scans, sizes))
        if target:
            return state_of(scans, target, sizes, start)
    if bounds:
        raise ValueError(f"no scan has a cluster of the class's size in {bounds}: widen them")
    raise ValueError(
        "no cluster of the class's size moves: give start.bearing=[LO,HI] (degrees) and "
        "start.range=[LO,HI] (m)"
    )


def _target(scans: Scans, start: ScansStart, tracks: Sequence[ClusterTrack]) -> ClusterTrack | None:
    """The target's track from the first scan that has one; of several that with the least value."""
    chosen = start.bearing is not None or start.range is not None
    # A cluster that is alone in its scans may move with any doubt: nothing else can be the target.
    alone = sum(len(one.rows) for one in tracks) == len({k for one in tracks for k in one.rows})
    for k in range(len(scans)):
        here = [one.since(k) for one in tracks if k in one.rows]
        values = [
            _from_middle(scans, k, one.rows[k], start) if chosen else _doubt(scans, one, alone)
            for one in here
        ]
        if min(values, default=np.inf) < np.inf:
            return here[int(np.argmin(values))]
    return None


def _doubt(scans: Scans, one: ClusterTrack, alone: bool) -> float:
    """The standard error of a cluster's speed as a share of it; inf if it may stand still."""
    velocity, error = one.velocity(scans)
    speed = float(np.hypot(*velocity))
    return error / speed if speed >= LEAST_SPEED and (alone or one.is_fast(scans)) else np.inf


def _from_middle(scans: Scans, k: int, rows: np.ndarray, start: ScansStart) -> float:
    """Distance of a cluster in scan `k`, m, from the middle of the bounds; inf outside of them."""
    pose, bounds = scans.sensor_poses_world[k], (start.bearing, start.range)
    offset = scans.points_world[rows].mean(axis=0) - pose[:2]
    bearing = float(np.degrees(wrap_angle(np.arctan2(offset[1], offset[0]) - pose[2])))
    place = bearing, float(np.hypot(*offset))
    limits = [given or (value, value) for value, given in zip(place, bounds, strict=True)]
    if any(not low <= value <= high for value, (low, high) in zip(place, limits, strict=True)):
        return np.inf
    middle = np.mean(limits, axis=1)
    here, there = (distance * np.exp(1j * np.radians(angle)) for angle, distance in (place, middle))
    return float(np.abs(here - there))


def find_tracks(scans: Scans, prior: PriorShape, start: ScansStart) -> tuple[ClusterTrack, ...]:
    """The road users of the class that move, in the order of their first scans."""
    sizes = possible_sizes(prior)
    kept: list[ClusterTrack] = []
    for one in follow(scans, sizes):
        one.confirmed = confirmed(scans, one)
        if one.confirmed is None:
            continue
        known = next((other for other in kept if are_one(scans, other, one, sizes)), None)
        if known:
            known.join(one)
        else:
            kept.append(one)
    for one in kept:
        one.initial = state_of(scans, one, sizes, start, min(one.rows))
    return tuple(kept)


def track_each(
    found: tuple[ClusterTrack, ...], scans: Scans, function: str, settings: Mapping[str, Any]
) -> tuple[ObjectTrack, ...]:
    """The track of each road user that is found, from its first to its last scan.

    Args:
        found: no point is in two of them.
        scans: all points.
        function: "module:function" of the tracker.
        settings: what the tracker gets besides scans and initial state.

    Raises:
        ValueError: if no road user is found.
    """
    if not found:
        raise ValueError(
            "source.target: auto finds no cluster of the class's size that moves: name a labelled "
            "target, or leave it out and give start.bearing=[LO,HI] (degrees)"
        )
    track = resolve_name(function)
    tracks = []
    for one in found:
        own, rows = own_scans(scans, one)
        result = track(scans=own, initial=one.initial, **settings)
        # Only the filtered track is compared with labels.
        result = replace(result, smoothed=None).of_points(rows)
        tracks.append(ObjectTrack(min(one.rows), one.confirmed, result))
    return tuple(tracks)


def own_scans(scans: Scans, found: ClusterTrack) -> tuple[Scans, np.ndarray]:
    """The scans from the first to the last of a road user, with its own points only.

    A scan without its cluster is empty. Also the rows (P,) of these points in `scans`.
    """
    ks = range(min(found.rows), max(found.rows) + 1)
    rows = np.concatenate([np.sort(found.rows[k]) for k in ks if k in found.rows])
    times, poses = scans.times[ks], scans.sensor_poses_world[ks]
    own = scans.of_rows(rows)
    offsets = own.offsets[ks.start : ks.stop + 1]
    return replace(own, times=times, sensor_poses_world=poses, offsets=offsets), rows


def are_one(scans: Scans, one: ClusterTrack, other: ClusterTrack, sizes: np.ndarray) -> bool:
    """Whether two tracks are of one road user: in their common scans both fit into its box.

    The box is along the last velocity of the first track. `sizes` (n, 2) m are those of the class.
    """
    common = one.rows.keys() & other.rows.keys()
    both = [np.concatenate([one.rows[k], other.rows[k]]) for k in common]
    along = rotation(float(np.arctan2(one.mean[3], one.mean[2])))
    extents = [np.ptp(scans.points_world[each] @ along, axis=0) for each in both]
    fits = bool(both) and np.median(extents, axis=0) <= LARGEST * sizes.max(axis=0)
    return bool(np.all(fits))


def confirmed(scans: Scans, one: ClusterTrack) -> int | None:
    """The first scan up to which a track moves like a road user.

    In `BEGIN` of its scans, one after the other, it is fast enough, and the places that it left are
    free. None for a track that may be a static object, with the errors of the sensor's motion, or a
    part of one.
    """
    ks, moving = [*one.rows], 0
    for last in range(BEGIN, len(ks)):
        recent = one.at(ks[max(0, last + 1 - RECENT) : last + 1])
        free, occupied = 0, 0
        if recent.is_fast(scans):
            *before, own = recent.rows.values()
            free, occupied = free_and_occupied(scans, ks[last], own, np.concatenate(before))
        moving = moving + 1 if free > FREE * occupied else 0
        if moving == BEGIN:
            return ks[last]
    return None


def free_and_occupied(scans: Scans, k: int, own: np.ndarray, before: np.ndarray) -> tuple[int, int]:
    """How many places that a cluster has left are seen to be free, and occupied, in scan `k`.

    The nearest point in the direction of a place decides: farther away than the place, it is free;
    at its range and not of the cluster, it is occupied. A place that is hidden, or outside of the
    field of view, is neither.

    Args:
        scans: of any sensor.
        k: the scan.
        own: rows (n,) of the cluster in it.
        before: rows (m,) of the cluster in earlier scans.
    """
    from scipy.spatial import cKDTree

    pose, view = scans.sensor_poses_world[k], scans.field_of_view
    # A cluster has left the places that would not belong to it now.
    away, _ = cKDTree(scans.points_world[own]).query(scans.points_world[before])
    places = _seen_from(scans, pose, before[away > GAP])
    points = _seen_from(scans, pose, scans.rows(k))
    if view is not None:
        places = places[:, (places[1] > view.right) & (places[1] < view.left)]
    ranges, bearings, variances = places[..., None]
    across = np.abs(wrap_angle(points[1] - bearings)) * ranges
    behind = (points[0] - ranges) / np.sqrt(GAP**2 + 4.0 * (points[2] + variances))
    nearest = np.where(across < ACROSS, behind, np.inf)
    # The cluster itself hides a place that it has left, but it is not there.
    is_other = ~np.isin(np.arange(*scans.offsets[k : k + 2]), own)[nearest.argmin(axis=1)]
    nearest = nearest.min(axis=1)
    return int(np.sum(nearest >= 1.0)), int(np.sum(is_other & (np.abs(nearest) < 1.0)))


def _seen_from(scans: Scans, pose_world: np.ndarray, rows: np.ndarray | slice) -> np.ndarray:
    """Range (m), bearing from the heading (rad), variance along the ray (m²): (3, n), of rows."""
    away = scans.points_world[rows] - pose_world[:2]
    ranges = np.hypot(*away.T)
    along = away / np.maximum(ranges, 1e-9)[:, None]
    variances = np.einsum("ni,nij,nj->n", along, scans.covariances_world[rows], along)
    bearings = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - pose_world[2])
    return np.stack([ranges, bearings, variances])
