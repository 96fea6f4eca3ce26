"""Stacks of images, encoded without loss and decoded one at a time."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ImageStack:
    """Images of one size and kind, each one a file's bytes (lossless; decoded on access).

    Attributes:
        encoded: one PNG, PGM or PPM a frame. Grey (H, W) uint8 or uint16, or RGB (H, W, 3) uint8.
    """

    encoded: tuple[bytes, ...]

    @classmethod
    def from_images(cls, images: Iterable[np.ndarray]) -> "ImageStack":
        """Of images (H, W) uint8 or uint16, or (H, W, 3) uint8 RGB, not compressed."""
        return cls(tuple(encode_pnm(image) for image in images))

    def __len__(self) -> int:
        return len(self.encoded)

    def __getitem__(self, index: int) -> np.ndarray:
        return decode_image(self.encoded[index])


def eight_bits(images: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """Images of one pair as uint8, by one scale, (H, W) or (H, W, 3).

    Args:
        images: (H, W) or (H, W, C), C = 1 to 4, by the names that messages use. Alpha is dropped.
            The types are uint8; uint16, scaled so that the greatest value of all images is 255;
            and float, in [0, 1] or in [0, 255].

    ValueError for an image of another shape, type or range.
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


def reduced(image: np.ndarray, widest: int) -> np.ndarray:
    """An image (H, W) or (H, W, 3) with means of its pixels, if it is wider than `widest`, px."""
    import cv2

    height, width = image.shape[:2]
    if width <= widest:
        return image
    size = (widest, max(1, round(height * widest / width)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def encode_png(image: np.ndarray, extension: str = ".png") -> bytes:
    """One image, (H, W) uint8 or uint16 or (H, W, 3) uint8 RGB, as the bytes of a PNG.

    ValueError for an image of another shape or type.
    """
    import cv2

    grey = image.ndim == 2 and image.dtype in (np.uint8, np.uint16)
    if not grey and (image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8):
        raise ValueError(f"cannot encode an image of shape {image.shape}, type {image.dtype}")
    # OpenCV's order of colours, by its own function: a tenth of the time of a copy by NumPy.
    ordered = image if grey else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2BGR)
    # OpenCV's own settings: level 1, the filter SUB and the strategy RLE, which looks for runs
    # only. If the level is given, it changes the other two: half of the speed, hardly smaller.
    return cv2.imencode(extension, np.ascontiguousarray(ordered))[1].tobytes()


def encode_pnm(image: np.ndarray) -> bytes:
    """As `encode_png`, but as a PGM or PPM: not compressed, in a tenth of the time or less."""
    return encode_png(image, ".pnm")


def decode_image(data: bytes) -> np.ndarray:
    """The image in the bytes of a PNG, PGM or PPM, as it was encoded.

    ValueError if they are not an image.
    """
    import cv2

    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("not an image")
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
