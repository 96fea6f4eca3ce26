"""The images of a recording: from here on its stereo pairs are treated as rendered ones."""

from pathlib import Path

from stixel_cli.images import ImageStack
from stixel_cli.recordings.image_files import read_grey, read_rgb, rectified
from stixel_cli.recordings.types import LeftImage, Rectification
from stixel_cli.rendering.frames import StereoPairs


def read_pairs(
    files: tuple[Path, ...], frames: range, rectification: Rectification | None = None
) -> StereoPairs:
    """The grey images of `frames`.

    Args:
        files: the left images of all frames, then the right ones.
        frames: indices k.
        rectification: of the images; None if the files are rectified.

    Raises:
        UserError: if an image is missing or damaged.
    """
    stacks = [
        ImageStack.from_images(
            rectified(read_grey(files[first + k]), rectification, first > 0) for k in frames
        )
        for first in (0, len(files) // 2)
    ]
    return StereoPairs(frames.start, *stacks)


def read_left(
    files: tuple[Path, ...], frame: int, rectification: Rectification | None = None
) -> LeftImage:
    """The left image of `frame`; `files` and `rectification` as in `read_pairs`.

    Raises:
        UserError: if the image is missing or damaged.
    """
    image = rectified(read_rgb(files[frame]), rectification, False)
    return LeftImage(frame, ImageStack.from_images([image]))
