"""What both matchers share: the range of disparities, the padded border and the threads."""

from contextlib import contextmanager
from typing import Any

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.frames import StereoPairs
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities
from stixel_cli.stereo.parameters import BmParameters, SgmParameters

BLOCK = 16
"""OpenCV searches a multiple of this many disparities."""


def disparity_count(stereo: SgmParameters | BmParameters, rig: Rig) -> int:
    """Number of disparities to search, a multiple of 16.

    `stereo.disparities` where it is given, else enough for the depth `stereo.nearest` with this
    rig, thesis (3), and one more for the sub-pixel parabola's neighbour.
    """
    if stereo.disparities is not None:
        return stereo.disparities
    greatest = float(rig.disparity_from_depth(stereo.nearest)) - stereo.minimum_disparity + 1.0
    return BLOCK * max(1, int(np.ceil(greatest / BLOCK)))


def match_pairs(
    pairs: StereoPairs,
    frames: range,
    matcher: Any,
    stereo: SgmParameters | BmParameters,
    count: int,
    margin: int,
) -> Disparities:
    """Disparities of the pairs of `frames` by an OpenCV `matcher`.

    The matcher reports nothing in the leftmost `stereo.minimum_disparity` + `count` + `margin`
    columns, so that much is put in front of the images and taken off again. `count` is the number
    of disparities that it searches, `margin` half its window where it needs one, px.
    """
    minimum = stereo.minimum_disparity
    border = minimum + count + margin
    raw = []
    with _one_thread():
        for k in frames:
            left, right = pairs.left[k - pairs.first], pairs.right[k - pairs.first]
            found = _match(matcher, left, right, minimum, border)
            if stereo.error_cancellation:
                moved = _match(matcher, left, half_pixel_right(right), minimum, border)
                found = cancel_errors(found, moved)
            # In the leftmost columns a large disparity lies in the border, where no image is.
            beyond = found > np.arange(found.shape[1], dtype=np.int32) * SUBPIXELS
            raw.append(np.where(beyond, np.int16(INVALID), found))
    return Disparities.from_raw(frames.start, minimum + count, raw)


def _match(
    matcher: Any, left: np.ndarray, right: np.ndarray, minimum: int, border: int
) -> np.ndarray:
    """Raw disparity (H, W) int16 in 1/16 px of two grey images (H, W) uint8."""
    widen = ((0, 0), (border, 0))
    raw = matcher.compute(np.pad(left, widen, mode="edge"), np.pad(right, widen, mode="edge"))
    raw = raw[:, border:]
    return np.where(raw < minimum * SUBPIXELS, np.int16(INVALID), raw)


def half_pixel_right(image: np.ndarray) -> np.ndarray:
    """A grey image (H, W) uint8 moved half a pixel to the right, by cubic interpolation."""
    import cv2

    kernel = np.array([[-1.0, 9.0, 9.0, -1.0]], dtype=np.float32) / 16.0
    moved = cv2.filter2D(image, cv2.CV_32F, kernel, anchor=(2, 0), borderType=cv2.BORDER_REPLICATE)
    return np.clip(np.rint(moved), 0, 255).astype(np.uint8)


def cancel_errors(raw: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Mean (H, W) int16 of a raw disparity and of that to the right image moved half a pixel.

    A sub-pixel parabola is drawn towards whole pixels; half a pixel on it is drawn the other way,
    so that the mean of both has little of the error (Shimizu, Okutomi 2005, *Sub-pixel estimation
    error cancellation on area-based matching*). Where the two are more than a pixel apart, or one
    is invalid, `raw` stays.
    """
    first = raw.astype(np.int32)
    second = moved.astype(np.int32) + SUBPIXELS // 2
    both = (raw != INVALID) & (moved != INVALID) & (np.abs(first - second) <= SUBPIXELS)
    mean = (first + second) >> 1
    # Halves to the even number: always up would be a bias of its own.
    mean += (first + second) & mean & 1
    return np.where(both, mean, first).astype(np.int16)


@contextmanager
def _one_thread():
    """OpenCV on one thread: workers give the parallelism, the bytes must not depend on it."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
