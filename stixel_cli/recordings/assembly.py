"""A recording from its files: the steps that all layouts share."""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.listing import checked_pairs, common_frames
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
    target: int | str | None = None,
    layout: TableLayout = KITTI,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. `poses` may be
    missing, and so may `labels` if there is no `target`. `layout` is that of both. With the target
    `auto` all that moves is tracked.

    Raises:
        UserError: if a file is missing or not valid.
    """
    auto = target == "auto"
    target = None if auto else target
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
