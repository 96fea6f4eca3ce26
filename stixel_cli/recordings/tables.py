"""The ego poses and the labels of a recording, in whichever layout their files are."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from stixel_cli.recordings import (
    argoverse_tables,
    kitti_labels,
    poses_file,
    virtual_kitti_tables,
)
from stixel_cli.recordings.kitti_labels import Tracks, track_of
from stixel_cli.recordings.types import Labels, TableLayout


def read_poses(files: tuple[Path, ...], layout: TableLayout) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in any one frame, m.

    Raises:
        UserError: if a file is missing or not valid.
    """
    if layout.kind == "virtual_kitti":
        return virtual_kitti_tables.read_poses(files[0])
    if layout.kind == "argoverse":
        return argoverse_tables.read_poses(*files, layout.times)
    return poses_file.read_poses(files[0])


def read_labels(files: tuple[Path, ...], layout: TableLayout) -> Tracks:
    """The labels of each target by its track id.

    Raises:
        UserError: if a file is missing or not valid.
    """
    return _labels(files, layout, tuple(map(_state, files)))


def labels_of(files: tuple[Path, ...], layout: TableLayout, target: int | str) -> Labels:
    """The labels of one target.

    Raises:
        UserError: if the files have no such track; the line lists tracks that they have.
    """
    return track_of(read_labels(files, layout), target, files[0])


def _state(file: Path) -> tuple[int, int] | None:
    if not file.exists():
        return None
    stat = file.stat()
    return stat.st_mtime_ns, stat.st_size


@lru_cache(maxsize=32)
def _labels(files: tuple[Path, ...], layout: TableLayout, states: tuple) -> Tracks:
    """Parsed once per process while the files' `states` are the same."""
    if layout.kind == "virtual_kitti":
        return virtual_kitti_tables.read_labels(*files)
    if layout.kind == "argoverse":
        return argoverse_tables.read_labels(*files, layout.times)
    return kitti_labels.read_labels(files[0])
