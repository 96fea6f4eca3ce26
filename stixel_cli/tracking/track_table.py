"""A track in a file of another program, as a table.

A table (`.csv`, `.npz`) like a run's `track.csv` has the columns x, y (m), heading (rad), and k or
t (s). It may have x_rate, y_rate, heading_rate (m/s, rad/s); std_x … std_heading_rate, or var_xx,
var_xy, var_yy (m²); length and width (m); and radius_0, radius_1, … (m): the contour at even angles
over one turn, counter-clockwise from the heading. In a text file, rows of 8 numbers are a
trajectory in TUM's format, all others results of KITTI's tracking benchmark.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.measurements.tables import indices, read_table, refuse_other_times, refuse_rows
from stixel_cli.recordings.kitti_tables import numbers, read_labels, text_rows
from stixel_cli.recordings.times import unit_rotations

POSE, RATES = ("x", "y", "heading"), ("x_rate", "y_rate", "heading_rate")
STDS = tuple(f"std_{name}" for name in POSE + RATES)
VARIANCES, SIZE = ("var_xx", "var_xy", "var_yy"), ("length", "width")
RADII = tuple(f"radius_{number}" for number in range(720))

TABLES, TUM = (".csv", ".npz"), ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Suffixes of tables; columns of a trajectory."""

UPRIGHT = 0.8
"""Cosine between the z axes of a trajectory's poses and of its world, below which z is not up."""

Table = dict[str, np.ndarray]


def read_track(file: Path, track_id: int | None) -> Table:
    """The columns (n,) of the track in a file, n at least 1; `track_id` is that of KITTI's results.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    if file.name.endswith(TABLES):
        groups = (("k",), ("t",), RATES, STDS, VARIANCES, SIZE, *((name,) for name in RADII))
        table = read_table(file, POSE, groups)
    else:
        rows = [(row, words) for row, words in text_rows(file) if not words[0].startswith("#")]
        of_tum = bool(rows) and len(rows[0][1]) == len(TUM)
        table = _from_tum(file, rows) if of_tum else _from_kitti(file, track_id)
    if table.keys().isdisjoint(("k", "t", "frame")):
        raise UserError(f"{file}: the column k or t is missing")
    if len(table["x"]) == 0:
        raise UserError(f"{file}: has no rows, so there is no track")
    for name in table.keys() & {*SIZE, *RADII}:
        refuse_rows(file, table[name] <= 0.0, lambda _, name=name: f"{name} must be > 0")
    for name in table.keys() & {*STDS}:
        refuse_rows(file, table[name] < 0.0, lambda _, name=name: f"{name} must be >= 0")
    radii = [name for name in RADII if name in table]
    if radii and (len(radii) < 3 or radii[-1] != RADII[len(radii) - 1]):
        raise UserError(f"{file}: radius_0, radius_1, … must be three or more without a gap")
    return table


def _from_tum(file: Path, rows: list[tuple[int, list[str]]]) -> Table:
    values = np.array([numbers(file, row, words, len(TUM)) for row, words in rows])
    turns = unit_rotations(file, values[:, [7, 4, 5, 6]])
    if np.median(turns[:, 2, 2]) < UPRIGHT:
        raise UserError(f"{file}: z is not up: must be x y z qx qy qz qw (w last) with x ahead")
    heading = np.unwrap(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    return dict(zip(TUM, values.T, strict=True)) | {"heading": heading}


def _from_kitti(file: Path, track_id: int | None) -> Table:
    labels = read_labels(file)
    known = ", ".join(map(str, labels)) or "none"
    if track_id is None and len(labels) == 1:
        (track_id,) = labels
    if track_id not in labels:
        raise UserError(f"tracker.id: must be one of the tracks in {file}: {known}; got {track_id}")
    found = labels[track_id]
    x, _, y = found.places.T
    _, width, length = found.sizes.T
    columns = {"frame": found.frames, "x": x, "y": y, "heading": -found.yaws}
    return columns | {"length": length, "width": width}


def matched_rows(
    file: Path, table: Table, times: np.ndarray, near: np.ndarray, first_frame: int
) -> np.ndarray:
    """The row (K,) of each scan at `times` (K,) s, -1 for none.

    That of its k, or of its frame, `first_frame` that of the first scan; or the nearest in time, at
    most `near` (K,) s away.

    Raises:
        UserError: if a k is no scan or is given twice, is at another time, or no row matches.
    """
    rows = np.full(len(times), -1)
    if "frame" in table:
        k = table["frame"] - first_frame
        inside = np.flatnonzero((k >= 0) & (k < len(times)))
        rows[k[inside]] = inside
        if len(inside) == 0:
            raise UserError(f"{file}: the track has no frame from {first_frame} on")
    elif "k" in table:
        k = indices(file, "k", table["k"], len(times))
        refuse_rows(file, np.bincount(k)[k] > 1, lambda i: f"k = {k[i]} is given twice")
        if "t" in table:
            refuse_other_times(file, k, table["t"], times[k], near[k])
        rows[k] = np.arange(len(k))
    else:
        order = np.argsort(table["t"], kind="stable")
        t = table["t"][order]
        nearest = np.searchsorted(0.5 * (t[1:] + t[:-1]), times)
        rows = np.where(np.abs(t[nearest] - times) <= near, order[nearest], -1)
        if (rows < 0).all():
            raise UserError(
                f"{file}: no t within half an interval of a scan: t goes from {t[0]:.6g} to "
                f"{t[-1]:.6g} s, the scans from {times[0]:.6g} to {times[-1]:.6g} s"
            )
    return rows
