"""The camera's part of the playback page: small images, and the stixels."""

import numpy as np

from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.stixels.types import Stixels

WIDEST = 512
"""Wider images are reduced to this width, px. Averaging removes the noise, which JPEG cannot."""

QUALITY = 70


def camera_frames(pairs: StereoPairs, stixels: Stixels, frames: range) -> CameraFrames:
    """The left images of `frames` as JPEG, at most `WIDEST` px wide, and their stixels.

    Args:
        pairs, stixels: both contain all of `frames`.
        frames: indices k.

    Raises:
        ValueError: if an image cannot be encoded.
    """
    images = [pairs.left[k - pairs.first] for k in frames]
    height, width = images[0].shape
    first = frames.start - stixels.first
    offsets = stixels.offsets[first : first + len(frames) + 1]
    rows = slice(offsets[0], offsets[-1])
    return CameraFrames(
        first=frames.start,
        width=width,
        height=height,
        images=tuple(map(_jpeg, images)),
        offsets=(offsets - offsets[0]).astype(np.int64),
        left=stixels.left[rows],
        right=stixels.right[rows],
        top=stixels.top[rows],
        base=stixels.base[rows],
        depth=stixels.depth[rows],
    )


def _jpeg(image: np.ndarray) -> bytes:
    """A grey image (H, W) uint8 as a JPEG, made smaller if it is wider than `WIDEST`."""
    import cv2

    height, width = image.shape
    if width > WIDEST:
        size = (WIDEST, max(1, round(height * WIDEST / width)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    done, buffer = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise ValueError(f"cannot encode an image of shape {image.shape} as JPEG")
    return buffer.tobytes()
