"""What the tracker `contour` reports: contours, their uncertainty, and the states of a track."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.contour.class_shape import ClassShape
from stixel_cli.tracking.contour.ray_kernels import LEAST_COSINE, OUTLINE_STD
from stixel_cli.tracking.contour.residual import Residual
from stixel_cli.tracking.track import contour_directions

SIDEWAYS = 0.05
"""Standard deviation of the velocity across the heading, m/s, which the state does not have."""


def contours_of(
    means: np.ndarray,
    covariances: np.ndarray,
    shape: ClassShape,
    points: int,
    residual: Residual,
) -> tuple[np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m and standard deviations (K, M) m of K states.

    The outline of the class, scaled, at M = `points` even angles of the state's heading. A change
    of the state moves a contour's point by w; the contour then crosses the same ray from the
    reported centre farther by nᵀw / nᵀp, with the normal n and the ray's direction p.
    """
    angles, (unit,) = contour_directions(np.zeros(1), points)
    stds = np.interp(angles, *_polar(shape.outline, shape.outline_stds), period=2.0 * np.pi)
    centres = np.zeros((len(means), 2))
    radii = np.empty((len(means), points))
    for k, mean in enumerate(means):
        centres[k] = residual.box_centre(mean)[0]
        outline = residual.outline(mean) - centres[k]
        radii[k] = np.interp(angles, *_polar(outline, np.hypot(*outline.T)), period=2.0 * np.pi)
    bodies = radii[..., None] * unit + centres[:, None]
    edges = np.roll(bodies, -1, axis=1) - np.roll(bodies, 1, axis=1)
    normals, lengths = np.stack([edges[..., 1], -edges[..., 0]], axis=-1), np.hypot(*edges.T).T
    facing = np.maximum(np.einsum("kmi,mi->km", normals, unit), LEAST_COSINE * lengths)
    turns = np.array([rotation(heading) for heading in means[:, 2]]).reshape(-1, 2, 2)
    slopes = np.zeros((*radii.shape, means.shape[1]))
    slopes[..., :2] = normals @ turns.transpose(0, 2, 1)
    slopes[..., 2] = normals[..., 1] * bodies[..., 0] - normals[..., 0] * bodies[..., 1]
    slopes[..., 5:7] = normals * bodies
    slopes /= facing[..., None]
    for k, (body, mean) in enumerate(zip(bodies, means, strict=True)):
        slopes[k, :, 7:] = residual.weights_at(body, mean) * (lengths[k] / facing[k])[:, None]
    variances = np.einsum("kmi,kmi->km", slopes @ covariances, slopes)
    of_shape = np.maximum(stds, OUTLINE_STD) ** 2
    contours = means[:, None, :2] + bodies @ turns.transpose(0, 2, 1)
    return contours, np.sqrt(np.maximum(variances, 0.0) + of_shape)


def box_sizes(means: np.ndarray, shape: ClassShape, residual: Residual) -> np.ndarray:
    """Lengths and widths (K, 2) m of the boxes of K states, with room for the limbs in all poses.

    The outline may be smaller than this box, see `ClassShape`.
    """
    plain = np.ptp(shape.outline, axis=0)
    sizes = np.array([np.ptp(residual.outline(mean), axis=0) for mean in means]).reshape(-1, 2)
    return sizes * shape.size / plain


def _polar(outline: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bearings (N,) rad of an outline (N, 2) m and the `values` (N,) there, for `np.interp`."""
    return np.unwrap(np.arctan2(outline[:, 1], outline[:, 0])), values


def reported(
    means: np.ndarray, covariances: np.ndarray, residual: Residual
) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 8) and covariances (K, 8, 8) as a track has them.

    x, y, heading, their rates, and the logarithms of the two factors of size. The velocity is along
    the heading; across it its standard deviation is `SIDEWAYS`. x and y are the middle of
    the outline's box.
    """
    states, spreads = np.empty((len(means), 8)), np.empty((len(means), 8, 8))
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
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
