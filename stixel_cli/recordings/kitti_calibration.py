"""KITTI's calibration files: rows `P2: 12 numbers`, the 3 × 4 projections of the cameras.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*, (4). The odometry
benchmark's files may leave out the names; their rows are P0, P1, … in order.
"""

import re
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.recordings.rows import check_columns, numbers, text_rows
from stixel_cli.recordings.types import Calibration

CAMERA_HEIGHT = 1.65
"""Of KITTI's cameras above the road, m (Geiger et al. 2013, figure 3)."""


def read_calibration(file: Path, left: str, right: str) -> Calibration:
    """The calibration of the cameras `left` and `right`, such as `P2` and `P3`.

    Raises:
        UserError: if a projection is missing, damaged, or the cameras are not a rectified pair.
    """
    found = _projections(file)
    for name in (left, right):
        if name not in found:
            raise UserError(f"{file}: the projection {name} is missing")
    first, second = found[left], found[right]
    for name, matrix in ((left, first), (right, second)):
        if not (matrix[0, 0] > 0 and matrix[1, 1] > 0) or abs(matrix[2, 2] - 1.0) > 1e-6:
            raise UserError(f"{file}: {name} is not a camera's projection")
    if not np.allclose(first[:, :3], second[:, :3], rtol=0.0, atol=1e-3):
        raise UserError(f"{file}: {left} and {right} are not rectified to one camera matrix")
    # P = K [I | t]: t moves points from the labels' frame into the camera's.
    shifts = [np.linalg.solve(matrix[:, :3], matrix[:, 3]) for matrix in (first, second)]
    baseline = float(shifts[0][0] - shifts[1][0]) + 0.0
    if baseline < 0.001:
        raise UserError(
            f"{file}: no baseline: {right} is {baseline:.4g} m to the right of {left}; "
            "at least 0.001 m are needed"
        )
    return Calibration(
        focal_length=float(first[0, 0]),
        focal_length_v=float(first[1, 1]),
        principal_u=float(first[0, 2]),
        principal_v=float(first[1, 2]),
        baseline=baseline,
        camera_height=CAMERA_HEIGHT,
        left_camera=tuple(float(-value) for value in shifts[0]),
    )


def pair_names(file: Path) -> tuple[str, str]:
    """The names of the two cameras in a file: of the colour cameras, else of the grey ones.

    Raises:
        UserError: if it has no such pair.
    """
    found = _projections(file)
    for left, right in (("P2", "P3"), ("P_rect_02", "P_rect_03"), ("P0", "P1")):
        if left in found and right in found:
            return left, right
    raise UserError(f"{file}: the projections P2 and P3, or P0 and P1, are missing")


def _projections(file: Path) -> dict[str, np.ndarray]:
    """The 3 × 4 matrices by name."""
    found: dict[str, np.ndarray] = {}
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
        check_columns(file, row, words, 12)
        found[name] = np.array(numbers(file, row, words)).reshape(3, 4)
    return found
