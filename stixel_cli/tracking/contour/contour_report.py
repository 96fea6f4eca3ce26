"""What the tracker `contour` reports: contours, their uncertainty, and the states of a track."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.contour.class_shape import ClassShape
from stixel_cli.tracking.contour.ray_kernels import LEAST_COSINE, OUTLINE_STD
from stixel_cli.tracking.contour.residual import Residual
from stixel_cli.tracking.track import contour_directions

SIDEWAYS = 0.05
"""Standard deviation of the velocity across the heading, m/s, which the state does not have."""


def contour_of(
    mean: np.ndarray, covariance: np.ndarray, shape: ClassShape, points: int, residual: Residual
) -> tuple[np.ndarray, np.ndarray]:
    """Contour (M, 2) m and standard deviations (M,) m of a state.

    The outline of the class, scaled, at M = `points` even angles of the state's heading. A change
    of the state moves a contour's point by w; the contour then crosses the same ray from the
    reported centre farther by nᵀw / nᵀp, with the normal n and the ray's direction p.
    """
    angles, (unit,) = contour_directions(np.zeros(1), points)
    stds = np.interp(angles, *_polar(shape.outline, shape.outline_stds), period=2.0 * np.pi)
    centre, _ = residual.box_centre(mean)
    outline = residual.outline(mean) - centre
    radii = np.interp(angles, *_polar(outline, np.hypot(*outline.T)), period=2.0 * np.pi)
    body = radii[:, None] * unit + centre
    edges = np.roll(body, -1, axis=0) - np.roll(body, 1, axis=0)
    normals, lengths = np.stack([edges[:, 1], -edges[:, 0]], axis=-1), np.hypot(*edges.T)
    facing = np.maximum(np.einsum("mi,mi->m", normals, unit), LEAST_COSINE * lengths)
    turn, slopes = rotation(mean[2]), np.zeros((points, len(mean)))
    slopes[:, :2] = normals @ turn.T
    slopes[:, 2] = normals[:, 1] * body[:, 0] - normals[:, 0] * body[:, 1]
    slopes[:, 5:7] = normals * body
    slopes /= facing[:, None]
    slopes[:, 7:] = residual.weights_at(body, mean) * (lengths / facing)[:, None]
    variances = np.einsum("mi,mi->m", slopes @ covariance, slopes)
    of_shape = np.maximum(stds, OUTLINE_STD) ** 2
    return mean[:2] + body @ turn.T, np.sqrt(np.maximum(variances, 0.0) + of_shape)


def box_size(mean: np.ndarray, shape: ClassShape, residual: Residual) -> np.ndarray:
    """Length and width (2,) m of the box of a state, with room for the limbs in all poses.

    The outline may be smaller than this box, see `ClassShape`.
    """
    plain = np.ptp(shape.outline, axis=0)
    return np.ptp(residual.outline(mean), axis=0) * shape.size / plain


def _polar(outline: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bearings (N,) rad of an outline (N, 2) m and the `values` (N,) there, for `np.interp`."""
    return np.unwrap(np.arctan2(outline[:, 1], outline[:, 0])), values


def reported(
    mean: np.ndarray, covariance: np.ndarray, residual: Residual
) -> tuple[np.ndarray, np.ndarray]:
    """State (8,) and covariance (8, 8) as a track has them.

    x, y, heading, their rates, and the logarithms of the two factors of size. The velocity is along
    the heading; across it its standard deviation is `SIDEWAYS`. x and y are the middle of
    the outline's box.
    """
    shift, slopes = residual.box_centre(mean)
    turn, reduction = rotation(mean[2]), np.eye(7, len(mean))
    reduction[:2, 7:] = turn @ slopes
    covariance = reduction @ covariance @ reduction.T
    x, y = mean[:2] + turn @ shift
    along = np.array([np.cos(mean[2]), np.sin(mean[2])])
    across = np.array([-along[1], along[0]])
    state = np.array([x, y, mean[2], *(mean[3] * along), *mean[4:7]])
    matrix = np.zeros((8, 7))
    matrix[[0, 1, 2, 5, 6, 7], [0, 1, 2, 4, 5, 6]] = 1.0
    matrix[3:5, 3], matrix[3:5, 2] = along, mean[3] * across
    spread = matrix @ covariance @ matrix.T
    spread[3:5, 3:5] += SIDEWAYS**2 * np.outer(across, across)
    return state, spread
