"""Results of the stages that draw, and the settings of what they draw."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le, Len

from stixel_cli.errors import UserError
from stixel_cli.parameters import parameters


@dataclass(frozen=True)
class Pictures:
    """Finished pictures."""

    files: dict[str, bytes]
    """File name relative to the folder of figures (`k0033/left.png`, `path.svg`) to the file's
    bytes."""


@dataclass(frozen=True)
class CameraFrames:
    """The left camera's images and their stixels, small enough for a page."""

    first: int
    """Index k of the first frame."""
    width: int
    height: int
    """Size of the camera's own image, px; the pictures may be smaller."""
    images: dict[str, tuple[bytes, ...]]
    """One JPEG a frame by name: `grey`, `disparity`, `grid`, `free_space`."""
    offsets: np.ndarray
    """(n + 1,) int64, the stixels of frame i are rows offsets[i]:offsets[i + 1]."""
    left: np.ndarray
    right: np.ndarray
    top: np.ndarray
    base: np.ndarray
    """(S,) int32, columns left … right - 1 and rows top … base of the camera's own image."""
    depth: np.ndarray
    """(S,) float64 m."""


@parameters
class PicturesParameters:
    """The frames that get pictures.

    Attributes:
        frames: increasing indices k of the pictured frames; null for four frames, spread evenly
            over the run.
    """

    frames: Annotated[tuple[Annotated[int, Ge(0), Le(100000)], ...], Len(0, 64)] | None

    def check(self) -> None:
        """Raise ValueError if `frames` is not increasing; `frames_of` knows the last one."""
        if any(later <= earlier for earlier, later in pairwise(self.frames or ())):
            raise ValueError(f"pictures.frames: must be increasing, got {list(self.frames)}")

    def frames_of(self, count: int) -> tuple[int, ...]:
        """The frames to draw of a run of `count`: those chosen, or four spread evenly over it."""
        chosen, last = self.frames, count - 1
        if chosen is None:
            return tuple(sorted({round(last * share / 4) for share in (0.5, 1.5, 2.5, 3.5)}))
        if chosen and chosen[-1] > last:
            raise UserError(f"pictures.frames: must be <= {last}, the last frame, got {chosen[-1]}")
        return chosen
