"""What the trackers of a rectangle report: its contour, and which of its axes points forwards."""

import numpy as np

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.tracking.motion import GREATEST_VARIANCE, LEAST_SPEED, MOVING
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import contour_directions

NORMALS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Outward normals of front, rear, left and right side in the target's frame."""

SHAPE = np.array([2, 6, 7])
"""Indices of heading, length and width in the eight states."""

QUARTER = 0.5 * np.pi


def contours_of(
    means: np.ndarray,
    covariances: np.ndarray,
    prior: PriorShape,
    side_std: float = 0.0,
    points: int = 240,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m, directions (K, M, 2) and std (K, M) m of K rectangles; see `Track`.

    With b the angle from a side's normal n to the direction p, a ray from the estimated centre
    meets the side at r = h / cos b, and a change of the state moves this by
    (n dx^c + dh - r sin b dpsi) / cos b. The sides' error adds to that, and the distance of the
    class's shape from a rectangle of its size.

    `means` (K, 8) are x, y, heading, their rates, length and width; M = `points`.
    """
    angles, directions = contour_directions(means[:, 2], points)
    body = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    contours, std = np.empty_like(directions), np.empty(directions.shape[:2])
    class_radii = prior_radii(prior, angles)
    of_class, _ = radii_of(body, np.array([prior.length, prior.width]))
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        radii, sides = radii_of(body, mean[6:])
        normals = NORMALS[sides]
        cosine = np.einsum("mi,mi->m", normals, body)
        rows = np.zeros((len(body), 8))
        rows[:, :2] = normals @ rotation(mean[2]).T
        rows[:, 2] = -radii * (normals[:, 0] * body[:, 1] - normals[:, 1] * body[:, 0])
        rows[np.arange(len(body)), 6 + sides // 2] = 0.5
        moved = np.einsum("mi,ij,mj->m", rows, covariance, rows) + side_std**2
        std[k] = np.sqrt(np.maximum(moved, 0.0) / cosine**2 + (of_class - class_radii) ** 2)
        contours[k] = mean[:2] + radii[:, None] * directions[k]
    return contours, directions, std


def radii_of(body: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays from the centre along `body` (M, 2) meet a rectangle: radii (M,) m, sides (M,)."""
    with np.errstate(divide="ignore"):
        reach = 0.5 * size[[0, 0, 1, 1]] / np.maximum(body @ NORMALS.T, 0.0)
    return reach.min(axis=1), reach.argmin(axis=1)


def forward_axis(angle: float, velocity: np.ndarray, heading: float) -> tuple[float, bool]:
    """Heading of a rectangle whose sides alone are known, and whether its axes change places.

    An axis is at `angle` rad. Of the four directions along the sides, the heading is the one
    nearest to the `velocity` (2,) m/s, or below `LEAST_SPEED` to the `heading` before, rad. It is
    unwound: no jump of a full turn is between two scans.
    """
    moving = np.hypot(*velocity) >= LEAST_SPEED
    towards = np.arctan2(velocity[1], velocity[0]) if moving else heading
    quarters = round(float(wrap_angle(towards - angle)) / QUARTER)
    turned = wrap_angle(angle + quarters * QUARTER - heading)
    return heading + float(turned), quarters % 2 == 1


def rectangle_states(
    moving: tuple[np.ndarray, np.ndarray],
    shape: tuple[np.ndarray, np.ndarray],
    heading: float,
    turn_rate_variance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (8,) and covariance (8, 8) of a track: x, y, heading, their rates, length and width.

    Args:
        moving: mean (4,) and covariance (4, 4) of x, y and their rates, m and m/s.
        shape: (3,) and (3, 3) of the first axis's angle, rad, and of the half sizes, m. It is
            independent of the velocity.
        heading: the one before, rad.
        turn_rate_variance: of its rate, which is 0, rad²/s².
    """
    mean, covariance = np.zeros(8), np.diag([0.0] * 5 + [turn_rate_variance, 0.0, 0.0])
    forwards, swapped = forward_axis(shape[0][0], moving[0][2:], heading)
    order, factors = np.array([0, 2, 1] if swapped else [0, 1, 2]), np.array([1.0, 2.0, 2.0])
    mean[MOVING], mean[SHAPE] = moving[0], factors * shape[0][order]
    mean[2] = forwards
    covariance[np.ix_(MOVING, MOVING)] = moving[1]
    of_shape = np.outer(factors, factors) * shape[1][np.ix_(order, order)]
    covariance[np.ix_(SHAPE, SHAPE)] = of_shape
    covariance[2, 2] = min(covariance[2, 2], GREATEST_VARIANCE)
    return mean, covariance
