"""The baseline of box trackers: the centroid of the visible sides, and the box of the class.

State: x, y and their rates, m and m/s, world frame. The heading is the
velocity's direction. Length and width are those of the class, and nothing of them is estimated.

The measurement is the centroid of the points in the gate: the predicted box, larger by a margin. A
sensor sees the sides of a box that face it; the centroid of these sides, each with the angle under
which it is seen, is where the points' centroid is expected. Without scans, the same box follows the
predicted state: the gain of a tracker from its scans is the difference from that.
"""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.geometry.pose import rotation, target_from_world
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.baselines.rectangle_contour import contours_of
from stixel_cli.tracking.kalman import CENTROID_STD, PLACE, correct
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import GREATEST_VARIANCE, MOVING, predict_place, six_states
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track


@parameters
class BoxParameters:
    """A Kalman filter of constant velocity on the centroid of the visible sides of a class box.

    Attributes:
        use_scans: false: predict only.
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        measurement_std: standard deviation of a point along each axis, m.
    """

    kind: Literal["box"]
    use_scans: bool
    sigma_q: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]


BESIDE = 1.0
"""Points this far outside of the predicted box are not used, m."""


def track(scans: Scans, initial: InitialState, prior: PriorShape, tracker: BoxParameters) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The NIS has two degrees of freedom, those of the centroid.
    """
    mean, covariance = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    heading = (float(initial.mean[2]), min(float(initial.covariance[2, 2]), GREATEST_VARIANCE))
    size = np.array([prior.length, prior.width])
    half, of_size = 0.5 * size, np.diag((size * [prior.length_std, prior.width_std]) ** 2)
    filtered, nis = Filtered(scans, 8), np.nan
    for scan in filtered:
        motion = scan.interval, tracker.sigma_q
        mean, covariance = predict_place(mean, covariance, *motion)
        states, _ = six_states(mean, covariance, heading, *motion)
        points = target_from_world(scan.points, states[:3])
        inside = (np.abs(points) <= half + BESIDE).all(axis=1) & tracker.use_scans
        if inside.any():
            sensor = target_from_world(scan.sensor[None, :2], states[:3])[0]
            expected = visible_centroid(half, sensor)
            innovation = rotation(states[2]) @ (points[inside].mean(axis=0) - expected)
            noise = np.full(2, CENTROID_STD**2 + tracker.measurement_std**2 / inside.sum())
            correction, covariance, nis = correct(covariance, PLACE, noise, innovation)
            mean = mean + correction
        states, spread = six_states(mean, covariance, heading, *motion)
        heading = (states[2], spread[2, 2])
        whole = np.pad(spread, (0, 2))
        whole[6:, 6:] = of_size
        filtered.add(np.append(states, size), whole, np.flatnonzero(inside), nis, degrees=2)
    track = filtered.track(contours_of(*filtered.states, prior))
    return replace(track, uses_scans=tracker.use_scans)


def visible_centroid(half: np.ndarray, sensor: np.ndarray) -> np.ndarray:
    """Mean (2,) m over the sides of a box that a sensor sees, in the target's frame.

    Points are even in the sensor's bearing, so a side counts with the angle under which it is seen.

    Args:
        half: (2,) m, half of the length and of the width.
        sensor: (2,) m, its place in the target's frame. Inside the box it sees no side: the centre.
    """
    seen = np.abs(sensor) > half
    middles, along = np.diag(np.copysign(half, sensor)), np.diag(half)[::-1]
    one, other = middles + along - sensor, middles - along - sensor
    across = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    angles = np.where(seen, np.arctan2(np.abs(across), (one * other).sum(axis=1)), 0.0)
    return angles @ middles / angles.sum() if seen.any() else np.zeros(2)
