"""The images of a stereo recording, listed and checked before anything is computed."""

import re
from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.image_files import image_size

MOST_FILES = 200_000


def numbered_images(folder: Path, names: str = r"(\d{1,9})\.png", example: str = "000000.png"):
    """The images of a folder by the number in their name, a dictionary of paths.

    Args:
        folder: of the images.
        names: pattern of their names; its group is the number.
        example: such a name, for messages.

    Raises:
        UserError: if there is no such folder, or it has no such file.
    """
    found = {}
    try:
        for i, file in enumerate(folder.iterdir()):
            if i >= MOST_FILES:
                raise UserError(f"{folder}: more than {MOST_FILES} files")
            if match := re.fullmatch(names, file.name):
                found[int(match[1])] = file
    except FileNotFoundError:
        raise UserError(f"{folder}: no such folder") from None
    except OSError as error:
        raise UserError(f"{folder}: cannot be read: {error.strerror}") from error
    if not found:
        raise UserError(f"{folder}: has no images such as {example}")
    return dict(sorted(found.items()))


def common_frames(
    chosen: range | None, images: dict[int, Path], limits: dict[str, tuple[int, int]]
) -> range:
    """The frames that the images and each of the `limits` have, without gaps in the images.

    Args:
        chosen: by the user; None for all.
        images: by their number.
        limits: first frame and stop of other files, by a name for messages.

    Raises:
        UserError: if there is no common frame, or a chosen frame is missing.
    """
    spans = {"the images": (min(images), max(images) + 1), **limits}
    first = max(start for start, _ in spans.values())
    stop = min(end for _, end in spans.values())
    if chosen is not None:
        for name, (start, end) in spans.items():
            if chosen.start < start or chosen.stop > end:
                raise UserError(
                    f"source.frames: {chosen.start}:{chosen.stop} is not within "
                    f"{start}:{end}, the frames of {name}"
                )
        first, stop = chosen.start, chosen.stop
    if first >= stop:
        words = "; ".join(f"{name} {start}:{end}" for name, (start, end) in spans.items())
        raise UserError(f"source.frames: no common frame: {words}")
    return range(first, stop)


def checked_pairs(
    frames: range, left: dict[int, Path], right: dict[int, Path]
) -> tuple[tuple[Path, ...], tuple[Path, ...], tuple[int, int]]:
    """Left and right image of each frame, and their common width and height.

    Raises:
        UserError: if one is missing, is not an image of 8 bits, or has another size.
    """
    size: tuple[int, int] | None = None
    for number in frames:
        for images in (left, right):
            if number not in images:
                folder = next(iter(images.values())).parent
                raise UserError(f"{folder}: the image of frame {number} is missing")
            found = image_size(images[number])
            if size is None:
                size = found
            elif found != size:
                raise UserError(
                    f"{images[number]}: {found[0]} × {found[1]} px, "
                    f"but the images before have {size[0]} × {size[1]} px"
                )
    return tuple(left[n] for n in frames), tuple(right[n] for n in frames), size
