"""Images of two cameras that are not aligned, as a rectified pair."""

import numpy as np

from stixel_cli.recordings.types import Rectification


def rectified(image: np.ndarray, rectification: Rectification | None, right: bool) -> np.ndarray:
    """An image (H, W) or (H, W, 3) uint8 of the left or the right camera; as it is without one."""
    if rectification is None:
        return image
    import cv2

    turn = np.reshape(rectification.right if right else rectification.left, (3, 3))
    size = (rectification.width, rectification.height)
    return cv2.warpPerspective(image, turn, size, flags=cv2.INTER_LINEAR)
