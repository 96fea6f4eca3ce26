"""A track from a file: a table, a trajectory in TUM's format, or results of KITTI tracking.

A table (`.csv`, `.npz`) like a run's `track.csv` has the columns x, y (m), heading (rad), and k or
t (s). It may have x_rate, y_rate, heading_rate (m/s, rad/s); std_x … std_heading_rate, or var_xx,
var_xy, var_yy (m²); length and width (m); and radius_0, radius_1, … (m): the contour at even angles
over one turn, counter-clockwise from the heading. In a text file, rows of 8 numbers are a
trajectory in TUM's format, all others results of KITTI's tracking benchmark.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STATE, STRAIGHT_AHEAD, rectangle, rotations
from stixel_cli.measurements import tables
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.recordings.kitti_tables import numbers, read_labels, text_rows
from stixel_cli.recordings.times import unit_rotations
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, contour_directions, shift_variances

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


@parameters
class FileTrackParameters:
    """The track of another program, from a file.

    Attributes:
        path: the file: a table, a trajectory of TUM, or results of KITTI tracking; required.
        id: of the track in results of KITTI; null: the only one.
        first_frame: number of the frame at k = 0 in results of KITTI.
        frame: of the poses, x to the right and y ahead: `world`, of the sensor at k = 0, or
            `camera`, of the sensor at each k. Of KITTI's results, x and z are taken.
    """

    kind: Literal["file"]
    path: str | None
    id: Annotated[int, Ge(0)] | None
    first_frame: Annotated[int, Ge(0)]
    frame: Literal["world", "camera"]

    def check(self, source: Any) -> None:
        """Raise an error without a valid file, or for a `source` of other frames or targets."""
        if not self.path:
            raise ValueError("tracker.path: is missing: give the file of the track")
        if getattr(source, "target", None) == "auto":
            raise ValueError("tracker: file has one track: source.target must not be auto")
        frames = getattr(source, "frames", None) or f"{self.first_frame}:"
        start = int(frames.partition(":")[0])
        if "frame" in read_track(Path(self.path), self.id) and start != self.first_frame:
            raise ValueError(
                f"tracker.first_frame: must be {start}, where source.frames start, got "
                f"{self.first_frame}"
            )


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: FileTrackParameters
) -> Track:
    """The track in the file at the times of `scans`, which take rows as `rows_of_scans` states.

    A scan without a row keeps the previous estimate; before the first row, the first one. Missing
    rates are 0, and a missing size or contour is that of `prior`. Missing variances are 0, and the
    scores of consistency leave them out. No point is used, and `initial` is not read.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    count = len(scans)
    table = rows_of_scans(scans, tracker).reindex(range(count), method="ffill").bfill()
    means, covariances = states = states_of(table, scans, tracker.frame)
    sizes = table[SIZE].to_numpy() if SIZE[0] in table else None
    radii = table[table.columns.intersection(RADII)].to_numpy()
    if radii.size:
        _, directions = contour_directions(means[:, 2], radii.shape[1])
        contours = means[:, None, :2] + radii[:, :, None] * directions
    else:
        boxes = np.array([[prior.length, prior.width]]) if sizes is None else sizes
        corners = 0.5 * boxes[:, None] * rectangle(2.0, 2.0)
        contours = corners @ rotations(-means[:, 2]) + means[:, None, :2]
    unused, shapes = [np.zeros(0, np.int64)] * count, (contours, np.zeros(contours.shape[:2]))
    found = Track.of_scans(scans.times, states, shapes, unused, np.full(count, np.nan))
    std = np.sqrt(np.maximum(shift_variances(found.contour_directions, covariances), 0.0))
    return replace(found, contour_std=std, box_sizes=sizes, uses_scans=False)


def rows_of_scans(scans: Scans, tracker: FileTrackParameters) -> "DataFrame":
    """The rows of the file that belong to scans, at most one each, by scan in ascending order.

    The index is the scan. A row belongs to the scan of its k, or of its frame; without both, the
    row that is the nearest in time belongs to a scan, at most half an interval away. Times since
    1970 become those of the scans.

    Raises:
        UserError: if a k is no scan or is given twice, is at another time, or no row belongs.
    """
    file, times = Path(tracker.path), scans.times
    table, near = read_track(file, tracker.id), 0.5 * intervals(times) + 1e-9
    t = table["t"].to_numpy() if "t" in table else None
    if t is not None and scans.epoch is not None and tables.unit_and_epoch(t, None)[1] is not None:
        table["t"] = t = tables.seconds(file, t, None, scans.epoch)
    if "frame" in table:
        k = table["frame"] - tracker.first_frame
        chosen = (k >= 0) & (k < len(times))
        if not chosen.any():
            raise UserError(f"{file}: the track has no frame from {tracker.first_frame} on")
        return table[chosen].set_index(k[chosen])
    if "k" in table:
        k = tables.indices(file, "k", table["k"].to_numpy(), len(times))
        tables.refuse_rows(file, np.bincount(k)[k] > 1, lambda i: f"k = {k[i]} is given twice")
        if t is not None:
            tables.refuse_other_times(file, k, t, times[k], near[k])
        return table.set_index(k).sort_index()
    order = np.argsort(t, kind="stable")
    t = t[order]
    nearest = np.searchsorted(0.5 * (t[1:] + t[:-1]), times)
    (k,) = np.nonzero(np.abs(t[nearest] - times) <= near)
    if not len(k):
        raise UserError(
            f"{file}: no t within half an interval of a scan: t goes from {t[0]:.6g} to "
            f"{t[-1]:.6g} s, the scans from {times[0]:.6g} to {times[-1]:.6g} s"
        )
    return table.iloc[order[nearest[k]]].set_index(k)


def states_of(table: "DataFrame", scans: Scans, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Means (n, 6) and covariances (n, 6, 6) in the world of the n rows of a table.

    Its index is the scan, and its poses are in the `frame`.
    """
    means, covariances = np.zeros((len(table), 6)), np.zeros((len(table), 6, 6))
    means[:, :3] = table[POSE]
    if RATES[0] in table:
        means[:, 3:] = table[RATES]
    if STDS[0] in table:
        covariances[:, range(6), range(6)] = table[STDS] ** 2
    if VARIANCES[0] in table:
        xx, xy, yy = VARIANCES
        covariances[:, [0, 0, 1, 1], [0, 1, 0, 1]] = table[[xx, xy, xy, yy]]
    if frame == "camera":
        sensors = scans.sensor_poses_world[table.index]
        turns = np.tile(np.eye(6), (len(table), 1, 1))
        turns[:, :2, :2] = turns[:, 3:5, 3:5] = rotations(sensors[:, 2] - STRAIGHT_AHEAD)
        means = (turns @ means[:, :, None])[:, :, 0]
        means[:, :3] += sensors - [0.0, 0.0, STRAIGHT_AHEAD]
        covariances = turns @ covariances @ turns.swapaxes(1, 2)
    return means, covariances


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
