"""The images of a recording: from here on its stereo pairs are treated as rendered ones."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stixel_cli.errors import located
from stixel_cli.recordings.image_files import grey, read_image, rectified, rgb
from stixel_cli.recordings.rosbag import read_images
from stixel_cli.recordings.types import Messages, Rectification
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack, eight_bits, encode_pnm


def read_pairs(
    files: tuple[Path, ...],
    frames: range,
    rectification: Rectification | None = None,
    messages: Messages = (),
) -> StereoPairs:
    """The grey images of `frames`, both of a pair by one scale (`eight_bits`).

    `files` are the left images of all frames, then the right ones; or a bag, in which `messages`
    are the images. `rectification` is None if the files are rectified.
    """
    encoded = [
        [encode_pnm(rectified(grey(image), rectification, i == 1)) for i, image in enumerate(pair)]
        for pair in _images(files, frames, messages, "left", "right")
    ]
    return StereoPairs(frames.start, *map(ImageStack, zip(*encoded, strict=True)))


def read_left(
    files: tuple[Path, ...],
    frame: int,
    rectification: Rectification | None = None,
    messages: Messages = (),
) -> ImageStack:
    """The left image of `frame`, alone and in RGB, of `files` that may be the left ones alone.

    The other arguments are those of `read_pairs`.
    """
    ((image,),) = _images(files, range(frame, frame + 1), messages, "left")
    return ImageStack.from_images([rectified(rgb(image), rectification, False)])


def _images(
    files: tuple[Path, ...], frames: range, messages: Messages, *sides: str
) -> Iterator[list[np.ndarray]]:
    """The images of each frame, `left` or both `sides`, by one scale (`eight_bits`)."""
    found, chosen = [], slice(frames.start, frames.stop)
    for i in range(len(sides)):
        if messages:
            topic, times = messages[i]
            found.append(read_images(files, topic, times[chosen]))
        else:
            found.append(map(read_image, files[i * len(files) // 2 :][chosen]))
    for images in zip(*found, strict=True):
        with located("source"):
            yield eight_bits(dict(zip(sides, images, strict=True)))
