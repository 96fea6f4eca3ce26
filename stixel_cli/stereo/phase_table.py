"""Correction of the pull of semi-global matching to whole pixels by a table of sub-pixel phases."""

import numpy as np

from stixel_cli.stereo.disparities import INVALID, SUBPIXELS

PHASE_TABLE = (0, 2, 4, 5, 6, 7, 7, 8, 8, 8, 9, 9, 10, 11, 12, 14)
"""True phase by matched phase, 1/16 px. `python bench/phase_table.py` prints it."""

NEAR = 4
"""A median that is farther from its pixel is of another surface, 1/16 px."""


def correct_phases(raw: np.ndarray) -> np.ndarray:
    """Raw disparity (H, W) int16 with the phases of `PHASE_TABLE`, and less noise.

    `raw` (H, W) int16 is in 1/16 px, negative without a match. True phases are even over a large
    area, matched phases are not, so their cumulated histogram is the correction. The median of
    5 × 5 px makes up for the noise that the mean with a second match removes; it is taken only
    within `NEAR`, so that edges stay.
    """
    import cv2

    # OpenCV looks up bytes: the lowest one of a raw disparity has its phase.
    steps = np.array(PHASE_TABLE, dtype=np.int8) - np.arange(SUBPIXELS, dtype=np.int8)
    corrected = raw + cv2.LUT(raw.astype(np.uint8), np.tile(steps, 256 // SUBPIXELS))
    median = cv2.medianBlur(corrected, 5)
    near = (raw >= 0) & (median >= 0) & (np.abs(median - corrected) <= NEAR)
    np.copyto(corrected, median, where=near)
    # The phase of INVALID moved it, but it is still negative.
    return np.maximum(corrected, INVALID, out=corrected)
