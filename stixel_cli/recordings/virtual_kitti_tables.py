"""Virtual KITTI 2's text files: a row of names, then one row per frame, camera and object.

Cabon, Murray, Humenberger 2020, *Virtual KITTI 2*. Camera 0 is the left one. The columns of the
labels mean those of KITTI tracking, in the left camera's frame. One differs from its description:
`occupancy_ratio` is the share of the object's box in the image that its visible pixels fill.
"""

from pathlib import Path

import numpy as np

from stixel_cli.border.files import remembered
from stixel_cli.errors import UserError
from stixel_cli.recordings import kitti_tables
from stixel_cli.recordings.types import Calibration, Tracks

VISIBLE = 0.7
"""Least share of its box that a vehicle in full view fills: chosen here, not by the data set."""

KEY = ("frame", "cameraID", "trackID")
PLACE = ("camera_space_X", "camera_space_Y", "camera_space_Z")
POSE = ("height", "width", "length", *PLACE, "rotation_camera_space_y")
BOX = ("left", "top", "right", "bottom", "truncation_ratio", "occupancy_ratio")


def read_calibration(intrinsic: Path, extrinsic: Path) -> Calibration:
    """The calibration of the two cameras, from the rows of the first frame."""
    matrices = _of_first_frame(intrinsic, 4)
    if matrices[0] != matrices[1]:
        raise UserError(f"{intrinsic}: the cameras are not rectified to one camera matrix")
    focal_length, focal_length_v, principal_u, principal_v = matrices[0]
    if focal_length <= 0.0 or focal_length_v <= 0.0:
        raise UserError(f"{intrinsic}: the focal lengths must be > 0")
    left, right = (np.reshape(values, (4, 4)) for values in _of_first_frame(extrinsic, 16))
    # Of the left camera in the frame of the right one.
    motion = right @ np.linalg.inv(left) if np.linalg.det(left) else np.zeros((4, 4))
    baseline = -float(motion[0, 3])
    aligned = np.eye(4)
    aligned[0, 3] = -baseline
    if not np.allclose(motion, aligned, atol=0.01):
        raise UserError(f"{extrinsic}: the cameras of the first frame are not a rectified pair")
    kitti_tables.check_baseline(extrinsic, baseline, "camera 0", "camera 1")
    return Calibration(focal_length, focal_length_v, principal_u, principal_v, baseline, None)


def read_poses(extrinsic: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in the world, m."""
    poses: list[tuple[int, np.ndarray]] = []
    for row, words in _rows(extrinsic, ("frame", "cameraID"), 18):
        frame, camera, *values = kitti_tables.numbers(extrinsic, row, words)
        if camera == 0 and frame != len(poses):
            raise UserError(f"{extrinsic}: row {row}: frame {len(poses)} is missing before it")
        if camera == 0:
            matrix = np.reshape(values, (4, 4))[:3]
            turn = matrix[:, :3].T
            poses.append((row, np.column_stack([turn, -turn @ matrix[:, 3]])))
    return kitti_tables.checked_poses(extrinsic, poses)


@remembered
def read_labels(pose: Path, bbox: Path, info: Path) -> Tracks:
    """The labels of each target by its track id, where it has both a pose and a box."""
    kinds = dict(words for _, words in _rows(info, ("trackID", "label")))
    boxes, labels = _of_left_camera(bbox, BOX), []
    for (frame, track), (place, values) in _of_left_camera(pose, POSE).items():
        if (frame, track) in boxes:
            kind = kinds.get(str(int(track)))
            if kind is None:
                raise UserError(f"{info}: track {track:g} of {pose.name} is missing")
            *box, truncated, filled = boxes[frame, track][1]
            hidden = float(filled < VISIBLE)
            labels.append((place, kind, frame, track, truncated, hidden, *box, *values))
    return kitti_tables.tracks_of(labels)


def _of_left_camera(
    file: Path, names: tuple[str, ...]
) -> dict[tuple[float, float], tuple[str, list[float]]]:
    """The place of each label in the file and its values of `names`, by frame and track."""
    found = {}
    for row, words in _rows(file, (*KEY, *names)):
        frame, camera, track, *values = kitti_tables.numbers(file, row, words)
        place = f"{file}: row {row}"
        if camera != 0:
            continue
        if (frame, track) in found:
            raise UserError(f"{place}: track {track:g} is labelled twice in frame {frame:g}")
        found[frame, track] = place, values
    return found


def _of_first_frame(file: Path, columns: int) -> tuple[list[float], list[float]]:
    """The values of cameras 0 and 1 in their first row."""
    by_camera: dict[float, list[float]] = {}
    for row, words in _rows(file, ("frame", "cameraID"), 2 + columns):
        _, camera, *values = kitti_tables.numbers(file, row, words)
        by_camera.setdefault(camera, values)
        if {0.0, 1.0} <= by_camera.keys():
            return by_camera[0.0], by_camera[1.0]
    raise UserError(f"{file}: a row of cameraID {0 if 0.0 not in by_camera else 1} is missing")


def _rows(
    file: Path, names: tuple[str, ...], count: int | None = None
) -> list[tuple[int, list[str]]]:
    """Number of each row after that of the names, and its words in the columns `names`.

    With `count`, all of its words, which must be as many.
    """
    rows = kitti_tables.text_rows(file)
    header = rows[0][1] if rows else []
    for name in names:
        if name not in header:
            raise UserError(f"{file}: row 1: the column {name} is missing")
    columns = [header.index(name) for name in names] if count is None else range(count)
    for row, words in rows[1:]:
        kitti_tables.check_columns(file, row, words, count or len(header))
    return [(row, [words[i] for i in columns]) for row, words in rows[1:]]
