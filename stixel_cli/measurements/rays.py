"""Rays from the left camera, and where they first meet a contour.

Frame: angles phi in the sensor's frame, counter-clockwise from its heading, rad, in (-pi, pi].
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rays:
    """Rays over a horizontal field of view, thesis (16).

    Attributes:
        angles: (n,) rad, ascending.
        directions: (n, 2) unit vectors along them.
        steps: (n,) rad, the angle between neighbours, there.
    """

    angles: np.ndarray
    directions: np.ndarray
    steps: np.ndarray


def spread_rays(count: int, field_of_view: tuple[float, float], even_tangent: bool) -> Rays:
    """`count` >= 2 rays; the first and last are the borders of `field_of_view`, rad, ascending.

    Even in tan phi with `even_tangent`, as a pinhole's columns are; else in phi.
    """
    if even_tangent:
        tangents = np.linspace(*np.tan(field_of_view), count)
        angles = np.arctan(tangents)
        steps = (tangents[1] - tangents[0]) / (1.0 + tangents**2)
    else:
        angles = np.linspace(*field_of_view, count)
        steps = np.full(count, angles[1] - angles[0])
    return Rays(
        angles=angles,
        directions=np.stack([np.cos(angles), np.sin(angles)], axis=-1),
        steps=steps,
    )


def first_crossings(contour_sensor: np.ndarray, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """Indices (m,) of the rays that meet a contour, ascending, and ranges (m,) m of the nearest.

    `contour_sensor` (M, 2) m is a simple polygon, counter-clockwise, in the sensor's frame with x
    along its heading; it may be concave, and only itself hides it.
    """
    # Imported here: composing reads the noise's settings, and must not pay for Numba.
    from stixel_cli.geometry.polygon import first_hits

    ranges = first_hits(contour_sensor, np.zeros(2), rays.directions)
    hit = np.flatnonzero(np.isfinite(ranges))
    return hit, ranges[hit]
