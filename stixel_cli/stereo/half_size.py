"""Large disparities from images of half the size, which also check the small ones."""

import numpy as np

from stixel_cli.stereo.disparities import INVALID, SUBPIXELS

AGREE = 2
"""Disparities of both sizes that differ by at most this are of the same surface, px."""

HOLE = 5
"""A pixel without a match may be of the surface of one so many pixels away, at half the size."""


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

    Where both agree, that of the full size is taken: it is more precise. Where the half size has no
    match, its least or greatest one within `HOLE` may agree. Else that of the half size is doubled,
    if it is above `end` - `AGREE`: there the full size finds a wrong point or no point. Other
    pixels are invalid.

    Args:
        full: (H, W) int16, searched below `end` px. It needs no checks of its own.
        half: (⌈H/2⌉, ⌈W/2⌉) int16, searched everywhere and checked.
        greatest: disparities from here on are invalid, px.
    """
    import cv2

    # Where no match is near, one that, doubled, agrees with no disparity: too small, too large.
    small, large = np.int16(-AGREE * SUBPIXELS), np.int16(2**14 - 1)
    hole, window = half < 0, np.ones((2 * HOLE + 1, 2 * HOLE + 1), dtype=np.uint8)
    greatest_near = cv2.dilate(np.where(hole, small, half), window)
    least_near = cv2.erode(np.where(hole, large, half), window)
    agree = np.zeros(full.shape, dtype=bool)
    for found in (greatest_near, least_near):
        doubled = _doubled(np.where(hole, found, half), full.shape)
        agree |= np.abs(full - doubled) <= AGREE * SUBPIXELS
    agree &= full >= 0
    doubled = _doubled(half, full.shape)
    near = (doubled >= (end - AGREE) * SUBPIXELS) & (doubled < greatest * SUBPIXELS)
    return np.where(agree, full, np.where(near, doubled, np.int16(INVALID)))


def _doubled(half: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Disparities (⌈H/2⌉, ⌈W/2⌉) at half the size, at the full one (H, W): each for 2 × 2 px."""
    import cv2

    # INTER_NEAREST takes column u // 2.
    doubled = cv2.resize(2 * half, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)
    return doubled[: shape[0], : shape[1]]
