"""Rays from the left camera, where they first meet a contour, and what is measured along them.

Frame: angles phi in the sensor's frame, counter-clockwise from its heading, rad, in (-pi, pi].
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le, Lt

from stixel_cli.geometry.rig import Rig
from stixel_cli.parameters import parameters


@dataclass(frozen=True)
class Rays:
    """Rays over a horizontal field of view, thesis (16)."""

    angles: np.ndarray
    """(n,) rad, ascending."""
    directions: np.ndarray
    """(n, 2) unit vectors along them."""
    steps: np.ndarray
    """(n,) rad, the angle between neighbours, there."""


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
    return Rays(angles, np.stack([np.cos(angles), np.sin(angles)], axis=-1), steps)


def first_crossings(contour_sensor: np.ndarray, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """Indices (m,) of the rays that meet a contour, ascending, and ranges (m,) m of the nearest.

    `contour_sensor` (M, 2) m is a simple polygon, counter-clockwise, in the sensor's frame with x
    along its heading; it may be concave, and only itself hides it.
    """
    # Imported here: composing reads the noise's settings, and must not pay for Numba.
    from stixel_cli.geometry.kernel import first_hits

    ranges = first_hits(contour_sensor, np.zeros_like(rays.directions), rays.directions)
    hit = np.flatnonzero(np.isfinite(ranges))
    return hit, ranges[hit]


@parameters
class StereoNoise:
    """Noise along the ray that grows with the depth: white in the disparity.

    Attributes:
        disparity_std: standard deviation of the disparity, px.
    """

    kind: Literal["stereo"]
    disparity_std: Annotated[float, Ge(0), Le(10)]
    columns_per_point: ClassVar[int] = 1


@parameters
class ConstantNoise:
    """Noise along the ray that is the same at every range.

    Attributes:
        range_std: standard deviation of the range, m.
    """

    kind: Literal["constant"]
    range_std: Annotated[float, Ge(0), Le(10)]
    columns_per_point: ClassVar[int] = 1


@parameters
class FittedNoise:
    """Noise fitted to the errors of simulated points: `stixel study rq3` writes the presets.

    Columns are rays. The error along the ray is `range_bias` + e; e has the standard deviation
    `disparity_std` dr/dd, dr/dd the range sensitivity, and is
    correlated along the row. One part each for bias, spread and ends: with a second (bias of the
    disparity, spread of the range, ends in columns) the fit follows the ranges of its own paths,
    and is farther from the points of others.

    Attributes:
        columns_per_point: columns that make one point, as those of a stixel do.
        range_bias: measured minus true range, m: the visible surface is behind the contour, which
            is the outermost outline over all heights.
        disparity_std: standard deviation, px.
        correlation_columns: columns over which the correlation of neighbours falls to 1/e; 0:
            no correlation.
        edge_metres, edge_metres_std: how far the points reach beyond either end of the
            silhouette, mean and standard deviation, metres at the target. Positive is edge
            fattening, points next to the target; negative are ends that give no points, such as
            arms and wheels too slight for a stixel.
        edge_disparity_std: standard deviation, px, that the outermost point of either end
            has in addition, from mixed depths.
        missed_share: share of the points between the ends that are missed.
        missed_columns: mean length of a run of missed points, columns.
    """

    kind: Literal["fitted"]
    columns_per_point: Annotated[int, Ge(1), Le(256)]
    range_bias: Annotated[float, Ge(-10), Le(10)]
    disparity_std: Annotated[float, Ge(0), Le(10)]
    correlation_columns: Annotated[float, Ge(0), Le(1000)]
    edge_metres: Annotated[float, Ge(-10), Le(10)]
    edge_metres_std: Annotated[float, Ge(0), Le(10)]
    edge_disparity_std: Annotated[float, Ge(0), Le(10)]
    missed_share: Annotated[float, Ge(0), Lt(1)]
    missed_columns: Annotated[float, Ge(1), Le(1000)]


Noise = StereoNoise | ConstantNoise | FittedNoise


def range_std(noise: Noise, ranges: np.ndarray, angles: np.ndarray, rig: Rig) -> np.ndarray:
    """Standard deviation (n,) m along rays `angles` (n,) rad off the optical axis, thesis (17)."""
    if noise.kind == "constant":
        return np.full(len(ranges), noise.range_std)
    return range_sensitivity(ranges, angles, rig, noise.disparity_std)


def range_sensitivity(
    ranges: np.ndarray, angles: np.ndarray, rig: Rig, disparity: float = 1.0
) -> np.ndarray:
    """Growth (n,) m of the range if the disparity is less by `disparity` px; m/px for 1.

    To first order: z = f B / d, so dz = -(z² / f B) dd at z = r cos(angle), dr = dz / cos(angle).
    """
    cosine = np.cos(angles)
    depth = ranges * cosine
    return depth**2 * (disparity / (rig.focal * rig.baseline)) / cosine


def measure(
    noise: Noise,
    hit: np.ndarray,
    ranges: np.ndarray,
    rays: Rays,
    rig: Rig,
    random: "np.random.Generator",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays (n,) that give a point, the ranges (n,) m that they should measure, and those they do.

    `hit` (m,) are the rays that meet the contour, ascending, at `ranges` (m,) m. With fitted noise,
    each block of rays gives a point whose middle ray is between the shifted ends.
    """
    if noise.kind != "fitted":
        std = range_std(noise, ranges, rays.angles[hit], rig)
        return hit, ranges, ranges + std * random.standard_normal(len(hit))
    drawn = random.standard_normal(2)
    if len(hit) == 0:
        return hit, ranges, ranges
    ends = [0, -1]
    per_metre = 1.0 / (ranges[ends] * rays.steps[hit[ends]])
    shifts = (noise.edge_metres + noise.edge_metres_std * drawn) * per_metre
    width, last_ray = noise.columns_per_point, len(rays.angles) - 1
    # An end at the image's border is not an end of the silhouette.
    left = hit[0] - 0.5 - (shifts[0] if hit[0] > 0 else 0.0)
    right = hit[-1] + 0.5 + (shifts[1] if hit[-1] < last_ray else 0.0)
    middles = np.arange(width // 2, last_ray + 1, width)
    ray = middles[(middles > left) & (middles < right)]
    # Outside the silhouette the range is that of the nearest ray that meets the contour.
    nearest = np.clip(np.searchsorted(hit, ray), 0, len(hit) - 1)
    true, angles = ranges[nearest], rays.angles[ray]
    sensitivity = range_sensitivity(true, angles, rig)
    correlated = _neighbours(noise, len(ray), random)
    error = noise.range_bias + range_std(noise, true, angles, rig) * correlated
    mixed = noise.edge_disparity_std * random.standard_normal(2)
    if len(ray) > 1:
        error[[0, -1]] -= mixed * sensitivity[[0, -1]]
    seen = ~_missed(noise, len(ray), random)
    return ray[seen], true[seen], (true + error)[seen]


def _neighbours(noise: FittedNoise, count: int, random: "np.random.Generator") -> np.ndarray:
    """Standard normal numbers (count,) with correlated neighbours, e^(-columns / length).

    An exponential correlation of evenly spaced points is a first-order autoregression.
    """
    white = random.standard_normal(count)
    if noise.correlation_columns == 0.0 or count == 0:
        return white
    share = float(np.exp(-noise.columns_per_point / noise.correlation_columns))
    rest = float(np.sqrt(1.0 - share**2))
    values = white.tolist()
    for i in range(1, count):
        values[i] = share * values[i - 1] + rest * values[i]
    return np.array(values)


def _missed(noise: FittedNoise, count: int, random: "np.random.Generator") -> np.ndarray:
    """Whether each of `count` points is missed: a Markov chain of two states along the row."""
    drawn = random.random(count)
    if noise.missed_share == 0.0:
        return np.zeros(count, dtype=bool)
    leave = min(1.0, noise.columns_per_point / noise.missed_columns)
    enter = min(1.0, leave * noise.missed_share / (1.0 - noise.missed_share))
    missed, state = [], None
    for number in drawn.tolist():
        limit = noise.missed_share if state is None else 1.0 - leave if state else enter
        state = number < limit
        missed.append(state)
    return np.array(missed, dtype=bool)
