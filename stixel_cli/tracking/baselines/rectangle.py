"""An extended Kalman filter on an oriented rectangle, with the sides that the sensor sees.

State: x, y, heading, their rates, length and width; world frame, m, rad, s. A point is measured as
its distance from the nearest visible side, with an error that all points on a side share. The first
and the last point from right to left are near the corners where the rectangle ends for the sensor,
which makes the rest of the pose and the size observable. The velocity across the heading is 0 ±
slip. Equations: `docs/theory.md`, "The rectangle".
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import rotation, target_from_world, wrap_angle
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import GATE, associate, uncut
from stixel_cli.tracking.baselines.rectangle_contour import LEAST_SIZE, NORMALS, contours_of
from stixel_cli.tracking.kalman import correct
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import predict, process_noise, tied_to_velocity
from stixel_cli.tracking.prior import PriorShape, fullness_of
from stixel_cli.tracking.track import InitialState, Track


@parameters
class RectangleParameters:
    """An extended Kalman filter on an oriented rectangle, with the sides that the sensor sees.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: process noise of the heading, rad/s^1.5.
        slip: standard deviation of the velocity across the heading, m/s.
        measurement_std: m, along each axis, added to the covariance of each point.
        side_std: standard deviation, m, of an error that all points on a side share in a scan.
        corner_std: standard deviation, m, of the place across the ray where the target ends.
    """

    kind: Literal["rectangle"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    slip: Annotated[float, Gt(0), Le(100)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]
    side_std: Annotated[float, Ge(1e-6), Le(10)]
    corner_std: Annotated[float, Ge(1e-6), Le(10)]


CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
"""Signs of the corners, counter-clockwise."""


class Rows(NamedTuple):
    """Linearised measurements: m scalars."""

    innovations: np.ndarray
    """(m,) measured minus predicted."""
    matrix: np.ndarray
    """(m, 12) derivatives by the eight states and by the errors of the four sides."""
    variances: np.ndarray
    """(m,) of the errors that are independent."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: RectangleParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The size starts as that of the class's `prior`. Reads no truth. The reported states are x, y,
    heading, their rates, length and width. Each point has one degree of freedom, and so has each
    end of the target that is used.
    """
    from statistics import NormalDist

    size, fullness = np.array([prior.length, prior.width]), fullness_of(prior)
    mean = np.concatenate([initial.mean, size])
    covariance = np.pad(initial.covariance, (0, 2))
    covariance[[6, 7], [6, 7]] = (size * [prior.length_std, prior.width_std]) ** 2
    of_sides = np.diag([0.0] * 8 + [tracker.side_std**2] * 4)
    filtered = Filtered(scans, 8)
    # So many standard deviations of one scalar have the gate's probability.
    widest = NormalDist().inv_cdf(0.5 + 0.5 * GATE)
    for scan in filtered:
        noise = process_noise(scan.interval, tracker.sigma_q, tracker.sigma_q_psi)
        # The size stays, as radii do that nothing forgets.
        mean, covariance = predict(mean, covariance, scan.interval, noise, 0.0)
        noises, nis, degrees = scan.covariances + tracker.measurement_std**2 * np.eye(2), np.nan, 0
        turn = rotation(mean[2])
        area = turn @ np.diag(mean[6:] ** 2 / 12.0) @ turn.T
        spread = covariance[:2, :2] + area + noises
        indices = associate(scan.points, mean[:2], spread)
        if len(indices):
            mean, covariance, *_ = tied_to_velocity(mean, covariance, tracker.slip)
            seen = scan.points[indices], noises[indices], scan.sensor
            measured = measure(mean, *seen, fullness, tracker.corner_std, scans.field_of_view)
            # The errors of the four sides are further states.
            whole = np.pad(covariance, (0, 4)) + of_sides
            predicted = np.einsum("mi,ij,mj->m", measured.matrix, whole, measured.matrix)
            kept = np.abs(measured.innovations) <= widest * np.sqrt(predicted + measured.variances)
            indices = indices[kept[: len(indices)]]
        if len(indices):
            innovations, matrix, variances = (part[kept] for part in measured)
            correction, posterior, nis = correct(whole, matrix, variances, innovations)
            mean, covariance, degrees = mean + correction[:8], posterior[:8, :8], len(innovations)
            mean[6:] = np.maximum(mean[6:], LEAST_SIZE)
        filtered.add(mean, covariance, indices, nis, degrees)
    return filtered.track(contours_of(*filtered.states, prior, tracker.side_std))


def measure(
    mean: np.ndarray,
    points_world: np.ndarray,
    noises: np.ndarray,
    sensor_pose: np.ndarray,
    fullness: float,
    corner_std: float,
    field_of_view: FieldOfView | None,
) -> Rows:
    """The rows of points (n, 2) m with covariances (n, 2, 2) m², n > 0, at the state `mean` (8,).

    First one for each point, then the two ends of the target where they can be used. `sensor_pose`
    (3,) is that of the sensor in the world, `fullness` the area of the class's shape over that of
    its box, `field_of_view` as in `Scans`.
    """
    turn = rotation(mean[2])
    body = target_from_world(points_world, mean[:3])
    sides = sides_of(body, mean[6:], visible_sides(mean, sensor_pose[:2]))
    normals = NORMALS[sides]
    # The mean distance of a shape's side from its middle is this part of that of its box.
    half = 0.5 * fullness
    points = np.zeros((len(body), 12))
    points[:, :2] = -normals @ turn.T
    # The point in the target's frame turns back where the heading turns.
    points[:, 2] = normals[:, 0] * body[:, 1] - normals[:, 1] * body[:, 0]
    points[np.arange(len(body)), 6 + sides // 2] = -half
    points[np.arange(len(body)), 8 + sides] = -1.0
    distances = np.einsum("ni,ni->n", normals, body) - half * mean[6 + sides // 2]
    across = normals @ turn.T
    variances = np.einsum("ni,nij,nj->n", across, noises, across)

    ends = _ends(mean, points_world, noises, sensor_pose, corner_std, field_of_view)
    parts = zip(Rows(-distances, points, variances), ends, strict=True)
    return Rows(*(np.concatenate(part) for part in parts))


def visible_sides(mean: np.ndarray, sensor_world: np.ndarray) -> np.ndarray:
    """Which sides (4,) of the rectangle `mean` (8,) a sensor at `sensor_world` (2,) m sees.

    A sensor inside of the rectangle sees all.
    """
    sensor = target_from_world(sensor_world[None], mean[:3])[0]
    seen = NORMALS @ sensor > 0.5 * mean[[6, 6, 7, 7]]
    return seen if seen.any() else ~seen


def sides_of(points_target: np.ndarray, size: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The nearest of the `seen` sides (4,) of each point (n, 2) m; `size` is length and width."""
    half = 0.5 * size
    outside = np.maximum(np.abs(points_target) - half, 0.0)[:, [1, 1, 0, 0]]
    away = points_target @ NORMALS.T - half[[0, 0, 1, 1]]
    return np.where(seen, np.hypot(away, outside), np.inf).argmin(axis=1)


def _ends(
    mean: np.ndarray,
    points_world: np.ndarray,
    noises: np.ndarray,
    sensor_pose: np.ndarray,
    corner_std: float,
    field_of_view: FieldOfView | None,
) -> Rows:
    """The rows of the right and the left end of the target, as the sensor sees it."""
    # Of two points both would be ends, at any distance of neighbouring rays.
    if len(points_world) < 3:
        return Rows(np.zeros(0), np.zeros((0, 12)), np.zeros(0))
    offsets = points_world - sensor_pose[:2]
    bearings = wrap_angle(np.arctan2(offsets[:, 1], offsets[:, 0]) - sensor_pose[2])
    gap = np.median(np.diff(np.sort(bearings))) * np.hypot(*offsets.T).mean()
    turn, body = rotation(mean[2]), 0.5 * CORNERS * mean[6:]
    corners = body @ turn.T + mean[:2] - sensor_pose[:2]
    last = np.array([bearings.argmin(), bearings.argmax()])
    innovations, matrix, variances = np.empty(2), np.zeros((2, 12)), np.empty(2)
    for i, side in enumerate((-1.0, 1.0)):
        ray = offsets[last[i]] / np.hypot(*offsets[last[i]])
        outwards = side * np.array([-ray[1], ray[0]])
        corner = np.arctan2(corners @ outwards, corners @ ray).argmax()
        innovations[i] = 0.5 * gap - outwards @ corners[corner]
        matrix[i, :2] = outwards
        matrix[i, 2] = outwards @ turn @ [-body[corner, 1], body[corner, 0]]
        matrix[i, 6:8] = 0.5 * CORNERS[corner] * (outwards @ turn)
        variances[i] = gap**2 / 12.0 + outwards @ noises[last[i]] @ outwards + corner_std**2
    kept = uncut(bearings[last], np.hypot(*offsets[last].T), field_of_view)
    return Rows(innovations[kept], matrix[kept], variances[kept])
