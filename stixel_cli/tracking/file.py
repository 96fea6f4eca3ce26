"""A track from a file: that of a tracker in any other program.

A table (`.csv`, `.npz`) like a run's `track.csv` has the columns x, y (m), heading (rad), and k or
t (s). It may have x_rate, y_rate, heading_rate (m/s, rad/s); std_x … std_heading_rate, or var_xx,
var_xy, var_yy (m²); length and width (m); and radius_0, radius_1, … (m): the contour at even angles
over one turn, counter-clockwise from the heading. In a text file, rows of 8 numbers are a
trajectory in TUM's format, all others results of KITTI's tracking benchmark.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import (
    STRAIGHT_AHEAD,
    rectangle,
    rotation,
    rotations,
    world_from_ego,
    world_from_target,
    wrap_angle,
)
from stixel_cli.measurements.scans import Scans
from stixel_cli.measurements.tables import indices, read_table, refuse_rows
from stixel_cli.measurements.units import seconds, unit_and_epoch
from stixel_cli.parameters import parameters
from stixel_cli.recordings.kitti_tables import numbers, read_labels, text_rows
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, contour_directions

POSE, RATES = ("x", "y", "heading"), ("x_rate", "y_rate", "heading_rate")
STDS = tuple(f"std_{name}" for name in POSE + RATES)
VARIANCES, SIZE = ("var_xx", "var_xy", "var_yy"), ("length", "width")
RADII = tuple(f"radius_{number}" for number in range(720))

TABLES, TUM = (".csv", ".npz"), ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Suffixes of tables; columns of a trajectory."""

Table = dict[str, np.ndarray]


@parameters
class FileTrackParameters:
    """The track of another program, from a file. This module describes the files.

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
    """The track in the file at the times of `scans`, which take rows as `matched_rows` states.

    A scan without a row keeps the previous estimate; before the first row, the first one. Missing
    rates are 0, and a missing size or contour is that of `prior`. Missing variances are 0, and the
    scores of consistency leave them out. No point is used, and `initial` is not read.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    table, rows = _of_scans(scans, tracker)
    held = np.maximum.accumulate(np.where(rows >= 0, np.arange(len(rows)), np.argmax(rows >= 0)))
    rows, count = rows[held], len(scans)
    means, covariances = np.zeros((count, 6)), np.zeros((count, 6, 6))
    means[:, :3] = _columns(table, POSE)[rows]
    if RATES[0] in table:
        means[:, 3:] = _columns(table, RATES)[rows]
    if STDS[0] in table:
        covariances[:, range(6), range(6)] = _columns(table, STDS)[rows] ** 2
    if VARIANCES[0] in table:
        xx, xy, yy = _columns(table, VARIANCES)[rows].T
        covariances[:, :2, :2] = np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0)
    if tracker.frame == "camera":
        sensors = scans.sensor_poses_world[held]
        means = np.array([_in_world(*one) for one in zip(means, sensors, strict=True)])
        turns = np.array([np.kron(np.eye(2), _turn(pose)) for pose in sensors])
        moving = np.ix_(range(count), (0, 1, 3, 4), (0, 1, 3, 4))
        covariances[moving] = turns @ covariances[moving] @ turns.swapaxes(1, 2)
    sizes = _columns(table, SIZE)[rows] if SIZE[0] in table else None
    radii = [name for name in RADII if name in table]
    if radii:
        _, directions = contour_directions(means[:, 2], len(radii))
        contours = means[:, None, :2] + _columns(table, radii)[rows][:, :, None] * directions
    else:
        boxes = np.tile([prior.length, prior.width], (count, 1)) if sizes is None else sizes
        contours = np.array(
            [world_from_target(rectangle(*boxes[k]), means[k, :3]) for k in range(count)]
        )
        arms = contours - means[:, None, :2]
        directions = arms / np.linalg.norm(arms, axis=2, keepdims=True)
    variances = np.einsum("kmi,kij,kmj->km", directions, covariances[:, :2, :2], directions)
    states = means, covariances
    shapes = contours, directions, np.sqrt(np.maximum(variances, 0.0))
    unused = [np.zeros(0, np.int64)] * count
    found = Track.of_scans(scans.times, states, shapes, unused, np.full(count, np.nan))
    return replace(found, box_sizes=sizes, uses_scans=False)


def _of_scans(scans: Scans, tracker: FileTrackParameters) -> tuple[Table, np.ndarray]:
    """The table of the file and its `matched_rows`; times since 1970 become those of the scans."""
    file = Path(tracker.path)
    table = read_track(file, tracker.id)
    t = table.get("t")
    if t is not None and scans.epoch is not None and unit_and_epoch(t, None)[1] is not None:
        table = table | {"t": seconds(file, t, None, scans.epoch)}
    return table, matched_rows(table, scans.times, tracker)


def _turn(sensor_pose: np.ndarray) -> np.ndarray:
    return rotation(sensor_pose[2] - STRAIGHT_AHEAD)


def _in_world(mean: np.ndarray, sensor_pose: np.ndarray) -> np.ndarray:
    """A state (6,) in the frame of a sensor at `sensor_pose` (3,) in the world."""
    place = world_from_ego(mean[:2], sensor_pose)
    heading = mean[2] + sensor_pose[2] - STRAIGHT_AHEAD
    return np.array([*place, heading, *_turn(sensor_pose) @ mean[3:5], mean[5]])


def _columns(table: Table, names: tuple[str, ...] | list[str]) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1)


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
    for name in table:
        if name in (*SIZE, *RADII):
            refuse_rows(file, table[name] <= 0.0, lambda _, name=name: f"{name} must be > 0")
        if name in STDS:
            refuse_rows(file, table[name] < 0.0, lambda _, name=name: f"{name} must be >= 0")
    radii = [name for name in RADII if name in table]
    if radii and (len(radii) < 3 or radii[-1] != RADII[len(radii) - 1]):
        raise UserError(f"{file}: radius_0, radius_1, … must be three or more without a gap")
    return table


def _from_tum(file: Path, rows: list[tuple[int, list[str]]]) -> Table:
    values = np.array([numbers(file, row, words, len(TUM)) for row, words in rows])
    table = dict(zip(TUM, values.T, strict=True))
    quaternions = values[:, [7, 4, 5, 6]]
    if not np.allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=0.01):
        raise UserError(f"{file}: the last four columns must be unit quaternions qx qy qz qw")
    turns = rotations(quaternions)
    if np.median(turns[:, 2, 2]) < UPRIGHT:
        first = rotations(values[:, 4:])
        if np.median(first[:, 2, 2]) > UPRIGHT:
            reason = "the quaternions are probably w first: must be qx qy qz qw"
        else:
            reason = "z is not up: the poses are probably those of a camera (x right, z ahead)"
        raise UserError(f"{file}: {reason}")
    return table | {"heading": np.unwrap(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))}


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


def matched_rows(table: Table, times: np.ndarray, tracker: FileTrackParameters) -> np.ndarray:
    """The row (K,) of each scan at `times` (K,) s, -1 for none: that of its k or frame, or the
    nearest in time, at most half an interval away.

    Raises:
        UserError: if a k is no scan or is given twice, is at another time, or no row matches.
    """
    file, count, near = Path(tracker.path), len(times), 0.5 * intervals(times) + 1e-9
    rows = np.full(count, -1)
    if "frame" in table:
        k = table["frame"] - tracker.first_frame
        inside = np.flatnonzero((k >= 0) & (k < count))
        rows[k[inside]] = inside
        if len(inside) == 0:
            raise UserError(f"{file}: the track has no frame from {tracker.first_frame} on")
        return rows
    if "k" in table:
        k = indices(file, "k", table["k"], count)
        refuse_rows(file, np.bincount(k)[k] > 1, lambda i: f"k = {k[i]} is given twice")
        if "t" in table:
            late = np.abs(table["t"] - times[k]) > near[k]
            refuse_rows(
                file,
                late,
                lambda i: f"t = {table['t'][i]:.6g} s, but k = {k[i]} is at {times[k[i]]:.6g} s",
            )
        rows[k] = np.arange(len(k))
        return rows
    order = np.argsort(table["t"], kind="stable")
    sorted_times = table["t"][order]
    after = np.clip(np.searchsorted(sorted_times, times), 1, max(len(order) - 1, 1))
    pair = np.minimum(np.stack([after - 1, after]), len(order) - 1)
    distance = np.abs(sorted_times[pair] - times)
    nearest = np.where(distance[0] <= distance[1], pair[0], pair[1])
    rows = np.where(distance.min(axis=0) <= near, order[nearest], -1)
    if (rows < 0).all():
        raise UserError(
            f"{file}: no t within half an interval of a scan: t goes from {sorted_times[0]:.6g} to "
            f"{sorted_times[-1]:.6g} s, the scans from {times[0]:.6g} to {times[-1]:.6g} s"
        )
    return rows


UPRIGHT = 0.95
"""Cosine of the greatest angle between a trajectory's z axis and up."""

LEAST_OFFSET, FAR = 0.001, 2.0
"""Of rows from scans, s; of places from the truth, m: less is no fault of the file."""


def track_doubts(
    tracker: FileTrackParameters, scans: Scans, track: Track, truth: np.ndarray
) -> list[str]:
    """What is probably wrong with the file of a track, one line each.

    `track` is that of the file, `truth` (K, 3) the true poses in the world, NaN where unknown.
    """
    table, rows = _of_scans(scans, tracker)
    given = rows >= 0
    doubts = []
    if not given.all():
        missing = f"{np.sum(~given)} of {len(rows)} scans have no row"
        doubts.append(f"{missing}: each keeps the previous estimate")
    if "t" in table:
        offset = float(np.median(table["t"][rows[given]] - scans.times[given]))
        if abs(offset) > LEAST_OFFSET:
            doubts.append(f"its times differ by {offset:+.3f} s (median) from those of the scans")
    if SIZE[0] in table and np.median(table["length"]) < np.median(table["width"]):
        doubts.append("length and width are probably exchanged")
    if np.abs(table["heading"]).max() > 4.0 * np.pi:
        doubts.append("the headings are probably in degrees: must be in radians")
    known = given & np.isfinite(truth).all(axis=1)
    true = truth[known]
    if known.any():
        sensors, distances = scans.sensor_poses_world[known], {}
        for order in ((0, 1, 2), (1, 0, 2)):
            means = np.pad(_columns(table, POSE)[rows[known]][:, order], ((0, 0), (0, 3)))
            moved = np.array([_in_world(*one) for one in zip(means, sensors, strict=True)])
            for frame, places in (("world", means), ("camera", moved)):
                distances[order, frame] = np.median(np.hypot(*(places[:, :2] - true[:, :2]).T))
        order, frame = min(distances, key=distances.get)
        far, near = distances[(0, 1, 2), tracker.frame], distances[order, frame]
        if far > max(FAR, 4.0 * near):
            faults = ["x and y (of KITTI: x and z) are exchanged"] * (order != (0, 1, 2))
            faults += [f"tracker.frame={frame} is right"] * (frame != tracker.frame)
            doubts.append(
                f"probably {' and '.join(faults)}: the median distance to the truth would be "
                f"{near:.2g} m instead of {far:.2g} m"
            )
        turned = np.degrees(np.median(np.abs(wrap_angle(track.means[known, 2] - true[:, 2]))))
        doubts += [
            f"the headings are probably off by {angle}°"
            for angle in (90, 180)
            if abs(turned - angle) < 30.0
        ]
    return [f"tracker.path: {Path(tracker.path)}: {doubt}" for doubt in doubts]
