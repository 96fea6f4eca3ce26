"""The reports of `stixel study robustness` and `robustness_real`: a table for each departure."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.errors import MissingData
from stixel_cli.report import tables
from stixel_cli.report.blocks import Material, Table
from stixel_cli.report.example_scans import scenes
from stixel_cli.report.run_frame import run_frame
from stixel_cli.results.result import RunResult
from stixel_cli.studies.data import DATA, StudyData, data_folder, shipped_meshes

SETS = "pandaset, lidarrm and kitti_tracking"
"""What the data folder of `robustness_real` has."""

CLIP, CARS = "0005", (31, 0, 1)
"""KITTI tracking's clip with images, and its cars."""

TRACKER = "contour"
MEASURES = (
    *("iou_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg"),
    *("nees_position_mean", "track_lost", "sure_and_wrong_share"),
)
"""Metrics of the tables, in this order."""

FOUND_AGAIN = 0.4
"""A target is found again if its box has this IoU one second after a gap."""

KEYS = {
    "shapes": ("shape", "tracker"),
    "following": ("tracker",),
    "gaps": ("road_user", "gap", "tracker"),
    "wrong_start": ("road_user", "tracker"),
    "miscalibrated": ("road_user", "path", "error", "tracker"),
    "stated": ("road_user", "path", "error", "tracker"),
    "curved": ("calibration", "tracker"),
    "pandaset": ("target", "tracker"),
    "lidarrm": ("scans", "tracker"),
    "lidarrm_peers": ("scans", "tracker"),
    "clip": ("target", "tracker"),
}
"""Sweep to the columns that name the rows of its table."""


def shapes() -> list[dict[str, list]]:
    """Axes: plain shapes, for the class whose prior the tracker has."""
    return shipped_meshes("shapes")


def pandaset() -> list[dict[str, list]]:
    """Axes: the tables of each target, whose folder's name begins with its class."""
    axis = _tables("pandaset", path="scans", ego="ego", truth="truth")
    folders = (Path(file).parent.name for file in axis["measurement.path"])
    return [{"road_user": [name.partition("-")[0] for name in folders], **axis}]


def lidarrm() -> list[dict[str, list]]:
    """Axes: the tables of each run; its sensor stays at the origin."""
    return [_tables("lidarrm", path="scans", truth="truth")]


def clip() -> list[dict[str, list]]:
    """Axes: the cars of the clip, with all frames that have their label."""
    folder = str(data_folder(SETS) / "kitti_tracking")
    axis = {"source.folder": [folder] * len(CARS), "source.sequence": [CLIP] * len(CARS)}
    return [axis | {"source.target": list(CARS)}]


def _tables(name: str, **files: str) -> dict[str, list]:
    """Axis of the tables in each folder of a set: key of the measurement to the table's name."""
    folder = data_folder(SETS) / name
    found = sorted(file.parent for file in folder.glob("*/scans.csv"))
    if not found:
        raise MissingData(f"{DATA}: {folder} has no folder with scans.csv")
    return {
        f"measurement.{key}": [str(one / f"{table}.csv") for one in found]
        for key, table in files.items()
    }


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    frames = {name: _named(run_frame(sweep.runs)) for name, sweep in data.sweeps.items()}
    answers = {name: _answer(frame) for name, frame in frames.items()}
    best: dict[str, list[str]] = {}
    for name, found in answers.items():
        best.setdefault(max(found, key=lambda one: found[one]["iou_box_mean"]), []).append(name)
    return Material(
        {
            "best": best,
            "scenes": scenes(
                {name.replace("_", " "): own["run"].iloc[0] for name, own in frames.items()}
            ),
            "answers": answers,
            "tables": {name: _table(name, frame) for name, frame in frames.items()},
        }
    )


def _named(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs with the columns of `KEYS` that their sweep has."""
    new = {
        "shape": ("road_user.mesh", lambda path: f"{Path(path).stem}, {Path(path).parent.name}"),
        "gap": ("measurement.dropout", lambda ends: f"{-np.subtract(*json.loads(ends)):g} s"),
        "error": ("sensor.disparity_error", lambda error: f"{json.loads(error)[0]:+g} px"),
        "calibration": ("rig.disparity_error", lambda error: "motion" if "-" in error else "none"),
        "target": ("source.target", str),
    }
    if "measurement.path" in runs:
        new["target"] = ("measurement.path", lambda path: Path(path).parent.name)
        new["scans"] = ("measurement.path", lambda path: Path(path).parent.name.partition("-")[0])
    runs = runs.assign(
        **{
            column: runs[key].map(str).map(text).str.replace("_", " ")
            for column, (key, text) in new.items()
            if key in runs
        }
    )
    return runs.assign(found_again=runs["run"].map(_found_again)) if "gap" in runs else runs


def _found_again(run: RunResult) -> float:
    """Whether the box has an IoU of `FOUND_AGAIN` one second after the gap, 0 or 1."""
    after = run.configuration.measurement.dropout[1] + 1.0
    times = run.scores.times - run.scores.times[0]
    at = int(np.argmin(np.abs(times - after)))
    return float(run.scores.iou_box[at] >= FOUND_AGAIN)


def _table(name: str, runs: pd.DataFrame) -> Table:
    """One row for each setting and tracker; of recordings also the mean over all."""
    measures = {measure: tables.label_of(measure) for measure in MEASURES}
    if "found_again" in runs:
        measures["found_again"] = "found again"
    # Seeds vary only the start of a recording: the unit is the recording.
    unit = "target" if "measurement.path" in runs else "seed"
    keys = KEYS[name]
    rows = [*tables.rows_by(runs, keys, measures, unit="seed" if "target" in keys else unit)]
    if name == "pandaset":
        cars = runs[runs["road_user"] == "car"].assign(target="mean of the cars")
        names = runs.loc[cars.index, "target"]
        rows += tables.rows_by(cars.assign(car=names), keys, measures, unit="car")
    return Table.of(name, rows)


def _answer(runs: pd.DataFrame) -> dict[str, Any]:
    """Tracker to its mean box IoU, share of lost tracks and NEES over all runs."""
    measures = ("iou_box_mean", "track_lost", "nees_position_mean")
    return {
        tracker: {name: float(own[name].mean()) for name in measures}
        for (tracker,), own in tables.groups(runs, ["tracker"])
    }
