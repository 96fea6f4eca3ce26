"""The formats of exports; CSV tables with a table of their columns, trajectories for evo."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.experiment.run import run_experiment
from stixel_cli.export.kitti_folder import export_kitti
from stixel_cli.export.new_folder import new_folder
from stixel_cli.export.rerun_log import export_rerun
from stixel_cli.export.stixel_files import export_stx1
from stixel_cli.results.folder import csv_text
from stixel_cli.results.result import RunResult
from stixel_cli.scene.classes import ROAD_USER_CLASSES

COLUMNS: dict[str, tuple[str, str]] = {
    "k": ("", "index of the scan, from 0"),
    "t": ("s", "time of the scan"),
    "x": ("m", "position, to the right of the ego car's pose at k = 0"),
    "y": ("m", "position, ahead of the ego car's pose at k = 0"),
    "heading": ("rad", "counter-clockwise from +x"),
    "x_rate": ("m/s", "derivative of x"),
    "y_rate": ("m/s", "derivative of y"),
    "heading_rate": ("rad/s", "derivative of heading"),
    "std_x": ("m", "standard deviation of x"),
    "std_y": ("m", "standard deviation of y"),
    "std_heading": ("rad", "standard deviation of heading"),
    "std_x_rate": ("m/s", "standard deviation of x_rate"),
    "std_y_rate": ("m/s", "standard deviation of y_rate"),
    "std_heading_rate": ("rad/s", "standard deviation of heading_rate"),
    "var_xx": ("m²", "variance of x"),
    "var_xy": ("m²", "covariance of x and y"),
    "var_yy": ("m²", "variance of y"),
    "used": ("", "1 if the track was updated with the point, else 0"),
    "points_used": ("", "number of points with which the track was updated"),
    "nis": ("", "normalised innovation squared; nan without a point"),
    "nis_degrees_of_freedom": ("", "degrees of freedom of nis"),
    **{
        f"{name}_probability": ("", f"probability of the class {name}, given the scans up to k")
        for name in ROAD_USER_CLASSES
    },
    "length": ("m", "length of the true box"),
    "width": ("m", "width of the true box"),
    "i": ("", "number of the contour's point, counter-clockwise, from 0"),
    "std": ("m", "standard deviation of the contour along the ray from the centre"),
}
"""Unit and meaning of each column; all positions are in the world frame."""


def export_csv(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write scans, track, truth, contours and ego poses as CSV, and `columns.csv` about them.

    Results that the cache lacks are computed.

    Raises:
        UserError: if the folder exists or cannot be written, or the run cannot be repeated.
        StageFailure: if a stage fails.
    """
    import pandas

    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    tables = exported_tables(run)
    rows = [(table, name, *COLUMNS[name]) for table, columns in tables.items() for name in columns]
    with new_folder(folder) as partial:
        for table, columns in tables.items():
            (partial / f"{table}.csv").write_text(csv_text(columns), encoding="utf-8")
        columns_table = pandas.DataFrame(rows, columns=["table", "column", "unit", "meaning"])
        columns_table.to_csv(partial / "columns.csv", index=False)


def exported_tables(run: RunResult) -> dict[str, dict[str, np.ndarray]]:
    """The tables by name; without truth, those of the truth are missing."""
    tables = {name: run.tables[name] for name in ("scans", "track", "truth", "ego")
              if name in run.tables}  # fmt: skip
    used = np.zeros(len(run.scans.points_world), dtype=np.int64)
    used[run.track.used_points] = 1
    tables["scans"] = tables["scans"] | {"used": used}
    contours = _contour(np.arange(len(run.track.times)), run.track.contours_world)
    tables["contour"] = contours | {"std": run.track.contour_std.ravel()}
    if "truth" in tables:
        known = np.flatnonzero(run.scenario.known)
        true_contours = np.stack([run.scenario.contour_world(k) for k in known])
        tables["true_contour"] = _contour(known, true_contours)
    return tables


def _contour(k: np.ndarray, contours_world: np.ndarray) -> dict[str, np.ndarray]:
    """Polygons (K, M, 2) m of the scans `k` (K,) as a table, one row a point."""
    count = contours_world.shape[1]
    x, y = contours_world.reshape(-1, 2).T
    return {"k": np.repeat(k, count), "i": np.tile(np.arange(count), len(k)), "x": x, "y": y}


def export_tum(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write the trajectories of the track, the truth and the ego car in TUM's format, as evo reads.

    Each row has the time (s), the place (m, z = 0) and the heading as a quaternion (x, y, z, w).
    Times without truth have no row.

    Raises:
        UserError: if the folder exists or cannot be written, or the run cannot be repeated.
        StageFailure: if a stage fails.
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    poses = {
        "track": run.track.means[:, :3],
        "truth": run.scenario.target_poses_world,
        "ego": run.scenario.ego_poses_world,
    }
    with new_folder(folder) as partial:
        for name, values in poses.items():
            text = tum_text(run.scenario.times, values)
            (partial / f"{name}.tum").write_text(text, encoding="utf-8")


def tum_text(times: np.ndarray, poses_world: np.ndarray) -> str:
    """Rows of `times` (K,) s and poses (K, 3) in TUM's format; a pose of NaN has no row."""
    rows = []
    for time, (x, y, heading) in zip(times, poses_world, strict=True):
        if np.isfinite([x, y, heading]).all():
            half = 0.5 * heading
            values = (time, x, y, 0.0, 0.0, 0.0, np.sin(half), np.cos(half))
            rows.append(" ".join(f"{float(value):.9g}" for value in values))
    return "".join(f"{row}\n" for row in rows)


FORMATS: dict[str, Callable[..., list[str] | None]] = {
    "kitti": export_kitti,
    "csv": export_csv,
    "tum": export_tum,
    "stx1": export_stx1,
    "rerun": export_rerun,
}
