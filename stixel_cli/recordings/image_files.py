"""Image files of any origin: checked before they are decoded; as arrays, and rectified."""

import zlib
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import opened, read_bytes
from stixel_cli.recordings.types import Rectification

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
LFS = b"version https://git-lfs"
GREATEST_IMAGE = 64 * 2**20
"""Bytes of an image file."""

GREATEST_SIDE = 4096
"""As of `rig.width` and `rig.height`, px."""

_JPEG_FRAMES = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Kinds of segment that begin with precision, height, width and channels."""

MOST_HEAD = 2**20
"""Bytes in which the size must be: before it are thumbnails, colour profiles and the like."""

_JPEG_END = b"\xff\xd9"

_COLOUR_TYPES = (0, 2)
"""PNG's grey and RGB."""


def image_size(file: Path, of_disparities: bool = False) -> tuple[int, int]:
    """Width and height in px of a PNG or JPEG of 8-bit grey or RGB values; reads only its head.

    With `of_disparities`, of a grey PNG of 16 bits.

    Raises:
        UserError: if it is missing, or another kind of file.
    """
    with opened(file, GREATEST_IMAGE) as stream:
        head = stream.read(33) or b""
        if head.startswith(JPEG):
            head += stream.read(MOST_HEAD)
        return size_in(file, head, of_disparities)


def read_image(file: Path) -> np.ndarray:
    """The image, grey (H, W) or BGR (H, W, 3) uint8, of a PNG or JPEG file.

    Raises:
        UserError: if it is missing, damaged, or not an image of 8-bit grey or RGB values.
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

    Raises:
        UserError: if it is missing, damaged, or not a grey PNG of 16 bits.
    """
    image = decoded(file, read_bytes(file, GREATEST_IMAGE), of_disparities=True)
    return np.where(image > 0, image / np.float32(256.0), np.float32(np.nan))


def decoded(file: Path | str, data: bytes, of_disparities: bool = False) -> np.ndarray:
    """As `read_image`, of `data` that may be in a file with other content, too.

    `file` names it in messages. With `of_disparities`, a grey PNG of 16 bits, (H, W) uint16.
    """
    import cv2

    width, height = size_in(file, data, of_disparities)
    # libpng and libjpeg write own lines to stderr about a damaged file, so it is checked first.
    if data.startswith(PNG):
        _check_chunks(file, data)
    elif not data.rstrip(b"\0\r\n").endswith(_JPEG_END):
        raise UserError(f"{file}: a damaged or incomplete JPEG image")
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    kind = np.uint16 if of_disparities else np.uint8
    shapes = ((height, width), (height, width, 3))
    if image is None or image.dtype != kind or image.shape not in shapes:
        raise UserError(f"{file}: cannot be decoded as an image")
    return image


def size_in(file: Path | str, head: bytes, of_disparities: bool = False) -> tuple[int, int]:
    """Width and height in px of a checked image that begins with `head`; `file` as in `decoded`."""
    if head.startswith(LFS):
        raise UserError(f"{file}: a Git LFS pointer, not an image: fetch it with git lfs pull")
    if head.startswith(JPEG) and not of_disparities:
        return _jpeg_size(file, head)
    if not head.startswith(PNG) or len(head) < 33 or head[12:16] != b"IHDR":
        is_jpeg = str(file).lower().endswith((".jpg", ".jpeg")) and not head.startswith(PNG)
        needed = "JPEG" if is_jpeg and not of_disparities else "PNG"
        raise UserError(f"{file}: not a {needed} image")
    width, height = (int.from_bytes(head[i : i + 4], "big") for i in (16, 20))
    bits, colour = head[24], head[25]
    check_sides(file, width, height)
    if of_disparities and (bits, colour) != (16, 0):
        raise UserError(f"{file}: not a grey PNG of 16 bits: 256 per px of disparity")
    if bits != 8 and not of_disparities:
        raise UserError(f"{file}: {bits} bits per channel: 8 are needed")
    if colour not in _COLOUR_TYPES:
        raise UserError(f"{file}: a PNG with a palette or transparency: grey or RGB is needed")
    return width, height


def _jpeg_size(file: Path | str, data: bytes) -> tuple[int, int]:
    """Width and height in the frame header (ITU-T T.81, B.2.2), after any other segments."""
    at = 2
    while at + 10 <= len(data) and data[at] == 0xFF:
        kind, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if kind in _JPEG_FRAMES:
            bits, channels = data[at + 4], data[at + 9]
            height, width = (int.from_bytes(data[i : i + 2], "big") for i in (at + 5, at + 7))
            if bits != 8:
                raise UserError(f"{file}: {bits} bits per channel: 8 are needed")
            if channels not in (1, 3):
                raise UserError(f"{file}: a JPEG of {channels} channels: grey or RGB is needed")
            check_sides(file, width, height)
            return width, height
        # 0xFF may be repeated before a kind.
        at += 1 if kind == 0xFF else 2 + length
    raise UserError(f"{file}: a damaged or incomplete JPEG image")


def check_sides(file: Path | str, width: int, height: int) -> None:
    """Raise UserError if an image is too large, or empty."""
    if not (0 < width <= GREATEST_SIDE and 0 < height <= GREATEST_SIDE):
        raise UserError(f"{file}: {width} × {height} px: each side must be 1 to {GREATEST_SIDE}")


def _check_chunks(file: Path | str, data: bytes) -> None:
    """Raise UserError unless a PNG is whole and its checksums are right."""
    at = len(PNG)
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        end = at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            break
        if data[at + 4 : at + 8] == b"IEND":
            return
        at = end + 4
    raise UserError(f"{file}: a damaged or incomplete PNG image")


def rectified(image: np.ndarray, rectification: Rectification | None, right: bool) -> np.ndarray:
    """An image (H, W) or (H, W, 3) uint8 of the left or the right camera; as it is without one."""
    if rectification is None:
        return image
    import cv2

    turn = np.reshape(rectification.right if right else rectification.left, (3, 3))
    return cv2.warpPerspective(image, turn, rectification.size, flags=cv2.INTER_LINEAR)
