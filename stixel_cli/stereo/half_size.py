"""Large disparities from images of half the size, which also check the small ones."""

import numpy as np

from stixel_cli.stereo.disparities import INVALID, SUBPIXELS

AGREE = 2
"""Disparities of both sizes that are as near to each other are of the same point, px."""


def halved(image: np.ndarray) -> np.ndarray:
    """A grey image (H, W) uint8 at half the size, (⌈H/2⌉, ⌈W/2⌉): means of 2 × 2 px."""
    import cv2

    height, width = image.shape
    even = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
    return cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def halved_range(minimum: int, count: int, step: int) -> tuple[int, int]:
    """Least disparity and their number, a multiple of `step`, at half the size."""
    least = minimum // 2
    return least, step * -(-(minimum + count - 2 * least) // (2 * step))


def combined(full: np.ndarray, half: np.ndarray, end: int, greatest: int) -> np.ndarray:
    """Raw disparity (H, W) int16 in 1/16 px of both sizes.

    Where both agree, that of the full size is taken: it is more precise. Else that of the half size
    is doubled, if it is outside of the range of the full size: there the full size finds a wrong
    point or no point. Other pixels are invalid.

    Args:
        full: (H, W) int16, searched below `end` px. It needs no checks of its own.
        half: (⌈H/2⌉, ⌈W/2⌉) int16, searched everywhere and checked.
        greatest: disparities from here on are invalid, px.
    """
    import cv2

    height, width = full.shape
    # Each pixel four times: INTER_NEAREST takes column u // 2.
    doubled = cv2.resize(2 * half, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)
    doubled = doubled[:height, :width]
    agree = (full >= 0) & (doubled >= 0) & (np.abs(full - doubled) <= AGREE * SUBPIXELS)
    near = (doubled >= (end - AGREE) * SUBPIXELS) & (doubled < greatest * SUBPIXELS)
    return np.where(agree, full, np.where(near, doubled, np.int16(INVALID)))
