"""Bags of ROS 1 and ROS 2, made from one of KITTI tracking's clips."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stixel_cli.recordings.kitti_tables import read_poses

START, STEP = 1_700_000_000_123_456_789, 100_000_000
SIDES = ("left", "right")
IMAGE, INFO = "/stereo/{}/image_rect", "/stereo/{}/camera_info"
ODOMETRY, STATIC = "/odom", "/tf_static"

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from a camera (x right, y down, z forward) to a frame with x ahead and z up."""

RECTIFYING = Rotation.from_euler("yx", [1.0, -0.5], degrees=True).as_matrix()


def _pose(turn, place) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, place
    return pose


HEAD = _pose(Rotation.from_euler("z", 4.0, degrees=True).as_matrix(), (1.5, 0.2, 1.3))
CAMERA = _pose(OPTICAL @ RECTIFYING, (0.02, 0.06, 0.0))
IN_ODOMETRY = _pose(Rotation.from_euler("z", 130.0, degrees=True).as_matrix(), (40.0, -7.0, 2.0))


def _values(pose, turn: str, place: str) -> dict:
    words = dict(zip("xyzw", Rotation.from_matrix(pose[:3, :3]).as_quat().tolist(), strict=True))
    return {turn: words, place: dict(zip("xyz", pose[:3, 3].tolist(), strict=True))}


def header(time: int, frame: str) -> dict:
    return {"stamp": {"sec": time // 10**9, "nanosec": time % 10**9}, "frame_id": frame}


def messages(clip: Path, encoding: str, sequence: str = "0003") -> list[tuple[str, int, str, dict]]:
    """Topic, time of recording, type and fields of each message.

    The odometry has no pose at the first pair.
    """
    found = []
    for i, side in enumerate(SIDES):
        for file in sorted((clip / f"image_0{2 + i}" / sequence).iterdir()):
            k, grey = int(file.stem), cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
            time = START + k * STEP + i * 1000
            # They arrive later than the next pair of the other camera, now and then.
            arrival = time + (20_000_000, 140_000_000)[(k + i) % 2]
            topic, fields = IMAGE.format(side), {"header": header(time, f"{side}_optical")}
            kind = "sensor_msgs/msg/Image"
            if encoding == "png":
                topic, kind = f"{topic}/compressed", "sensor_msgs/msg/CompressedImage"
                data = np.frombuffer(file.read_bytes(), np.uint8)
                fields |= {"format": "mono8; png compressed", "data": data}
            else:
                channels = {"bgr8": 3, "rgba8": 4, "16UC3": 3}.get(encoding, 1)
                rows = np.repeat(grey, channels, axis=1)
                if "16" in encoding:
                    rows = (257 * rows.astype("<u2")).view(np.uint8)
                elif encoding == "32FC1":
                    rows = (rows / 255.0).astype("<f4").view(np.uint8)
                padded = np.pad(rows, ((0, 0), (0, 5)))
                height, width = grey.shape
                fields |= {"height": height, "width": width, "encoding": encoding}
                fields |= {"step": padded.shape[1], "data": padded.ravel()}
            found.append((topic, arrival, kind, fields))
        matrix = np.array([[150.0, 0, 78, -75.0 * i], [0, 150, 40, 0], [0, 0, 1, 0]])
        info = {"header": header(START, f"{side}_optical"), "height": 96, "width": 160}
        info |= {"distortion_model": "plumb_bob", "d": np.array([-0.2, 0.1, 0, 0, 0])}
        info |= {"k": matrix[:, :3].ravel(), "r": RECTIFYING.ravel(), "p": matrix.ravel()}
        found.append((INFO.format(side), START, "sensor_msgs/msg/CameraInfo", info))
    above = [("left_optical", "head", CAMERA), ("head", "/base_link", HEAD)]
    for name, parent, pose in (*above, ("lidar", "base_link", np.eye(4))):
        step = {"header": header(START, parent), "child_frame_id": name}
        step["transform"] = _values(pose, "rotation", "translation")
        found.append((STATIC, START, "tf2_msgs/msg/TFMessage", {"transforms": [step]}))
    to_base = np.linalg.inv(HEAD @ CAMERA @ _pose(RECTIFYING.T, (0, 0, 0)))
    for k, camera in enumerate(read_poses(clip / "ego_poses" / f"{sequence}.txt")[1:], start=1):
        pose = IN_ODOMETRY @ _pose(camera[:, :3], camera[:, 3]) @ to_base
        for late in (0, 1):
            fields = {"header": header(START + k * STEP + late, "odom")}
            fields |= {"child_frame_id": "base_link"}
            fields["pose"] = {"pose": _values(pose, "orientation", "position")}
            found.append((ODOMETRY, START + k * STEP + late, "nav_msgs/msg/Odometry", fields))
    return sorted(found, key=lambda one: one[1])


def write_bag(path: Path, content: list[tuple[str, int, str, dict]], plugin: str = "mcap") -> Path:
    """Write messages as a bag of ROS 1 if `path` ends with .bag, else as a folder of ROS 2."""
    from rosbags import rosbag1, rosbag2

    first = path.suffix == ".bag"
    store = _types(first)
    storage = rosbag2.StoragePlugin[plugin.upper()]
    options = {} if first else {"version": 9, "storage_plugin": storage}
    with (rosbag1 if first else rosbag2).Writer(path, **options) as bag:
        connections = {}
        for topic, time, kind, fields in content:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=store)
            pack = store.serialize_ros1 if first else store.serialize_cdr
            bag.write(connections[topic], time, pack(_message(store, kind, fields), kind))
    return path


@cache
def _types(first: bool):
    """The types of messages of ROS 1 or 2, of which each is a class that is made anew."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    if first:
        text = "geometry_msgs/TransformStamped[] transforms"
        store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return store


def _message(store, kind: str, fields: dict):
    """A message with these fields, and zeros for the others."""
    from rosbags.interfaces import Nodetype

    values = {}
    for name, (node, what) in store.fielddefs[kind][1]:
        given = fields.get(name, fields.get(name.lower()))
        if node == Nodetype.NAME:
            values[name] = _message(store, what, given or {})
        elif node == Nodetype.SEQUENCE and what[0][0] == Nodetype.NAME:
            values[name] = [_message(store, what[0][1], one) for one in given]
        elif given is None:
            zero = "" if what[0] == "string" else 0
            values[name] = np.zeros(what[1]) if node == Nodetype.ARRAY else zero
        else:
            values[name] = given
    return store.types[kind](**values)
