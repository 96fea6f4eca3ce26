"""Initialisation of a tracker from the first scans alone: a cluster of points that is followed."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import SIZES, possible_sizes
from stixel_cli.tracking.followed import OpenTrack, ScansStart, follow, state_of
from stixel_cli.tracking.motion import LEAST_SPEED
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState


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


def _target(scans: Scans, start: ScansStart, tracks: Sequence[OpenTrack]) -> OpenTrack | None:
    """The target's track for `start.duration` from the first scan that has one.

    Of several the one with the least value.
    """
    chosen = start.bearing is not None or start.range is not None
    # A cluster that is alone in its scans may move with any doubt: nothing else can be the target.
    alone = sum(len(one.rows) for one in tracks) == len({k for one in tracks for k in one.rows})
    for k in range(len(scans)):
        here = [one.within(scans, k, start.duration) for one in tracks if k in one.rows]
        values = [
            _from_middle(scans, k, one.rows[k], start) if chosen else _doubt(scans, one, alone)
            for one in here
        ]
        if min(values, default=np.inf) < np.inf:
            return here[int(np.argmin(values))]
    return None


def _doubt(scans: Scans, one: OpenTrack, alone: bool) -> float:
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
