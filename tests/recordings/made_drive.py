"""The oxts and the raw drive that a clip of KITTI tracking would come from."""

import shutil
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stixel_cli.recordings.kitti_tables import read_labels, read_poses

NAMES = ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
EARTH = 6378137.0
AHEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from x ahead, y to the left, z up to x right, y down, z forward."""


def motion(turn, place=(0.0, 0.0, 0.0)) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turn, place
    return made


def euler(*degrees) -> np.ndarray:
    return Rotation.from_euler("ZYX", degrees, degrees=True).as_matrix()


RECTIFIED = motion(euler(0.5, -0.4, 0.3))
CAMERA = motion(AHEAD @ euler(0.6, 0.8, -0.4), (0.0, -0.08, -0.27))
IMU = motion(euler(-0.3, 0.1, 0.8), (-0.81, 0.32, -0.8))
MOUNTING = dict(zip(NAMES, (RECTIFIED, CAMERA, IMU), strict=True))
VELODYNE = RECTIFIED @ CAMERA
"""From the velodyne's frame to that of the rectified camera 0."""


def text_of(values) -> str:
    return " ".join(f"{value:.12e}" for value in np.ravel(values))


def packets(poses: np.ndarray, latitude=49.01, longitude=8.43) -> list[str]:
    """Rows of the GPS/IMU for poses (n, 3, 4) of camera 0, from a place and a heading of choice."""
    whole = VELODYNE @ IMU
    rows, scale = [], EARTH * np.cos(np.radians(latitude))
    start = motion(euler(130.0, 1.0, -2.0), (0.0, 0.0, 112.0))
    for pose in poses:
        at = start @ np.linalg.inv(whole) @ np.vstack([pose, [0, 0, 0, 1]]) @ whole
        yaw, pitch, roll = Rotation.from_matrix(at[:3, :3]).as_euler("ZYX")
        north = np.arctanh(np.sin(np.radians(latitude))) + at[1, 3] / scale
        place = np.degrees([2.0 * np.arctan(np.exp(north)) - 0.5 * np.pi, at[0, 3] / scale])
        values = [place[0], place[1] + longitude, at[2, 3], roll, pitch, yaw]
        rows.append(" ".join(f"{value:.13f}" for value in [*values, *[0.0] * 19]) + " 4 10 4 4 0")
    # The scale is that of the first packet's latitude.
    first = float(rows[0].split()[0])
    return rows if abs(first - latitude) < 1e-9 else packets(poses, first, longitude)


def make_official(clip: Path, sequence: str = "0003") -> None:
    """Let the `clip` have the files of the benchmark: oxts and not ego_poses."""
    poses = read_poses(clip / "ego_poses" / f"{sequence}.txt")
    (clip / "oxts").mkdir()
    (clip / "oxts" / f"{sequence}.txt").write_text("\n".join(packets(poses)))
    shutil.rmtree(clip / "ego_poses")
    calibration = clip / "calib" / f"{sequence}.txt"
    rows = [line for line in calibration.read_text().splitlines() if line.startswith("P")]
    for name, values in MOUNTING.items():
        rows.append(f"{name} {text_of(values[:3, : 3 if name == 'R_rect' else 4])}")
    calibration.write_text("\n".join(rows))


def make_drive(clip: Path, folder: Path, sequence: str = "0003", kind: str = "Car") -> Path:
    """Write the `clip` as a raw drive below a day's `folder`; return the drive."""
    drive = folder / "2011_09_26_drive_0001_sync"
    for camera in ("image_02", "image_03"):
        (drive / camera / "data").mkdir(parents=True)
        for file in (clip / camera / sequence).iterdir():
            shutil.copy(file, drive / camera / "data" / f"0000{file.name}")
    (drive / "oxts/data").mkdir(parents=True)
    for k, row in enumerate(packets(read_poses(clip / "ego_poses" / f"{sequence}.txt"))):
        (drive / "oxts/data" / f"{k:010d}.txt").write_text(row + "\n")
    rows = (clip / "calib" / f"{sequence}.txt").read_text().splitlines()
    matrices = [f"P_rect_0{row[1]}: {row.partition(' ')[2]}" for row in rows if row[0] == "P"]
    turn = f"R_rect_00: {text_of(RECTIFIED[:3, :3])}"
    sizes = "S_rect_02: 1.600000e+02 9.600000e+01"
    head = "calib_time: 09-Jan-2012 13:57:47\n"
    (folder / "calib_cam_to_cam.txt").write_text(head + "\n".join([*matrices, turn, sizes]))
    for name, values in (("velo_to_cam", CAMERA), ("imu_to_velo", IMU)):
        text = f"{head}R: {text_of(values[:3, :3])}\nT: {text_of(values[:3, 3])}\n"
        (folder / f"calib_{name}.txt").write_text(text)
    (drive / "tracklet_labels.xml").write_text(tracklets(clip, sequence, kind))
    return drive


def tracklets(clip: Path, sequence: str, kind: str) -> str:
    """The labels of target 0 in XML as of the devkit."""
    labels = read_labels(clip / "label_02" / f"{sequence}.txt")[0]
    height, width, length = labels.sizes[0]
    poses = []
    for place, yaw in zip(labels.places, labels.yaws, strict=True):
        x, y, z = (np.linalg.inv(VELODYNE) @ [*place, 1.0])[:3]
        ahead = VELODYNE[:3, :3].T @ [np.cos(yaw), 0.0, -np.sin(yaw)]
        rz = np.arctan2(ahead[1], ahead[0])
        values = {"tx": x, "ty": y, "tz": z, "rx": 0, "ry": 0, "rz": rz, "state": 2}
        values |= {"occlusion": 0, "occlusion_kf": 0, "truncation": 0, "amt_occlusion": -1}
        inner = "".join(f"<{name}>{value!r}</{name}>\n" for name, value in values.items())
        poses.append(f"<item>\n{inner.replace('np.float64(', '').replace(')', '')}</item>\n")
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        '<boost_serialization signature="serialization::archive" version="9">\n'
        '<tracklets class_id="0" tracking_level="0" version="0">\n<count>1</count>\n'
        '<item_version>1</item_version>\n<item class_id="1" tracking_level="0" version="1">\n'
        f"<objectType>{kind}</objectType>\n<h>{height}</h>\n<w>{width}</w>\n<l>{length}</l>\n"
        f"<first_frame>{labels.frames[0]}</first_frame>\n<poses class_id='2' version='0'>\n"
        f"<count>{len(poses)}</count>\n<item_version>2</item_version>\n{''.join(poses)}</poses>\n"
        "<finished>1</finished>\n</item>\n</tracklets>\n</boost_serialization>\n"
    )
