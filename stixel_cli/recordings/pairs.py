"""The stereo pairs of a recording: from here on they are treated as rendered ones."""

from pathlib import Path

from stixel_cli.images import ImageStack
from stixel_cli.recordings.image_files import read_grey, rectified
from stixel_cli.recordings.types import Rectification
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
    count = len(files) // 2
    left = ImageStack.from_images(
        rectified(read_grey(files[k]), rectification, False) for k in frames
    )
    right = ImageStack.from_images(
        rectified(read_grey(files[count + k]), rectification, True) for k in frames
    )
    return StereoPairs(frames.start, left, right)
