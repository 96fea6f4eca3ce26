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
        field_of_view: bearings of its two borders, rad, ascending, less than half a turn apart.
        even_tangent: even in tan phi, as a pinhole's columns are; else even in phi.
    """

    angles: np.ndarray
    directions: np.ndarray
    steps: np.ndarray
    field_of_view: tuple[float, float]
    even_tangent: bool

    def position(self, angles: np.ndarray) -> np.ndarray:
        """Where `angles` rad, any shape, fall among the rays: a real index; -1, n beyond them."""
        low, high = self.field_of_view
        beyond = np.where(angles < low, -1.0, float(len(self.angles)))
        # Clipping must not move to the border a crossing beyond it.
        outside = (angles < low) | (angles > high)
        values = np.clip(angles, low, high)
        if self.even_tangent:
            low, high, values = np.tan(low), np.tan(high), np.tan(values)
        inside = (values - low) * ((len(self.angles) - 1) / (high - low))
        return np.where(outside, beyond, inside)


def spread_rays(count: int, field_of_view: tuple[float, float], even_tangent: bool) -> Rays:
    """`count` >= 2 rays; the first and last are the borders of `field_of_view`, see `Rays`."""
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
        field_of_view=field_of_view,
        even_tangent=even_tangent,
    )


def first_crossings(contour_sensor: np.ndarray, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """Indices (m,) of the rays that meet a contour, ascending, and ranges (m,) m of the nearest.

    `contour_sensor` (M, 2) m is a simple polygon, counter-clockwise, in the sensor's frame with x
    along its heading; it may be concave, and only itself hides it. Rays enter it through edges that
    face the sensor, so the others are left out, as if the sensor were never inside. Each edge
    spans a run of neighbouring rays: the work is one division a crossing, not a ray times an edge.
    """
    x, y = np.concatenate([contour_sensor, contour_sensor[:1]]).T
    # a × b < 0: seen from the sensor the edge a → b runs clockwise, so its outside faces the
    # sensor.
    cross = x[:-1] * y[1:] - y[:-1] * x[1:]
    facing = np.flatnonzero(cross < 0.0)
    bearing = np.arctan2(y, x)
    position = rays.position(bearing)
    first = np.ceil(position[facing + 1])
    last = np.floor(position[facing])
    low, high = bearing[facing + 1], bearing[facing]
    seam = low > high
    if seam.any():
        # An edge that crosses the seam behind the sensor spans less than half a turn, and the
        # rays less than half a turn too, so at most one of its two ends can reach them.
        from_above = seam & (low <= rays.field_of_view[1])
        first[seam & ~from_above] = 0.0
        last[from_above] = len(rays.angles)
    first = np.maximum(first, 0.0).astype(np.int64)
    last = np.minimum(last, len(rays.angles) - 1.0).astype(np.int64)
    counts = np.maximum(last - first + 1, 0)

    # One row a crossing: the edge, and the run of rays that it spans.
    edge = np.repeat(np.arange(len(facing)), counts)
    ray = np.arange(len(edge)) + (first - np.cumsum(counts) + counts)[edge]
    # range = (a × b) / (d × (b - a)) along the unit vector d.
    along_x, along_y = (x[facing + 1] - x[facing])[edge], (y[facing + 1] - y[facing])[edge]
    rate = rays.directions[ray, 0] * along_y - rays.directions[ray, 1] * along_x
    distance = np.hypot(x, y)
    farthest = np.maximum(distance[facing], distance[facing + 1])[edge]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = cross[facing][edge] / rate
    # A ray along an edge meets it somewhere up to its far end; rounding must not give a farther
    # one.
    ranges = np.where((ranges > 0.0) & (ranges < farthest), ranges, farthest)
    nearest = np.full(len(rays.angles), np.inf)
    np.minimum.at(nearest, ray, ranges)
    hit = np.flatnonzero(np.isfinite(nearest))
    return hit, nearest[hit]
