"""Ego poses and labels of a recording in any layout."""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_ego
from stixel_cli.recordings import argoverse, kitti_tables, rosbag, virtual_kitti_tables
from stixel_cli.recordings.types import Labels, Tables, Tracks
from stixel_cli.scene.scenario import EgoMotion

READERS = {
    "kitti": (kitti_tables.read_poses, kitti_tables.read_labels),
    "kitti_oxts": (kitti_tables.read_packets, kitti_tables.read_labels),
    "kitti_raw": (kitti_tables.read_packets, kitti_tables.read_tracklets),
    "virtual_kitti": (virtual_kitti_tables.read_poses, virtual_kitti_tables.read_labels),
    "argoverse": (argoverse.read_poses, argoverse.read_labels),
    "rosbag": (rosbag.read_poses, None),
}
"""The functions that read the ego poses and the labels of each kind of tables."""


def read_poses(files: tuple[Path, ...], tables: Tables) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in any one frame, m."""
    return READERS[tables.kind][0](*filter(None, [tables.times, tables.topics]), *files)


def read_labels(files: tuple[Path, ...], tables: Tables) -> Tracks:
    """The labels of each target by its track id."""
    return READERS[tables.kind][1](*filter(None, [tables.times]), *files)


def labels_of(
    files: tuple[Path, ...], tables: Tables, target: int | str, key: str = "source.target"
) -> Labels:
    """The labels of one target; `key` is the setting that names it.

    UserError if the files have no such track; the line lists tracks that they have.
    """
    tracks = read_labels(files, tables)
    if target not in tracks:
        shown = [f"{i} ({labels.kind})" for i, labels in list(tracks.items())[:12]]
        known = ", ".join(shown) or "none"
        more = ", …" if len(tracks) > 12 else ""
        raise UserError(f"{key}: {files[0]} has no track {target}; it has {known}{more}")
    return tracks[target]


def poses_of_labels(
    ego_motion: EgoMotion, labels: Labels, level_from_camera: np.ndarray, tables: Tables
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (n,) of the labels in the motion's frames, these frames (n,), from 0, and their poses
    (n, 3) in the world, whose headings have no jump."""
    frames = labels.frames - tables.first
    rows = np.flatnonzero((frames >= 0) & (frames < len(ego_motion.times)))
    poses = np.zeros((len(rows), 3))
    for pose, row in zip(poses, rows, strict=True):
        place = level_from_camera @ (labels.places[row] - tables.left_camera)
        ego = ego_motion.poses_world[frames[row]]
        pose[:2] = world_from_ego(place[None, [0, 2]], ego)[0]
        # KITTI's rotation_y is about the y axis (down), 0 along x.
        pose[2] = ego[2] - STRAIGHT_AHEAD - labels.yaws[row]
    poses[:, 2] = np.unwrap(poses[:, 2])
    return rows, frames[rows], poses
