"""A bag of ROS 1 (.bag) or ROS 2 (.mcap, .db3, or a folder with metadata.yaml).

It has the rectified images of two cameras, each with its `CameraInfo` in the topic `camera_info`
beside it, and optionally the odometry of the ego car. Frames are the pairs by the time in their
headers, numbered from 0; with odometry, those in its time.
"""

from pathlib import Path, PurePath

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import GREATEST_RECORDING, opened, read_yaml
from stixel_cli.recordings import bag_messages
from stixel_cli.recordings.assembly import common_frames
from stixel_cli.recordings.bag_messages import read_camera, read_messages, stamp
from stixel_cli.recordings.kitti_tables import rectified_pair
from stixel_cli.recordings.parameters import Rosbag, chosen_frames
from stixel_cli.recordings.times import PAIRED, check_steps, nearest
from stixel_cli.recordings.types import Recording, Tables

METADATA = "metadata.yaml"


def is_bag(file: Path) -> bool:
    """Whether this is a bag in one file."""
    return file.suffix in (".bag", ".mcap", ".db3") and file.is_file()


def find_recording(source: Rosbag) -> Recording:
    """The recording in a bag."""
    bag, odometry = source.folder, source.odometry_topic
    files, topics = _files(Path(bag)), (source.left_topic, source.right_topic)
    # Compressed images have the CameraInfo of the others.
    names = [topic.removesuffix("/compressed").rpartition("/") for topic in topics]
    cameras = [f"{folder}/camera_info" for folder, _, _ in names]
    infos = [read_camera(files, camera) for camera in cameras]
    for (_, _, name), topic, info in zip(names, topics, infos, strict=True):
        # A rectified image has the CameraInfo of the one from which it is made: its name tells.
        if "rect" not in name and (np.any(info["d"]) or np.any(info["r"] != np.eye(3).ravel())):
            raise UserError(f"{bag}: {topic}: must be rectified: its camera_info has a D or R")
    size = infos[0]["width"], infos[0]["height"]
    times: dict[str, dict[int, int]] = {topic: {} for topic in topics}
    for topic, time, message in read_messages(files, bag_messages.IMAGES, *topics):
        found = bag_messages.image_size(f"{bag}: {topic}", message)
        if found != size:
            raise UserError(f"{bag}: {topic}: an image of {found} px, but camera_info has {size}")
        times[topic][stamp(message)] = time
    if any(len({*found.values()}) < len(found) for found in times.values()):
        raise UserError(f"{bag}: two images of a topic were recorded at one time")
    left, right = times.values()
    others = sorted(right)
    pairs = [(time, nearest(others, time)) for time in sorted(left) if others]
    pairs = [pair for pair in pairs if abs(pair[1] - pair[0]) <= PAIRED]
    if odometry is not None:
        known = [stamp(one) for *_, one in read_messages(files, bag_messages.ODOMETRY, odometry)]
        pairs = [pair for pair in pairs if min(known) <= pair[0] <= max(known)]
    if not pairs:
        raise UserError(f"{bag}: no pair of images at one time (of the odometry, too)")
    frames = common_frames(chosen_frames(source.frames), range(len(pairs)), {})
    at = [(left[pairs[k][0]], right[pairs[k][1]]) for k in frames]
    stamps = tuple(time for time, _ in pairs)
    recording = Recording(
        layout=source.kind,
        frames=frames,
        tables=Tables("rosbag", stamps, frames.start, topics=(odometry or "", cameras[0])),
        calibration=rectified_pair(bag, cameras, [np.reshape(one["p"], (3, 4)) for one in infos]),
        left=files,
        width=size[0],
        height=size[1],
        pose_files=files if odometry else (),
        auto=source.target == "auto",
        messages=tuple(zip(topics, zip(*at, strict=True), strict=True)),
    )
    check_steps(recording, source.sample_time, bag, "source")
    if odometry is not None:
        bag_messages.read_poses(stamps, recording.tables.topics, *files)
    return recording


def _files(bag: Path) -> tuple[Path, ...]:
    """The file, or `METADATA` and the files beside it that it names."""
    files = [bag]
    if bag.is_dir():
        files = [bag / METADATA]
        try:
            names = read_yaml(files[0])["rosbag2_bagfile_information"]["relative_file_paths"]
            files += [bag / PurePath(name).name for name in names]
        except (KeyError, TypeError):
            raise UserError(f"{files[0]}: not the metadata of a ROS 2 bag") from None
    for file in files:
        with opened(file, GREATEST_RECORDING):
            pass
    return tuple(files)
