"""Image files of any origin: checked before they are decoded; as arrays, and rectified."""

from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stixel_cli.border.files import opened, read_bytes
from stixel_cli.errors import UserError
from stixel_cli.recordings.types import Rectification

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
LFS = b"version https://git-lfs"
GREATEST_IMAGE = 64 * 2**20
"""Bytes of an image file."""

GREATEST_SIDE = 4096
"""As of `rig.width` and `rig.height`, px."""

_JPEG_END = b"\xff\xd9"


def image_size(file: Path) -> tuple[int, int]:
    """Width and height in px of a PNG, or of a JPEG of 8-bit grey or RGB values; reads its head."""
    with opened(file, GREATEST_IMAGE) as stream:
        return size_in(file, stream)


def read_image(file: Path) -> np.ndarray:
    """The image, grey (H, W) or BGR (H, W, 3), uint8 or uint16, of a PNG or JPEG file.

    A palette is looked up, and transparency left out; a JPEG must be grey or RGB, of 8 bits.
    """
    return decoded(file, read_bytes(file, GREATEST_IMAGE))


def grey(image: np.ndarray) -> np.ndarray:
    """Grey values (H, W) of an image as `read_image` gives it; colour becomes luma (BT.601)."""
    import cv2

    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def rgb(image: np.ndarray) -> np.ndarray:
    """RGB values (H, W, 3) of an image as `read_image` gives it."""
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image[..., ::-1].copy()


def read_disparity(file: Path) -> np.ndarray:
    """The true disparities (H, W) float32 px in a file; NaN where they are unknown.

    As KITTI stores them: PNG of uint16, 256 per px, 0 for unknown.
    """
    image = read_image(file)
    if image.ndim != 2 or image.dtype != np.uint16:
        raise UserError(f"{file}: not a grey PNG of 16 bits: 256 per px of disparity")
    return np.where(image > 0, image / np.float32(256.0), np.float32(np.nan))


def decoded(file: Path | str, data: bytes) -> np.ndarray:
    """As `read_image`, of `data` that may be in a file with other content; `file` names it."""
    import cv2
    from PIL.PngImagePlugin import PngImageFile

    width, height = size_in(file, BytesIO(data))
    # libpng and libjpeg write own lines to stderr about a damaged file, so it is checked first.
    if data.startswith(PNG):
        try:
            PngImageFile(BytesIO(data)).verify()
        except Exception:
            # Pillow's errors have no common class.
            raise UserError(f"{file}: a damaged or incomplete PNG image") from None
    elif not data.rstrip(b"\0\r\n").endswith(_JPEG_END):
        raise UserError(f"{file}: a damaged or incomplete JPEG image")
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    shapes = ((height, width), (height, width, 3), (height, width, 4))
    if image is None or image.dtype not in (np.uint8, np.uint16) or image.shape not in shapes:
        raise UserError(f"{file}: cannot be decoded as an image")
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., :3])


def size_in(file: Path | str, stream: BinaryIO) -> tuple[int, int]:
    """Width and height in px of the image in `stream`, whose head is checked; as in `decoded`."""
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile

    head = stream.read(33) or b""
    if head.startswith(LFS):
        raise UserError(f"{file}: a Git LFS pointer, not an image: fetch it with git lfs pull")
    png = head.startswith(PNG)
    if not png and not head.startswith(JPEG):
        is_jpeg = str(file).lower().endswith((".jpg", ".jpeg"))
        raise UserError(f"{file}: not a {'JPEG' if is_jpeg else 'PNG'} image")
    stream.seek(0)
    try:
        image = (PngImageFile if png else JpegImageFile)(stream)
    except Exception:
        # Pillow's errors have no common class; it has no JPEG of 12 bits.
        kind = "PNG image" if png else "JPEG image, or not of 8 bits per channel"
        raise UserError(f"{file}: a damaged or incomplete {kind}") from None
    check_sides(file, *image.size)
    if image.mode == "CMYK":
        raise UserError(f"{file}: a JPEG in CMYK: must be grey or RGB")
    return image.size


def check_sides(file: Path | str, width: int, height: int) -> None:
    """Raise UserError if an image is too large, or empty."""
    if not (0 < width <= GREATEST_SIDE and 0 < height <= GREATEST_SIDE):
        raise UserError(f"{file}: {width} × {height} px: each side must be 1 to {GREATEST_SIDE}")


def rectified(image: np.ndarray, rectification: Rectification | None, right: bool) -> np.ndarray:
    """An image (H, W) or (H, W, 3) uint8 of the left or the right camera; as it is without one."""
    if rectification is None:
        return image
    import cv2

    turn = np.reshape(rectification.right if right else rectification.left, (3, 3))
    return cv2.warpPerspective(image, turn, rectification.size, flags=cv2.INTER_LINEAR)
