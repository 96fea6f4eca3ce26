"""A log of Argoverse 2's sensor data set: calibration, ego poses and labels.

Wilson et al. 2021, *Argoverse 2: next generation datasets for self-driving perception and
forecasting*. Frames: the city, the ego car (x ahead, y to the left, z up), a camera (x right, y
down, z forward). The images are undistorted but not rectified. Labels are at the times of the
lidar, in the ego car's frame at that time, and images at other times: here a label moves on a
straight line from one time to the next.

A replayed motion (`replay`) needs no camera: it has the labels all round, at their own times.
"""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.border.files import read_bytes, remembered
from stixel_cli.errors import UserError, located, printable
from stixel_cli.recordings.kitti_tables import GREATEST, MOST_ROWS, seen_box, tracks_of
from stixel_cli.recordings.times import GREATEST_GAP, poses_at, unit_rotations
from stixel_cli.recordings.types import Calibration, Recording, Rectification, Tables, Tracks
from stixel_cli.scene.parameters import CLASS_ROWS

if TYPE_CHECKING:
    import pyarrow

ANNOTATIONS, CITY = "annotations.feather", "city_SE3_egovehicle.feather"
SENSORS = "calibration/egovehicle_SE3_sensor.feather"
INTRINSICS = "calibration/intrinsics.feather"
TIME = "timestamp_ns"
CAMERAS = ("stereo_front_left", "stereo_front_right")

KITTI_TYPES = {row.argoverse_category: row.kitti_types[0] for row in CLASS_ROWS.values()}
"""By category."""

CYCLES = dict.fromkeys(("BICYCLE", "MOTORCYCLE"), "Cyclist")
"""They move as a cyclist, but their boxes are without the rider: only a motion may have them."""

LEVEL_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation of a camera that looks straight ahead, in the ego car's frame."""

HIDDEN = 0.1
"""Share of a label's columns that a nearer label may cover before it is occluded."""

TURN = ("qw", "qx", "qy", "qz")
PLACE = ("tx_m", "ty_m", "tz_m")
SIZE = ("height_m", "width_m", "length_m")

LARGEST = 16 * 2**20
"""Bytes of a Feather file (version 2: Arrow's IPC format)."""


def read_calibration(intrinsics: Path, sensors: Path) -> Calibration:
    """The rectified pair of the stereo cameras, whose files are free of distortion but not aligned.

    The axes are those of Fusiello, Trucco, Verri 2000, *A compact algorithm for rectification of
    stereo pairs*: x along the baseline, z between both optical axes. The images are cut to what
    both cameras see of them at infinity.
    """
    names = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px")
    rows = _of_cameras(intrinsics, names)
    width, height = rows[0, 4:].astype(int).tolist()
    if (rows[1, 4:] != rows[0, 4:]).any() or (rows <= 0.0).any():
        raise UserError(f"{intrinsics}: {' and '.join(CAMERAS)} must have one size, > 0")
    turns, _, aligned, baseline = _mounting(sensors)
    focal_length = float(rows[:, :2].mean())
    corners = np.array([[u, v, 1.0] for v in (0, height - 1) for u in (0, width - 1)])
    rays, low, high = [], np.full(2, -np.inf), np.full(2, np.inf)
    for (fu, fv, cu, cv, *_), turn in zip(rows, turns, strict=True):
        to_ray = np.linalg.inv([[fu, 0.0, cu], [0.0, fv, cv], [0.0, 0.0, 1.0]])
        rays.append(aligned.T @ turn @ to_ray)
        seen = corners @ rays[-1].T
        if (seen[:, 2] <= 0.0).any():
            raise UserError(f"{sensors}: {' and '.join(CAMERAS)} do not look the same way")
        u, v = focal_length * seen[:, 0] / seen[:, 2], focal_length * seen[:, 1] / seen[:, 2]
        low = np.maximum(low, [max(u[0], u[2]), max(v[0], v[1])])
        high = np.minimum(high, [min(u[1], u[3]), min(v[2], v[3])])
    first = np.ceil(low)
    size = np.floor(high) - first + 1.0
    if (size < 0.5 * np.array([width, height])).any():
        raise UserError(f"{sensors}: {' and '.join(CAMERAS)} do not look the same way")
    matrix = np.diag([focal_length, focal_length, 1.0])
    matrix[:2, 2] = -first
    left, right = (tuple(map(float, (matrix @ ray).ravel())) for ray in rays)
    rectification = Rectification(left, right, (int(size[0]), int(size[1])), (width, height))
    lens = focal_length, focal_length, float(-first[0]), float(-first[1])
    return Calibration(*lens, baseline, None, rectification=rectification)


def read_poses(times: tuple[int, ...], city: Path, sensors: Path | None = None) -> np.ndarray:
    """Poses (n, 3, 4) of the rectified left camera in the city at `times`, m.

    Without the cameras' mounting, `sensors`, of a camera at the origin of the ego car's frame (on
    the road, below the middle of the rear axle) that looks straight ahead.
    """
    turns, places = _ego_poses(city, np.array(times, dtype=np.int64))
    place, aligned = np.zeros(3), LEVEL_CAMERA
    if sensors is not None:
        _, (place, _), aligned, _ = _mounting(sensors)
    return np.concatenate([turns @ aligned, (turns @ place + places)[:, :, None]], axis=2)


@remembered
def read_labels(
    times: tuple[int, ...],
    annotations: Path,
    city: Path,
    sensors: Path | None = None,
    intrinsics: Path | None = None,
) -> Tracks:
    """The labels of each target by its track_uuid, in the frames at `times` that show it.

    A label is truncated if a corner is outside of the image, and occluded if no point of the lidar
    is inside, or a nearer label covers more than `HIDDEN` of its columns. Without `intrinsics` all
    frames have it, without a box in an image, and `CYCLES` are cyclists.
    """
    numbers = (TIME, "num_interior_pts", *SIZE, *TURN, *PLACE)
    table = read_columns(annotations, numbers, ("track_uuid", "category"))
    sizes = _stacked(table, SIZE)
    wrong = np.flatnonzero((sizes <= 0.0).any(axis=1))
    if len(wrong):
        raise UserError(f"{annotations}: row {wrong[0] + 1}: height, width and length must be > 0")
    calibration = None if intrinsics is None else read_calibration(intrinsics, sensors)
    types = KITTI_TYPES if calibration else KITTI_TYPES | CYCLES
    stamps, at = np.unique(table[TIME], return_inverse=True)
    ego_turns, ego_places = (values[at] for values in _ego_poses(city, stamps))
    turns = ego_turns @ unit_rotations(annotations, _stacked(table, TURN))
    places = np.einsum("nij,nj->ni", ego_turns, _stacked(table, PLACE)) + ego_places
    places -= 0.5 * sizes[:, :1] * turns[:, :, 2]
    cameras = read_poses(times, city, sensors)
    labels = []
    for track in np.unique(table["track_uuid"]).tolist():
        of_track = np.flatnonzero(table["track_uuid"] == track)
        of_track = of_track[np.argsort(table[TIME][of_track], kind="stable")]
        at_times = table[TIME][of_track]
        if (np.diff(at_times) == 0).any():
            raise UserError(f"{annotations}: track {printable(track)} is labelled twice at a time")
        category = str(table["category"][of_track[0]])
        for frame, i, share in _between(at_times, times):
            before, after = of_track[i], of_track[min(i + 1, len(of_track) - 1)]
            place = (1.0 - share) * places[before] + share * places[after]
            ahead = (1.0 - share) * turns[before, :, 0] + share * turns[after, :, 0]
            nearest = before if share < 0.5 else after
            # KITTI's rotation_y is that of the heading in the camera's frame.
            turn, centre = cameras[frame][:, :3], cameras[frame][:, 3]
            x, _, z = turn.T @ ahead
            pose = turn.T @ (place - centre), float(np.arctan2(-z, x))
            seen = np.zeros(4), False
            if calibration is not None:
                seen = seen_box(*pose, sizes[nearest], calibration, calibration.rectification.size)
            if seen is not None:
                box, truncated = seen
                empty = table["num_interior_pts"][nearest] <= 0
                # KITTI's state of occlusion 3: unknown.
                values = [float(truncated), 3.0 * empty, *box, *sizes[nearest], *pose[0], pose[1]]
                labels.append([annotations, types.get(category, category), frame, track, *values])
    _mark_hidden(labels)
    return tracks_of(labels)


def _between(stamps: np.ndarray, times: tuple[int, ...]) -> Iterator[tuple[int, int, float]]:
    """Frame, index i and share of the way from stamp i to i + 1, where that way is no gap.

    The `stamps` (n,), increasing, and the `times` of all frames are in ns.
    """
    before = np.searchsorted(stamps, times, side="right") - 1
    for frame, (i, time) in enumerate(zip(before, times, strict=True)):
        if i >= 0 and stamps[i] == time:
            yield frame, i, 0.0
        elif 0 <= i < len(stamps) - 1 and stamps[i + 1] - stamps[i] <= GREATEST_GAP:
            yield frame, i, float(time - stamps[i]) / float(stamps[i + 1] - stamps[i])


def _mark_hidden(labels: list[list]) -> None:
    """Mark as occluded, in place, what nearer labels of the same frame cover."""
    by_frame: dict[int, list[list]] = {}
    for label in labels:
        by_frame.setdefault(label[2], []).append(label)
    for frame in by_frame.values():
        left, top, right, bottom, depth = np.array([[*label[6:10], label[15]] for label in frame]).T
        nearer = (depth[None] < depth[:, None]) & (top[None] < bottom[:, None])
        nearer &= bottom[None] > top[:, None]
        shared = np.minimum(right[None], right[:, None]) - np.maximum(left[None], left[:, None])
        for label, covered in zip(frame, np.where(nearer, shared, 0.0), strict=True):
            if covered.max() > HIDDEN * (label[8] - label[6]):
                label[5] = 1.0


def _mounting(sensors: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Rotations (2, 3, 3) and places (2, 3) m of both cameras in the ego car's frame, the rotation
    (3, 3) of the rectified pair in it, and the baseline, m."""
    rows = _of_cameras(sensors, (*TURN, *PLACE))
    turns = unit_rotations(sensors, rows[:, :4])
    across = rows[1, 4:] - rows[0, 4:]
    baseline = float(np.linalg.norm(across))
    if baseline < 0.001 or across @ turns[0, :, 0] < 0.9 * baseline:
        raise UserError(f"{sensors}: {CAMERAS[1]} is not to the right of {CAMERAS[0]}")
    right = across / baseline
    ahead = turns[:, :, 2].sum(axis=0)
    ahead -= ahead @ right * right
    ahead /= np.linalg.norm(ahead)
    return turns, rows[:, 4:], np.stack([right, np.cross(ahead, right), ahead], axis=1), baseline


def _of_cameras(file: Path, names: tuple[str, ...]) -> np.ndarray:
    """The columns (2, n) of the left and the right camera."""
    table = read_columns(file, names, ("sensor_name",))
    values = []
    for camera in CAMERAS:
        rows = np.flatnonzero(table["sensor_name"] == camera)
        if len(rows) != 1:
            raise UserError(f"{file}: must have one row of {camera}, got {len(rows)}")
        values.append([float(table[name][rows[0]]) for name in names])
    return np.array(values)


def _ego_poses(city: Path, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and places (n, 3) m of the ego car in the city at `times` (n,) ns."""
    table = read_columns(city, (TIME, *TURN, *PLACE))
    turns, places = _stacked(table, TURN), _stacked(table, PLACE)
    return poses_at(city, times, table[TIME], turns, places)


def _stacked(table: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1)


def find_motion(root: Path) -> Recording:
    """All labels of a log and the motion of its ego car, which need no images.

    The frames are those of the labels. With the mounting of the cameras the camera is the rectified
    left one, without it one at the origin of the ego car's frame.
    """
    annotations, sensors = root / ANNOTATIONS, root / SENSORS
    poses = (root / CITY, *([sensors] if sensors.is_file() else []))
    times = tuple(np.unique(read_columns(annotations, (TIME,))[TIME]).tolist())
    return Recording(
        layout="argoverse",
        frames=range(len(times)),
        tables=Tables("argoverse", times),
        pose_files=poses,
        label_files=(annotations, *poses),
    )


def read_columns(
    file: Path, numbers: tuple[str, ...], words: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Columns by their names: `numbers` as (n,) float64 or int64, `words` as (n,) objects.

    UserError if the file is missing, not valid or too large, pyarrow is not installed, a column is
    missing or of another type, or a number is too large.
    """
    data = read_bytes(file, LARGEST)
    needs = "source=argoverse needs pyarrow: pip install 'stixel[argoverse]'"
    with located(needs, caught=ImportError):
        import pyarrow
        from pyarrow.dataset import IpcFileFormat
    try:
        content = IpcFileFormat().make_fragment(pyarrow.BufferReader(data))
        # The heads of the batches have the numbers of rows: nothing is unpacked for them.
        if content.count_rows() > MOST_ROWS:
            raise UserError(f"{file}: more than {MOST_ROWS} rows")
        table = content.to_table(use_threads=False)
        table.validate(full=True)
    except (pyarrow.ArrowException, OSError, ValueError) as fault:
        cause = str(fault).splitlines()[0]
        raise UserError(f"{file}: not a valid Feather file: {cause}") from None
    found = {name: _column(file, table, name, "numbers") for name in numbers}
    for name, values in found.items():
        if values.dtype == float and not (np.abs(values) <= GREATEST).all():
            raise UserError(f"{file}: the column {name} must be within ±{GREATEST:g} in each row")
    return found | {name: _column(file, table, name, "text") for name in words}


def _column(file: Path, table: "pyarrow.Table", name: str, kind: str) -> np.ndarray:
    """A column of `numbers` (int64 or float64) or of `text` (objects), without gaps."""
    from pyarrow import ArrowException, types

    if name not in table.column_names:
        raise UserError(f"{file}: the column {name} is missing")
    column = table.column(name)
    wanted = "int64" if types.is_integer(column.type) else "float64"
    with suppress(ArrowException):
        if not column.null_count:
            return column.cast(wanted if kind == "numbers" else "string").to_numpy()
    raise UserError(f"{file}: the column {name} must be of {kind} in each row")
