"""Stacks of images, compressed without loss and decoded one at a time."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ImageStack:
    """Images of one size and kind, each one a PNG (lossless; decoded on access).

    Attributes:
        encoded: one PNG a frame. Grey (H, W) uint8 or uint16, or RGB (H, W, 3) uint8.
    """

    encoded: tuple[bytes, ...]

    @classmethod
    def from_images(cls, images: Iterable[np.ndarray]) -> "ImageStack":
        """Compress (H, W) uint8 or uint16, or (H, W, 3) uint8 RGB, images."""
        return cls(tuple(encode_png(image) for image in images))

    def __len__(self) -> int:
        return len(self.encoded)

    def __getitem__(self, index: int) -> np.ndarray:
        return decode_png(self.encoded[index])


def eight_bits(images: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """Images of one pair as uint8, by one scale, (H, W) or (H, W, 3).

    Args:
        images: (H, W) or (H, W, C), C = 1 to 4, by the names that messages use. Alpha is dropped.
            The types are uint8; uint16, scaled so that the greatest value of all images is 255;
            and float, in [0, 1] or in [0, 255].

    Raises:
        ValueError: for an image of another shape, type or range.
    """
    plain = []
    for name, image in images.items():
        kind = image.dtype
        if kind not in (np.uint8, np.uint16, np.float32, np.float64):
            raise ValueError(f"{name}: must be uint8, uint16 or float, got {kind}")
        if image.size == 0 or image.ndim not in (2, 3) or image.shape[2:] > (4,):
            raise ValueError(f"{name}: must be (H, W), (H, W, 3) or (H, W, 4), got {image.shape}")
        if kind.kind == "f" and not (image.min() >= 0.0 and image.max() <= 255.0):
            got = f"{image.min():g} to {image.max():g}"
            raise ValueError(f"{name}: must have values in [0, 1] or in [0, 255], got {got}")
        if image.ndim == 3:
            image = image[..., :3] if image.shape[2] >= 3 else image[..., 0]
        plain.append(np.ascontiguousarray(image))
    if all(image.dtype == np.uint8 for image in plain):
        return plain
    greatest = max(1.0, *(float(image.max()) for image in plain))
    if greatest > 1.0 and plain[0].dtype != np.uint16:
        greatest = 255.0
    return [np.rint(image * (255.0 / greatest)).astype(np.uint8) for image in plain]


def encode_png(image: np.ndarray, compressed: bool = True) -> bytes:
    """One image, (H, W) uint8 or uint16 or (H, W, 3) uint8 RGB, as the bytes of a PNG.

    Not `compressed`, a picture takes twice the space and less time, here and to decode.

    Raises:
        ValueError: for an image of another shape or type.
    """
    import cv2

    grey = image.ndim == 2 and image.dtype in (np.uint8, np.uint16)
    if not grey and (image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8):
        raise ValueError(f"cannot encode an image of shape {image.shape}, type {image.dtype}")
    # OpenCV's order of colours, by its own function: a tenth of the time of a copy by NumPy.
    ordered = image if grey else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2BGR)
    # OpenCV's own settings: level 1, the filter SUB and the strategy RLE, which looks for runs
    # only. If the level is given, it changes the other two: half of the speed, hardly smaller.
    settings = () if compressed else (cv2.IMWRITE_PNG_COMPRESSION, 0)
    return cv2.imencode(".png", np.ascontiguousarray(ordered), settings)[1].tobytes()


def decode_png(data: bytes) -> np.ndarray:
    """The image in the bytes of a PNG, as `encode_png` took it.

    Raises:
        ValueError: if they are not a PNG image.
    """
    import cv2

    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("not a PNG image")
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
