"""A recording from its files: the steps that all layouts share."""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.kitti_labels import labels_of
from stixel_cli.recordings.listing import checked_pairs, common_frames, numbered_images
from stixel_cli.recordings.parameters import Recorded, chosen_frames
from stixel_cli.recordings.poses_file import read_poses
from stixel_cli.recordings.types import Calibration, Recording


def assembled_recording(
    source: Recorded,
    calibration: Calibration,
    left_folder: Path,
    right_folder: Path,
    poses: Path,
    labels: Path | None = None,
    target: int | None = None,
    auto: bool = False,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. `poses` may be
    missing, and so may `labels` if there is no `target`.

    Raises:
        UserError: if a file is missing or not valid.
    """
    left, right = numbered_images(left_folder), numbered_images(right_folder)
    limits: dict[str, tuple[int, int]] = {}
    if target is not None:
        found = labels_of(labels, target)
        limits[f"track {target}"] = (int(found.frames[0]), int(found.frames[-1]) + 1)
    if poses.exists():
        limits["the ego poses"] = (0, len(read_poses(poses)))
    frames = common_frames(chosen_frames(source.frames), left, limits)
    of_target = {}
    if target is not None:
        if frames.start not in found.frames:
            raise UserError(
                f"source.frames: {labels} has no label of track {target} in frame {frames.start}"
            )
        box = found.boxes[found.frames == frames.start][0]
        of_target = {"label": found.kind, "first_box": (float(box[0]), float(box[2]))}
    files_left, files_right, (width, height) = checked_pairs(
        frames, left, right, left_folder, right_folder
    )
    return Recording(
        layout=source.kind,
        frames=frames,
        left=files_left,
        right=files_right,
        width=width,
        height=height,
        calibration=calibration,
        poses=poses if poses.exists() else None,
        labels=labels if labels is not None and labels.exists() else None,
        target=target,
        auto=auto,
        **of_target,
    )
