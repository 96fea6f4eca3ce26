"""What the trackers of a rectangle report: its contour, and which of its axes points forwards."""

import numpy as np

from stixel_cli.geometry.pose import rotations, wrap_angle
from stixel_cli.tracking.motion import GREATEST_VARIANCE, six_states
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import contour_directions

NORMALS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Outward normals of front, rear, left and right side in the target's frame."""

SHAPE = np.array([2, 6, 7])
"""Indices of heading, length and width in the eight states."""

LEAST_SIZE = 0.1
"""Least length, width or half of them that an update leaves, m."""

QUARTER = 0.5 * np.pi


def contours_of(
    means: np.ndarray,
    covariances: np.ndarray,
    prior: PriorShape,
    side_std: float = 0.0,
    points: int = 240,
) -> tuple[np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m and std (K, M) m of K rectangles; see `Track`.

    With b the angle from a side's normal n to the direction p, a ray from the estimated centre
    meets the side at r = h / cos b, and a change of the state moves this by
    (n dx^c + dh - r sin b dpsi) / cos b. The sides' error adds to that, and the distance of the
    class's shape from a rectangle of its size.

    `means` (K, 8) are x, y, heading, their rates, length and width; M = `points`.
    """
    angles, directions = contour_directions(means[:, 2], points)
    body = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    with np.errstate(divide="ignore"):
        reach = 0.5 / np.maximum(body @ NORMALS.T, 0.0)
    reach_of_class = np.min(reach * [*[prior.length] * 2, *[prior.width] * 2], axis=1)
    reach = reach * means[:, None, [6, 6, 7, 7]]
    radii, normals = reach.min(axis=2), NORMALS[reach.argmin(axis=2)]
    rows = np.zeros((*radii.shape, 8))
    rows[..., :2] = normals @ rotations(-means[:, 2])
    rows[..., 2] = -radii * (normals[..., 0] * body[:, 1] - normals[..., 1] * body[:, 0])
    rows[..., 6:] = 0.5 * np.abs(normals)
    moved = np.einsum("kmi,kmi->km", rows @ covariances, rows) + side_std**2
    cosine = np.einsum("kmi,mi->km", normals, body)
    of_class = (reach_of_class - prior_radii(prior, angles)) ** 2
    std = np.sqrt(np.maximum(moved, 0.0) / cosine**2 + of_class)
    return means[:, None, :2] + radii[..., None] * directions, std


def rectangle_states(
    moving: tuple[np.ndarray, np.ndarray],
    shape: tuple[np.ndarray, np.ndarray],
    heading: float,
    interval: float,
    sigma_q: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (8,) and covariance (8, 8) of a track: x, y, heading, their rates, length and width.

    Of the four directions along the sides, the heading is the one nearest to that of `six_states`,
    which is the velocity's.

    Args:
        moving: mean (4,) and covariance (4, 4) of x, y and their rates, m and m/s.
        shape: (3,) and (3, 3) of the first axis's angle, rad, and of the half sizes, m. It is
            independent of the velocity.
        heading: the one before, rad.
        interval, sigma_q: as of `six_states`.
    """
    states, spread = six_states(*moving, (heading, 0.0), interval, sigma_q)
    mean, covariance = np.append(states, [0.0, 0.0]), np.pad(spread, (0, 2))
    quarters = round(float(wrap_angle(states[2] - shape[0][0])) / QUARTER)
    order, factors = np.array([0, 1 + quarters % 2, 2 - quarters % 2]), np.array([1.0, 2.0, 2.0])
    mean[SHAPE] = factors * shape[0][order]
    mean[2] = states[2] + wrap_angle(shape[0][0] + quarters * QUARTER - states[2])
    # The shape is independent of the motion.
    covariance[2], covariance[:, 2] = 0.0, 0.0
    of_shape = np.outer(factors, factors) * shape[1][np.ix_(order, order)]
    covariance[np.ix_(SHAPE, SHAPE)] = of_shape
    covariance[2, 2] = min(covariance[2, 2], GREATEST_VARIANCE)
    return mean, covariance


def shape_of(extension: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and covariance (3, 3) of the longer axis's angle, rad, and of the half sizes, m.

    To first order an inverse Wishart density gives a half size a, b the variance
    a² / (2 (alpha + 3)), and the direction a² b² / ((alpha + 3) (a² - b²)²), which is at most that
    of a direction that is quite unknown within a quarter turn.
    """
    squares, axes = np.linalg.eigh(extension)
    squares, along = squares[::-1], axes[:, 1]
    apart = (weight + 3.0) * (squares[0] - squares[1]) ** 2
    unknown = QUARTER**2 / 12.0
    of_angle = squares.prod() / max(apart, squares.prod() / unknown)
    mean = np.array([np.arctan2(along[1], along[0]), *np.sqrt(squares)])
    return mean, np.diag([of_angle, *squares / (2.0 * (weight + 3.0))])
