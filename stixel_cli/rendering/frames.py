"""The result of a renderer: a chunk of noise-free stereo pairs with the left view's truth."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stixel_cli.rendering.images import ImageStack, encode_png, encode_pnm

SKY_ID, ROAD_ID, TARGET_ID, BACKGROUND_ID = 0, 1, 2, 3

DEPTH_STEP = 1.0 / 4096.0
"""Depths are stored as whole multiples of this, m (a quarter of a millimetre)."""


@dataclass(frozen=True)
class RenderedFrames:
    """Rendered frames `first`, `first` + 1, …."""

    first: int
    """Index k of the first frame."""
    left: ImageStack
    right: ImageStack
    """`left`, `right`: RGB images, (H, W, 3) uint8."""
    depth_high: ImageStack
    depth_low: ImageStack
    """`depth_high`, `depth_low`: the upper and lower 16 bits of the left view's depth along the
    optical axis in multiples of `DEPTH_STEP`; 0 without a surface (sky)."""
    ids: ImageStack
    """The object that each pixel of the left view shows, (H, W) uint8: `SKY_ID`, `ROAD_ID`,
    `TARGET_ID`, or `BACKGROUND_ID` + the object's number."""

    @classmethod
    def from_frames(
        cls, first: int, frames: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
    ) -> "RenderedFrames":
        """From (left, right, depth, ids) of each frame, compressed one frame after the other.

        `depth` is in m, float, with inf or NaN without a surface.
        """
        stacks = ([], [], [], [], [])
        for left, right, depth, ids in frames:
            depth = np.asarray(depth)
            steps = np.where(np.isfinite(depth), np.rint(depth / DEPTH_STEP), 0).astype(np.uint32)
            high, low = (steps >> 16).astype(np.uint16), (steps & 0xFFFF).astype(np.uint16)
            for stack, image in zip(stacks, (left, right, high, low, ids), strict=True):
                # Depths and ids shrink to a tenth; a picture to a half, in 20 times the time.
                stack.append((encode_png if image.ndim == 2 else encode_pnm)(image))
        return cls(first, *(ImageStack(tuple(stack)) for stack in stacks))

    def depth(self, index: int) -> np.ndarray:
        """True depth (H, W) float32 in m of the `index`-th frame here; inf without a surface."""
        steps = self.depth_high[index].astype(np.uint32) << 16 | self.depth_low[index]
        metres = steps.astype(np.float64) * DEPTH_STEP
        return np.where(steps > 0, metres, np.inf).astype(np.float32)


@dataclass(frozen=True)
class StereoPairs:
    """Images of the cameras for frames `first`, `first` + 1, …: all that later stages may see."""

    first: int
    """Index k of the first frame."""
    left: ImageStack
    right: ImageStack
    """`left`, `right`: grey images with the sensor's noise, (H, W) uint8; a tuple of arrays in
    place of a stack where nothing is stored."""

    def __len__(self) -> int:
        return len(self.left)


def encoded(light: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] of linear light, any shape (IEC 61966-2-1)."""
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
