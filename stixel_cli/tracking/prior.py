"""The shape that a class of road users has before any of it is seen."""

import numpy as np

from stixel_cli.tracking.parameters import PriorShape


def prior_radii(prior: PriorShape, angles: np.ndarray) -> np.ndarray:
    """Radius in m of the class's shape at `angles` (n,) rad in the target's frame, shape (n,).

    The shape is symmetric about both axes, so the first quadrant serves.
    """
    cosine, sine = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    half_length, half_width = 0.5 * prior.length, 0.5 * prior.width
    if prior.shape == "ellipse":
        return half_length * half_width / np.hypot(half_width * cosine, half_length * sine)
    corner = np.array([half_length, half_width]) - prior.corner_radius
    with np.errstate(divide="ignore"):
        front, side = half_length / cosine, half_width / sine
    # A ray that meets neither straight edge meets the circle of the corner, from the inside.
    along = corner[0] * cosine + corner[1] * sine
    across = corner[0] * sine - corner[1] * cosine
    rounded = along + np.sqrt(np.maximum(prior.corner_radius**2 - across**2, 0.0))
    return np.where(
        front * sine <= corner[1], front, np.where(side * cosine <= corner[0], side, rounded)
    )
