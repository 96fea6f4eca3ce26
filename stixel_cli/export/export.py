"""The formats of exports; CSV tables with a table of their columns, trajectories for evo."""

import csv
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import run_experiment
from stixel_cli.experiment.stages import computed_stages, pipeline_stages
from stixel_cli.export.kitti_folder import export_kitti
from stixel_cli.export.rerun_log import export_rerun
from stixel_cli.export.stx1 import export_stx1
from stixel_cli.results.folder import csv_text, write_whole_folder
from stixel_cli.results.result import RunResult
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.track import REPORTED, STATE, state_columns

COLUMNS: dict[str, tuple[str, str]] = {
    "k": ("", "index of the scan, from 0"),
    "t": ("s", "time of the scan"),
    "x": ("m", "position, to the right of the ego car's pose at k = 0"),
    "y": ("m", "position, ahead of the ego car's pose at k = 0"),
    "heading": ("rad", "counter-clockwise from +x"),
    "x_rate": ("m/s", "derivative of x"),
    "y_rate": ("m/s", "derivative of y"),
    "heading_rate": ("rad/s", "derivative of heading"),
    **{
        f"std_{name}": (unit, f"standard deviation of {name}")
        for name, unit in zip(STATE, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True)
    },
    "var_xx": ("m²", "variance of x"),
    "var_xy": ("m²", "covariance of x and y"),
    "var_yy": ("m²", "variance of y"),
    "used": ("", "1 if the track was updated with the point, else 0"),
    "points_used": ("", "number of points with which the track was updated"),
    "nis": ("", "normalised innovation squared; nan without a point"),
    "nis_degrees_of_freedom": ("", "degrees of freedom of nis"),
    **{
        f"{name}_probability": ("", f"probability of the class {name}, given the scans up to k")
        for name in REPORTED
    },
    "length": ("m", "length of the true box"),
    "width": ("m", "width of the true box"),
    "i": ("", "number of the contour's point, counter-clockwise, from 0"),
    "std": ("m", "standard deviation of the contour along the ray from the centre"),
}
"""Unit and meaning of each column; all positions are in the world frame."""


def export_csv(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write scans, start, track, truth, contours and ego poses as CSV, and `columns.csv`."""
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    tables = exported_tables(run)
    with computed_stages(stored.composition, ["start"], progress) as (_, load):
        starts = load("start")
    for start in starts:
        # One sample before the first scan.
        before = run.scans.times[:1] - intervals(run.scans.times)[:1]
        state = state_columns(start.mean[None], start.covariance[None])
        tables["start"] = {"t": before, **state}
    rows = [("table", "column", "unit", "meaning")]
    rows += [(table, name, *COLUMNS[name]) for table, names in tables.items() for name in names]
    csv.writer(meanings := io.StringIO(), lineterminator="\n").writerows(rows)
    files = {f"{table}.csv": csv_text(columns) for table, columns in tables.items()}
    write_whole_folder(folder, files | {"columns.csv": meanings.getvalue()})


def exported_tables(run: RunResult) -> dict[str, dict[str, np.ndarray]]:
    """The tables by name; without truth, those of the truth are missing."""
    names = ("scans", "track", "truth", "ego")
    tables = {name: run.tables[name] for name in names if name in run.tables}
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
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    poses = {
        "track": run.track.means[:, :3],
        "truth": run.scenario.target_poses_world,
        "ego": run.scenario.ego_poses_world,
    }
    files = {}
    for name, values in poses.items():
        np.savetxt(rows := io.BytesIO(), tum_rows(run.scenario.times, values), "%.9g")
        files[f"{name}.tum"] = rows.getvalue()
    write_whole_folder(folder, files)


def tum_rows(times: np.ndarray, poses_world: np.ndarray) -> np.ndarray:
    """Rows (n, 8) of `times` (K,) s and poses (K, 3) as TUM has them; a pose of NaN has no row."""
    known = np.isfinite(poses_world).all(axis=1)
    x, y, heading = poses_world[known].T
    zero = np.zeros(len(x))
    quaternion = (zero, zero, np.sin(0.5 * heading), np.cos(0.5 * heading))
    return np.column_stack([times[known], x, y, zero, *quaternion])


FORMATS: dict[str, Callable[..., list[str] | None]] = {
    "kitti": export_kitti,
    "csv": export_csv,
    "tum": export_tum,
    "stx1": export_stx1,
    "rerun": export_rerun,
}

NEEDED = {"kitti": ("add_sensor_noise", "rendered images"), "stx1": ("stixels", "stixels")}
"""The stage that a format needs, and the noun of its result."""


def export(
    stored: RunResult, folder: Path, format: str, progress: Progress | None = None
) -> list[str] | None:
    """Write a run in one of `FORMATS` into a new folder, which appears complete or not at all.

    Results that the cache lacks are computed.

    Returns:
        What the format's function returns.

    Raises:
        UserError: if the folder cannot be written or exists by then, the run lacks what the format
            needs or cannot be repeated, or the format's package is not installed.
        StageFailure: if a stage fails.
    """
    stage, noun = NEEDED.get(format, ("track", "track"))
    if stage not in {one.name for one in pipeline_stages(stored.composition)}:
        raise UserError(f"{stored.folder}: has no {noun} to export")
    return FORMATS[format](stored, folder, progress)
