"""The recording of a configuration's `source`, in whichever layout it is."""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings import argoverse, kitti, plain_folder, rosbag
from stixel_cli.recordings.parameters import Source
from stixel_cli.recordings.types import Recording

LAYOUTS = {
    "kitti_raw": (kitti.is_raw, kitti.find_raw),
    "kitti_tracking": (kitti.is_tracking, kitti.find_tracking),
    "kitti_odometry": (kitti.is_odometry, kitti.find_odometry),
    "kitti_pair": (kitti.is_pair, kitti.find_pair),
    "virtual_kitti": (kitti.is_virtual, kitti.find_virtual),
    "argoverse": (argoverse.is_layout, argoverse.find_recording),
    "rosbag": (rosbag.is_layout, rosbag.find_recording),
    "folder": (plain_folder.is_layout, plain_folder.find_recording),
    "pair": (lambda folder: False, plain_folder.find_named_pair),  # no folder has it
}
"""Whether a folder has the layout, and its recording, by the option of `source`.

Each of the latter is called by, and has the errors of, `find_recording`.
"""


def find_recording(source: Source) -> Recording:
    """The files of a recording, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid; it names the file, the row and the cause.
    """
    if source.kind not in ("pair", "rosbag") and not Path(source.folder).is_dir():
        raise UserError(f"source.folder: {source.folder}: no such folder")
    _, find = LAYOUTS[source.kind]
    return find(source)


def guess_layout(folder: Path) -> str:
    """The layout of a folder, as the option of `source`.

    Raises:
        UserError: if its layout is not known.
    """
    for name, (is_layout, _) in LAYOUTS.items():
        if is_layout(folder):
            return name
    if not folder.is_dir():
        raise UserError(f"source.folder: {folder}: no such folder")
    raise UserError(
        f"source.folder: {folder}: not a known layout: image_02 (source=kitti_tracking), "
        "image_02/data (source=kitti_raw), "
        "image_0 and calib.txt (source=kitti_odometry), image_2 and calib (source=kitti_pair), "
        "frames/rgb/Camera_0 (source=virtual_kitti), sensors/cameras/stereo_front_left "
        "(source=argoverse), metadata.yaml (source=rosbag) or rig.yaml (source=folder) is missing"
    )
