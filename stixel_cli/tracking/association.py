"""The first step of every tracker: which candidate points belong to the target.

The normal density N(z; mu, S) round the predicted target, thesis (38) with its minus, cut at a
chi-square probability. mu and the extent in S are the centroid and the second central moments of
the *area* inside the predicted contour. An area's own outline is inside such a gate: the corner
of any rectangle has the squared distance 6, an ellipse's outline 4, while the cut at 0.99 is 9.2
(at 0.95 it is 5.99, just short of the corners).
"""

import numpy as np

from stixel_cli.measurements.scans import FieldOfView

GATE = 0.99
"""Chi-square probability of a gate, and the default of `tracker.gate_probability`. Of clusters,
with 0.9 there is a false track, with 0.999 starts are worse."""

BORDER = np.radians(1.2)
"""A silhouette nearer than this to the border of the field of view, rad, may be cut off. With 0 the
NEES of `contour`, `gp_ekf` and `rectangle` is greater, of the first 1.7 times."""


def contour_moments(directions: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid (2,) in m and second central moments (2, 2) in m² of the area inside a contour.

    The unit vectors `directions` (n, 2), even over a full turn, and `radii` (n,) m describe the
    contour from its centre; the moments are in the same frame. Negative radii count as zero. In
    polar form the moments are integrals of r², r³ and r⁴. An area of zero has all moments zero.
    """
    radii = np.maximum(radii, 0.0)
    squares = radii * radii
    area = 0.5 * float(squares.sum())
    if area <= 0.0:
        return np.zeros(2), np.zeros((2, 2))
    centroid = (squares * radii) @ directions / (3.0 * area)
    second = (directions.T * (squares * squares)) @ directions / (4.0 * area)
    return centroid, second - centroid[:, None] * centroid


def associate(
    points_world: np.ndarray,
    expected_world: np.ndarray,
    spread: np.ndarray,
    probability: float | None = GATE,
) -> np.ndarray:
    """Indices (m,) int64, ascending, of the `points_world` (n, 2) in m inside the gate.

    `expected_world` (2,) is mu in m; `spread` S in m² is (2, 2), or (n, 2, 2) if it differs from
    point to point: the position's covariance + the extent + the measurement's covariance. A
    `probability` of None takes every point.
    """
    x, y = (points_world - expected_world).T
    xx, xy, yy = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    distance = (yy * x**2 - 2.0 * xy * x * y + xx * y**2) / (xx * yy - xy**2)
    return np.flatnonzero(distance <= gate(probability))


def gate(probability: float | None = GATE) -> float:
    """The greatest squared distance, of two degrees of freedom; inf without a probability."""
    return np.inf if probability is None else -2.0 * np.log1p(-probability)


GATE_STDS = np.sqrt(gate())
"""Width of the gate in standard deviations."""


def uncut(
    bearings: np.ndarray, ranges: np.ndarray, field_of_view: FieldOfView | None
) -> np.ndarray:
    """Which of two silhouettes (2,), the right and the left, are away from the border.

    They are at `bearings` (2,) rad and `ranges` (2,) m. A second camera's field of view begins
    farther to the right, so the left silhouette must be inside as that camera sees it.
    """
    if field_of_view is None:
        return np.ones(2, bool)
    x, y = ranges[1] * np.cos(bearings[1]), ranges[1] * np.sin(bearings[1])
    leftmost = np.arctan2(y + field_of_view.baseline, x)
    is_inside = bearings[0] > field_of_view.right + BORDER
    return np.array([is_inside, leftmost < field_of_view.left - BORDER])
