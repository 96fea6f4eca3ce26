"""Ego poses from packets of KITTI's GPS/IMU (oxts), of the tracking benchmark and of raw drives.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*, and their devkit's
`convertOxtsToPose`. A packet is a row of 30 numbers that begins with latitude and longitude
(degrees), altitude (m), roll, pitch and yaw (rad). Its frame is x ahead, y to the left, z up.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.recordings.kitti_tables import (
    checked_poses,
    named_numbers,
    numbers,
    read_labels,
    text_rows,
)
from stixel_cli.remembered import remembered

__all__ = ["read_labels", "read_poses"]

EARTH_RADIUS = 6378137.0
"""Of the devkit's Mercator projection, m."""

GREATEST_LATITUDE = 85.0
"""Degrees: the projection has no poles."""


@remembered
def read_poses(calibration: Path, packets: Path) -> np.ndarray:
    """Poses (n, 3, 4) of a clip of the tracking benchmark, see `packet_poses`."""
    rectified = rigid(calibration, 3, "R_rect", "R0_rect")
    camera = rectified @ rigid(calibration, 4, "Tr_velo_cam", "Tr_velo_to_cam")
    return packet_poses(camera @ rigid(calibration, 4, "Tr_imu_velo", "Tr_imu_to_velo"), packets)


def packet_poses(camera_from_imu: np.ndarray, *files: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the rectified camera 0 (x right, y down, z forward) in the first, m.

    The odometry benchmark's poses are of camera 0, too; the left colour camera is 6 cm beside it.

    Args:
        camera_from_imu: (4, 4), a motion from the frame of the GPS/IMU to that of camera 0.
        files: one with a packet in each row, or several of one packet, in their order.

    Raises:
        UserError: if a row is damaged, or the poses are not in order.
    """
    from scipy.spatial.transform import Rotation

    rows = [(file, row, words) for file in files for row, words in text_rows(file)]
    if not rows or len(files) not in (1, len(rows)):
        raise UserError(f"{files[0].parent}: must have one row of 30 numbers for each frame")
    packets = np.array([numbers(*row, 30)[:6] for row in rows])
    for (file, row, _), latitude in zip(rows, packets[:, 0], strict=True):
        if abs(latitude) > GREATEST_LATITUDE:
            raise UserError(f"{file}: row {row}: latitude must be within ±{GREATEST_LATITUDE:g}°")
    latitudes, longitudes = np.radians(packets[:, :2]).T
    scale = EARTH_RADIUS * np.cos(latitudes[0])
    imu = np.tile(np.eye(4), (len(rows), 1, 1))
    imu[:, :3, :3] = Rotation.from_euler("ZYX", packets[:, [5, 4, 3]]).as_matrix()
    north = np.log(np.tan(0.25 * np.pi + 0.5 * latitudes))
    imu[:, :3, 3] = np.stack([scale * longitudes, scale * north, packets[:, 2]], axis=1)
    poses = camera_from_imu @ np.linalg.inv(imu[0]) @ imu @ np.linalg.inv(camera_from_imu)
    return checked_poses(files[0], list(enumerate(poses[:, :3], 1)))


def rigid(file: Path, columns: int, *names: str) -> np.ndarray:
    """The motion (4, 4) in the first row with one of these names: (3, `columns`), row by row.

    Raises:
        UserError: if there is none, or it is not a rigid motion.
    """
    motion = np.eye(4)
    motion[:3, :columns] = np.reshape(named_numbers(file, 3 * columns, *names), (3, columns))
    if not np.allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-3):
        raise UserError(f"{file}: {names[0]} is not a rotation")
    return motion
