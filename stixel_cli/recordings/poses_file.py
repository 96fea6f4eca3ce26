"""KITTI's pose files: one row per frame, the 3 × 4 matrix of the left camera's pose, row by row."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.recordings.rows import check_columns, numbers, text_rows

GREATEST_STEP = 10.0
"""Between two rows, m; with more, they are not in the order of the frames."""

GREATEST_TURN = 30.0
"""Between two rows, degrees; likewise."""


def read_poses(file: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in that of the first row, m.

    Raises:
        UserError: if a row is short, not finite, not a rigid motion, or not in order.
    """
    stat = file.stat() if file.exists() else None
    return _read(file, None if stat is None else (stat.st_mtime_ns, stat.st_size))


@lru_cache(maxsize=32)
def _read(file: Path, state: tuple[int, int] | None) -> np.ndarray:
    poses = []
    for row, words in text_rows(file):
        check_columns(file, row, words, 12)
        poses.append((row, np.array(numbers(file, row, words)).reshape(3, 4)))
    return checked_poses(file, poses)


def checked_poses(file: Path, poses: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Poses (n, 3, 4), each given with its row in a file; errors as in `read_poses`."""
    found: list[np.ndarray] = []
    for row, pose in poses:
        turn = pose[:, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0.0:
            raise UserError(f"{file}: row {row}: not a rigid pose: its 3 × 3 part is no rotation")
        if found:
            step = np.linalg.norm(pose[:, 3] - found[-1][:, 3])
            cosine = 0.5 * (np.trace(found[-1][:, :3].T @ turn) - 1.0)
            angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
            if step > GREATEST_STEP or angle > GREATEST_TURN:
                raise UserError(
                    f"{file}: row {row}: out of order: {step:.1f} m and {angle:.0f} degrees from "
                    f"the row before, at most {GREATEST_STEP:g} m and {GREATEST_TURN:g} degrees"
                )
        found.append(pose)
    if not found:
        raise UserError(f"{file}: has no poses")
    return np.stack(found)
