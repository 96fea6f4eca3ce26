"""The tables of a run in the frame of the ego car (x right, y forward) at each time index."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_arrays
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, wrap_angle
from stixel_cli.results.reader import check_folder

Table = Mapping[str, np.ndarray]


def pose_columns(times: np.ndarray, poses_world: np.ndarray) -> dict[str, np.ndarray]:
    """Poses (K, 3) in the world at `times` (K,) s as a table: k, t (s), x, y (m), heading (rad)."""
    x, y, heading = poses_world.T
    return {"k": np.arange(len(times)), "t": times, "x": x, "y": y, "heading": heading}


def scans_in_ego_frame(scans: Table, ego: Table) -> dict[str, np.ndarray]:
    """The table of points with x, y (m) and their variances (m²) in the ego car's frame at k.

    Args:
        scans: columns as in `scans.csv`, in the world frame.
        ego: columns as in `ego.csv`, one row per k.
    """
    k = scans["k"].astype(np.int64)
    angle = STRAIGHT_AHEAD - ego["heading"][k]
    x, y = _turned(scans["x"] - ego["x"][k], scans["y"] - ego["y"][k], angle)
    variances = _turned_variances(scans["var_xx"], scans["var_xy"], scans["var_yy"], angle)
    return (
        dict(scans)
        | {"x": x, "y": y}
        | dict(zip(("var_xx", "var_xy", "var_yy"), variances, strict=True))
    )


def track_in_ego_frame(track: Table, ego: Table) -> dict[str, np.ndarray]:
    """The state over time in the ego car's frame at each k, one row per scan.

    The rates are those over the ground, along the axes of the ego car: its own motion is not
    subtracted. The heading is in (-pi, pi], counter-clockwise from the ego car's x axis, so a
    target that drives as the ego car does has pi/2.

    Args:
        track: arrays as in `track.npz`.
        ego: columns as in `ego.csv`, one row per k.

    Returns:
        k, t (s), x, y (m), heading (rad), x_rate, y_rate (m/s), heading_rate (rad/s), and for each
        of the six std_….
    """
    means, covariances = track["means"], track["covariances"]
    angle = STRAIGHT_AHEAD - ego["heading"]
    x, y = _turned(means[:, 0] - ego["x"], means[:, 1] - ego["y"], angle)
    x_rate, y_rate = _turned(means[:, 3], means[:, 4], angle)
    variances = np.diagonal(covariances, axis1=1, axis2=2)[:, :6].T.copy()
    for first in (0, 3):
        block = covariances[:, first : first + 2, first : first + 2]
        turned = _turned_variances(block[:, 0, 0], block[:, 0, 1], block[:, 1, 1], angle)
        variances[first], variances[first + 1] = turned[0], turned[2]
    state = {
        "x": x,
        "y": y,
        "heading": wrap_angle(means[:, 2] + angle),
        "x_rate": x_rate,
        "y_rate": y_rate,
        "heading_rate": means[:, 5],
    }
    std = {f"std_{name}": np.sqrt(row) for name, row in zip(state, variances, strict=True)}
    return {"k": np.arange(len(means)), "t": track["times"], **state, **std}


def read_ego_tables(folder: Path | str) -> dict[str, dict[str, np.ndarray]]:
    """The tables `ego`, `scans` and `track` of a result folder in the ego car's frame at each k.

    `ego` is the car's own pose: x, y (m), heading (rad) in the world. The others are as
    `scans_in_ego_frame` and `track_in_ego_frame` return them.

    Raises:
        UserError: if it is not a result folder, or a file is missing or not valid. Folders of older
            versions have no `ego.npz`.
    """
    folder = Path(folder)
    check_folder(folder)
    ego = _columns(folder / "ego.npz", pose_columns(np.zeros(0), np.zeros((0, 3))))
    scans = _columns(folder / "scans.npz", ("k", "x", "y", "var_xx", "var_xy", "var_yy"))
    track = read_arrays(folder / "track.npz")
    count = len(ego["k"])
    k = scans["k"]
    if not np.all((k >= 0) & (k < count) & (k == np.floor(k))):
        raise UserError(f"{folder / 'scans.npz'}: k must be 0 to {count - 1}, as in ego.npz")
    for name, dimensions in (("times", 1), ("means", 2), ("covariances", 3)):
        shape = track[name].shape if name in track else ()
        if len(shape) != dimensions or shape[0] != count or min((6, *shape[1:])) < 6:
            raise UserError(f"{folder / 'track.npz'}: {name} is missing or has a wrong shape")
    return {
        "ego": ego,
        "scans": scans_in_ego_frame(scans, ego),
        "track": track_in_ego_frame(track, ego),
    }


def _columns(file: Path, names) -> dict[str, np.ndarray]:
    """The columns of a table, all that the file has, of equal length.

    Raises:
        UserError: if one of `names` is missing, or the lengths differ.
    """
    columns = read_arrays(file)
    for name in names:
        if name not in columns:
            raise UserError(f"{file}: the column {name} is missing")
    if len({column.shape for column in columns.values()}) != 1 or columns["k"].ndim != 1:
        raise UserError(f"{file}: its columns must have one dimension and equal lengths")
    return columns


def _turned(x: np.ndarray, y: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (x, y), each (n,), turned counter-clockwise by `angle` (n,) rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


def _turned_variances(
    xx: np.ndarray, xy: np.ndarray, yy: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variances and covariance (n,) of vectors that are turned by `angle` (n,) rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return (
        cosine**2 * xx - 2.0 * cosine * sine * xy + sine**2 * yy,
        cosine * sine * (xx - yy) + (cosine**2 - sine**2) * xy,
        sine**2 * xx + 2.0 * cosine * sine * xy + cosine**2 * yy,
    )
