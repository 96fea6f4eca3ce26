"""A labelled recording from its files: the steps that all layouts share."""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.kitti_labels import labels_of
from stixel_cli.recordings.listing import checked_pairs, common_frames, numbered_images
from stixel_cli.recordings.parameters import KittiTracking, PlainFolder, chosen_frames
from stixel_cli.recordings.poses_file import read_poses
from stixel_cli.recordings.types import Calibration, Recording


def labelled_recording(
    source: KittiTracking | PlainFolder,
    calibration: Calibration,
    left_folder: Path,
    right_folder: Path,
    labels: Path,
    poses: Path,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. `poses` may be
    missing.

    Raises:
        UserError: if a file is missing or not valid.
    """
    target = labels_of(labels, source.target)
    left, right = numbered_images(left_folder), numbered_images(right_folder)
    limits = {f"track {source.target}": (int(target.frames[0]), int(target.frames[-1]) + 1)}
    if poses.exists():
        limits["the ego poses"] = (0, len(read_poses(poses)))
    frames = common_frames(chosen_frames(source.frames), left, limits)
    if frames.start not in target.frames:
        raise UserError(
            f"source.frames: {labels} has no label of track {source.target} in frame {frames.start}"
        )
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
        labels=labels,
        label=target.kind,
        first_box=tuple(target.boxes[target.frames == frames.start][0, [0, 2]].tolist()),
    )
