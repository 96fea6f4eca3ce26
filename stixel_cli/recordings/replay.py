"""The files of `path=recorded`: labels, ego poses and calibration of a KITTI clip."""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.kitti_calibration import read_calibration
from stixel_cli.recordings.kitti_labels import labels_of
from stixel_cli.recordings.parameters import chosen_frames
from stixel_cli.recordings.poses_file import read_poses
from stixel_cli.recordings.types import Recording
from stixel_cli.scene.path_parameters import ReplayedPath

LEAST_FRAMES = 5
"""Labelled frames of a track that the smoothing spline needs."""

LABELS = "label_02"


def find_replay(path: ReplayedPath) -> Recording:
    """The files and frames of the motion, a recording without images; the files are checked.

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
    found = labels_of(labels, path.target, "path.target")
    known = found.frames[found.frames < len(read_poses(poses))]
    frames = _frames(path, known.tolist())
    return Recording(
        layout="kitti_tracking",
        frames=frames,
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
    for root in (folder, folder / "training"):
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
