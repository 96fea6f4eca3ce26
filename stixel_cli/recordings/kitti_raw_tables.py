"""Tables of KITTI's raw drives: packets of the GPS/IMU, and the labels of `tracklet_labels.xml`.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*, and `readTracklets`
of their devkit. A tracklet's boxes are in the frame of the velodyne (x ahead, y to the left, z up):
the centre of the bottom (m) and rz, the heading from x (rad).
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_xml
from stixel_cli.recordings.kitti_tables import (
    labels_in,
    named_numbers,
    numbers,
    read_calibration,
    seen_box,
)
from stixel_cli.recordings.oxts import packet_poses, rigid
from stixel_cli.recordings.types import Tracks
from stixel_cli.remembered import remembered

CAMERAS = ("P_rect_02", "P_rect_03")

OUTSIDE = 2, 3
"""States of truncation of a box that is not in the image; -1 and 99 are unknown."""

VALUES = ("tx", "ty", "tz", "rz", "occlusion", "truncation")


@remembered
def read_poses(imu: Path, velodyne: Path, cameras: Path, *packets: Path) -> np.ndarray:
    """Poses (n, 3, 4) of a drive, see `packet_poses`."""
    return packet_poses(_camera_from_velodyne(velodyne, cameras) @ _mounting(imu), *packets)


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
    return rigid(cameras, 3, "R_rect_00") @ _mounting(velodyne)


def _mounting(file: Path) -> np.ndarray:
    """The motion (4, 4) in the rows R and T of a calibration."""
    motion = rigid(file, 3, "R")
    motion[:3, 3] = named_numbers(file, 3, "T")
    return motion
