"""A recording from its files: the steps that all layouts share."""

import re
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.image_files import image_size, read_disparity
from stixel_cli.recordings.parameters import Recorded, chosen_frames
from stixel_cli.recordings.tables import labels_of, read_poses
from stixel_cli.recordings.types import Calibration, Recording, Rectification, Tables

MOST_FILES = 200_000
"""In a folder of images."""

AS_KITTI = Tables()

Images = dict[int, Path]
"""The images of one camera by their number."""


def assembled_recording(
    source: Recorded,
    calibration: Calibration,
    images: tuple[Images, Images],
    poses: tuple[Path, ...],
    labels: tuple[Path, ...] = (),
    tables: Tables = AS_KITTI,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. With the target
    `auto` every moving object is tracked.

    Args:
        source: the user's parameters.
        calibration: of the rig.
        images: of the left and the right camera.
        poses: files of the ego poses, which may be missing.
        labels: files of the labels, which may be missing if the source has no target.
        tables: how both are written; by default as KITTI's.

    Raises:
        UserError: if a file is missing or not valid.
    """
    # One pair of images has no target: its labels are no tracks.
    named = getattr(source, "target", None)
    target = None if named == "auto" else named
    limits: dict[str, tuple[int, int]] = {}
    if target is not None:
        track = labels_of(labels, tables, target)
        limits[f"track {target}"] = (int(track.frames[0]), int(track.frames[-1]) + 1)
    pose_files = _existing(poses)
    if pose_files:
        limits["the ego poses"] = (0, len(read_poses(pose_files, tables)))
    frames = common_frames(chosen_frames(source.frames), images[0], limits)
    of_target = {}
    if target is not None:
        if frames.start not in track.frames:
            raise UserError(
                f"source.frames: {labels[0]} has no label of track {target} in frame {frames.start}"
            )
        box = track.boxes[track.frames == frames.start][0]
        of_target = {"label": track.kind, "first_box": (float(box[0]), float(box[2]))}
    width, height = _common_size(frames, images, calibration.rectification)
    left, right = (tuple(files[number] for number in frames) for files in images)
    return Recording(
        layout=source.kind,
        frames=frames,
        left=left,
        right=right,
        width=width,
        height=height,
        calibration=calibration,
        tables=replace(tables, first=frames.start, left_camera=calibration.left_camera),
        pose_files=pose_files,
        label_files=_existing(labels),
        target=target,
        auto=named == "auto",
        **of_target,
    )


def assembled_pair(
    source: Recorded,
    images: tuple[Path, Path],
    calibration: Calibration,
    labels: Path | None,
    disparity: Path | None,
) -> Recording:
    """The recording of one pair of images, without time and motion, and their optional truth."""
    left, right = ({0: image} for image in images)
    recording = assembled_recording(source, calibration, (left, right), poses=())
    true_disparities = () if disparity is None else (disparity,)
    for file in true_disparities:
        height, width = read_disparity(file).shape
        if (width, height) != (recording.width, recording.height):
            raise UserError(
                f"{file}: {width} × {height} px, but {images[0].name} has "
                f"{recording.width} × {recording.height} px"
            )
    label_files = () if labels is None else (labels,)
    return replace(recording, label_files=label_files, true_disparities=true_disparities)


def _existing(files: tuple[Path, ...]) -> tuple[Path, ...]:
    """All of these files, or () if one is missing."""
    return files if all(file.exists() for file in files) else ()


def root_of(folder: Path, *contents: str) -> Path:
    """The folder that has one of the `contents`: the folder itself, or else its `training`."""
    inner = folder / "training"
    has_contents = any((folder / name).exists() for name in contents)
    return inner if inner.is_dir() and not has_contents else folder


def numbered_images(
    *folders: Path, names: str = r"(\d{1,10})\.(?:png|jpe?g)", example: str = "000000.png"
) -> tuple[Images, ...]:
    """The images of each of the `folders` by the number in their name, in ascending order.

    `names` is the pattern of the files' names, its group is the number; `example` is such a name.

    Raises:
        UserError: if a folder is missing, or has no such file.
    """
    return tuple(_numbered(folder, names, example) for folder in folders)


def _numbered(folder: Path, names: str, example: str) -> Images:
    images = {}
    try:
        for i, file in enumerate(folder.iterdir()):
            if i >= MOST_FILES:
                raise UserError(f"{folder}: more than {MOST_FILES} files")
            match = re.fullmatch(names, file.name, re.IGNORECASE)
            # A PNG before a JPEG of the same number, in whichever order the folder lists them.
            if match and file > images.get(int(match[1]), Path()):
                images[int(match[1])] = file
    except FileNotFoundError:
        raise UserError(f"{folder}: no such folder") from None
    except OSError as error:
        raise UserError(f"{folder}: cannot be read: {error.strerror}") from error
    if not images:
        raise UserError(f"{folder}: has no images such as {example}")
    return dict(sorted(images.items()))


def common_frames(
    chosen: range | None, images: Collection[int], limits: dict[str, tuple[int, int]]
) -> range:
    """The frames that the images and each of the `limits` have, or those `chosen` by the user.

    `limits` are the first frame and the stop of other files, by a name for messages.
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


def _common_size(
    frames: range, images: tuple[Images, Images], rectification: Rectification | None
) -> tuple[int, int]:
    """Width and height in px of the rectified images of all `frames`."""
    size: tuple[int, int] | None = None
    for number in frames:
        for files in images:
            if number not in files:
                folder = next(iter(files.values())).parent
                raise UserError(f"{folder}: the image of frame {number} is missing")
            width, height = image_size(files[number])
            size = size or (width, height)
            if (width, height) != size:
                raise UserError(
                    f"{files[number]}: {width} × {height} px, "
                    f"but the images before have {size[0]} × {size[1]} px"
                )
    if rectification is None:
        return size
    if size != rectification.file_size:
        width, height = rectification.file_size
        raise UserError(
            f"{images[0][frames[0]]}: {size[0]} × {size[1]} px, "
            f"but its calibration has {width} × {height} px"
        )
    return rectification.size
