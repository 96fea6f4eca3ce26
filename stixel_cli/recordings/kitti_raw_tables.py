"""Tables of KITTI's sensors: packets of the GPS/IMU (oxts), and labels of the velodyne's tracklets.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*, and the functions
`convertOxtsToPose` and `readTracklets` of their devkit. Packets are of the tracking benchmark or of
raw drives: rows of 30 numbers that begin with latitude and longitude (degrees), altitude (m), roll,
pitch and yaw (rad). Tracklets are those of raw drives, `tracklet_labels.xml`: the centre of a box's
bottom (m) and rz, the heading from x (rad). Both frames have x ahead, y to the left, z up.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_xml
from stixel_cli.recordings.kitti_tables import (
    checked_poses,
    labels_in,
    named_numbers,
    numbers,
    read_calibration,
    seen_box,
    text_rows,
)
from stixel_cli.recordings.types import Tracks
from stixel_cli.remembered import remembered

EARTH_RADIUS = 6378137.0
"""Of the devkit's Mercator projection, m."""

GREATEST_LATITUDE = 85.0
"""Degrees: the projection has no poles."""

CAMERAS = ("P_rect_02", "P_rect_03")

OUTSIDE = 2, 3
"""States of truncation of a box that is not in the image; -1 and 99 are unknown."""

VALUES = ("tx", "ty", "tz", "rz", "occlusion", "truncation")


@remembered
def read_poses(mounting: Path, velodyne: Path, cameras: Path, *packets: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the rectified camera 0 (x right, y down, z forward) in the first, m.

    The odometry benchmark's poses are of camera 0, too; the left colour camera is 6 cm beside it.

    Args:
        mounting, velodyne, cameras: the calibrations of the GPS/IMU, the velodyne and the cameras:
            three files of a drive, or three times the one of a clip of the tracking benchmark.
        packets: one file with a packet in each row, or several of one packet, in their order.

    Raises:
        UserError: if a row is damaged, or the poses are not in order.
    """
    from scipy.spatial.transform import Rotation

    rows = [(file, row, words) for file in packets for row, words in text_rows(file)]
    if not rows or len(packets) not in (1, len(rows)):
        raise UserError(f"{packets[0].parent}: must have one row of 30 numbers for each frame")
    values = np.array([numbers(*row, 30)[:6] for row in rows])
    for (file, row, _), latitude in zip(rows, values[:, 0], strict=True):
        if abs(latitude) > GREATEST_LATITUDE:
            raise UserError(f"{file}: row {row}: latitude must be within ±{GREATEST_LATITUDE:g}°")
    latitudes, longitudes = np.radians(values[:, :2]).T
    scale = EARTH_RADIUS * np.cos(latitudes[0])
    imu = np.tile(np.eye(4), (len(rows), 1, 1))
    imu[:, :3, :3] = Rotation.from_euler("ZYX", values[:, [5, 4, 3]]).as_matrix()
    north = np.log(np.tan(0.25 * np.pi + 0.5 * latitudes))
    imu[:, :3, 3] = np.stack([scale * longitudes, scale * north, values[:, 2]], axis=1)
    velodyne_from_imu = _mounting(mounting, "Tr_imu_velo", "Tr_imu_to_velo")
    camera_from_imu = _camera_from_velodyne(velodyne, cameras) @ velodyne_from_imu
    poses = camera_from_imu @ np.linalg.inv(imu[0]) @ imu @ np.linalg.inv(camera_from_imu)
    return checked_poses(packets[0], list(enumerate(poses[:, :3], 1)))


@remembered
def read_labels(tracklets: Path, velodyne: Path, cameras: Path) -> Tracks:
    """The labels of each target by the number of its tracklet, from 0, in the frame of camera 0.

    Frames in which its box is not in the image are left out. Their boxes in the image are those of
    the box's corners.

    Raises:
        UserError: if a value is missing or not a number, or a calibration is damaged.
    """
    calibration = read_calibration(cameras, CAMERAS)
    size = tuple(map(int, named_numbers(cameras, 2, "S_rect_02")))
    camera = _camera_from_velodyne(velodyne, cameras)
    tracks: Tracks = {}
    for track, tracklet in enumerate(read_xml(tracklets).findall("./tracklets/item")):
        place = f"{tracklets}: tracklet {track}"
        words = [tracklet.findtext(name, "") for name in ("h", "w", "l", "first_frame")]
        *box_size, first = numbers(place, 1, words)
        if min(box_size) <= 0.0 or first < 0.0:
            raise UserError(f"{place}: h, w and l must be > 0 and first_frame >= 0")
        rows = []
        for i, pose in enumerate(tracklet.findall("./poses/item")):
            values = numbers(place, i + 1, [pose.findtext(name, "") for name in VALUES])
            *centre, heading, occluded, truncated = values
            x, y, z = camera[:3, :3] @ centre + camera[:3, 3]
            ahead = camera[:3, :3] @ [np.cos(heading), np.sin(heading), 0.0]
            # KITTI's rotation_y is that of the heading in the camera's frame.
            yaw = float(np.arctan2(-ahead[2], ahead[0]))
            seen = seen_box(
                np.array([x, y, z]) - calibration.left_camera, yaw, box_size, calibration, size
            )
            if truncated not in OUTSIDE and seen is not None:
                flags = [truncated, occluded % 4.0, 0.0]
                rows.append([first + i, track, *flags, *seen[0], *box_size, x, y, z, yaw])
        if rows:
            kind = tracklet.findtext("objectType", "")
            # As in the other benchmarks.
            kind = "Person_sitting" if kind == "Person (sitting)" else printable(kind)
            tracks[track] = labels_in(np.array(rows), kind)
    return tracks


def _camera_from_velodyne(velodyne: Path, cameras: Path) -> np.ndarray:
    """The motion (4, 4) from the velodyne's frame to that of the rectified camera 0."""
    rectified = _rigid(cameras, 3, "R_rect_00", "R_rect", "R0_rect")
    return rectified @ _mounting(velodyne, "Tr_velo_cam", "Tr_velo_to_cam")


def _mounting(file: Path, *names: str) -> np.ndarray:
    """The motion (4, 4) in the row with one of these names, or in the rows R and T."""
    if not any(words[0].removesuffix(":") == "R" for _, words in text_rows(file)):
        return _rigid(file, 4, *names, "R and T")
    motion = _rigid(file, 3, "R")
    motion[:3, 3] = named_numbers(file, 3, "T")
    return motion


def _rigid(file: Path, columns: int, *names: str) -> np.ndarray:
    """The motion (4, 4) in the first row with one of these names: (3, `columns`), row by row.

    Raises:
        UserError: if there is none, or it is not a rigid motion.
    """
    motion = np.eye(4)
    motion[:3, :columns] = np.reshape(named_numbers(file, 3 * columns, *names), (3, columns))
    if not np.allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-3):
        raise UserError(f"{file}: {names[0]} is not a rotation")
    return motion
