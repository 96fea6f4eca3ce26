"""Stixels painted over an image, pixel by pixel: without axes and text."""

import numpy as np

from stixel_cli.stixels.types import Stixels

OPACITY = 0.65
"""Of the stixels over the image, as in the pictures of a run."""


def painted(image: np.ndarray, stixels: Stixels, colours: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) uint8 of an image (H, W) or (H, W, 3) uint8, with stixels over it.

    `colours` (S, 3) of the stixels are from 0 to 1.
    """
    picture = image.copy() if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    # From far to near, where several stixels are in one column.
    for row in np.argsort(-stixels.depth, kind="stable"):
        rows = slice(stixels.top[row], stixels.base[row] + 1)
        area = picture[rows, stixels.left[row] : stixels.right[row]]
        area[...] = np.rint(255.0 * OPACITY * colours[row] + (1.0 - OPACITY) * area)
    return picture
