"""Ego poses and labels of a recording in any layout."""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.recordings import (
    argoverse_tables,
    bag_messages,
    kitti_raw_tables,
    kitti_tables,
    virtual_kitti_tables,
)
from stixel_cli.recordings.types import Labels, Tables, Tracks

READERS = {
    "kitti": (kitti_tables.read_poses, kitti_tables.read_labels),
    "kitti_oxts": (kitti_raw_tables.read_poses, kitti_tables.read_labels),
    "kitti_raw": (kitti_raw_tables.read_poses, kitti_raw_tables.read_labels),
    "virtual_kitti": (virtual_kitti_tables.read_poses, virtual_kitti_tables.read_labels),
    "argoverse": (argoverse_tables.read_poses, argoverse_tables.read_labels),
    "rosbag": (bag_messages.read_poses, None),
}
"""The functions that read the ego poses and the labels of each kind of tables."""


def read_poses(files: tuple[Path, ...], tables: Tables) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in any one frame, m.

    Raises:
        UserError: if a file is missing or not valid.
    """
    return READERS[tables.kind][0](*filter(None, [tables.times, tables.topics]), *files)


def read_labels(files: tuple[Path, ...], tables: Tables) -> Tracks:
    """The labels of each target by its track id; errors as in `read_poses`."""
    return READERS[tables.kind][1](*filter(None, [tables.times]), *files)


def labels_of(
    files: tuple[Path, ...], tables: Tables, target: int | str, key: str = "source.target"
) -> Labels:
    """The labels of one target; `key` is the setting that names it.

    Raises:
        UserError: if the files have no such track; the line lists tracks that they have.
    """
    tracks = read_labels(files, tables)
    if target not in tracks:
        shown = [f"{i} ({labels.kind})" for i, labels in list(tracks.items())[:12]]
        known = ", ".join(shown) or "none"
        more = ", …" if len(tracks) > 12 else ""
        raise UserError(f"{key}: {files[0]} has no track {target}; it has {known}{more}")
    return tracks[target]
