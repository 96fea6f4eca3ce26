"""JPEG images of recordings."""

import cv2
import numpy as np
import pytest

from stixel_cli.errors import UserError
from stixel_cli.recordings.image_files import grey, image_size, read_image, rgb


def frame(kind, bits, height, channels):
    """The header of a frame (ITU-T T.81, B.2.2), 16 px wide, and the begin of its scan (B.2.3)."""
    size = bytes([bits, *height.to_bytes(2, "big"), 0, 16, channels])
    size += b"".join(bytes([i + 1, 0x11, 0]) for i in range(channels))
    return b"\xff" + kind + (len(size) + 2).to_bytes(2, "big") + size + b"\xff\xda\x00\x02"


def test_jpeg_images_are_read_as_png_images_are(tmp_path, capfd):
    ramp = np.repeat(np.arange(0, 240, 4, dtype=np.uint8)[None], 30, axis=0)
    for name, image in (("grey", ramp), ("rgb", np.dstack([ramp, ramp // 2, ramp // 4]))):
        file = tmp_path / f"{name}.jpg"
        cv2.imwrite(str(file), image, [cv2.IMWRITE_JPEG_QUALITY, 100])
        assert image_size(file) == (60, 30)
        data = file.read_bytes()
        # A segment before the frame's, longer than the head of a PNG.
        file.write_bytes(data[:2] + b"\xff\xfe\x03\x00" + bytes(0x2FE) + data[2:])
        assert image_size(file) == (60, 30)
        assert rgb(read_image(file)).shape == (30, 60, 3)
        assert grey(read_image(file)).shape == (30, 60)
        file.write_bytes(file.read_bytes()[: len(data)])
        with pytest.raises(UserError, match=rf"{name}\.jpg: a damaged or incomplete JPEG image"):
            read_image(file)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (frame(b"\xc0", 12, 16, 3), "a damaged or incomplete JPEG image, or not of 8 bits"),
        (frame(b"\xc0", 8, 16, 4), "a JPEG in CMYK: must be grey or RGB"),
        (frame(b"\xc2", 8, 65296, 3), "16 × 65296 px: each side must be"),
        (b"\xff\xd8\xff\xff", "a damaged or incomplete JPEG image"),
        (b"\xff\xe0\x00\x00" * 9, "a damaged or incomplete JPEG image"),
    ],
)
def test_other_jpeg_images_are_refused(head, said, tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8" + head)
    with pytest.raises(UserError, match=said):
        image_size(tmp_path / "a.jpg")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"image", "a.jpg: not a JPEG image"),
        (b"version https://git-lfs.github.com/spec/v1", "a.jpg: a Git LFS pointer"),
    ],
)
def test_what_is_no_jpeg_image_is_named(content, said, tmp_path):
    (tmp_path / "a.jpg").write_bytes(content)
    with pytest.raises(UserError, match=said):
        image_size(tmp_path / "a.jpg")
