"""Image files of any origin: checked before they are decoded, and as grey or colour arrays."""

import zlib
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import opened, read_bytes

PNG = b"\x89PNG\r\n\x1a\n"
LFS = b"version https://git-lfs"
GREATEST_IMAGE = 64 * 2**20
"""Bytes of an image file."""

GREATEST_SIDE = 4096
"""As of `rig.width` and `rig.height`, px."""

_COLOUR_TYPES = {0: 1, 2: 3}
"""PNG's colour types with 8 bits per channel that are read, and their channels."""


def image_size(file: Path) -> tuple[int, int]:
    """Width and height in px of a PNG file of 8-bit grey or RGB values; reads only its head.

    Raises:
        UserError: if it is missing, or another kind of file.
    """
    with opened(file, GREATEST_IMAGE) as stream:
        return _size(file, stream.read(33) or b"")


def read_grey(file: Path) -> np.ndarray:
    """The grey values (H, W) uint8 of a PNG file; colour becomes luma (ITU-R BT.601).

    Raises:
        UserError: if it is missing, damaged, or not a PNG of 8-bit grey or RGB values.
    """
    import cv2

    image = _decoded(file)
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def read_rgb(file: Path) -> np.ndarray:
    """The RGB values (H, W, 3) uint8 of a PNG file; errors as in `read_grey`."""
    image = _decoded(file)
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image[..., ::-1].copy()


def _decoded(file: Path) -> np.ndarray:
    import cv2

    data = read_bytes(file, GREATEST_IMAGE)
    _size(file, data[:33])
    # libpng writes its own line to stderr about a damaged file, so the file is checked first.
    check_chunks(file, data)
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint8 or (image.ndim == 3 and image.shape[2] != 3):
        raise UserError(f"{file}: cannot be decoded as a PNG image")
    return image


def png_head(file: Path, head: bytes) -> tuple[int, int, int, int]:
    """Width, height, bits per channel and colour type of a PNG file that begins with `head`.

    Raises:
        UserError: if it is another kind of file, or too large.
    """
    if head.startswith(LFS):
        raise UserError(f"{file}: a Git LFS pointer, not an image: fetch it with git lfs pull")
    if not head.startswith(PNG) or len(head) < 33 or head[12:16] != b"IHDR":
        raise UserError(f"{file}: not a PNG image")
    width, height = (int.from_bytes(head[i : i + 4], "big") for i in (16, 20))
    if not (0 < width <= GREATEST_SIDE and 0 < height <= GREATEST_SIDE):
        raise UserError(f"{file}: {width} × {height} px: each side must be 1 to {GREATEST_SIDE}")
    return width, height, head[24], head[25]


def _size(file: Path, head: bytes) -> tuple[int, int]:
    width, height, bits, colour = png_head(file, head)
    if bits != 8:
        raise UserError(f"{file}: {bits} bits per channel: 8 are needed")
    if colour not in _COLOUR_TYPES:
        raise UserError(f"{file}: a PNG with a palette or transparency: grey or RGB is needed")
    return width, height


def check_chunks(file: Path, data: bytes) -> None:
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
