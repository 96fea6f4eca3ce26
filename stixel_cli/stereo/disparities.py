"""Disparity images of the left view."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stixel_cli.rendering.images import ImageStack

SUBPIXELS = 16
"""Raw disparities are whole multiples of 1/16 px."""

INVALID = -1
"""Raw disparity without a match."""


@dataclass(frozen=True)
class Disparities:
    """Disparities of frames `first`, `first` + 1, …."""

    first: int
    """Index k of the first frame."""
    count: int
    """Number of disparities searched, px: every valid disparity is in [0, count)."""
    stored: ImageStack | tuple[np.ndarray, ...]
    """raw + 1 as (H, W) uint16, so that 0 is invalid."""

    @classmethod
    def from_raw(cls, first: int, count: int, raw: Iterable[np.ndarray]) -> "Disparities":
        """From raw disparities (H, W) int16: 1/16 px, `INVALID` without a match."""
        return cls(first, count, ImageStack.from_images((r + 1).astype(np.uint16) for r in raw))

    @classmethod
    def in_memory(cls, first: int, count: int, raw: Iterable[np.ndarray]) -> "Disparities":
        """As `from_raw`, without compression: for results that are not stored."""
        return cls(first, count, tuple((r + 1).astype(np.uint16) for r in raw))

    def __len__(self) -> int:
        return len(self.stored)

    def raw(self, index: int) -> np.ndarray:
        """Raw disparity (H, W) int16 in 1/16 px of the `index`-th frame; `INVALID`: no match."""
        # As unsigned numbers, 0 - 1 is the greatest one: the bits of INVALID.
        return (self.stored[index] - np.uint16(1)).view(np.int16)

    def pixels(self, index: int) -> np.ndarray:
        """Disparity (H, W) float32 in px of the `index`-th frame here; NaN where invalid."""
        raw = self.raw(index)
        return np.where(raw >= 0, raw / SUBPIXELS, np.nan).astype(np.float32)
