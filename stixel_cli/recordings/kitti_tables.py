"""KITTI's text files: calibration, ego poses and labels.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*. Calibration: rows
`P2: 12 numbers`, the 3 × 4 projections of the cameras, (4); the odometry benchmark may leave out
the names, its rows are P0, P1, … in order. Poses: one row per frame, the 3 × 4 matrix of the left
camera's pose, row by row. Labels: one row per frame and object with frame, track id, type,
truncated, occluded, alpha, box in the left colour image (left, top, right, bottom, px), size
(height, width, length, m), place of the bottom's centre (x, y, z, m, in the frame of camera 0),
rotation_y (rad), https://www.cvlibs.net/datasets/kitti/eval_tracking.php. Those of the object
benchmark have no frame and no track id, and a share of truncation: they are of frame 0, and the
track id is the number of the row, from 0. Result files have a score in one more column.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_text
from stixel_cli.geometry.pose import rectangle
from stixel_cli.recordings.types import Calibration, Labels, Tracks
from stixel_cli.remembered import remembered

MOST_ROWS = 1_000_000

GREATEST = 1e9
"""Greatest absolute value of a number, in its unit: products of larger ones overflow."""


def text_rows(file: Path) -> list[tuple[int, list[str]]]:
    """Number (from 1) and words of each row that is not empty.

    Raises:
        UserError: if the file is missing, not a text, or has more than `MOST_ROWS` rows.
    """
    lines = read_text(file).splitlines()
    if len(lines) > MOST_ROWS:
        raise UserError(f"{file}: more than {MOST_ROWS} rows")
    return [(i, line.split()) for i, line in enumerate(lines, 1) if line.strip()]


def numbers(file: Path, row: int, words: list[str], needed: int | None = None) -> list[float]:
    """The words of a row as numbers.

    Raises:
        UserError: if there are not as many as `needed`, or one is not finite or beyond `GREATEST`.
    """
    check_columns(file, row, words, needed or len(words))
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            raise UserError(f"{file}: row {row}: {printable(word)!r} is not a number") from None
        if not math.isfinite(value):
            raise UserError(f"{file}: row {row}: {printable(word)} is not finite")
        if abs(value) > GREATEST:
            raise UserError(f"{file}: row {row}: {printable(word)} must be within ±{GREATEST:g}")
        values.append(value)
    return values


def named_numbers(file: Path, count: int, *names: str) -> list[float]:
    """The `count` numbers in the first row with one of these names, such as `T: 1 2 3`.

    `T=[1 2; 3]` is read, too. UserError without such a row.
    """
    for row, words in text_rows(file):
        name, *values = re.sub(r"[=\[\];,]", " ", " ".join(words)).split() or [""]
        if name.removesuffix(":") in names:
            return numbers(file, row, values, count)
    raise UserError(f"{file}: {' or '.join(names)} is missing")


def check_columns(file: Path, row: int, words: list[str], needed: int) -> None:
    """Raise UserError unless the row has `needed` columns."""
    if len(words) != needed:
        raise UserError(f"{file}: row {row}: {needed} columns are needed, got {len(words)}")


CAMERA_HEIGHT = 1.65
"""Of KITTI's cameras above the road, m (Geiger et al. 2013, figure 3)."""


PAIRS = ("P2", "P3"), ("P_rect_02", "P_rect_03"), ("P0", "P1")
"""Names of the colour cameras, in either kind of file, and of the grey ones."""


def read_calibration(file: Path, *pairs: tuple[str, str]) -> Calibration:
    """The calibration of the first of the `pairs` of cameras, such as `P2` and `P3`, that it has.

    Raises:
        UserError: if a projection is missing, damaged, or the cameras are not a rectified pair.
    """
    projections = _projections(file)
    left, right = next((pair for pair in pairs if {*pair} <= projections.keys()), (None, None))
    if left is None:
        names = ", or ".join(" and ".join(pair) for pair in pairs)
        raise UserError(f"{file}: the projections {names} are missing")
    pair = rectified_pair(file, (left, right), (projections[left], projections[right]))
    return replace(pair, camera_height=CAMERA_HEIGHT)


def rectified_pair(
    file: Path | str, names: Sequence[str], projections: Sequence[np.ndarray]
) -> Calibration:
    """The calibration in the projections (3, 4) of a left and a right camera; errors as above."""
    (left, right), (first, second) = names, projections
    for name, matrix in ((left, first), (right, second)):
        if not (matrix[0, 0] > 0 and matrix[1, 1] > 0) or abs(matrix[2, 2] - 1.0) > 1e-6:
            raise UserError(f"{file}: {name} is not a camera's projection")
    differs = np.abs(first[:, :3] - second[:, :3]) > 1e-3
    # The columns of the principal points may differ, as `rig.principal_u_right`.
    other_column, differs[0, 2] = bool(differs[0, 2]), False
    if differs.any():
        raise UserError(f"{file}: {left} and {right} are not rectified to one camera matrix")
    # P = K [I | t]: t moves points from the labels' frame into the camera's.
    shifts = [np.linalg.solve(matrix[:, :3], matrix[:, 3]) for matrix in (first, second)]
    baseline = float(shifts[0][0] - shifts[1][0]) + 0.0
    check_baseline(file, baseline, left, right)
    return Calibration(
        focal_length=float(first[0, 0]),
        focal_length_v=float(first[1, 1]),
        principal_u=float(first[0, 2]),
        principal_v=float(first[1, 2]),
        baseline=baseline,
        camera_height=None,
        principal_u_right=float(second[0, 2]) if other_column else None,
        left_camera=tuple(float(-value) for value in shifts[0]),
    )


def check_baseline(file: Path | str, baseline: float, left: str, right: str) -> None:
    """Raise UserError if the `baseline` from the camera `left` to `right`, m, cannot be one."""
    if not 0.001 <= baseline <= 5.0:
        apart = f"{right} is {baseline:.4g} m to the right of {left}"
        unit = "; is it in mm?" if baseline > 5.0 else ""
        raise UserError(f"{file}: no baseline: {apart}, must be 0.001 to 5 m{unit}")


def _projections(file: Path) -> dict[str, np.ndarray]:
    """The 3 × 4 matrices by name."""
    projections: dict[str, np.ndarray] = {}
    unnamed = 0
    for row, words in text_rows(file):
        name = words[0].removesuffix(":")
        if name[:1].isalpha() and name.lower() not in ("nan", "inf"):
            words = words[1:]
        else:
            name, unnamed = f"P{unnamed}", unnamed + 1
        # Other rows, such as Tr_velo_to_cam, are not needed.
        if not re.fullmatch(r"P(_rect_)?\d+", name):
            continue
        projections[name] = np.reshape(numbers(file, row, words, 12), (3, 4))
    return projections


COLUMNS = 17
OBJECT_COLUMNS = 15


@remembered
def read_labels(file: Path) -> Tracks:
    """The labels of each target by its track id; regions of the type `DontCare` are left out.

    Raises:
        UserError: if a row is short, has a value that is not finite, or repeats a frame.
    """
    rows: dict[int, list[list[float]]] = {}
    kinds: dict[int, str] = {}
    seen: set[tuple[int, int]] = set()
    texts = text_rows(file)
    of_object = bool(texts) and len(texts[0][1]) in (OBJECT_COLUMNS, OBJECT_COLUMNS + 1)
    columns = OBJECT_COLUMNS if of_object else COLUMNS
    for row, words in texts:
        check_columns(file, row, words[:columns] if len(words) == columns + 1 else words, columns)
        if of_object:
            words = ["0", str(row - 1), *words]
        kind = words[2]
        if kind == "DontCare":
            continue
        values = numbers(file, row, words[:2] + words[3:COLUMNS])
        frame, target = int(values[0]), int(values[1])
        if (frame, target) != (values[0], values[1]) or frame < 0 or target < 0:
            raise UserError(f"{file}: row {row}: frame and track id must be whole numbers ≥ 0")
        if (frame, target) in seen:
            raise UserError(f"{file}: row {row}: track {target} is labelled twice in frame {frame}")
        if min(values[9:12]) <= 0.0:
            raise UserError(f"{file}: row {row}: height, width and length must be > 0")
        if kinds.setdefault(target, kind) != kind:
            raise UserError(
                f"{file}: row {row}: track {target} is a {printable(kind)}, "
                f"but was a {printable(kinds[target])} before"
            )
        seen.add((frame, target))
        rows.setdefault(target, []).append(values)
    return {target: labels_in(np.array(rows[target]), kinds[target]) for target in sorted(rows)}


def labels_in(values: np.ndarray, kind: str) -> Labels:
    """The labels of one target in rows (n, 16): KITTI's columns but for the type."""
    values = values[np.argsort(values[:, 0], kind="stable")]
    return Labels(
        frames=values[:, 0].astype(np.int64),
        truncated=np.ceil(values[:, 2]).astype(np.int64),
        occluded=values[:, 3].astype(np.int64),
        boxes=values[:, 5:9],
        sizes=values[:, 9:12],
        places=values[:, 12:15],
        yaws=values[:, 15],
        kind=kind,
    )


NEAREST = 0.5
"""Depth of a label's nearest corner, m: a nearer one is not seen."""


def seen_box(
    place: np.ndarray,
    yaw: float,
    size: Sequence[float],
    calibration: Calibration,
    image_size: tuple[int, int],
) -> tuple[np.ndarray, bool] | None:
    """The box (4,) px of a label in the image, and whether the border cuts it; None outside.

    `place` (3,) m of the bottom's centre is in the left camera's frame, `yaw` and `size` as in
    `Labels`.
    """
    height, width, length = size
    along, across = rectangle(length, width).T
    x = place[0] + np.cos(yaw) * along + np.sin(yaw) * across
    z = place[2] - np.sin(yaw) * along + np.cos(yaw) * across
    if z.min() < NEAREST:
        return None
    u = calibration.principal_u + calibration.focal_length * x / z
    y = place[1] - np.array([[0.0], [height]])
    v = calibration.principal_v + calibration.focal_length * y / z
    box = np.array([u.min(), v.min(), u.max(), v.max()])
    inside = np.clip(box, 0.0, np.array(image_size * 2) - 1.0)
    if inside[2] <= inside[0] or inside[3] <= inside[1]:
        return None
    return inside, bool((inside != box).any())


GREATEST_STEP = 10.0
"""Between two rows, m; with more, they are not in the order of the frames."""

GREATEST_TURN = 30.0
"""Between two rows, degrees; likewise."""


@remembered
def read_poses(file: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in that of the first row, m.

    Raises:
        UserError: if a row is short, not finite, not a rigid motion, or not in order.
    """
    rows = text_rows(file)
    return checked_poses(
        file, [(row, np.reshape(numbers(file, row, words, 12), (3, 4))) for row, words in rows]
    )


def checked_poses(file: Path, poses: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Poses (n, 3, 4), each given with its row in a file; errors as in `read_poses`."""
    before = None
    for row, pose in poses:
        turn = pose[:, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0.0:
            raise UserError(f"{file}: row {row}: not a rigid pose: its 3 × 3 part is no rotation")
        if before is not None:
            step = np.linalg.norm(pose[:, 3] - before[:, 3])
            cosine = 0.5 * (np.trace(before[:, :3].T @ turn) - 1.0)
            angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
            if step > GREATEST_STEP or angle > GREATEST_TURN:
                raise UserError(
                    f"{file}: row {row}: out of order: {step:.1f} m and {angle:.0f} degrees from "
                    f"the row before, at most {GREATEST_STEP:g} m and {GREATEST_TURN:g} degrees"
                )
        before = pose
    if not poses:
        raise UserError(f"{file}: has no poses")
    return np.stack([pose for _, pose in poses])
