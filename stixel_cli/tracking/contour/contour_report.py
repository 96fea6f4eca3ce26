"""What the tracker `contour` reports: contours, their uncertainty, and the states of a track."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.contour.class_shape import ClassShape
from stixel_cli.tracking.contour.residual import Residual
from stixel_cli.tracking.track import contour_directions

LEAST_OUTLINE_STD = 0.03
"""How well at least the class's outline, scaled, fits one road user, m."""

SIDEWAYS = 0.05
"""Standard deviation of the velocity across the heading, m/s, which the state does not have."""


def contours_of(
    means: np.ndarray,
    covariances: np.ndarray,
    shape: ClassShape,
    points: int,
    residual: Residual | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m, directions (K, M, 2) and standard deviations (K, M) m of K states.

    The outline of the class, scaled, at M = `points` even angles of the state's heading. A change
    of the state moves a contour's point by w; the contour then crosses the same ray from the
    reported centre farther by nᵀw / nᵀp, with the normal n and the ray's direction p.
    """
    angles, directions = contour_directions(means[:, 2], points)
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    contours = np.empty((len(means), points, 2))
    std = np.empty((len(means), points))
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        outline = residual.outline(mean) if residual else shape.outline * np.exp(mean[5:])
        centre = residual.box_centre(mean)[0] if residual else np.zeros(2)
        radii, shape_stds = _radii(outline - centre, shape.outline_stds, angles)
        body = radii[:, None] * unit + centre
        edges = np.roll(body, -1, axis=0) - np.roll(body, 1, axis=0)
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
        facing = np.maximum(np.einsum("mi,mi->m", normals, unit), 0.2 * np.hypot(*edges.T))
        turn = rotation(mean[2])
        moves = np.zeros((points, 2, len(mean)))
        moves[:, :, :2] = turn.T
        moves[:, 0, 2], moves[:, 1, 2] = -body[:, 1], body[:, 0]
        moves[:, 0, 5], moves[:, 1, 6] = body[:, 0], body[:, 1]
        slopes = np.einsum("mi,mij->mj", normals, moves) / facing[:, None]
        if residual:
            lengths = np.hypot(*edges.T) / facing
            slopes[:, 7:] = residual.weights_at(body, mean) * lengths[:, None]
        variances = np.einsum("mi,ij,mj->m", slopes, covariance, slopes)
        std[k] = np.sqrt(
            np.maximum(variances, 0.0) + np.maximum(shape_stds, LEAST_OUTLINE_STD) ** 2
        )
        contours[k] = mean[:2] + body @ turn.T
    return contours, directions, std


def box_sizes(means: np.ndarray, shape: ClassShape, residual: Residual | None = None) -> np.ndarray:
    """Lengths and widths (K, 2) m of the boxes of K states, with room for the limbs in all poses.

    The outline may be smaller than this box, see `ClassShape`.
    """
    plain = np.ptp(shape.outline, axis=0)
    if residual is None:
        return shape.size * np.exp(means[:, 5:7])
    return np.stack([np.ptp(residual.outline(mean), axis=0) for mean in means]) * shape.size / plain


def _radii(
    outline: np.ndarray, outline_stds: np.ndarray, angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Radii (M,) m and their standard deviations (M,) m of an outline (N, 2) m at `angles` rad."""
    bearings = np.unwrap(np.arctan2(outline[:, 1], outline[:, 0]))
    radii = np.hypot(outline[:, 0], outline[:, 1])
    turn = 2.0 * np.pi
    return (
        np.interp(angles, bearings, radii, period=turn),
        np.interp(angles, bearings, outline_stds, period=turn),
    )


def reported(
    means: np.ndarray, covariances: np.ndarray, residual: Residual | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 8) and covariances (K, 8, 8) as a track has them.

    x, y, heading, their rates, and the logarithms of the two factors of size. The velocity is along
    the heading; across it its standard deviation is `SIDEWAYS`. With a `residual`, x and y are the
    middle of the outline's box.
    """
    states, spreads = np.empty((len(means), 8)), np.empty((len(means), 8, 8))
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        if residual:
            shift, slopes = residual.box_centre(mean)
            turn, reduction = rotation(mean[2]), np.eye(7, len(mean))
            reduction[:2, 7:] = turn @ slopes
            covariance = reduction @ covariance @ reduction.T
            mean = np.concatenate([mean[:2] + turn @ shift, mean[2:7]])
        along = np.array([np.cos(mean[2]), np.sin(mean[2])])
        across = np.array([-along[1], along[0]])
        states[k] = [*mean[:3], *(mean[3] * along), *mean[4:]]
        matrix = np.zeros((8, 7))
        matrix[[0, 1, 2, 5, 6, 7], [0, 1, 2, 4, 5, 6]] = 1.0
        matrix[3:5, 3], matrix[3:5, 2] = along, mean[3] * across
        spreads[k] = matrix @ covariance @ matrix.T
        spreads[k, 3:5, 3:5] += SIDEWAYS**2 * np.outer(across, across)
    return states, spreads
