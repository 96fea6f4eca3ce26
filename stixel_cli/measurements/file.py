"""Scans from a file: the `scans.csv` that a run writes, or such a table of any other sensor.

One row per point: k, t (s), x, y (m, world frame), optionally var_xx, var_xy, var_yy (m²). The
sensor's poses are a table like a run's `ego.csv`: k, t, x, y (m), heading (rad). Without k the rows
of one t are a scan. A row without x and y is a return without a point.
"""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.errors import UserError, counted
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.measurements import tables
from stixel_cli.measurements.parameters import Disturbance
from stixel_cli.measurements.scans import NO_SHARED_ERRORS, FieldOfView, Scans, SharedErrors
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
        range_bias_std: standard deviation of an error that all ranges of the file share, m.
        ego_std: those of errors of the sensor's place (x and y, m) and heading (degrees) that all
            of its poses share.
        time_std: that of an error of the times of the sensor's poses, s, as of a clock.
        horizontal_fov: field of view in degrees, symmetric to the sensor's heading; null: unknown.
        time_unit: unit of t; null: seconds, or that of times since 1970.
        angle_unit: unit of the headings in `ego` and `truth`.
        road_z: of the road near the target in the table's column z, m: the points have heights, and
            trackers take the nearest of each bearing. null: z is not read, as where the points of a
            target are the nearest of their bearings.
    """

    kind: Literal["file"]
    path: str | None
    ego: str | None
    truth: str | None
    range_std: Annotated[float, Gt(0), Le(10)]
    range_bias_std: Annotated[float, Ge(0), Le(10)]
    ego_std: tuple[Annotated[float, Ge(0), Le(10)], Annotated[float, Ge(0), Le(45)]]
    time_std: Annotated[float, Ge(0), Le(10)]
    horizontal_fov: Annotated[float, Gt(0), Le(360)] | None
    time_unit: tables.TimeUnit | None
    angle_unit: tables.AngleUnit
    road_z: Annotated[float, Ge(-10000), Le(10000)] | None

    @property
    def shared_errors(self) -> SharedErrors:
        """What all points of the file share."""
        position, heading = self.ego_std
        return SharedErrors(
            range_bias=self.range_bias_std,
            position=position,
            heading=float(np.radians(heading)),
            time=self.time_std,
        )

    def check(self) -> None:
        """Raise ValueError for an empty file name."""
        for name in ("path", "ego", "truth"):
            if getattr(self, name) == "":
                raise ValueError(f"measurement.{name}: is empty: must be the name of a file")


VARIANCES = ("var_xx", "var_xy", "var_yy")


def read_scans(
    path: str,
    ego: str | None,
    range_std: float,
    horizontal_fov: float | None = None,
    time_unit: tables.TimeUnit | None = None,
    angle_unit: tables.AngleUnit = "rad",
    note: Callable[[str], object] = str,
    shared_errors: SharedErrors = NO_SHARED_ERRORS,
    road_z: float | None = None,
) -> Scans:
    """Scans of the points in the file `path`, in their order in the file.

    The arguments are the settings of `FileParameters`, and `note`, which is called with one line
    for what a user may not expect. Without the table `ego` the sensor is at (0, 0, pi/2), the scans
    are 0 to the largest k, and the times of absent k are interpolated. Without variances the
    covariance of a point is range_std² I. Times since 1970 become relative.
    """
    file = Path(path)
    needed = ("t", "x", "y") if road_z is None else ("t", "x", "y", "z")
    table = tables.read_table(file, needed, (("k",), VARIANCES), gaps=("x", "y", "z", *VARIANCES))
    k, times, poses, epoch = _clock(file, table, ego, time_unit, angle_unit, note)
    # A return without a point tells that there is a scan.
    order = np.argsort(k, kind="stable")
    order = order[np.isfinite(table["x"][order])]
    half = None if horizontal_fov is None else np.radians(0.5 * horizontal_fov)
    counts = np.bincount(k[order], minlength=len(times))
    if dropped := len(k) - len(order):
        note(f"{file}: {dropped} of {counted(len(k), 'row')} dropped: x and y are empty")
    return Scans(
        times=times,
        sensor_poses_world=poses,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        points_world=np.stack([table["x"], table["y"]], axis=1)[order],
        covariances_world=_covariances(file, table, range_std)[order],
        field_of_view=None if half is None else FieldOfView(-half, half),
        epoch=epoch,
        shared_errors=shared_errors,
        heights=None if road_z is None else table["z"][order] - road_z,
    )


def _clock(
    file: Path,
    table: Mapping[str, np.ndarray],
    ego: str | None,
    time_unit: tables.TimeUnit | None,
    angle_unit: tables.AngleUnit,
    note: Callable[[str], object],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int | None]:
    """The scan (n,) of each row, times (K,) s and sensor poses (K, 3) of the scans, the epoch."""
    clock, rows, lacks = file, table, "points: give the times of the scans, measurement.ego=FILE"
    if ego is not None:
        clock, lacks = Path(ego), "rows, so there are no scans"
        rows = tables.read_table(clock, ("t", "x", "y", "heading"), (("k",),))
    unit, epoch = tables.unit_and_epoch(rows["t"], time_unit)
    t = tables.seconds(clock, rows["t"], time_unit, epoch)
    if len(t) == 0:
        raise UserError(f"{clock}: has no {lacks}")
    k = _scans_of_rows(clock, rows, t)
    present, first = np.unique(k, return_index=True)
    known = t[first]
    if ego is None:
        tables.refuse_other_times(file, k, t, known[np.searchsorted(present, k)], 0.0)
    elif not np.array_equal(present, np.arange(len(k))):
        raise UserError(
            f"{clock}: must have one row for each scan k, each number from 0 to {len(k) - 1} once"
        )
    for i in np.flatnonzero(np.diff(known) <= 0.0):
        raise UserError(
            f"{clock}: t must increase with k, but scan {present[i + 1]} is at "
            f"{known[i + 1]:.6g} s and scan {present[i]} at {known[i]:.6g} s"
        )
    if ego is None:
        times = _all_times(file, present, known)
        poses = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (len(times), 1))
    else:
        headings = tables.in_radians(rows["heading"], angle_unit)
        times, poses = known, np.stack([rows["x"], rows["y"], headings], axis=1)[first]
        k = tables.scan_indices(file, table, times, time_unit, epoch)
    if epoch is not None and time_unit is None:
        day = datetime.fromtimestamp(epoch // 10**9, UTC).date()
        note(
            f"{clock}: t is read as {unit} since 1970 (first scan: {day}); if that is wrong, set "
            "measurement.time_unit"
        )
    return k, times, poses, epoch


def _all_times(file: Path, present: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The times (K,) s of all scans, of which those of the `present` (n,) scans are `known`."""
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


def _scans_of_rows(file: Path, table: Mapping[str, np.ndarray], t: np.ndarray) -> np.ndarray:
    """The scan k (n,) of each row at `t` (n,); without a column k, the rows of one t are a scan."""
    if "k" in table:
        return tables.indices(file, "k", table["k"])
    times, k = np.unique(t, return_inverse=True)
    if len(times) > tables.MOST_SCANS:
        raise UserError(
            f"{file}: without the column k, each t is a scan: at most {tables.MOST_SCANS}, "
            f"got {len(times)}"
        )
    return k


def _covariances(file: Path, table: dict[str, np.ndarray], range_std: float) -> np.ndarray:
    """Covariances (n, 2, 2) m² of the points."""
    if VARIANCES[0] not in table:
        return np.tile(range_std**2 * np.eye(2), (len(table["t"]), 1, 1))
    xx, xy, yy = (table[name] for name in VARIANCES)
    # A point measured exactly across the ray has a determinant of zero, up to rounding.
    tables.refuse_rows(
        file,
        (xx < 0) | (yy < 0) | (xx * yy - xy**2 < -1e-9 * xx * yy),
        lambda _: (
            "var_xx, var_xy, var_yy must be a covariance: no negative variance, and var_xy² at "
            "most var_xx var_yy"
        ),
    )
    return np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
