"""The camera's part of the playback page: small images, and the stixels."""

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures.frame_view import FrameView
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.occupancy import picture_grid
from stixel_cli.stixels.parameters import OccupancyParameters, RoadParameters
from stixel_cli.stixels.types import FreeSpace, Stixels

WIDEST = 512
"""Wider images are reduced to this width, px. Averaging removes the noise, which JPEG cannot."""

_VIEW = (".webp", 400, (cv2.IMWRITE_WEBP_QUALITY, 40))
IMAGES = {"grey": (".jpg", WIDEST, (cv2.IMWRITE_JPEG_QUALITY, 70))}
IMAGES |= dict.fromkeys(("disparity", "grid", "free_space"), _VIEW)
"""Format, greatest width in px and quality of the images of a `FrameView` that the page shows."""


def camera_frames(
    pairs: StereoPairs,
    disparities: Disparities,
    free_space: FreeSpace,
    stixels: Stixels,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    frames: range,
) -> CameraFrames:
    """The left images of `frames` and what was found in them, in small, and their stixels.

    Args:
        pairs, disparities, free_space, stixels: all contain all of `frames`.
        rig, road, occupancy: those of the grid.
        frames: indices k.
    """
    views = [
        FrameView(k, 0.0, rig, None, pairs, disparities, grid, free_space, stixels, None)
        for k in frames
        for grid in [picture_grid(disparities, free_space, rig, road, occupancy, k)]
    ]
    first = frames.start - stixels.first
    offsets = stixels.offsets[first : first + len(frames) + 1]
    rows = slice(offsets[0], offsets[-1])
    return CameraFrames(
        first=frames.start,
        width=rig.width,
        height=rig.height,
        images={
            name: tuple(_encoded(getattr(view, f"{name}_image"), *how) for view in views)
            for name, how in IMAGES.items()
        },
        offsets=(offsets - offsets[0]).astype(np.int64),
        left=stixels.left[rows],
        right=stixels.right[rows],
        top=stixels.top[rows],
        base=stixels.base[rows],
        depth=stixels.depth[rows],
    )


def _encoded(image: np.ndarray, extension: str, widest: int, quality: tuple[int, int]) -> bytes:
    """An RGB image (H, W, 3) uint8 as a file, made smaller if it is wider than `widest`."""
    height, width = image.shape[:2]
    if width > widest:
        size = (widest, max(1, round(height * widest / width)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(extension, image[..., ::-1], quality)[1].tobytes()
