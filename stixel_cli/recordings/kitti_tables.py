"""KITTI's files: calibration, ego poses and labels, of its benchmarks and of its sensors.

Geiger, Lenz, Stiller, Urtasun 2013, *Vision meets robotics: the KITTI dataset*. Calibration: rows
`P2: 12 numbers`, the 3 × 4 projections of the cameras, (4); the odometry benchmark may leave out
the names, its rows are P0, P1, … in order. Poses: one row per frame, the 3 × 4 matrix of the left
camera's pose, row by row. Labels: one row per frame and object with frame, track id, type,
truncated, occluded, alpha, box in the left colour image (left, top, right, bottom, px), size
(height, width, length, m), place of the bottom's centre (x, y, z, m, in the frame of camera 0),
rotation_y (rad), https://www.cvlibs.net/datasets/kitti/eval_tracking.php. Those of the object
benchmark have no frame and no track id, and a share of truncation: they are of frame 0, and the
track id is the number of the row, from 0. Result files have a score in one more column.

Of the sensors, as `convertOxtsToPose` and `readTracklets` of the devkit read them: packets of the
GPS/IMU (oxts), of the tracking benchmark or of raw drives, rows of 30 numbers that begin with
latitude and longitude (degrees), altitude (m), roll, pitch and yaw (rad); and the labels of raw
drives, `tracklet_labels.xml`: the centre of a box's bottom (m) and rz, the heading from x (rad), in
the frame of the velodyne. Both frames have x ahead, y to the left, z up.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path

import numpy as np

from stixel_cli.border.files import read_text, read_xml, remembered
from stixel_cli.errors import UserError, printable
from stixel_cli.geometry.pose import rectangle
from stixel_cli.recordings.types import Calibration, Labels, Tables, Tracks

MOST_ROWS = 1_000_000

GREATEST = 1e9
"""Greatest absolute value of a number, in its unit: products of larger ones overflow."""


def root_of(folder: Path, *contents: str) -> Path:
    """The folder that has one of the `contents`: the folder itself, or else its `training`."""
    inner = folder / "training"
    has_contents = any((folder / name).exists() for name in contents)
    return inner if inner.is_dir() and not has_contents else folder


def clip_poses(root: Path, name: str) -> tuple[Tables, tuple[Path, ...]]:
    """How the ego poses of a clip of the tracking benchmark are written, and their files."""
    own = root / "ego_poses" / f"{name}.txt"
    if own.is_file():
        return Tables(), (own,)
    calibration, packets = (root / kind / f"{name}.txt" for kind in ("calib", "oxts"))
    return Tables("kitti_oxts"), (calibration, calibration, calibration, packets)


def text_rows(file: Path) -> list[tuple[int, list[str]]]:
    """Number (from 1) and words of each row that is not empty."""
    lines = read_text(file).splitlines()
    if len(lines) > MOST_ROWS:
        raise UserError(f"{file}: more than {MOST_ROWS} rows")
    return [(i, line.split()) for i, line in enumerate(lines, 1) if line.strip()]


def numbers(file: Path, row: int, words: list[str], needed: int | None = None) -> list[float]:
    """The words of a row, as many as `needed`, as finite numbers within ±`GREATEST`."""
    check_columns(file, row, words, needed or len(words))
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            raise UserError(f"{file}: row {row}: {printable(word)!r} is not a number") from None
        if not abs(value) <= GREATEST:
            raise UserError(f"{file}: row {row}: {printable(word)} must be within ±{GREATEST:g}")
        values.append(value)
    return values


def named_numbers(file: Path, count: int, *names: str) -> list[float]:
    """The `count` numbers in the first row with one of these names, such as `T: 1 2 3`.

    `T=[1 2; 3]` is read, too. UserError without such a row.
    """
    for row, words in text_rows(file):
        name, *values = re.sub(r"[=\[\];,]", " ", " ".join(words)).split() or [""]
        if name.removesuffix(":") in names:
            return numbers(file, row, values, count)
    raise UserError(f"{file}: {' or '.join(names)} is missing")


def check_columns(file: Path, row: int, words: list[str], needed: int) -> None:
    """Raise UserError unless the row has `needed` columns."""
    if len(words) != needed:
        raise UserError(f"{file}: row {row}: {needed} columns are needed, got {len(words)}")


CAMERA_HEIGHT = 1.65
"""Of KITTI's cameras above the road, m (Geiger et al. 2013, figure 3)."""


PAIRS = ("P2", "P3"), ("P_rect_02", "P_rect_03"), ("P0", "P1")
"""Names of the colour cameras, in either kind of file, and of the grey ones."""


def read_calibration(file: Path, *pairs: tuple[str, str]) -> Calibration:
    """The calibration of the first of the `pairs` of cameras, such as `P2` and `P3`, in a file."""
    projections: dict[str, np.ndarray] = {}
    unnamed = count()
    for row, words in text_rows(file):
        name = words[0].removesuffix(":")
        if name[:1].isalpha() and name.lower() not in ("nan", "inf"):
            words = words[1:]
        else:
            name = f"P{next(unnamed)}"
        # Other rows, such as Tr_velo_to_cam, are not needed.
        if re.fullmatch(r"P(_rect_)?\d+", name):
            projections[name] = np.reshape(numbers(file, row, words, 12), (3, 4))
    left, right = next((pair for pair in pairs if {*pair} <= projections.keys()), (None, None))
    if left is None:
        names = ", or ".join(" and ".join(pair) for pair in pairs)
        raise UserError(f"{file}: the projections {names} are missing")
    pair = rectified_pair(file, (left, right), (projections[left], projections[right]))
    return replace(pair, camera_height=CAMERA_HEIGHT)


def rectified_pair(
    file: Path | str, names: Sequence[str], projections: Sequence[np.ndarray]
) -> Calibration:
    """The calibration in the projections (3, 4) of a left and a right camera."""
    (left, right), (first, second) = names, projections
    for name, matrix in ((left, first), (right, second)):
        if not (matrix[0, 0] > 0 and matrix[1, 1] > 0) or abs(matrix[2, 2] - 1.0) > 1e-6:
            raise UserError(f"{file}: {name} is not a camera's projection")
    differs = np.abs(first[:, :3] - second[:, :3]) > 1e-3
    # The columns of the principal points may differ, as `rig.principal_u_right`.
    other_column, differs[0, 2] = bool(differs[0, 2]), False
    if differs.any():
        raise UserError(f"{file}: {left} and {right} are not rectified to one camera matrix")
    # P = K [I | t]: t moves points from the labels' frame into the camera's.
    shifts = [np.linalg.solve(matrix[:, :3], matrix[:, 3]) for matrix in (first, second)]
    baseline = float(shifts[0][0] - shifts[1][0]) + 0.0
    check_baseline(file, baseline, left, right)
    return Calibration(
        focal_length=float(first[0, 0]),
        focal_length_v=float(first[1, 1]),
        principal_u=float(first[0, 2]),
        principal_v=float(first[1, 2]),
        baseline=baseline,
        camera_height=None,
        principal_u_right=float(second[0, 2]) if other_column else None,
        left_camera=tuple(float(-value) for value in shifts[0]),
    )


def check_baseline(file: Path | str, baseline: float, left: str, right: str) -> None:
    """Raise UserError if the `baseline` from the camera `left` to `right`, m, cannot be one."""
    if not 0.001 <= baseline <= 5.0:
        apart = f"{right} is {baseline:.4g} m to the right of {left}"
        unit = "; is it in mm?" if baseline > 5.0 else ""
        raise UserError(f"{file}: no baseline: {apart}, must be 0.001 to 5 m{unit}")


COLUMNS = 17
OBJECT_COLUMNS = 15


@remembered
def read_labels(file: Path) -> Tracks:
    """The labels of each target by its track id; regions of the type `DontCare` are left out."""
    labels, texts = [], text_rows(file)
    of_object = bool(texts) and len(texts[0][1]) in (OBJECT_COLUMNS, OBJECT_COLUMNS + 1)
    columns = OBJECT_COLUMNS if of_object else COLUMNS
    for row, words in texts:
        check_columns(file, row, words[:columns] if len(words) == columns + 1 else words, columns)
        frame, track, kind, *others = ["0", str(row - 1), *words] if of_object else words
        if kind != "DontCare":
            values = numbers(file, row, [frame, track, *others[:2], *others[3:14]])
            labels.append((f"{file}: row {row}", kind, *values))
    return tracks_of(labels)


def tracks_of(labels: Iterable[tuple]) -> Tracks:
    """The labels of each target by its track id.

    Of each label: its place in the file, for errors; its type; and KITTI's columns but for that and
    alpha: frame, track id (a number or a name), state of truncation, …. UserError if a number of a
    frame or track or a size is not valid, or a track has two labels in a frame, or two types.
    """
    rows: dict[int | str, dict[int, tuple]] = {}
    kinds: dict[int | str, str] = {}
    for place, kind, frame, track, *values in labels:
        if any(n < 0 or n != int(n) for n in (frame, track) if not isinstance(n, str)):
            raise UserError(f"{place}: frame and track id must be whole numbers ≥ 0")
        frame, track = int(frame), track if isinstance(track, str) else int(track)
        if frame in rows.setdefault(track, {}):
            raise UserError(f"{place}: track {track} is labelled twice in frame {frame}")
        if min(values[6:9]) <= 0.0:
            raise UserError(f"{place}: height, width and length must be > 0")
        kind, before = printable(kind), kinds.setdefault(track, printable(kind))
        if before != kind:
            raise UserError(f"{place}: track {track} is a {kind}, but was a {before} before")
        rows[track][frame] = frame, *values
    tracks = {}
    for track, by_frame in sorted(rows.items()):
        values = np.array([by_frame[frame] for frame in sorted(by_frame)])
        tracks[track] = Labels(
            frames=values[:, 0].astype(np.int64),
            boxes=values[:, 3:7],
            sizes=values[:, 7:10],
            places=values[:, 10:13],
            yaws=values[:, 13],
            truncated=np.ceil(values[:, 1]).astype(np.int64),
            occluded=values[:, 2].astype(np.int64),
            kind=kinds[track],
        )
    return tracks


NEAREST = 0.5
"""Depth of a label's nearest corner, m: a nearer one is not seen."""


def seen_box(
    place: np.ndarray,
    yaw: float,
    size: Sequence[float],
    calibration: Calibration,
    image_size: tuple[int, int],
) -> tuple[np.ndarray, bool] | None:
    """The box (4,) px of a label in the image, and whether the border cuts it; None outside.

    `place` (3,) m of the bottom's centre is in the left camera's frame, `yaw` and `size` as in
    `Labels`.
    """
    height, width, length = size
    along, across = rectangle(length, width).T
    x = place[0] + np.cos(yaw) * along + np.sin(yaw) * across
    z = place[2] - np.sin(yaw) * along + np.cos(yaw) * across
    if z.min() < NEAREST:
        return None
    u = calibration.principal_u + calibration.focal_length * x / z
    y = place[1] - np.array([[0.0], [height]])
    v = calibration.principal_v + calibration.focal_length * y / z
    box = np.array([u.min(), v.min(), u.max(), v.max()])
    inside = np.clip(box, 0.0, np.array(image_size * 2) - 1.0)
    if inside[2] <= inside[0] or inside[3] <= inside[1]:
        return None
    return inside, bool((inside != box).any())


GREATEST_STEP, GREATEST_TURN = 10.0, 30.0
"""Between two rows, m and degrees; with more, they are not in the order of the frames."""


@remembered
def read_poses(file: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the left camera (x right, y down, z forward) in that of the first row, m.

    UserError if a row is short, not finite, not a rigid motion, or not in order.
    """
    rows = ((row, numbers(file, row, words, 12)) for row, words in text_rows(file))
    return checked_poses(file, [(row, np.reshape(pose, (3, 4))) for row, pose in rows])


def checked_poses(file: Path, poses: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Poses (n, 3, 4), each given with its row in a file; errors as in `read_poses`."""
    if not poses:
        raise UserError(f"{file}: has no poses")
    for (_, before), (row, pose) in pairwise([poses[0], *poses]):
        turn = pose[:, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0.0:
            raise UserError(f"{file}: row {row}: not a rigid pose: its 3 × 3 part is no rotation")
        step = np.linalg.norm(pose[:, 3] - before[:, 3])
        cosine = 0.5 * (np.trace(before[:, :3].T @ turn) - 1.0)
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        if step > GREATEST_STEP or angle > GREATEST_TURN:
            raise UserError(
                f"{file}: row {row}: out of order: {step:.1f} m and {angle:.0f} degrees from "
                f"the row before, at most {GREATEST_STEP:g} m and {GREATEST_TURN:g} degrees"
            )
    return np.stack([pose for _, pose in poses])


EARTH_RADIUS = 6378137.0
"""Of the devkit's Mercator projection, m."""

GREATEST_LATITUDE = 85.0
"""Degrees: the projection has no poles."""

OUTSIDE = 2, 3
"""States of truncation of a box that is not in the image; -1 and 99 are unknown."""

OF_TRACKLET = ("tx", "ty", "tz", "rz", "occlusion", "truncation")


@remembered
def read_packets(mounting: Path, velodyne: Path, cameras: Path, *packets: Path) -> np.ndarray:
    """Poses (n, 3, 4) of the rectified camera 0 (x right, y down, z forward) in the first, m.

    The odometry benchmark's poses are of camera 0, too; the left colour camera is 6 cm beside it.

    Args:
        mounting, velodyne, cameras: the calibrations of the GPS/IMU, the velodyne and the cameras:
            three files of a drive, or three times the one of a clip of the tracking benchmark.
        packets: one file with a packet in each row, or several of one packet, in their order.
    """
    from scipy.spatial.transform import Rotation

    rows = [(file, row, words) for file in packets for row, words in text_rows(file)]
    if not rows or len(packets) not in (1, len(rows)):
        raise UserError(f"{packets[0].parent}: must have one row of 30 numbers for each frame")
    values = np.array([numbers(*row, 30)[:6] for row in rows])
    for (file, row, _), latitude in zip(rows, values[:, 0], strict=True):
        if abs(latitude) > GREATEST_LATITUDE:
            raise UserError(f"{file}: row {row}: latitude must be within ±{GREATEST_LATITUDE:g}°")
    latitudes, longitudes = np.radians(values[:, :2]).T
    scale = EARTH_RADIUS * np.cos(latitudes[0])
    imu = np.tile(np.eye(4), (len(rows), 1, 1))
    imu[:, :3, :3] = Rotation.from_euler("ZYX", values[:, [5, 4, 3]]).as_matrix()
    north = np.log(np.tan(0.25 * np.pi + 0.5 * latitudes))
    imu[:, :3, 3] = np.stack([scale * longitudes, scale * north, values[:, 2]], axis=1)
    velodyne_from_imu = _motion(mounting, "Tr_imu_velo", "Tr_imu_to_velo")
    camera_from_imu = _camera_from_velodyne(velodyne, cameras) @ velodyne_from_imu
    poses = camera_from_imu @ np.linalg.inv(imu[0]) @ imu @ np.linalg.inv(camera_from_imu)
    return checked_poses(packets[0], list(enumerate(poses[:, :3], 1)))


@remembered
def read_tracklets(tracklets: Path, velodyne: Path, cameras: Path) -> Tracks:
    """The labels of each target by the number of its tracklet, from 0, in the frame of camera 0.

    Frames in which its box is not in the image are left out. Their boxes in the image are those of
    the box's corners.
    """
    calibration = read_calibration(cameras, PAIRS[1])
    size = tuple(map(int, named_numbers(cameras, 2, "S_rect_02")))
    camera, labels = _camera_from_velodyne(velodyne, cameras), []
    for track, tracklet in enumerate(read_xml(tracklets).findall("./tracklets/item")):
        place = f"{tracklets}: tracklet {track}"
        words = [tracklet.findtext(name, "") for name in ("h", "w", "l", "first_frame")]
        *box_size, first = numbers(place, 1, words)
        kind = tracklet.findtext("objectType", "")
        # As in the other benchmarks.
        kind = "Person_sitting" if kind == "Person (sitting)" else kind
        for i, pose in enumerate(tracklet.findall("./poses/item")):
            values = numbers(place, i + 1, [pose.findtext(name, "") for name in OF_TRACKLET])
            *centre, heading, occluded, truncated = values
            at = camera[:3, :3] @ centre + camera[:3, 3]
            ahead = camera[:3, :3] @ [np.cos(heading), np.sin(heading), 0.0]
            # KITTI's rotation_y is that of the heading in the camera's frame.
            yaw = float(np.arctan2(-ahead[2], ahead[0]))
            seen = seen_box(at - calibration.left_camera, yaw, box_size, calibration, size)
            if truncated not in OUTSIDE and seen is not None:
                values = [truncated, occluded % 4.0, *seen[0], *box_size, *at, yaw]
                labels.append((f"{place}: row {i + 1}", kind, first + i, track, *values))
    return tracks_of(labels)


def _camera_from_velodyne(velodyne: Path, cameras: Path) -> np.ndarray:
    """The motion (4, 4) from the velodyne's frame to that of the rectified camera 0."""
    rectified = _motion(cameras, "R_rect_00", "R_rect", "R0_rect", columns=3)
    return rectified @ _motion(velodyne, "Tr_velo_cam", "Tr_velo_to_cam")


def _motion(file: Path, *names: str, columns: int = 4) -> np.ndarray:
    """The motion (4, 4) in the first row with one of these names: (3, `columns`), row by row.

    With a place, it may also be in the rows R and T. UserError if there is none, or no rotation.
    """
    motion = np.eye(4)
    if columns == 4:
        names = (*names, "R and T")
        if any(words[0].removesuffix(":") == "R" for _, words in text_rows(file)):
            motion[:3, 3] = named_numbers(file, 3, "T")
            names, columns = ("R",), 3
    motion[:3, :columns] = np.reshape(named_numbers(file, 3 * columns, *names), (3, columns))
    if not np.allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-3):
        raise UserError(f"{file}: {names[0]} is not a rotation")
    return motion
