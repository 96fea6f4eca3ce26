"""The tables of a run in the frame of the ego car (x right, y forward) at each time index."""

from collections.abc import Mapping

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotation, wrap_angle
from stixel_cli.tracking.track import state_columns

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
    turn = _turns(ego["heading"][k])
    away = np.stack([scans["x"] - ego["x"][k], scans["y"] - ego["y"][k]], axis=1)
    x, y = (turn @ away[:, :, None])[:, :, 0].T
    xx, xy, yy = (scans[name] for name in ("var_xx", "var_xy", "var_yy"))
    covariances = turn @ np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0) @ turn.swapaxes(1, 2)
    (xx, xy), (_, yy) = np.moveaxis(covariances, 0, 2)
    return {**scans, "x": x, "y": y, "var_xx": xx, "var_xy": xy, "var_yy": yy}


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
    times, turn = track["times"], _turns(ego["heading"])
    means, covariances = track["means"].copy(), track["covariances"].copy()
    means[:, :3] -= np.stack([ego["x"], ego["y"], ego["heading"] - STRAIGHT_AHEAD], axis=1)
    means[:, 2] = wrap_angle(means[:, 2])
    for xy in (slice(0, 2), slice(3, 5)):
        means[:, xy] = (turn @ means[:, xy, None])[:, :, 0]
        covariances[:, xy, xy] = turn @ covariances[:, xy, xy] @ turn.swapaxes(1, 2)
    return {"k": np.arange(len(times)), "t": times, **state_columns(means, covariances)}


def _turns(headings: np.ndarray) -> np.ndarray:
    """Rotations (n, 2, 2) from the world's axes to those of the ego car with headings (n,) rad."""
    return np.moveaxis(rotation(STRAIGHT_AHEAD - headings), 2, 0)
