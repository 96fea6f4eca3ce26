"""The offset between a pair of images and its true disparities, without a matcher.

The image is cut into patches. Where the truth in a patch is one upright plane, the right image is
warped by it to the left view, and the shift that is left is estimated by least squares (Lucas,
Kanade 1981). So the result is about the images and the truth, and about no matcher.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.image_files import read_disparity
from stixel_cli.rendering.frames import StereoPairs

SIDE = 12
"""Of a patch, px."""

LEAST_TRUTH = 16
"""Pixels of a patch with a true disparity."""

UPRIGHT = 0.03
"""Greatest change of the truth from row to row, px: the road has more, and no stixels."""

FLATNESS = 0.3
"""Greatest standard deviation of the truth from its plane, px."""

STEPS = 6

GREATEST_SHIFT = 2.0
"""A patch that moves farther, px, has locked to something else."""

LEAST_TEXTURE = 25.0
"""Mean square of the grey value's change along the row, per px²."""


@dataclass(frozen=True)
class Alignment:
    """Shift of the images against the truth, one row per patch.

    Attributes:
        columns, rows: (n,) px, middles of the patches.
        truth: (n,) px, true disparity there.
        shifts: (n,) px, disparity of the images minus the true one.
    """

    columns: np.ndarray
    rows: np.ndarray
    truth: np.ndarray
    shifts: np.ndarray


def align_truth(pairs: Iterable[StereoPairs], files: tuple[Path, ...], rig: Rig) -> Alignment:
    """Shifts of all patches of all frames whose truth is a plane.

    Args:
        pairs: chunks in the order of their frames.
        files: the true disparities, one file per frame.
        rig: the images' disparities are corrected by its present disparity error.

    Raises:
        UserError: if a file is not valid.
    """
    found = [np.zeros((0, 4))]
    for chunk in pairs:
        for i in range(len(chunk)):
            truth = read_disparity(files[chunk.first + i])
            found.append(_frame(chunk.left[i], chunk.right[i], truth, rig))
    return Alignment(*np.concatenate(found).T)


def _frame(left: np.ndarray, right: np.ndarray, truth: np.ndarray, rig: Rig) -> np.ndarray:
    """Rows (n, 4) of column, row, true disparity and shift."""
    import cv2

    height, width = (SIDE * (size // SIDE) for size in left.shape)
    v, u = np.mgrid[:height, :width].astype(np.float64)
    planes, usable = _planes(truth[:height, :width], rig.disparity_errors()[:width])
    disparity = (
        _spread(planes[0]) + _spread(planes[1]) * (u % SIDE) + _spread(planes[2]) * (v % SIDE)
    )
    one = cv2.GaussianBlur(left, (3, 3), 0).astype(np.float32)[:height, :width]
    other = cv2.GaussianBlur(right, (3, 3), 0).astype(np.float32)
    shift = np.zeros(planes[0].shape)
    texture = np.zeros(planes[0].shape)
    for _ in range(STEPS):
        at = (u - disparity - _spread(shift)).astype(np.float32)
        inside = (at > 2) & (at < right.shape[1] - 3)
        seen = cv2.remap(other, at, v.astype(np.float32), cv2.INTER_CUBIC)
        # A greater disparity moves the sample to the left.
        slope = -0.5 * (
            cv2.remap(other, at + 1, v.astype(np.float32), cv2.INTER_CUBIC)
            - cv2.remap(other, at - 1, v.astype(np.float32), cv2.INTER_CUBIC)
        )
        n = np.maximum(_sums(inside), 1)
        difference, slope = np.where(inside, one - seen, 0.0), np.where(inside, slope, 0.0)
        # Patches differ in brightness: without the means.
        texture = (_sums(slope**2) - _sums(slope) ** 2 / n) / n
        change = (_sums(slope * difference) - _sums(slope) * _sums(difference) / n) / n
        shift = shift + np.clip(change / np.maximum(texture, 1e-6), -0.5, 0.5)
    whole = _sums(inside) == SIDE**2
    good = usable & whole & (texture > LEAST_TEXTURE) & (np.abs(shift) < GREATEST_SHIFT)
    row, column = np.nonzero(good)
    middle = 0.5 * (SIDE - 1)
    true = planes[0] + middle * (planes[1] + planes[2])
    columns = SIDE * column + middle
    true = true[good] - np.interp(columns, np.arange(rig.width), rig.disparity_errors())
    return np.stack([columns, SIDE * row + middle, true, shift[good]], axis=1)


def _planes(truth: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Planes (3, R, C) through the truth of each patch, and which (R, C) are good.

    Values: px at the patch's first pixel, px per column, px per row; the `errors` (W,) are added.
    """
    height, width = truth.shape
    v, u = np.mgrid[:height, :width]
    known = np.isfinite(truth)
    d = np.where(known, truth + errors, 0.0)
    terms = [known * one for one in (np.ones_like(d), u % SIDE, v % SIDE)]
    normal = np.stack([[_sums(a * b) for b in terms] for a in terms])
    right = np.stack([_sums(a * d) for a in terms])
    count = normal[0, 0]
    # A small term keeps patches without truth solvable.
    normal = np.moveaxis(normal, (0, 1), (2, 3)) + 1e-6 * np.eye(3)
    planes = np.linalg.solve(normal, np.moveaxis(right, 0, 2)[..., None])[..., 0]
    planes = np.moveaxis(planes, 2, 0)
    model = sum(_spread(one) * term for one, term in zip(planes, terms, strict=True))
    spread = np.sqrt(_sums((known * (d - model)) ** 2) / np.maximum(count, 1))
    upright = np.abs(planes[2]) < UPRIGHT
    return planes, upright & (count >= LEAST_TRUTH) & (spread < FLATNESS)


def _sums(values: np.ndarray) -> np.ndarray:
    """Sums (R, C) over the patches of (R SIDE, C SIDE) values."""
    rows, columns = (size // SIDE for size in values.shape)
    return values.reshape(rows, SIDE, columns, SIDE).sum(axis=(1, 3), dtype=np.float64)


def _spread(values: np.ndarray) -> np.ndarray:
    """Values (R SIDE, C SIDE) of patches' values (R, C)."""
    return np.repeat(np.repeat(values, SIDE, axis=0), SIDE, axis=1)
