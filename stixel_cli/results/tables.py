"""A run's results as tables: the columns of its CSV files and the arrays of its NPZ files."""

import numpy as np

from stixel_cli.evaluation.metric_table import Scores
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.track import Track


def scan_columns(scans: Scans) -> dict[str, np.ndarray]:
    """The scans as a table, one row per point: k, t (s), x, y (m), variances (m²)."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return {
        "k": k,
        "t": scans.times[k],
        "x": scans.points_world[:, 0],
        "y": scans.points_world[:, 1],
        "var_xx": scans.covariances_world[:, 0, 0],
        "var_xy": scans.covariances_world[:, 0, 1],
        "var_yy": scans.covariances_world[:, 1, 1],
    }


def track_columns(track: Track) -> dict[str, np.ndarray]:
    """The track as a table, one row per scan: pose, rates, their stds, number of points used."""
    names = ("x", "y", "heading", "x_rate", "y_rate", "heading_rate")
    std = np.sqrt(np.diagonal(track.covariances, axis1=1, axis2=2)[:, :6])
    return {
        "k": np.arange(len(track.times)),
        "t": track.times,
        **{name: track.means[:, i] for i, name in enumerate(names)},
        **{f"std_{name}": std[:, i] for i, name in enumerate(names)},
        "points_used": np.diff(track.used_offsets),
        "nis": track.nis,
        "nis_degrees_of_freedom": track.nis_degrees_of_freedom,
    }


def score_columns(scores: Scores) -> dict[str, np.ndarray]:
    """The errors as a table, one row per scan; units as in `Scores`."""
    return {
        "k": np.arange(len(scores.times)),
        "t": scores.times,
        "centre_error": scores.centre_error,
        "orientation_error": scores.orientation_error,
        "iou": scores.iou,
        "nees_position": scores.nees_position,
        "nis": scores.nis,
    }


def pose_columns(times: np.ndarray, poses_world: np.ndarray) -> dict[str, np.ndarray]:
    """Poses (K, 3) in the world at `times` (K,) s as a table: k, t (s), x, y (m), heading (rad)."""
    x, y, heading = poses_world.T
    return {"k": np.arange(len(times)), "t": times, "x": x, "y": y, "heading": heading}


def track_arrays(track: Track) -> dict[str, np.ndarray]:
    """All arrays of the track by name; shapes as in `Track`."""
    return {name: value for name, value in vars(track).items() if isinstance(value, np.ndarray)}
