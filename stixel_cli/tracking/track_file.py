"""The file of a track: a table, a trajectory in TUM's format, or results of KITTI tracking.

A table (`.csv`, `.npz`) like a run's `track.csv` has the columns x, y (m), heading (rad), and k or
t (s). It may have x_rate, y_rate, heading_rate (m/s, rad/s); std_x … std_heading_rate, or var_xx,
var_xy, var_yy (m²); length and width (m); and radius_0, radius_1, … (m): the contour at even angles
over one turn, counter-clockwise from the heading. In a text file, rows of 8 numbers are a
trajectory in TUM's format, all others results of KITTI's tracking benchmark.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STATE
from stixel_cli.measurements import tables
from stixel_cli.recordings.kitti_tables import numbers, read_labels, text_rows
from stixel_cli.recordings.times import unit_rotations

if TYPE_CHECKING:
    from pandas import DataFrame

POSE, RATES = [*STATE[:3]], [*STATE[3:]]
STDS = [f"std_{name}" for name in STATE]
VARIANCES, SIZE = ["var_xx", "var_xy", "var_yy"], ["length", "width"]
RADII = [f"radius_{number}" for number in range(720)]

TABLES, TUM = (".csv", ".npz"), ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Suffixes of tables; columns of a trajectory."""

UPRIGHT = 0.8
"""Cosine between the z axes of a trajectory's poses and of its world, below which z is not up."""


def read_track(file: Path, track_id: int | None) -> "DataFrame":
    """The track in a file, one row or more; `track_id` is that of KITTI's results.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    from pandas import DataFrame

    if file.name.endswith(TABLES):
        groups = (["k"], ["t"], RATES, STDS, VARIANCES, SIZE, *([name] for name in RADII))
        columns = tables.read_table(file, POSE, groups)
    else:
        rows = [(row, words) for row, words in text_rows(file) if not words[0].startswith("#")]
        of_tum = bool(rows) and len(rows[0][1]) == len(TUM)
        columns = _from_tum(file, rows) if of_tum else _from_kitti(file, track_id)
    if columns.keys().isdisjoint(("k", "t", "frame")):
        raise UserError(f"{file}: the column k or t is missing")
    if len(columns["x"]) == 0:
        raise UserError(f"{file}: has no rows, so there is no track")
    for name in columns.keys() & {*SIZE, *RADII}:
        tables.refuse_rows(file, columns[name] <= 0.0, lambda _, name=name: f"{name} must be > 0")
    for name in columns.keys() & {*STDS}:
        tables.refuse_rows(file, columns[name] < 0.0, lambda _, name=name: f"{name} must be >= 0")
    radii = [name for name in RADII if name in columns]
    if radii and (len(radii) < 3 or radii[-1] != RADII[len(radii) - 1]):
        raise UserError(f"{file}: radius_0, radius_1, … must be three or more without a gap")
    return DataFrame(columns)


def _from_tum(file: Path, rows: list[tuple[int, list[str]]]) -> dict[str, np.ndarray]:
    values = np.array([numbers(file, row, words, len(TUM)) for row, words in rows])
    turns = unit_rotations(file, values[:, [7, 4, 5, 6]])
    if np.median(turns[:, 2, 2]) < UPRIGHT:
        raise UserError(f"{file}: z is not up: must be x y z qx qy qz qw (w last) with x ahead")
    heading = np.unwrap(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    return dict(zip(TUM, values.T, strict=True)) | {"heading": heading}


def _from_kitti(file: Path, track_id: int | None) -> dict[str, np.ndarray]:
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
