"""The baseline: a Kalman filter of constant velocity on a scan's centroid, a circle as contour.

State: x, y and their rates, m and m/s, world frame. The contour is a circle of the same area as the
prior's shape; nothing of it is estimated. The filter is Bar-Shalom, Li & Kirubarajan 2001, chapter
5 and (6.2.2): a white acceleration moves the target. One part of the centroid's error falls with
the number of points (Koch 2008 has the same form for an extended target), the other is shared by
all of them: only the side towards the sensor is seen. It stays for as long as the same side is
seen, so no such filter can be consistent. Equations: `docs/theory.md`, "The centroid".
"""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.kalman import PLACE, correct
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import GREATEST_VARIANCE, MOVING, predict_place, six_states
from stixel_cli.tracking.prior import EVEN, PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions, shift_variances


@parameters
class PointParameters:
    """The baseline: a Kalman filter of constant velocity on the centroid of a scan.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        measurement_std: standard deviation of a point along each axis, m.
    """

    kind: Literal["point"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]


CENTROID_OFFSET = np.pi / 4.0
"""Standard deviation of the centroid along each axis, in radii of the circle: so far from the
centre is the centroid of points that a distant sensor sees, even across its rays."""


def class_circle(prior: PriorShape) -> tuple[float, float]:
    """Radius and its std, both in m, of the circle with the area of the prior's shape.

    The std is that of the class's radius round the circle, over all directions: the shape's
    own, and the part that the prior's kernel adds.
    """
    radii = prior_radii(prior, EVEN)
    radius = np.sqrt(np.mean(radii**2))
    variance = np.mean((radii - radius) ** 2) + prior.sigma_f**2 + prior.sigma_r**2
    return float(radius), float(np.sqrt(variance))


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: PointParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The heading is the velocity's direction, see `six_states`. The centroid has two coordinates, so
    the NIS has two degrees of freedom.
    """
    radius, std = class_circle(prior)
    mean, covariance = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    heading = (float(initial.mean[2]), min(float(initial.covariance[2, 2]), GREATEST_VARIANCE))
    lone = 0.25 * radius**2 + tracker.measurement_std**2

    filtered, nis = Filtered(scans, 6), np.nan
    for scan in filtered:
        motion = scan.interval, tracker.sigma_q
        mean, covariance = predict_place(mean, covariance, *motion)
        indices = associate(scan.points, mean[:2], covariance[:2, :2] + lone * np.eye(2))
        if len(indices):
            noise = np.full(2, (CENTROID_OFFSET * radius) ** 2 + lone / len(indices))
            innovation = scan.points[indices].mean(axis=0) - mean[:2]
            correction, covariance, nis = correct(covariance, PLACE, noise, innovation)
            mean = mean + correction
        states, spread = six_states(mean, covariance, heading, *motion)
        heading = (states[2], spread[2, 2])
        filtered.add(states, spread, indices, nis, degrees=2)
    means, covariances = filtered.states
    _, directions = contour_directions(means[:, 2])
    shift = shift_variances(directions, covariances)
    contours = means[:, None, :2] + radius * directions, np.sqrt(std**2 + shift)
    return filtered.track(contours)
