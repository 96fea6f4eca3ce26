"""The motion of `path=recorded`: KITTI's tracking benchmark or a log of Argoverse 2, no images.

`ReplayedPath` names the files, `kitti_tables` and `argoverse` describe them. If the camera's place
in a log is wanted, `calibration/egovehicle_SE3_sensor.feather` has it.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.errors import UserError, located
from stixel_cli.recordings import argoverse
from stixel_cli.recordings.kitti_tables import clip_poses, read_calibration, root_of
from stixel_cli.recordings.parameters import chosen_frames
from stixel_cli.recordings.tables import labels_of, poses_of_labels, read_poses
from stixel_cli.recordings.times import check_steps
from stixel_cli.recordings.types import Recording, Tables
from stixel_cli.scene.parameters import ReplayedPath, RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LEAST_FRAMES = 5
"""Labelled frames of a track that the smoothing spline of a replayed motion needs."""

LABELS = "label_02"


def find_replay(path: ReplayedPath) -> Recording:
    """The files and frames of a replayed motion, a recording without images; they are checked."""
    folder = Path(path.folder)
    recording = find_motion(folder, path.sequence)
    track = labels_of(recording.label_files, recording.tables, path.target, "path.target")
    count = len(read_poses(recording.pose_files, recording.tables))
    frames = _frames(path, track.frames[track.frames < count].tolist())
    tables = replace(recording.tables, first=frames.start)
    of_target = {"target": path.target, "label": track.kind}
    recording = replace(recording, frames=frames, tables=tables, **of_target)
    if tables.times:
        check_steps(recording, path.sample_time, folder, "path")
    return recording


def find_motion(folder: Path, sequence: str | None) -> Recording:
    """All labels and ego poses of a log of Argoverse 2, or of the clip `sequence` of KITTI.

    Its frames and its target are those of a user to choose.
    """
    if (folder / argoverse.ANNOTATIONS).is_file():
        if sequence is not None:
            raise UserError(f"path.sequence: {folder} is one log of Argoverse 2: leave it out")
        return argoverse.find_motion(folder)
    root = label_root(folder)
    if sequence is None:
        raise UserError("path.sequence: is required with KITTI's labels, a number such as 0005")
    name = f"{int(sequence):04d}"
    labels = root / LABELS / f"{name}.txt"
    tables, poses = clip_poses(root, name)
    if not labels.is_file():
        known = ", ".join(sequences(root))
        raise UserError(f"path.sequence: {labels}: no such file; there are {known}")
    if not poses[-1].is_file():
        raise UserError(f"path.sequence: {poses[-1]}: no such file; the ego car's motion is needed")
    calibration = read_calibration(root / "calib" / f"{name}.txt", ("P2", "P3"))
    return Recording(
        layout="kitti_tracking",
        frames=range(0),
        tables=replace(tables, left_camera=calibration.left_camera),
        pose_files=poses,
        label_files=(labels,),
    )


def label_root(folder: Path) -> Path:
    """The folder that has `label_02`: the folder itself or its `training`."""
    root = root_of(folder, LABELS)
    if (root / LABELS).is_dir():
        return root
    if not folder.is_dir():
        raise UserError(f"path.folder: {folder}: no such folder")
    raise UserError(
        f"path.folder: {folder}: has neither a folder {LABELS} with KITTI's labels nor "
        f"{argoverse.ANNOTATIONS} of Argoverse 2"
    )


def sequences(root: Path) -> list[str]:
    """Names of the clips with labels and ego poses below a `label_root`."""
    found = (file.stem for file in (root / LABELS).glob("*.txt"))
    return sorted(name for name in found if clip_poses(root, name)[1][-1].is_file())


def _frames(path: ReplayedPath, known: list[int]) -> range:
    """The frames to replay, of those with a label and an ego pose; both ends have a label."""
    with located(""):
        chosen = chosen_frames(path.frames, "path.frames")
    if chosen is None:
        chosen = range(known[0], known[-1] + 1) if known else range(0)
    inside = [frame for frame in known if frame in chosen]
    track = f"track {path.target} of clip {path.sequence or Path(path.folder).name}"
    key = "target" if path.frames is None else "frames"
    if len(inside) < LEAST_FRAMES:
        raise UserError(
            f"path.{key}: {track} has {len(inside)} labelled frames with an ego pose here, "
            f"at least {LEAST_FRAMES} are needed"
        )
    labelled = f"{inside[0]}:{inside[-1] + 1}"
    if labelled != f"{chosen.start}:{chosen.stop}":
        raise UserError(
            f"path.frames: {track} has no label at an end of {path.frames}; {labelled} has"
        )
    return chosen


def replayed_scenario(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    road_user: RoadUser,
    tables: Tables,
    target: int | str,
    smoothing: float,
) -> Scenario:
    """Ground truth of `road_user` on the smoothed path of one labelled target.

    The labels' places and headings are moved into the world by the ego poses. A smoothing spline
    over time of each coordinate gives the poses and their exact derivatives at all frames, those
    without a label among them.

    The first and the last of the frames of `ego_motion` have a label of `target`, a track id or
    track_uuid, in the `files`. `road_user` is the target in the scene, with its own size. For
    `smoothing`, s, see `smoothing_spline`.
    """
    from scipy.integrate import cumulative_trapezoid

    from stixel_cli.scene.contours import road_user_contours
    from stixel_cli.scene.road_user import limb_poses

    times, labels = ego_motion.times, labels_of(files, tables, target, "path.target")
    _, frames, poses = poses_of_labels(ego_motion, labels, np.eye(3), tables)
    splines = [smoothing_spline(times[frames], values, smoothing) for values in poses.T]
    smooth = np.stack([spline(times) for spline in splines], axis=1)
    rates = np.stack([spline.derivative()(times) for spline in splines], axis=1)
    travelled = cumulative_trapezoid(np.hypot(*rates[:, :2].T), times, initial=0.0)
    target = smooth, rates, road_user_contours(road_user), limb_poses(road_user, travelled)
    return Scenario(times, ego_motion.poses_world, *target)


def smoothing_spline(times: np.ndarray, values: np.ndarray, period: float) -> "BSpline":
    """The natural cubic smoothing spline of `values` (n,), n ≥ 5, at `times` (n,) s.

    It minimises Σ (value - f)² + λ ∫ f''². At evenly spaced times with step T that is a filter of
    gain 1 / (1 + λ T ω⁴) (Silverman 1984, *Spline smoothing: the equivalent variable kernel
    method*). λ makes the gain 1/2 at the given period, s. With 0 it goes through all values.
    """
    from scipy.interpolate import make_smoothing_spline

    step = np.median(np.diff(times))
    return make_smoothing_spline(times, values, lam=(period / (2.0 * np.pi)) ** 4 / step)
