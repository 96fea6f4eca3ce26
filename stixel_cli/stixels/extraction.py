"""Stixels from free space and height, Badino, Franke, Pfeiffer 2009, *The Stixel World*."""

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.grouping import BINS_PER_PIXEL, Grouping, Layer, group_columns
from stixel_cli.stixels.height import Frame, depth_windows, top_rows
from stixel_cli.stixels.layers import layers_behind
from stixel_cli.stixels.parameters import ExtractionParameters, HeightParameters
from stixel_cli.stixels.refinement import aligned
from stixel_cli.stixels.road import base_rows, pitch_and_height
from stixel_cli.stixels.types import SAME_OBJECT, FreeSpace, Stixels

UNEVEN_REACH = 8
"""The unevenness of a surface is a mean over so many stixels on either side."""


def extract_stixels(
    disparities: Disparities,
    free_space: FreeSpace,
    pairs: StereoPairs,
    rig: Rig,
    height: HeightParameters,
    extraction: ExtractionParameters,
    frames: range,
) -> Stixels:
    """Stixels of `frames`, with pitch-compensated disparities like those of the free space."""
    found = []
    for k in frames:
        i = k - free_space.first
        columns = cv2.transpose(disparities.raw(k - disparities.first))
        of_frame = free_space.disparity[i], free_space.base_row[i], free_space.road[i]
        frame = Frame(columns, disparities.count, *of_frame, rig)
        images = None
        if extraction.refinement > 0:
            images = pairs.left[k - pairs.first], pairs.right[k - pairs.first]
        found.append(stixels_of_frame(frame, height, extraction, images))
    offsets = np.cumsum([0] + [len(f["left"]) for f in found], dtype=np.int64)
    arrays = {name: np.concatenate([f[name] for f in found]) for name in found[0]}
    return Stixels(first=frames.start, offsets=offsets, **arrays)


def stixels_of_frame(
    frame: Frame,
    height: HeightParameters,
    extraction: ExtractionParameters,
    images: tuple[np.ndarray, np.ndarray] | None = None,
) -> dict[str, np.ndarray]:
    """Stixels of one frame, the fields of `Stixels` by name; of the same columns the nearest first.

    `images` are left and right (H, W) uint8, read where `extraction.refinement` is not 0.
    """
    rig, columns = frame.rig, frame.columns
    grouping = Grouping(
        extraction.width,
        smoothing_kernel(extraction.smoothing),
        extraction.least_pixels,
        # A height h has f_v h / z = (f_v / f) h d / B rows.
        extraction.front_height / rig.baseline * rig.focal_v / rig.focal,
        extraction.front_margin,
    )
    foot = rows_at_height(frame.obstacle, frame.base_row, rig, extraction.least_height)
    layers = [(frame.obstacle, top_rows(frame, height), foot, frame.base_row)]
    if extraction.layers == "many":
        limits = extraction.width, height.depth_margin, extraction.least_height
        behind = layers_behind(frame, *limits)
        layers += [(further, top, base, base) for further, top, base in behind]
    found: list[dict[str, np.ndarray]] = []
    for obstacle, tops, foot, base_row in layers:
        window = depth_windows(obstacle, rig, height.depth_margin)
        head = np.maximum(tops, rows_at_height(obstacle, base_row, rig, extraction.greatest_height))
        layer = Layer(obstacle, window, tops, head, foot, base_row)
        areas, values = group_columns(columns, frame.scale, frame.count, layer, grouping)
        if found:
            # Only behind a stixel, so that the first one of a group's columns is the nearest.
            behind_one = np.isin(areas[:, 0], found[0]["left"])
            areas, values = areas[behind_one], values[behind_one]
        if extraction.refinement > 0:
            given, errors = np.ascontiguousarray(values[:, 0]), rig.disparity_errors()
            refined = aligned(*images, columns, areas, given, frame.scale, errors)
            values[:, 0] += extraction.refinement * (refined - given)
        areas[:, 2] = np.maximum(areas[:, 2] - height.hidden_rows, 0)
        fields = group_fields(areas, values, frame, extraction)
        if found:
            # Its foot is hidden.
            fields["base"] = np.minimum(fields["base"], areas[:, 3]).astype(np.int32)
        found.append(fields)
    order = np.argsort(np.concatenate([fields["left"] for fields in found]), kind="stable")
    return {name: np.concatenate([fields[name] for fields in found])[order] for name in found[0]}


def rows_at_height(
    obstacle: np.ndarray, base_row: np.ndarray, rig: Rig, height: float
) -> np.ndarray:
    """Rows (W,) int32 that see the obstacles `height` m above the road; -1 where free.

    A height h has f_v h / z = (f_v / f) h d / B rows.
    """
    rows_per_px = height / rig.baseline * (rig.focal_v / rig.focal)
    # More than the image has are as many: a wide and low image would overflow.
    rows = np.minimum(np.rint(rows_per_px * np.nan_to_num(obstacle)), rig.height).astype(np.int32)
    return np.where(base_row >= 0, np.maximum(base_row - rows, -1), -1).astype(np.int32)


def smoothing_kernel(std: float) -> np.ndarray:
    """Normal density (2 r + 1,) float64 in bins, of `std` px, sum 1."""
    reach = int(np.ceil(3.0 * std * BINS_PER_PIXEL))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (std * BINS_PER_PIXEL)) ** 2)
    return kernel / kernel.sum()


def group_fields(
    areas: np.ndarray, measured: np.ndarray, frame: Frame, extraction: ExtractionParameters
) -> dict[str, np.ndarray]:
    """Fields of `Stixels` from column ranges, tops and disparities.

    `areas` (S, 4) are left, right (exclusive), top and base row; `measured` (S, 2)
    pitch-compensated disparity px and mean row of the pixels.
    """
    line, rig = frame.line, frame.rig
    left, right, top = areas[:, 0], areas[:, 1], areas[:, 2].astype(np.float64)
    disparity, mean_row = measured[:, 0], measured[:, 1]
    pitch, camera_height = pitch_and_height(line, rig)
    focal_baseline = rig.focal * rig.baseline
    depth = focal_baseline / disparity
    upright = np.cos(pitch) - np.sin(pitch) * (mean_row - rig.v0) / rig.focal_v
    depth_camera = depth / upright
    bearing = (0.5 * (left + right - 1) - rig.u0) / rig.focal
    points = np.stack([bearing * depth_camera, depth], axis=1)
    # Depth along the ray, and the place within the columns across it (even over them: w²/12).
    neighbours, step = surroundings(left, depth, extraction.width)
    scatter = step + unevenness(left, depth, extraction.width)
    variance = np.where(neighbours < 3, extraction.edge_std**2, 0.0) + extraction.least_std**2
    depth_variance = (depth / disparity) ** 2 * variance + scatter + extraction.surface_std**2
    ray = np.stack([bearing / upright, np.ones_like(depth)], axis=1)
    covariances = depth_variance[:, None, None] * ray[:, :, None] * ray[:, None, :]
    covariances[:, 0, 0] += (depth_camera * (right - left) / rig.focal) ** 2 / 12.0
    base = np.clip(np.rint(base_rows(disparity, line, rig)), top, rig.height - 1)
    # The top row's upper edge; with d = f B / z its disparity in the image is the road's at h = H.
    edge = top - 0.5
    at_edge = disparity * (np.cos(pitch) - np.sin(pitch) * (edge - rig.v0) / rig.focal_v)
    return {
        "left": left.astype(np.int32),
        "right": right.astype(np.int32),
        "top": areas[:, 2].astype(np.int32),
        "base": base.astype(np.int32),
        "disparity": disparity,
        "disparity_variance": variance,
        "depth": depth,
        "height": camera_height * (1.0 - (line[0] * edge + line[1]) / at_edge),
        "points_ego": points,
        "covariances_ego": covariances,
    }


def surroundings(left: np.ndarray, depth: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """How many of the two stixels on either side are on the same object, and the step to them.

    Neighbours (S,) int64, 0 … 4, nearer than `SAME_OBJECT`; and an eighth of the mean square of
    their differences of depth (S,) m², 0 without a neighbour. On a slope that is the variance of a
    point that is half a stixel's step off. `left` (S,) are the first columns, ascending, multiples
    of `width`; `depth` (S,) is in m.
    """
    count = np.zeros(len(left), dtype=np.int64)
    squares = np.zeros(len(left))
    for apart in (1, 2):
        near, far = np.arange(len(left) - apart), np.arange(apart, len(left))
        # Not across a gap of two stixels or more.
        within = left[far] - left[near] <= 2 * width
        within &= np.abs(depth[far] - depth[near]) < SAME_OBJECT
        near, far = near[within], far[within]
        squared = (depth[far] - depth[near]) ** 2
        for side in (near, far):
            count[side] += 1
            squares[side] += squared
    return count, 0.125 * squares / np.maximum(count, 1)


def unevenness(left: np.ndarray, depth: np.ndarray, width: int) -> np.ndarray:
    """Variance (S,) m² of the depths about a straight line through their neighbours.

    A sixth of the mean square of z₋ - 2 z + z₊ over the stixels of one object, up to `UNEVEN_REACH`
    on either side: that is the variance of one z if their errors are independent. A slope has none,
    wheels, limbs and a matcher's noise have some; 0 where no three stixels follow each other.
    The arguments are those of `surroundings`.
    """
    n = len(left)
    same = (np.diff(left) <= 2 * width) & (np.abs(np.diff(depth)) < SAME_OBJECT)
    middle = np.flatnonzero(same[:-1] & same[1:]) + 1
    squares, known = np.zeros(n), np.zeros(n)
    squares[middle] = (depth[middle - 1] - 2.0 * depth[middle] + depth[middle + 1]) ** 2 / 6.0
    known[middle] = 1.0
    # First stixel of each one's object, and the first after it.
    breaks = np.flatnonzero(~same) + 1
    start, end = np.zeros(n, dtype=np.int64), np.full(n, n)
    start[breaks], end[breaks - 1] = breaks, breaks
    start, end = np.maximum.accumulate(start), np.minimum.accumulate(end[::-1])[::-1]
    first = np.maximum(np.arange(n) - UNEVEN_REACH, start)
    last = np.minimum(np.arange(n) + UNEVEN_REACH + 1, end)
    total = np.concatenate([[0.0], np.cumsum(squares)])
    count = np.concatenate([[0.0], np.cumsum(known)])
    # A difference of two sums that are equal but for rounding must not be below 0.
    return np.maximum(total[last] - total[first], 0.0) / np.maximum(count[last] - count[first], 1.0)
