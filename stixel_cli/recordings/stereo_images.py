"""The images of a recording: from here on its stereo pairs are treated as rendered ones."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.images import ImageStack, eight_bits, encode_png
from stixel_cli.recordings.image_files import grey, read_image, rectified, rgb
from stixel_cli.recordings.rosbag import read_images
from stixel_cli.recordings.types import Messages, Rectification
from stixel_cli.rendering.frames import StereoPairs


def read_pairs(
    files: tuple[Path, ...],
    frames: range,
    rectification: Rectification | None = None,
    messages: Messages = (),
) -> StereoPairs:
    """The grey images of `frames`, both of a pair by one scale (`eight_bits`).

    Args:
        files: the left images of all frames, then the right ones; or those of a bag.
        frames: indices k.
        rectification: of the images; None if the files are rectified.
        messages: the images, if they are in a bag.

    Raises:
        UserError: if an image is missing or damaged.
    """
    encoded = [
        [
            encode_png(rectified(grey(image), rectification, right))
            for right, image in enumerate(_plain({"left": left, "right": other}))
        ]
        for left, other in zip(
            _images(files, frames, False, messages),
            _images(files, frames, True, messages),
            strict=True,
        )
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

    Raises:
        UserError: if the image is missing or damaged.
    """
    (image,) = _images(files, range(frame, frame + 1), False, messages)
    (image,) = _plain({"left": image})
    return ImageStack.from_images([rectified(rgb(image), rectification, False)])


def _plain(images: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """`eight_bits`; its faults as UserError."""
    try:
        return eight_bits(images)
    except ValueError as fault:
        raise UserError(f"source: {fault}") from None


def _images(
    files: tuple[Path, ...], frames: range, right: bool, messages: Messages
) -> Iterable[np.ndarray]:
    if messages:
        topic, times = messages[right]
        return read_images(files, topic, times[frames.start : frames.stop])
    first = len(files) // 2 if right else 0
    return map(read_image, files[first + frames.start : first + frames.stop])
