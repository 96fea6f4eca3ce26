"""True disparities in files, as KITTI stores them: PNG of uint16, 256 per px, 0 for unknown."""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes
from stixel_cli.recordings.image_files import GREATEST_IMAGE, check_chunks, png_head


def read_disparity(file: Path) -> np.ndarray:
    """The disparities (H, W) float32 px in a file; NaN where they are unknown.

    Raises:
        UserError: if it is missing, damaged, or not a grey PNG of 16 bits.
    """
    import cv2

    data = read_bytes(file, GREATEST_IMAGE)
    _, _, bits, colour = png_head(file, data[:33])
    if (bits, colour) != (16, 0):
        raise UserError(f"{file}: not a grey PNG of 16 bits: 256 per px of disparity")
    check_chunks(file, data)
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16 or image.ndim != 2:
        raise UserError(f"{file}: cannot be decoded as a PNG image")
    return np.where(image > 0, image / np.float32(256.0), np.float32(np.nan))
