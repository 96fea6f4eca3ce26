"""The colour image of the left camera, for pictures."""

from pathlib import Path

from stixel_cli.images import ImageStack
from stixel_cli.recordings.image_files import read_rgb
from stixel_cli.recordings.types import LeftImage


def read_left(files: tuple[Path, ...], frame: int) -> LeftImage:
    """The left image of `frame`; `files` as in `pairs.read_pairs`.

    Raises:
        UserError: if the image is missing or damaged.
    """
    return LeftImage(frame, ImageStack.from_images([read_rgb(files[frame])]))
