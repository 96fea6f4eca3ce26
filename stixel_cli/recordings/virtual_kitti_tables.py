"""Virtual KITTI 2's text files: a row of names, then one row per frame, camera and object.

Cabon, Murray, Humenberger 2020, *Virtual KITTI 2*. Camera 0 is the left one. The columns of the
labels mean those of KITTI tracking, in the left camera's frame. One differs from its description:
`occupancy_ratio` is the share of the object's box in the image that its visible pixels fill.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.recordings.tables import (
    Tracks,
    check_columns,
    checked_poses,
    labels_in,
    numbers,
    text_rows,
)
from stixel_cli.recordings.types import Calibration
from stixel_cli.remembered import remembered

VISIBLE = 0.7
"""Least share of its box that a vehicle in full view fills: chosen here, not by the data set."""

KEY = ("frame", "cameraID", "trackID")
POSE = ("height", "width", "length")
POSE += ("camera_space_X", "camera_space_Y", "camera_space_Z", "rotation_camera_space_y")
BOX = ("left", "top", "right", "bottom", "truncation_ratio", "occupancy_ratio")


def read_calibration(intrinsic: Path, extrinsic: Path) -> Calibration:
    """The calibration of the two cameras, from the rows of the first frame.

    Raises:
        UserError: if a row is missing or damaged, or the cameras are not a rectified pair.
    """
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
    if baseline < 0.001:
        raise UserError(
            f"{extrinsic}: no baseline: camera 1 is {baseline:.4g} m to the right of camera 0; "
            "at least 0.001 m are needed"
        )
    return Calibration(focal_length, focal_length_v, principal_u, principal_v, baseline, None)


def read_poses(extrinsic: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in the world, m.

    Raises:
        UserError: if a row is damaged, a frame is missing, or the poses are not in order.
    """
    poses = []
    for row, words in _rows(extrinsic, ("frame", "cameraID"), 18):
        frame, camera, *values = numbers(extrinsic, row, words)
        if camera != 0:
            continue
        if frame != len(poses):
            raise UserError(f"{extrinsic}: row {row}: frame {len(poses)} is missing before it")
        matrix = np.reshape(values, (4, 4))[:3]
        turn = matrix[:, :3].T
        poses.append((row, np.column_stack([turn, -turn @ matrix[:, 3]])))
    return checked_poses(extrinsic, poses)


@remembered
def read_labels(pose: Path, bbox: Path, info: Path) -> Tracks:
    """The labels of each target by its track id, where it has both a pose and a box.

    Raises:
        UserError: if a row is short, has a value that is not finite, or repeats a frame.
    """
    kinds = {words[0]: words[1] for _, words in _rows(info, ("trackID", "label"), picked=True)}
    boxes = _of_left_camera(bbox, BOX)
    rows: dict[int, list[list[float]]] = {}
    for (frame, track), (row, values) in _of_left_camera(pose, POSE).items():
        if min(values[:3]) <= 0.0:
            raise UserError(f"{pose}: row {row}: height, width and length must be > 0")
        if (frame, track) in boxes:
            *box, truncated, filled = boxes[frame, track][1]
            occluded = float(filled < VISIBLE)
            one = [frame, track, truncated, occluded, 0.0, *box, *values]
            rows.setdefault(track, []).append(one)
    for track in rows:
        if str(track) not in kinds:
            raise UserError(f"{info}: track {track} of {pose.name} is missing")
    return {
        track: labels_in(np.array(rows[track]), printable(kinds[str(track)]))
        for track in sorted(rows)
    }


def _of_left_camera(
    file: Path, names: tuple[str, ...]
) -> dict[tuple[int, int], tuple[int, list[float]]]:
    """Row number and the columns `names` by frame and track."""
    found: dict[tuple[int, int], tuple[int, list[float]]] = {}
    for row, words in _rows(file, (*KEY, *names), picked=True):
        frame, camera, track, *values = numbers(file, row, words)
        if camera != 0:
            continue
        if (int(frame), int(track)) != (frame, track) or min(frame, track) < 0:
            raise UserError(f"{file}: row {row}: frame and trackID must be whole numbers ≥ 0")
        if (frame, track) in found:
            raise UserError(
                f"{file}: row {row}: track {track:g} is labelled twice in frame {frame:g}"
            )
        found[int(frame), int(track)] = row, values
    return found


def _of_first_frame(file: Path, columns: int) -> tuple[list[float], list[float]]:
    """The values of cameras 0 and 1 in their first row."""
    found: dict[float, list[float]] = {}
    for row, words in _rows(file, ("frame", "cameraID"), 2 + columns):
        _, camera, *values = numbers(file, row, words)
        found.setdefault(camera, values)
        if {0.0, 1.0} <= found.keys():
            return found[0.0], found[1.0]
    raise UserError(f"{file}: a row of cameraID {0 if 0.0 not in found else 1} is missing")


def _rows(
    file: Path, names: tuple[str, ...], columns: int | None = None, picked: bool = False
) -> list[tuple[int, list[str]]]:
    """Number and words of each row after that of the names, which must have `names`.

    Args:
        file: to read.
        names: of columns.
        columns: number of them; None for those of the row of names.
        picked: whether to return the columns `names` only, in this order.
    """
    rows = text_rows(file)
    header = rows[0][1] if rows else []
    for name in names:
        if name not in header:
            raise UserError(f"{file}: row 1: the column {name} is missing")
    for row, words in rows[1:]:
        check_columns(file, row, words, columns or len(header))
    at = [header.index(name) for name in names] if picked else slice(None)
    return [(row, [words[i] for i in at] if picked else words) for row, words in rows[1:]]
