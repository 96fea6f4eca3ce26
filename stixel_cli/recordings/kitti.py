"""Clips of KITTI's tracking and odometry benchmarks, and the motion in a clip for `path=recorded`.

Geiger, Lenz, Urtasun 2012, *Are we ready for autonomous driving?*. Tracking: below the folder, or
below its `training/`, are `image_02/0005/000000.png`, `image_03/0005/…`, `calib/0005.txt`,
`label_02/0005.txt`. The benchmark has no poses of the ego car; `ego_poses/0005.txt` has them, one
row per frame, as in the odometry benchmark. That has image_0 and image_1 (or 2 and 3), calib.txt
and no labels; its `poses.txt`, which it has in another folder, is expected next to the images.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.assembly import assembled_recording, numbered_images
from stixel_cli.recordings.parameters import KittiOdometry, KittiTracking, chosen_frames
from stixel_cli.recordings.tables import (
    read_calibration,
    read_kitti_labels,
    read_kitti_poses,
    track_of,
)
from stixel_cli.recordings.types import Recording
from stixel_cli.scene.path_parameters import ReplayedPath

LEAST_FRAMES = 5
"""Labelled frames of a track that the smoothing spline of a replayed motion needs."""

LABELS = "label_02"


def is_tracking(folder: Path) -> bool:
    """Whether the folder has the layout of the tracking benchmark."""
    return (_root(folder, "image_02") / "image_02").is_dir()


def is_odometry(folder: Path) -> bool:
    """Whether the folder has the layout of the odometry benchmark."""
    return (folder / "image_0").is_dir() and (folder / "calib.txt").is_file()


def _root(folder: Path, content: str) -> Path:
    """The folder that has `content`: the folder itself or its `training`."""
    inner = folder / "training"
    return inner if inner.is_dir() and not (folder / content).exists() else folder


def find_tracking(source: KittiTracking) -> Recording:
    """The files of a clip and its target, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    root, name = _root(Path(source.folder), "image_02"), f"{int(source.sequence):04d}"
    return assembled_recording(
        source,
        read_calibration(root / "calib" / f"{name}.txt", "P2", "P3"),
        left=numbered_images(root / "image_02" / name),
        right=numbered_images(root / "image_03" / name),
        labels=(root / LABELS / f"{name}.txt",),
        poses=(root / "ego_poses" / f"{name}.txt",),
    )


def find_odometry(source: KittiOdometry) -> Recording:
    """The files of a clip; errors as in `find_tracking`."""
    root = Path(source.folder)
    left, right = ("2", "3") if (root / "image_2").is_dir() else ("0", "1")
    return assembled_recording(
        source,
        read_calibration(root / "calib.txt", f"P{left}", f"P{right}"),
        left=numbered_images(root / f"image_{left}"),
        right=numbered_images(root / f"image_{right}"),
        poses=(root / "poses.txt",),
    )


def find_replay(path: ReplayedPath) -> Recording:
    """The files and frames of a replayed motion, a recording without images; they are checked.

    Raises:
        UserError: if a file is missing or not valid, or the track has too few labels.
    """
    root, name = label_root(Path(path.folder)), f"{int(path.sequence):04d}"
    labels, poses = root / LABELS / f"{name}.txt", root / "ego_poses" / f"{name}.txt"
    if not labels.is_file():
        known = ", ".join(sequences(root))
        raise UserError(f"path.sequence: {labels}: no such file; there are {known}")
    if not poses.is_file():
        raise UserError(f"path.sequence: {poses}: no such file; the ego car's motion is required")
    found = track_of(read_kitti_labels(labels), path.target, labels, "path.target")
    known = found.frames[found.frames < len(read_kitti_poses(poses))]
    return Recording(
        layout="kitti_tracking",
        frames=_frames(path, known.tolist()),
        left=(),
        right=(),
        width=0,
        height=0,
        calibration=read_calibration(root / "calib" / f"{name}.txt", "P2", "P3"),
        pose_files=(poses,),
        label_files=(labels,),
        target=path.target,
        label=found.kind,
    )


def label_root(folder: Path) -> Path:
    """The folder that has `label_02`: the folder itself or its `training`.

    Raises:
        UserError: if neither has it.
    """
    root = _root(folder, LABELS)
    if (root / LABELS).is_dir():
        return root
    if not folder.is_dir():
        raise UserError(f"path.folder: {folder}: no such folder")
    raise UserError(f"path.folder: {folder}: has no folder {LABELS} with KITTI's labels")


def sequences(root: Path) -> list[str]:
    """Names of the clips with labels below a `label_root`."""
    return sorted(file.stem for file in (root / LABELS).glob("*.txt"))


def _frames(path: ReplayedPath, known: list[int]) -> range:
    """The frames to replay, of those with a label and an ego pose; both ends have a label."""
    try:
        chosen = chosen_frames(path.frames, "path.frames")
    except ValueError as fault:
        raise UserError(str(fault)) from None
    if chosen is None:
        chosen = range(known[0], known[-1] + 1) if known else range(0)
    inside = [frame for frame in known if frame in chosen]
    track = f"track {path.target} of clip {path.sequence}"
    key = "target" if path.frames is None else "frames"
    if len(inside) < LEAST_FRAMES:
        raise UserError(
            f"path.{key}: {track} has {len(inside)} labelled frames with an ego pose here, "
            f"at least {LEAST_FRAMES} are needed"
        )
    if (inside[0], inside[-1] + 1) != (chosen.start, chosen.stop):
        raise UserError(
            f"path.frames: {track} has no label at an end of {path.frames}; "
            f"{inside[0]}:{inside[-1] + 1} has"
        )
    return chosen
