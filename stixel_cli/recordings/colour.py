"""The colour image of the left camera, for pictures."""

from pathlib import Path

from stixel_cli.images import ImageStack
from stixel_cli.recordings.image_files import read_rgb, rectified
from stixel_cli.recordings.types import LeftImage, Rectification


def read_left(
    files: tuple[Path, ...], frame: int, rectification: Rectification | None = None
) -> LeftImage:
    """The left image of `frame`; `files` and `rectification` as in `pairs.read_pairs`.

    Raises:
        UserError: if the image is missing or damaged.
    """
    image = rectified(read_rgb(files[frame]), rectification, False)
    return LeftImage(frame, ImageStack.from_images([image]))
