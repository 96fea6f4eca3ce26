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
    images, rows, offsets = [], [], [0]
    height = width = 0
    for k in frames:
        image = pairs.left[k - pairs.first]
        height, width = image.shape
        images.append(_jpeg(image))
        chosen = stixels.rows(k - stixels.first)
        rows.append(np.arange(chosen.start, chosen.stop))
        offsets.append(offsets[-1] + len(rows[-1]))
    of_frames = np.concatenate(rows)
    return CameraFrames(
        first=frames.start,
        width=width,
        height=height,
        images=tuple(images),
        offsets=np.array(offsets, dtype=np.int64),
        left=stixels.left[of_frames],
        right=stixels.right[of_frames],
        top=stixels.top[of_frames],
        base=stixels.base[of_frames],
        depth=stixels.depth[of_frames],
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
