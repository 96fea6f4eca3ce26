"""Export a run as CSV tables with a table of their columns."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.experiment.run import run_experiment
from stixel_cli.export.new_folder import write_texts
from stixel_cli.results.folder import csv_text
from stixel_cli.results.result import RunResult
from stixel_cli.scene.classes import ROAD_USER_CLASSES
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

if TYPE_CHECKING:
    import pandas

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


def export_csv(stored: RunResult, folder: Path, progress: Progress | None = None) -> list[str]:
    """Write scans, track, truth, contours and ego poses as CSV, and `columns.csv` about them.

    Results that the cache lacks are computed. Returns the names of the files.

    Raises:
        UserError: if the folder exists or cannot be written, or the run cannot be repeated.
        StageFailure: if a stage fails.
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    tables = exported_tables(run)
    texts = {f"{name}.csv": csv_text(columns) for name, columns in tables.items()}
    texts["columns.csv"] = columns_table(tables).to_csv(index=False)
    return write_texts(folder, texts)


def exported_tables(run: RunResult) -> dict[str, dict[str, np.ndarray]]:
    """The tables by name; without truth, those of the truth are missing."""
    tables = {name: run.tables[name] for name in ("scans", "track", "truth", "ego")
              if name in run.tables}  # fmt: skip
    used = np.zeros(len(run.scans.points_world), dtype=np.int64)
    used[run.track.used_points] = 1
    tables["scans"] = tables["scans"] | {"used": used}
    tables["contour"] = _estimated(run.track)
    if "truth" in tables:
        tables["true_contour"] = _true(run.scenario)
    return tables


def columns_table(tables: dict[str, dict[str, np.ndarray]]) -> "pandas.DataFrame":
    """One row for each column of each table: table, column, unit, meaning."""
    import pandas

    rows = [(table, name, *COLUMNS[name]) for table, columns in tables.items() for name in columns]
    return pandas.DataFrame(rows, columns=["table", "column", "unit", "meaning"])


def _estimated(track: Track) -> dict[str, np.ndarray]:
    return _contour(np.arange(len(track.times)), track.contours_world) | {
        "std": track.contour_std.ravel()
    }


def _true(scenario: Scenario) -> dict[str, np.ndarray]:
    known = np.flatnonzero(scenario.known)
    return _contour(known, np.stack([scenario.contour_world(k) for k in known]))


def _contour(k: np.ndarray, contours_world: np.ndarray) -> dict[str, np.ndarray]:
    """Polygons (K, M, 2) m of the scans `k` (K,) as a table, one row a point."""
    count = contours_world.shape[1]
    x, y = contours_world.reshape(-1, 2).T
    return {"k": np.repeat(k, count), "i": np.tile(np.arange(count), len(k)), "x": x, "y": y}
