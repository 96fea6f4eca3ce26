"""A recording from its files: the steps that all layouts share."""

import re
from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.image_files import image_size
from stixel_cli.recordings.parameters import Recorded, chosen_frames
from stixel_cli.recordings.tables import labels_of, read_poses
from stixel_cli.recordings.types import KITTI, Calibration, Recording, TableLayout


def assembled_recording(
    source: Recorded,
    calibration: Calibration,
    left: dict[int, Path],
    right: dict[int, Path],
    poses: tuple[Path, ...],
    labels: tuple[Path, ...] = (),
    layout: TableLayout = KITTI,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. `poses` may be
    missing, and so may `labels` if the source has no target. `layout` is that of both. With the
    target `auto` every moving object is tracked.

    Raises:
        UserError: if a file is missing or not valid.
    """
    auto = source.target == "auto"
    target = None if auto else source.target
    limits: dict[str, tuple[int, int]] = {}
    if target is not None:
        found = labels_of(labels, layout, target)
        limits[f"track {target}"] = (int(found.frames[0]), int(found.frames[-1]) + 1)
    pose_files = _existing(poses)
    if pose_files:
        limits["the ego poses"] = (0, len(read_poses(pose_files, layout)))
    frames = common_frames(chosen_frames(source.frames), left, limits)
    of_target = {}
    if target is not None:
        if frames.start not in found.frames:
            raise UserError(
                f"source.frames: {labels[0]} has no label of track {target} in frame {frames.start}"
            )
        box = found.boxes[found.frames == frames.start][0]
        of_target = {"label": found.kind, "first_box": (float(box[0]), float(box[2]))}
    files_left, files_right, (width, height) = checked_pairs(frames, left, right)
    return Recording(
        layout=source.kind,
        frames=frames,
        left=files_left,
        right=files_right,
        width=width,
        height=height,
        calibration=calibration,
        pose_files=pose_files,
        label_files=_existing(labels),
        table_layout=layout,
        target=target,
        auto=auto,
        **of_target,
    )


def _existing(files: tuple[Path, ...]) -> tuple[Path, ...]:
    """All of these files, or () if one is missing."""
    return files if all(file.exists() for file in files) else ()


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
