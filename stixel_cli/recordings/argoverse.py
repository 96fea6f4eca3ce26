"""Argoverse 2's sensor data set: the stereo cameras of one log.

Wilson et al. 2021. Below the log's folder: `sensors/cameras/stereo_front_left/TIME.jpg` and
`stereo_front_right/…` (TIME in ns), `calibration/intrinsics.feather`,
`calibration/egovehicle_SE3_sensor.feather`, `city_SE3_egovehicle.feather`, and optionally
`annotations.feather`. Frames are numbered from 0 in the order of the left images. The images are
undistorted but not rectified.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.feather import read_columns
from stixel_cli.recordings.argoverse_tables import CAMERAS, read_calibration
from stixel_cli.recordings.assembly import assembled_recording, numbered_images
from stixel_cli.recordings.parameters import Argoverse
from stixel_cli.recordings.times import PAIRED, check_steps, nearest
from stixel_cli.recordings.types import Recording, Tables

ANNOTATIONS, CITY = "annotations.feather", "city_SE3_egovehicle.feather"
SENSORS = "calibration/egovehicle_SE3_sensor.feather"
TIME = "timestamp_ns"
IMAGES = Path("sensors/cameras")
NAMES = r"(\d{1,18})\.jpg"
EXAMPLE = "315966070549927216.jpg"


def find_recording(source: Argoverse) -> Recording:
    """The recording of a log."""
    root = Path(source.folder)
    folders = (root / IMAGES / name for name in CAMERAS)
    left, right = numbered_images(*folders, names=NAMES, example=EXAMPLE)
    intrinsics, sensors = root / "calibration/intrinsics.feather", root / SENSORS
    times, city = tuple(left), root / CITY
    others = list(right)
    partners = {k: nearest(others, time) for k, time in enumerate(times)}
    pairs = {k: right[t] for k, t in partners.items() if abs(t - times[k]) <= PAIRED}
    if not pairs:
        raise UserError(f"{root / IMAGES}: no image of {CAMERAS[1]} at a time of {CAMERAS[0]}")
    recording = assembled_recording(
        source,
        read_calibration(intrinsics, sensors),
        (dict(enumerate(left.values())), pairs),
        poses=(city, sensors),
        labels=(root / ANNOTATIONS, city, sensors, intrinsics),
        tables=Tables("argoverse", times),
    )
    check_steps(recording, source.sample_time, root, "source")
    return recording


def find_motion(root: Path) -> Recording:
    """All labels of a log and the motion of its ego car, which need no images.

    The frames are those of the labels. With the mounting of the cameras the camera is the rectified
    left one, without it one at the origin of the ego car's frame.
    """
    annotations, sensors = root / ANNOTATIONS, root / SENSORS
    poses = (root / CITY, *([sensors] if sensors.is_file() else []))
    times = tuple(np.unique(read_columns(annotations, (TIME,))[TIME]).tolist())
    return Recording(
        layout="argoverse",
        frames=range(len(times)),
        tables=Tables("argoverse", times),
        pose_files=poses,
        label_files=(annotations, *poses),
    )
