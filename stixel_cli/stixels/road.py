"""The road plane in the disparity image, and the pixels of obstacles on it.

A plane road that the camera looks along has the disparity a v + b in row v. With the camera H above
it and the pitch p (nose down), a point at height h above the road has y_level = H - h, so that

    d = B (cos p (v - v0) + f sin p) / (H - h),

and a pixel of disparity d is h = H (1 - (a v + b) / d) above the road. Both directions are
exact: a and b follow from H and p, and H and p from a and b.
"""

from dataclasses import replace
from typing import ClassVar

import cv2
import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning
from stixel_cli.geometry.rig import Rig
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.parameters import EstimatedRoad, RoadParameters

STEPS = 41
"""The estimate tries this many pitches, and this many heights."""

REFINEMENTS = 5
"""Least squares are repeated this often after the vote, each with half the former tolerance."""


def road_line(pitch: float | np.ndarray, height: float | np.ndarray, rig: Rig) -> np.ndarray:
    """Slope and offset (…, 2) of the road's disparity, px.

    `pitch` in rad and camera `height` in m are numbers, or arrays of one shape.
    """
    cosine, sine = np.cos(pitch), np.sin(pitch)
    scale = rig.baseline / height * (rig.focal / rig.focal_v)
    offset = scale * (rig.focal_v * sine - cosine * rig.v0)
    return np.stack([scale * cosine, offset], axis=-1)


def pitch_and_height(line: np.ndarray, rig: Rig) -> tuple[float, float]:
    """Pitch in rad and camera height in m of a road line (2,): the inverse of `road_line`."""
    pitch = np.arctan((line[1] / line[0] + rig.v0) / rig.focal_v)
    scale = rig.baseline * (rig.focal / rig.focal_v)
    return float(pitch), float(scale * np.cos(pitch) / line[0])


def pitch_factors(line: np.ndarray, rig: Rig) -> np.ndarray:
    """Factors (H,) float32 from a row's disparity to f B / z_level, z_level along the road.

    `line` (2,) is the road's disparity a v + b, px. An upright object has one z_level in all its
    rows, but not one disparity, if the camera is pitched:
    z_level = z (cos p - sin p (v - v0) / f_v).
    """
    pitch, _ = pitch_and_height(line, rig)
    rows = np.arange(rig.height)
    upright = np.cos(pitch) - np.sin(pitch) * (rows - rig.v0) / rig.focal_v
    return (1.0 / np.maximum(upright, 0.1)).astype(np.float32)


def base_rows(compensated_disparity: np.ndarray, line: np.ndarray, rig: Rig) -> np.ndarray:
    """Rows, any shape, float px, of the feet of upright objects of a pitch-compensated disparity.

    Where the road `line` (2,), a v + b, meets the object's disparity
    d_level (cos p - sin p (v - v0) / f_v).
    """
    pitch, _ = pitch_and_height(line, rig)
    sine = np.sin(pitch) / rig.focal_v
    upright = np.cos(pitch) + sine * rig.v0
    return (compensated_disparity * upright - line[1]) / (line[0] + compensated_disparity * sine)


def obstacle_limits(
    line: np.ndarray, rig: Rig, road: RoadParameters, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest raw disparity (H,) int32 of an obstacle pixel, row by row.

    An obstacle is between `road.least_height` and `road.greatest_height` above the road, and
    its disparity exceeds the road's by `road.disparity_margin`. `count` is the number of
    disparities searched. Rows without possible obstacles have least > greatest.
    """
    of_road = line[0] * np.arange(rig.height) + line[1]
    _, height = pitch_and_height(line, rig)
    lower = of_road + road.disparity_margin
    upper = np.full(rig.height, np.inf)
    # h > least is c d > a v + b with c = 1 - least / H, and h < greatest the other way round.
    for sign, limit in ((1.0, road.least_height), (-1.0, road.greatest_height)):
        factor, bound = sign * (1.0 - limit / height), sign * of_road
        if factor > 0:
            lower = np.maximum(lower, bound / factor)
        elif factor < 0:
            upper = np.minimum(upper, bound / factor)
        else:
            upper = np.where(bound < 0, upper, -np.inf)
    greatest = SUBPIXELS * count - 1
    lower = np.clip(np.floor(lower * SUBPIXELS) + 1, 1, greatest + 1)
    upper = np.clip(np.ceil(upper * SUBPIXELS) - 1, 0, greatest)
    return lower.astype(np.int32), upper.astype(np.int32)


def find_road(
    columns: np.ndarray,
    count: int,
    rig: Rig,
    road: RoadParameters,
    pitch: float = 0.0,
    height: float = 0.0,
) -> np.ndarray:
    """Road line (2,) of one disparity image, px: from the camera's pose, or estimated near the rig.

    The estimate is the plane, of a grid of pitches and heights round the rig's, for which the most
    pixels vote (the v-disparity histogram of Labayrade, Aubert, Tarel 2002), refined by least
    squares over the pixels near it. Without a vote it is the rig's.

    `pitch`, rad, and `height`, m, of the camera in this frame, beyond those of the rig, are for a
    road that is not estimated. Poses are no start for the estimate: their errors grow.
    """
    if not isinstance(road, EstimatedRoad):
        return road_line(rig.pitch_radians + pitch, rig.camera_height + height, rig)
    histogram = v_disparity(columns, count, road.column_step)
    spread = np.linspace(-1.0, 1.0, STEPS)
    pitches = rig.pitch_radians + np.radians(road.pitch_range) * spread
    heights = rig.camera_height * (1.0 + road.height_range * spread)
    lines = road_line(*(a.ravel() for a in np.meshgrid(pitches, heights, indexing="ij")), rig)
    votes = np.zeros(len(lines), dtype=np.int64)
    _add_votes(votes, np.cumsum(histogram, axis=1, dtype=np.int32), lines, road.tolerance)
    # Ties, and the empty image, go to the plane nearest to the rig's.
    away = (np.abs(spread)[:, None] + np.abs(spread)[None, :]).ravel()
    line = lines[np.lexsort((away, -votes))[0]]
    tolerance = road.tolerance
    for _ in range(REFINEMENTS):
        refined = np.array(_least_squares(histogram, line, tolerance))
        pitch, height = pitch_and_height(refined, rig) if refined[0] > 0 else (np.inf, np.inf)
        turn, rise = abs(pitch - rig.pitch_radians), abs(height / rig.camera_height - 1.0)
        if turn > np.radians(road.pitch_range) or rise > road.height_range:
            break
        line, tolerance = refined, max(0.5 * tolerance, 0.5)
    return line


@returning(lambda columns, count, step: np.zeros((columns.shape[1], 4 * count), dtype=np.int32))
@njit(cache=True, nogil=True, error_model="numpy")
def v_disparity(histogram, columns, count, step):
    """Histogram (H, 4 count) int32 of the disparities of each row, in bins of a quarter pixel."""
    width, height = columns.shape
    for u in range(0, width, step):
        for v in range(height):
            raw = columns[u, v]
            if raw > 0:
                histogram[v, raw >> 2] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _add_votes(votes, cumulative, lines, tolerance):
    """Add to (n,) int64 the pixels within `tolerance` px of each line; bins are cumulative."""
    height, bins = cumulative.shape
    for n in range(len(lines)):
        for v in range(height):
            centre = lines[n, 0] * v + lines[n, 1]
            if centre < 1.0:
                continue
            low = int(4.0 * max(centre - tolerance, 0.0))
            high = min(int(4.0 * (centre + tolerance)), bins - 1)
            if low <= high:
                votes[n] += cumulative[v, high] - (cumulative[v, low - 1] if low > 0 else 0)


@njit(cache=True, nogil=True, error_model="numpy")
def _least_squares(histogram, line, tolerance):
    """Slope and offset of the line through the pixels within `tolerance` px of `line` (2,).

    Those of `line` if the pixels are few.
    """
    height, bins = histogram.shape
    n = sv = sd = svv = svd = 0.0
    for v in range(height):
        centre = line[0] * v + line[1]
        if centre < 1.0:
            continue
        low = int(4.0 * max(centre - tolerance, 0.0))
        high = min(int(4.0 * (centre + tolerance)), bins - 1)
        for b in range(low, high + 1):
            # Raw disparities 4 b … 4 b + 3 in 1/16 px: their middle.
            weight, disparity = histogram[v, b], (4.0 * b + 1.5) / 16.0
            n += weight
            sv += weight * v
            sd += weight * disparity
            svv += weight * v * v
            svd += weight * v * disparity
    spread = n * svv - sv * sv
    if n < 100.0 or spread <= 0.0:
        return line[0], line[1]
    slope = (n * svd - sv * sd) / spread
    return slope, (sd - slope * sv) / n


MIDDLE = 1.7
"""m, the middle of the heights that are searched: from 0.25 to 3.1 m."""

LEAST_SHARE = 0.07
"""Of the pixels, within 1 px of the road; noise and images upside down have up to 0.05."""

NO_ROAD = (
    "the disparities show no road: no plane 0.25 to 3.1 m below the camera, with a pitch of up to "
    f"10°, contains {LEAST_SHARE:.0%} of the pixels"
)

USUAL_WIDTH = 1242
"""Width of the images for which that 1 px is chosen, px; larger images are thinned."""


class _AnyRoad(EstimatedRoad):
    height_range: ClassVar[float] = 0.85


def seen_road(disparities: Disparities, rig: Rig) -> tuple[float, float] | None:
    """Pitch, rad, and height, m, of the cameras over the road in one image; None without a road.

    They are searched far round those of the `rig`, `MIDDLE` and 0 for any. Of the road's disparity
    a v + b, a gives the height and b the pitch: an offset of the disparities adds to b, too, so
    they count as exact but for the error that the rig states.
    """
    road = _AnyRoad(kind="estimated", pitch_range=10.0)
    step = max(1, round(rig.width / USUAL_WIDTH))
    raw, count = disparities.raw(0), disparities.count
    if step > 1:
        raw, count = raw[::step, ::step] // step, -(-count // step)
        rig = replace(
            rig,
            width=raw.shape[1],
            height=raw.shape[0],
            horizontal_fov=None,
            focal_length=rig.focal / step,
            principal_u=rig.u0 / step,
            principal_v=rig.v0 / step,
        )
    line = find_road(cv2.transpose(raw), count, rig, road)
    of_road = (line[0] * np.arange(rig.height) + line[1])[:, None]
    if np.mean((np.abs(raw / SUBPIXELS - of_road) < 1.0) & (of_road > 1.0)) > LEAST_SHARE:
        return pitch_and_height(line, rig)
    return None
