"""Results of the stages that draw."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pictures:
    """Finished pictures.

    Attributes:
        files: file name relative to the folder of figures (`k0033/left.png`, `path.svg`) to the
            file's bytes.
    """

    files: dict[str, bytes]


@dataclass(frozen=True)
class CameraFrames:
    """The left camera's images and their stixels, small enough for a page.

    Attributes:
        first: index k of the first frame.
        width, height: size of the camera's own image, px; the pictures may be smaller.
        images: one JPEG per frame.
        offsets: (n + 1,) int64, the stixels of frame i are rows offsets[i]:offsets[i + 1].
        left, right, top, base: (S,) int32, columns left … right - 1 and rows top … base of the
            camera's own image.
        depth: (S,) float64 m.
    """

    first: int
    width: int
    height: int
    images: tuple[bytes, ...]
    offsets: np.ndarray
    left: np.ndarray
    right: np.ndarray
    top: np.ndarray
    base: np.ndarray
    depth: np.ndarray
