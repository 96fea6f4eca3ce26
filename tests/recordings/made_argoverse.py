"""A small look-alike of a log of Argoverse 2, made from one of KITTI tracking's clips."""

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stixel_cli.recordings.kitti_tables import read_labels, read_poses

TARGET = "022c398c-0000-4000-8000-000000000001"
START = 315966070549927216
STEP = 100_000_000
LEFT_IN_EGO = np.array([1.6, 0.25, 1.2])
AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from the clip's cameras (x right, y down, z forward) to the ego car."""

ANGLES = np.array([0.8, 0.6, 0.3])
MOUNTED = [Rotation.from_euler("yzx", one, degrees=True) for one in (ANGLES, -ANGLES)]
"""Rotations from the left and the right camera to those of the clip."""


def write_table(file: Path, rows: list[dict]) -> None:
    import pyarrow
    from pyarrow import feather

    file.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pyarrow.Table.from_pylist(rows), str(file), compression="zstd")


def pose_row(turn, place) -> dict:
    x, y, z, w = Rotation.from_matrix(turn).as_quat().tolist()
    tx, ty, tz = map(float, place)
    return {"qw": w, "qx": x, "qy": y, "qz": z, "tx_m": tx, "ty_m": ty, "tz_m": tz}


def make_log(clip: Path, folder: Path, baseline: float = 0.5, sequence: str = "0003") -> None:
    """Write the files of `clip`, in KITTI tracking's layout, in that of a log of Argoverse 2."""
    matrix = np.array([[150.0, 0.0, 78.0], [0.0, 150.0, 40.0], [0.0, 0.0, 1.0]])
    sensors, intrinsics = [], []
    for i, name in enumerate(("stereo_front_left", "stereo_front_right")):
        images = folder / "sensors/cameras" / name
        images.mkdir(parents=True)
        turn = MOUNTED[i].as_matrix()
        to_file = matrix @ turn.T @ np.linalg.inv(matrix)
        for file in sorted((clip / f"image_0{2 + i}" / sequence).iterdir()):
            image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
            image = cv2.warpPerspective(image, to_file, image.shape[::-1], flags=cv2.INTER_CUBIC)
            time = START + int(file.stem) * STEP + i
            cv2.imwrite(str(images / f"{time}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 100])
        place = LEFT_IN_EGO + AHEAD[:, 0] * baseline * i
        sensors.append({"sensor_name": name} | pose_row(AHEAD @ turn, place))
        sizes = {"height_px": image.shape[0], "width_px": image.shape[1]}
        values = {"fx_px": 150.0, "fy_px": 150.0, "cx_px": 78.0, "cy_px": 40.0, "k1": -0.2}
        intrinsics.append({"sensor_name": name} | values | sizes)
    others = {"sensor_name": "up_lidar"} | pose_row(np.eye(3), (1.35, 0.0, 1.64))
    write_table(folder / "calibration/egovehicle_SE3_sensor.feather", [others, *sensors])
    write_table(folder / "calibration/intrinsics.feather", intrinsics)
    write_table(folder / "city_SE3_egovehicle.feather", _city(clip, sequence))
    write_table(folder / "annotations.feather", annotations(clip, sequence=sequence))


CITY = Rotation.from_euler("z", 70.0, degrees=True).as_matrix()
ORIGIN = np.array([747.0, 1275.0, -24.0])


def _ego_in_city(pose) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and place of the ego car, of a pose (3, 4) of the clip's left camera."""
    turn = CITY @ AHEAD @ pose[:, :3] @ AHEAD.T
    return turn, CITY @ AHEAD @ pose[:, 3] + ORIGIN - turn @ LEFT_IN_EGO


def _lidar_pose(k: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the ego car half a step before image k: anywhere, because the label takes it off."""
    return Rotation.from_euler("zyx", [k, 0.02, 0.01]).as_matrix(), np.array([700.0, 1200.0, k])


def _city(clip: Path, sequence: str) -> list[dict]:
    poses = read_poses(clip / "ego_poses" / f"{sequence}.txt")
    rows = []
    for k, pose in enumerate(poses):
        row = pose_row(*_ego_in_city(pose))
        # Poses of both cameras, whose quaternions may have another sign.
        rows.append({"timestamp_ns": START + k * STEP} | row)
        signs = {name: -row[name] for name in ("qw", "qx", "qy", "qz")}
        rows.append({"timestamp_ns": START + k * STEP + 1} | row | signs)
    for k in range(len(poses) + 1):
        rows.append({"timestamp_ns": START + k * STEP - STEP // 2} | pose_row(*_lidar_pose(k)))
    return rows


def annotations(
    clip: Path,
    track: str = TARGET,
    category: str = "REGULAR_VEHICLE",
    share: float = 1.0,
    sequence: str = "0003",
) -> list[dict]:
    """Labels between the images: the clip's car drives straight on.

    With another `share` they are at that share of the way from the camera to the car.
    """
    poses = read_poses(clip / "ego_poses" / f"{sequence}.txt")
    (labels,) = read_labels(clip / "label_02" / f"{sequence}.txt").values()
    height, width, length = (labels.sizes[0] * min(abs(share), 1.0)).tolist()
    places, heads = [], []
    for pose, place, yaw in zip(poses, labels.places, labels.yaws, strict=True):
        of_way = place * (share, 1.0, share)
        places.append(CITY @ AHEAD @ (pose[:, :3] @ of_way + pose[:, 3]) + ORIGIN)
        heads.append(CITY @ AHEAD @ pose[:, :3] @ (np.cos(yaw), 0.0, -np.sin(yaw)))
    velocity = (places[-1] - places[0]) / (len(places) - 1)
    up = np.array([0.0, 0.0, 1.0])
    turn = np.stack([heads[0], np.cross(up, heads[0]), up], axis=1)
    rows = []
    for k in range(len(places) + 1):
        ego_turn, ego_place = _lidar_pose(k)
        centre = places[0] + (k - 0.5) * velocity + 0.5 * height * up
        label = pose_row(ego_turn.T @ turn, ego_turn.T @ (centre - ego_place))
        names = {"track_uuid": track, "category": category, "num_interior_pts": 30}
        sizes = {"length_m": length, "width_m": width, "height_m": height}
        rows.append({"timestamp_ns": START + k * STEP - STEP // 2} | names | sizes | label)
    return rows


def make_motion(folder: Path, mounted: bool, category: str = "BICYCLE") -> np.ndarray:
    """Write labels and ego poses of a log without images: the ego car turns, the target goes on.

    Returns the poses (2, 12, 3) of the camera and the target at the times of the labels, in the
    world of the first pose of the camera, which has a place in the ego car if it is `mounted`.
    """
    times = 1e-9 * STEP * np.arange(12)
    headings = 1.2 + 0.4 * times
    egos = ORIGIN[:2] + 10.0 * np.stack([np.sin(headings), -np.cos(headings)], axis=1)
    targets = egos[0] + np.array([2.0, 9.0]) + times[:, None] * (3.0, 1.0)
    course = np.arctan2(1.0, 3.0)
    turns = Rotation.from_euler("z", headings[:, None]).as_matrix()
    city, labels = [], []
    for k, (turn, ego, target) in enumerate(zip(turns, egos, targets, strict=True)):
        time, names = START + k * STEP, {"track_uuid": TARGET, "category": category}
        place = turn.T @ np.array([*(target - ego), 0.8])
        pose = pose_row(turn.T @ Rotation.from_euler("z", course).as_matrix(), place)
        sizes = {"num_interior_pts": 9, "length_m": 1.8, "width_m": 0.6, "height_m": 1.6}
        labels.append({"timestamp_ns": time} | names | sizes | pose)
        city.append({"timestamp_ns": time} | pose_row(turn, (*ego, ORIGIN[2])))
    write_table(folder / "annotations.feather", labels)
    write_table(folder / "city_SE3_egovehicle.feather", city)
    if mounted:
        right = LEFT_IN_EGO - [0.0, 0.5, 0.0]
        mounts = {"stereo_front_left": LEFT_IN_EGO, "stereo_front_right": right}
        rows = [{"sensor_name": name} | pose_row(AHEAD, at) for name, at in mounts.items()]
        write_table(folder / "calibration/egovehicle_SE3_sensor.feather", rows)
    cameras = egos + (turns[:, :2, :2] @ LEFT_IN_EGO[:2] if mounted else 0.0)
    to_world = Rotation.from_euler("z", np.pi / 2.0 - headings[0]).as_matrix()[:2, :2]
    bearings = np.pi / 2.0 - headings[0] + np.stack([headings, np.full(12, course)])
    places = np.stack([cameras, targets]) - cameras[0]
    return np.concatenate([places @ to_world.T, bearings[:, :, None]], axis=2)
