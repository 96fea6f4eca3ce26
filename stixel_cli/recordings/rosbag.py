"""A bag of ROS 1 (.bag) or ROS 2 (.mcap, .db3, or a folder with metadata.yaml).

It has the rectified images of two cameras, each with its `CameraInfo` in the topic `camera_info`
beside it, and optionally the odometry of the ego car. Frames are the pairs by the time in their
headers, numbered from 0; with odometry, those in its time.

The types of the messages are those that rosbags knows. The definitions in a bag are not used:
rosbags would make Python code of them. A camera's frame has x right, y down, z forward (REP 103).
"""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from io import BytesIO
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from stixel_cli.border.files import GREATEST_RECORDING, opened, read_yaml, remembered
from stixel_cli.errors import UserError, located, printable
from stixel_cli.recordings.image_files import GREATEST_IMAGE, check_sides, decoded, size_in
from stixel_cli.recordings.kitti_tables import rectified_pair
from stixel_cli.recordings.parameters import Rosbag
from stixel_cli.recordings.times import (
    check_steps,
    common_frames,
    pairs_by_time,
    poses_at,
    unit_rotations,
)
from stixel_cli.recordings.types import Recording, Tables

METADATA, SUFFIXES = "metadata.yaml", (".bag", ".mcap", ".db3")
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA, ODOMETRY = ("sensor_msgs/msg/CameraInfo",), ("nav_msgs/msg/Odometry",)
TRANSFORMS = ("tf2_msgs/msg/TFMessage",)

_ENCODING = re.compile(r"(mono|bgra?|rgba?)(8|16)|(8U|16U|32F)C([134])")
"""Of a raw image: channels and bits, or bits and number of channels, which are OpenCV's."""

MOST_MESSAGES = 1_000_000


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
    for topic, time, message in read_messages(files, IMAGES, *topics):
        found = image_size(f"{bag}: {topic}", message)
        if found != size:
            raise UserError(f"{bag}: {topic}: an image of {found} px, but camera_info has {size}")
        times[topic][stamp(message)] = time
    if any(len({*found.values()}) < len(found) for found in times.values()):
        raise UserError(f"{bag}: two images of a topic were recorded at one time")
    left, right = times.values()
    pairs = list(pairs_by_time(sorted(left), sorted(right)).items())
    if odometry is not None:
        known = [stamp(one) for *_, one in read_messages(files, ODOMETRY, odometry)]
        pairs = [pair for pair in pairs if min(known) <= pair[0] <= max(known)]
    if not pairs:
        raise UserError(f"{bag}: no pair of images at one time (of the odometry, too)")
    frames = common_frames(source.frames, range(len(pairs)), {})
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
        read_poses(stamps, recording.tables.topics, *files)
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


def bag_of(files: Sequence[Path]) -> Path:
    """The bag with these files: of ROS 2 it may be a folder."""
    return files[0].parent if len(files) > 1 else files[0]


def read_messages(
    files: tuple[Path, ...], types: tuple[str, ...], *topics: str, span: tuple[int, ...] = ()
) -> Iterator[tuple[str, int, Any]]:
    """Topic, time of recording in ns, and content of messages; with `span`, of those times.

    UserError if the files are not a bag or damaged, one of the `topics` is missing or of other
    `types`, there is no message, or one is too large.
    """
    with located("source=rosbag needs rosbags: pip install 'stixel[rosbag]'", caught=ImportError):
        from rosbags import rosbag1, rosbag2
    name, number, first = f"{bag_of(files)}: {', '.join(topics)}", 0, files[0].suffix == ".bag"
    try:
        with (rosbag1 if first else rosbag2).Reader(bag_of(files)) as bag:
            chosen = [one for one in bag.connections if one.msgtype in types]
            known = sorted({one.topic for one in chosen})
            if not {*topics} <= {*known}:
                has = ", ".join(map(printable, known[:12])) or "none"
                raise UserError(f"{name}: no such topic of {' or '.join(types)}; it has {has}")
            chosen = [one for one in chosen if one.topic in topics]
            for connection, time, data in bag.messages(chosen, *span):
                number += 1
                if number > MOST_MESSAGES or len(data) > GREATEST_IMAGE:
                    raise UserError(f"{name}: too many messages, or one of {len(data)} bytes")
                yield connection.topic, int(time), _parser(first)(data, connection.msgtype)
    except UserError:
        raise
    except Exception as fault:
        # rosbags, SQLite, struct, lz4 and zstd have no common class of errors.
        reason = printable(f"{type(fault).__name__}: {fault}", 150)
        raise UserError(f"{name}: damaged, or not a bag of ROS: {reason}") from None
    if not number:
        raise UserError(f"{name}: has no message")


@cache
def _parser(first: bool) -> Callable[[bytes, str], Any]:
    """The function that parses a message of ROS 1 or 2 of a type. It takes a while to make."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if not first:
        return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    store = get_typestore(Stores.ROS1_NOETIC)
    # rosbags leaves it out.
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", *TRANSFORMS))
    return store.deserialize_ros1


def stamp(message: Any) -> int:
    """The time in a message's header, ns."""
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def read_camera(files: tuple[Path, ...], topic: str) -> dict[str, Any]:
    """The fields of the first `CameraInfo` of a topic, by their names in ROS 2."""
    _, _, message = next(read_messages(files, CAMERA, topic))
    return {name.lower(): value for name, value in vars(message).items()}


def image_size(name: str, message: Any) -> tuple[int, int]:
    """Width and height in px of an image; UserError, with the `name`, if its head is not valid."""
    if hasattr(message, "format"):
        return size_in(name, BytesIO(message.data.tobytes()))
    check_sides(name, message.width, message.height)
    kind, channels = _layout(name, message)
    least = message.width * len(channels) * kind.itemsize
    if message.step < least or len(message.data) != message.step * message.height:
        raise UserError(f"{name}: a damaged image: {len(message.data)} bytes")
    return message.width, message.height


def _layout(name: str, message: Any) -> tuple[np.dtype, str]:
    """The type of a raw image's values, and its channels in their order."""
    found = _ENCODING.fullmatch(message.encoding)
    if found is None:
        known = "mono, bgr, rgb, bgra, rgba (8 or 16 bits) or 8UC, 16UC, 32FC (1, 3 or 4 channels)"
        raise UserError(f"{name}: encoding {printable(message.encoding)}: must be {known}")
    named, bits, kind, count = found.groups()
    kind = {"8": "u1", "8U": "u1", "16": "u2", "16U": "u2", "32F": "f4"}[bits or kind]
    channels = "y" if named == "mono" or count == "1" else named or "bgra"[: int(count)]
    return np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<"), channels


def read_images(files: tuple[Path, ...], topic: str, times: tuple[int, ...]) -> list[np.ndarray]:
    """The images, grey (H, W) or BGR (H, W, 3), that were recorded at `times`, ns.

    They are uint8, uint16 or float32.
    """
    span = min(times), max(times) + 1
    found = {time: one for _, time, one in read_messages(files, IMAGES, topic, span=span)}
    return [_image(f"{bag_of(files)}: {topic}", found[time]) for time in times]


def _image(name: str, message: Any) -> np.ndarray:
    width, height = image_size(name, message)
    if hasattr(message, "format"):
        return decoded(name, message.data.tobytes())
    kind, channels = _layout(name, message)
    rows = message.data.reshape(height, message.step)
    pixels = rows[:, : width * len(channels) * kind.itemsize].copy().view(kind)
    order = 0 if channels == "y" else [channels.index(one) for one in "bgr"]
    image = pixels.reshape(height, width, -1)[..., order]
    return np.ascontiguousarray(image, kind.newbyteorder("="))


@remembered
def read_poses(times: tuple[int, ...], topics: tuple[str, str], *files: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the rectified left camera in the frame of the odometry, m.

    They are at the `times` (n,) of the left images, ns; the `topics` are those of the odometry and
    of the left camera's `CameraInfo`. Where the camera is on the car, `/tf_static` says.
    """
    odometry, camera = topics
    found = [message for *_, message in read_messages(files, ODOMETRY, odometry)]
    poses = np.array([_numbers(one.pose.pose.orientation, one.pose.pose.position) for one in found])
    stamps = np.array([stamp(one) for one in found])
    name = f"{bag_of(files)}: {odometry}"
    turns, places = poses_at(name, np.array(times), stamps, poses[:, :4], poses[:, 4:])
    info = read_camera(files, camera)
    mounting = _mounting(files, found[0].child_frame_id, info["header"].frame_id)
    # R turns from the camera to the rectified camera.
    aligned = turns @ mounting[:3, :3] @ np.reshape(info["r"], (3, 3)).T
    poses = np.concatenate([aligned, (turns @ mounting[:3, 3] + places)[:, :, None]], axis=2)
    if not (np.abs(poses) < 1e9).all():
        raise UserError(f"{name}, {camera} or /tf_static: a number is not below 1e9")
    return poses


def _numbers(quaternion: Any, place: Any) -> list[float]:
    turn = [quaternion.w, quaternion.x, quaternion.y, quaternion.z]
    return [*turn, place.x, place.y, place.z]


def _mounting(files: tuple[Path, ...], base: str, camera: str) -> np.ndarray:
    """The pose (4, 4) of the frame `camera` in the frame `base`."""
    # ROS 1 has names with a slash before them, too.
    base, frame = base.lstrip("/"), camera.lstrip("/")
    name, pose, steps = f"{bag_of(files)}: /tf_static", np.eye(4), {}
    for *_, message in () if base == frame else read_messages(files, TRANSFORMS, "/tf_static"):
        for one in message.transforms:
            numbers = np.array(_numbers(one.transform.rotation, one.transform.translation))
            step = np.eye(4)
            step[:3, :3] = unit_rotations(name, numbers[None, :4])[0]
            step[:3, 3] = numbers[4:]
            steps[one.child_frame_id.lstrip("/")] = one.header.frame_id.lstrip("/"), step
    while frame != base:
        if frame not in steps:
            frames = f"from {printable(base)}, the frame of the odometry, to {printable(camera)}"
            raise UserError(f"{name} has no transforms {frames}")
        # Taken out, so that a loop ends.
        frame, step = steps.pop(frame)
        pose = step @ pose
    return pose
