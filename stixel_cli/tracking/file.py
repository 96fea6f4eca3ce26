"""A track from a file: that of a tracker in any other program, see `tracking.track_table`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rectangle, rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.measurements.tables import seconds, unit_and_epoch
from stixel_cli.parameters import parameters
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import (
    InitialState,
    Track,
    contour_directions,
    directions_of,
    shift_variances,
)
from stixel_cli.tracking.track_table import (
    POSE,
    RADII,
    RATES,
    SIZE,
    STDS,
    VARIANCES,
    Table,
    matched_rows,
    read_track,
)

FRAMES = ("world", "camera")


@parameters
class FileTrackParameters:
    """The track of another program, from a file. `tracking.track_table` describes the files.

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
    sensors = scans.sensor_poses_world[held]
    means, covariances = states = _states(table, rows, sensors, tracker.frame)
    sizes = _columns(table, SIZE)[rows] if SIZE[0] in table else None
    radii = [name for name in RADII if name in table]
    if radii:
        _, directions = contour_directions(means[:, 2], len(radii))
        contours = means[:, None, :2] + _columns(table, radii)[rows][:, :, None] * directions
    else:
        boxes = np.array([[prior.length, prior.width]]) if sizes is None else sizes
        corners = 0.5 * boxes[:, None] * rectangle(2.0, 2.0)
        contours = corners @ _turns(-means[:, 2]) + means[:, None, :2]
        directions = directions_of(contours, means)
    std = np.sqrt(np.maximum(shift_variances(directions, covariances), 0.0))
    unused = [np.zeros(0, np.int64)] * count
    shapes = contours, directions, std
    found = Track.of_scans(scans.times, states, shapes, unused, np.full(count, np.nan))
    return replace(found, box_sizes=sizes, uses_scans=False)


def _of_scans(scans: Scans, tracker: FileTrackParameters) -> tuple[Table, np.ndarray]:
    """The table of the file and its `matched_rows`; times since 1970 become those of the scans."""
    file = Path(tracker.path)
    table = read_track(file, tracker.id)
    t = table.get("t")
    if t is not None and scans.epoch is not None and unit_and_epoch(t, None)[1] is not None:
        table = table | {"t": seconds(file, t, None, scans.epoch)}
    near = 0.5 * intervals(scans.times) + 1e-9
    return table, matched_rows(file, table, scans.times, near, tracker.first_frame)


def _states(
    table: Table, rows: np.ndarray, sensors: np.ndarray, frame: str
) -> tuple[np.ndarray, np.ndarray]:
    """Means (n, 6) and covariances (n, 6, 6) in the world of `rows` (n,) of the table.

    Its poses are in the `frame`; the sensor is at `sensors` (n, 3) in the world.
    """
    means, covariances = np.zeros((len(rows), 6)), np.zeros((len(rows), 6, 6))
    means[:, :3] = _columns(table, POSE)[rows]
    if RATES[0] in table:
        means[:, 3:] = _columns(table, RATES)[rows]
    if STDS[0] in table:
        covariances[:, range(6), range(6)] = _columns(table, STDS)[rows] ** 2
    if VARIANCES[0] in table:
        covariances[:, [0, 0, 1, 1], [0, 1, 0, 1]] = _columns(table, VARIANCES)[rows][
            :, [0, 1, 1, 2]
        ]
    if frame == "camera":
        turns = np.tile(np.eye(6), (len(rows), 1, 1))
        turns[:, :2, :2] = turns[:, 3:5, 3:5] = _turns(sensors[:, 2] - STRAIGHT_AHEAD)
        means = (turns @ means[:, :, None])[:, :, 0]
        means[:, :3] += sensors - [0.0, 0.0, STRAIGHT_AHEAD]
        covariances = turns @ covariances @ turns.swapaxes(1, 2)
    return means, covariances


def _turns(angles: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 2, 2) by `angles` (n,) rad."""
    return np.moveaxis(rotation(angles), -1, 0)


def _columns(table: Table, names: tuple[str, ...] | list[str]) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1)


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
    if known.any():
        distances = {}
        for name, columns in (
            ("as they are", table),
            ("exchanged", table | {"x": table["y"], "y": table["x"]}),
        ):
            for frame in FRAMES:
                sensors = scans.sensor_poses_world[known]
                means, _ = _states(columns, rows[known], sensors, frame)
                away = means[:, :2] - truth[known, :2]
                distances[name, frame] = float(np.median(np.hypot(*away.T)))
        far, (name, frame) = (
            distances["as they are", tracker.frame],
            min(distances, key=distances.get),
        )
        near = distances[name, frame]
        if far > max(FAR, 4.0 * near):
            doubts.append(
                f"with x and y (of KITTI: x and z) {name} and tracker.frame={frame} the median "
                f"distance to the truth would be {near:.2g} m instead of {far:.2g} m"
            )
        turned = wrap_angle(track.means[known, 2] - truth[known, 2])
        angle = 90 * round(np.degrees(np.median(np.abs(turned))) / 90)
        if angle:
            doubts.append(f"the headings are probably off by {angle}°")
    return [f"tracker.path: {Path(tracker.path)}: {doubt}" for doubt in doubts]
