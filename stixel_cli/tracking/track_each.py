"""Tracks of several road users: the chosen tracker for each, on the points of its own clusters."""

from collections.abc import Mapping
from dataclasses import replace
from pkgutil import resolve_name
from typing import Any

import numpy as np

from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.track import FoundTrack, ObjectTrack


def track_each(
    found: tuple[FoundTrack, ...], scans: Scans, function: str, settings: Mapping[str, Any]
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


def own_scans(scans: Scans, found: FoundTrack) -> tuple[Scans, np.ndarray]:
    """The scans from the first to the last of a road user, with its own points only.

    A scan without its cluster is empty. Also the rows (P,) of these points in `scans`.
    """
    ks = range(min(found.rows), max(found.rows) + 1)
    rows = np.concatenate([np.sort(found.rows[k]) for k in ks if k in found.rows])
    times, poses = scans.times[ks], scans.sensor_poses_world[ks]
    own = scans.of_rows(rows)
    offsets = own.offsets[ks.start : ks.stop + 1]
    return replace(own, times=times, sensor_poses_world=poses, offsets=offsets), rows
