"""Scans from a file: the `scans.csv` that a run writes, or such a table of any other sensor.

One row per point: k, t (s), x, y (m, world frame), optionally var_xx, var_xy, var_yy (m²). The
sensor's poses are a table like a run's `ego.csv`: k, t, x, y (m), heading (rad).
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Le

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.measurements.disturbance_parameters import Disturbance
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.measurements.tables import indices, read_table, refuse_rows
from stixel_cli.parameters import parameters


@parameters
class FileParameters(Disturbance):
    """Scans of any sensor, read from a table. This module and `file_truth` describe the columns.

    Attributes:
        path: the scans, `.csv` or `.npz`; required.
        ego: the sensor's pose and the time of each scan, empty ones too; null: the sensor stays at
            the origin, and an absent k is an empty scan.
        truth: the target's true poses and size or contour; null: unknown, so no errors are scored.
        range_std: standard deviation of a point along each axis, m, if the file has no variances.
        horizontal_fov: field of view in degrees, symmetric to the sensor's heading; null: unknown.
    """

    kind: Literal["file"]
    path: str | None
    ego: str | None
    truth: str | None
    range_std: Annotated[float, Gt(0), Le(10)]
    horizontal_fov: Annotated[float, Gt(0), Le(360)] | None

    def check(self) -> None:
        """Raise ValueError for an empty file name."""
        for name in ("path", "ego", "truth"):
            if getattr(self, name) == "":
                raise ValueError(f"measurement.{name}: is empty: must be the name of a file")


VARIANCES = ("var_xx", "var_xy", "var_yy")

SAME_TIME = 1e-3
"""The times of one scan in the two files may differ by this, s: files have rounded numbers."""


def read_scans(
    path: str, ego: str | None, range_std: float, horizontal_fov: float | None = None
) -> Scans:
    """Scans of the points in the file `path`, in their order in the file.

    Args:
        path: the table of points.
        ego: the table of sensor poses, one row for each k from 0 on. None: the sensor is at
            (0, 0, pi/2), the scans are 0 to the largest k, and the times of absent k are
            interpolated.
        range_std: m. Without variances the covariance of a point is range_std² I.
        horizontal_fov: of the sensor, degrees, symmetric to its heading; None: unknown.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    file = Path(path)
    table = read_table(file, ("k", "t", "x", "y"), (VARIANCES,))
    k = indices(file, "k", table["k"])
    if ego is None:
        times = _times(file, k, table["t"])
        poses = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (len(times), 1))
    else:
        times, poses = _read_ego(Path(ego))
        _check_times(file, Path(ego), k, table["t"], times)
    order = np.argsort(k, kind="stable")
    counts = np.bincount(k, minlength=len(times))
    view = None
    if horizontal_fov is not None:
        view = FieldOfView(-np.radians(0.5 * horizontal_fov), np.radians(0.5 * horizontal_fov))
    return Scans(
        times=times,
        sensor_poses_world=poses,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        points_world=np.stack([table["x"], table["y"]], axis=1)[order],
        covariances_world=_covariances(file, table, range_std)[order],
        field_of_view=view,
    )


def _times(file: Path, k: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The time of each scan from 0 to the largest k, s; those of absent k are interpolated."""
    if len(k) == 0:
        raise UserError(f"{file}: has no points: give the times of the scans, measurement.ego=FILE")
    present, first = np.unique(k, return_index=True)
    known = t[first]
    _check_one_time(file, k, t, known[np.searchsorted(present, k)], 0.0)
    _check_increasing(file, present, known)
    if len(present) < 2 and present[0] > 0:
        raise UserError(
            f"{file}: has one scan, k = {present[0]}, so the times of the scans before it are "
            "unknown: give measurement.ego=FILE"
        )
    times = np.interp(np.arange(present[-1] + 1), present, known)
    if present[0] > 0:
        step = (known[1] - known[0]) / (present[1] - present[0])
        times[: present[0]] = known[0] - step * np.arange(present[0], 0, -1)
    return times


def _read_ego(file: Path) -> tuple[np.ndarray, np.ndarray]:
    table = read_table(file, ("k", "t", "x", "y", "heading"))
    k = indices(file, "k", table["k"])
    if len(k) == 0:
        raise UserError(f"{file}: has no rows, so there are no scans")
    order = np.argsort(k, kind="stable")
    if not np.array_equal(k[order], np.arange(len(k))):
        raise UserError(f"{file}: k must be each number from 0 to {len(k) - 1} once")
    times = table["t"][order]
    _check_increasing(file, k[order], times)
    return times, np.stack([table[name][order] for name in ("x", "y", "heading")], axis=1)


def _check_times(file: Path, ego: Path, k: np.ndarray, t: np.ndarray, times: np.ndarray) -> None:
    last = len(times) - 1
    refuse_rows(file, k > last, lambda i: f"k = {k[i]}, but {ego} ends at k = {last}")
    _check_one_time(file, k, t, times[k], SAME_TIME)


def _check_one_time(
    file: Path, k: np.ndarray, t: np.ndarray, expected: np.ndarray, tolerance: float
) -> None:
    refuse_rows(
        file,
        np.abs(t - expected) > tolerance,
        lambda i: f"t = {t[i]:.6g} s, but scan k = {k[i]} is at {expected[i]:.6g} s",
    )


def _check_increasing(file: Path, k: np.ndarray, times: np.ndarray) -> None:
    wrong = np.flatnonzero(np.diff(times) <= 0.0)
    if len(wrong):
        raise UserError(
            f"{file}: t must increase with k, but scan {k[wrong[0] + 1]} is at "
            f"{times[wrong[0] + 1]:.6g} s and scan {k[wrong[0]]} at {times[wrong[0]]:.6g} s"
        )


def _covariances(file: Path, table: dict[str, np.ndarray], range_std: float) -> np.ndarray:
    """Covariances (n, 2, 2) m² of the points."""
    if VARIANCES[0] not in table:
        return np.tile(range_std**2 * np.eye(2), (len(table["k"]), 1, 1))
    xx, xy, yy = (table[name] for name in VARIANCES)
    # A point measured exactly across the ray has a determinant of zero, up to rounding.
    refuse_rows(
        file,
        (xx < 0) | (yy < 0) | (xx * yy - xy**2 < -1e-9 * xx * yy),
        lambda _: (
            "var_xx, var_xy, var_yy must be a covariance: no negative variance, and var_xy² at "
            "most var_xx var_yy"
        ),
    )
    return np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
