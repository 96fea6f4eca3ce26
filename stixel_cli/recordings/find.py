"""The recording of a configuration's `source`, in whichever layout it is.

Two layouts are of no benchmark: a pair whose files are named, with a calibration of any kind that
`rig_files` reads; and a plain folder with rig.yaml, left/000000.png, right/000000.png, optional
labels.txt and poses.txt. `rig.yaml` has `focal_length`, `principal_u`, `principal_v` (px),
`baseline` (m), and optionally `focal_length_v`, `principal_u_right` (px) and `camera_height` (m),
or is a YAML file of ROS or OpenCV. The images are rectified. `labels.txt` has the columns of KITTI
tracking, in the frame of the left camera, and `poses.txt` the rows of KITTI odometry.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings import argoverse, kitti, rosbag
from stixel_cli.recordings.assembly import (
    assembled_pair,
    assembled_recording,
    numbered_images,
    root_of,
)
from stixel_cli.recordings.parameters import LabelledFolder, Pair, Source
from stixel_cli.recordings.rig_files import read_named_calibration, read_rig
from stixel_cli.recordings.types import Recording

MARKS = (
    ("kitti_raw", "image_02/data"),
    ("kitti_tracking", "image_02"),
    ("kitti_odometry", "image_0", "calib.txt"),
    ("kitti_pair", "image_2", "calib"),
    ("kitti_pair", "image_2", "calib_cam_to_cam"),
    ("kitti_pair", "image_0", "calib"),
    ("virtual_kitti", str(kitti.VIRTUAL_IMAGES)),
    ("argoverse", str(argoverse.IMAGES)),
    ("rosbag", rosbag.METADATA),
    ("folder", "rig.yaml"),
)
"""The option of `source` for a folder that has, itself or in its `training`, all of these."""


def find_recording(source: Source) -> Recording:
    """The files of a recording, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid; it names the file, the row and the cause.
    """
    if source.kind not in ("pair", "rosbag") and not Path(source.folder).is_dir():
        raise UserError(f"source.folder: {source.folder}: no such folder")
    find = {
        "kitti_raw": kitti.find_raw,
        "kitti_tracking": kitti.find_tracking,
        "kitti_odometry": kitti.find_odometry,
        "kitti_pair": kitti.find_pair,
        "virtual_kitti": kitti.find_virtual,
        "argoverse": argoverse.find_recording,
        "rosbag": rosbag.find_recording,
        "folder": _folder,
        "pair": _named_pair,
    }[source.kind]
    return find(source)


def guess_layout(folder: Path) -> str:
    """The layout of a folder, as the option of `source`.

    Raises:
        UserError: if its layout is not known.
    """
    if rosbag.is_bag(folder):
        return "rosbag"
    if not folder.is_dir():
        raise UserError(f"source.folder: {folder}: no such folder")
    for name, *marks in MARKS:
        if all((root_of(folder, marks[0]) / mark).exists() for mark in marks):
            return name
    known = ", ".join(f"{' and '.join(marks)} (source={name})" for name, *marks in MARKS)
    raise UserError(f"source.folder: {folder}: not a known layout, which has one of: {known}")


def _folder(source: LabelledFolder) -> Recording:
    root = Path(source.folder)
    return assembled_recording(
        source,
        read_rig(root / "rig.yaml"),
        numbered_images(root / "left", root / "right"),
        labels=(root / "labels.txt",),
        poses=(root / "poses.txt",),
    )


def _named_pair(source: Pair) -> Recording:
    return assembled_pair(
        source,
        (Path(source.left), Path(source.right)),
        read_named_calibration(Path(source.calibration)),
        None if source.labels is None else Path(source.labels),
        None if source.disparity is None else Path(source.disparity),
    )
