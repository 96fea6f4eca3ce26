"""Errors of stixel disparities against the labels of a recording, and the rig's error in them."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stixel_cli.calibration.disparity_fit import DisparityFit, fit_line
from stixel_cli.geometry.pose import rectangle, world_from_target
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.rays import Rays, first_crossings, spread_rays
from stixel_cli.recordings.tables import read_labels
from stixel_cli.recordings.types import Labels, Tables
from stixel_cli.scene.classes import CLASS_OF_KITTI_TYPE
from stixel_cli.stixels.types import Stixels

GREATEST_ERROR = 3.0
"""A stixel farther from the label's face than this, px, is of another object."""

INNER = 0.7
"""Share of the columns of a label that is used: at its sides a stixel may be of the background."""

LEAST_STIXELS = 3
"""Per label."""

LABEL_STD = 0.05
"""Of a label's place, m."""

DISPARITY_STD = 0.15
"""Of the median over a label's stixels, px."""


@dataclass(frozen=True)
class LabelErrors:
    """Disparity errors, one row per label of a car that is neither truncated nor occluded.

    Attributes:
        frames: (n,) numbers of the frames.
        tracks: (n,) one number per track.
        columns: (n,) px, middle of the label's stixels.
        depths: (n,) m, of the label's visible face there.
        errors: (n,) px: measured minus that of the face, the median over the label's stixels.
        stds: (n,) px, standard deviations that the fit assumes.
    """

    frames: np.ndarray
    tracks: np.ndarray
    columns: np.ndarray
    depths: np.ndarray
    errors: np.ndarray
    stds: np.ndarray


def label_errors(
    stixels: Iterable[Stixels], files: tuple[Path, ...], rig: Rig, tables: Tables
) -> LabelErrors:
    """Errors at all labelled cars in the frames of `stixels`.

    The true disparity of a stixel is that of the label's box where the ray of the stixel's middle
    column enters it.

    Args:
        stixels: chunks in the order of their frames.
        files: the files of the labels.
        rig: of the stixels.
        tables: how the files are written.
    """
    rays = column_rays(rig)
    tracks = enumerate(read_labels(files, tables).values())
    cars = {i: one for i, one in tracks if CLASS_OF_KITTI_TYPE.get(one.kind) == "car"}
    rows = []
    for chunk in stixels:
        for i in range(len(chunk.offsets) - 1):
            number = tables.first + chunk.first + i
            for track, labels in cars.items():
                for row in np.flatnonzero(labels.frames == number):
                    if labels.truncated[row] or labels.occluded[row]:
                        continue
                    face = label_face(labels, row, rays, rig, tables.left_camera)
                    found = _one_label(chunk, chunk.rows(i), face, rig)
                    if found is not None:
                        rows.append((number, track, *found))
    columns = np.array(rows, dtype=np.float64).reshape(-1, 6).T
    return LabelErrors(columns[0].astype(np.int64), columns[1].astype(np.int64), *columns[2:])


def column_rays(rig: Rig) -> Rays:
    """One ray per image column, the rightmost first."""
    right = -np.arctan((rig.width - 1 - rig.u0) / rig.focal)
    return spread_rays(rig.width, (float(right), float(np.arctan(rig.u0 / rig.focal))), True)


def face_depths(contour: np.ndarray, rays: Rays, rig: Rig) -> np.ndarray:
    """Depth (W,) m at which the ray of each column enters a contour (M, 2); NaN outside it."""
    depths = np.full(rig.width, np.nan)
    hit, ranges = first_crossings(contour, rays)
    depths[rig.width - 1 - hit] = ranges * np.cos(rays.angles[hit])
    return depths


def label_face(
    labels: Labels, row: int, rays: Rays, rig: Rig, left_camera: tuple[float, float, float]
) -> np.ndarray:
    """Depth (W,) m at which the ray of each column enters a label's box; NaN outside it."""
    place = rig.level_from_camera @ (labels.places[row] - np.array(left_camera))
    _, width, length = labels.sizes[row]
    # Frame of the rays: x ahead, y to the left.
    pose = np.array([place[2], -place[0], -labels.yaws[row] - 0.5 * np.pi])
    return face_depths(world_from_target(rectangle(length, width), pose), rays, rig)


def fit_label_errors(found: LabelErrors, rig: Rig) -> DisparityFit:
    """The offset and slope of the rig's disparities that `found` shows.

    The slope is 0 if the labels are of one target, which cannot show it.

    Raises:
        ValueError: without any label.
    """
    if len(found.errors) == 0:
        raise ValueError("no car in these frames is labelled as fully visible and has stixels")
    tracks = len(np.unique(found.tracks))
    unit = f"labels of {tracks} car{'s' if tracks > 1 else ''}"
    line = fit_line(found.columns, found.errors, found.stds, sloped=tracks > 1, rig=rig)
    return DisparityFit(method="labels", unit=unit, **line)


def _one_label(
    chunk: Stixels, rows: slice, face: np.ndarray, rig: Rig
) -> tuple[float, float, float, float] | None:
    """Column, depth, error and its standard deviation at one label; None with too few stixels."""
    seen = np.flatnonzero(np.isfinite(face))
    if len(seen) == 0:
        return None
    margin = 0.5 * (1.0 - INNER) * (seen[-1] - seen[0] + 1)
    columns = (chunk.left[rows] + chunk.right[rows] - 1) // 2
    inside = (columns >= seen[0] + margin) & (columns <= seen[-1] - margin)
    columns, measured = columns[inside], chunk.disparity[rows][inside]
    depths = face[columns]
    errors = measured - rig.disparity_from_depth(depths)
    near = np.abs(errors) <= GREATEST_ERROR
    if near.sum() < LEAST_STIXELS:
        return None
    depth = float(np.median(depths[near]))
    per_metre = float(rig.disparity_from_depth(depth)) / depth
    std = float(np.hypot(DISPARITY_STD, per_metre * LABEL_STD))
    return float(np.median(columns[near])), depth, float(np.median(errors[near])), std
