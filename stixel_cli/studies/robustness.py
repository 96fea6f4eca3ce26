"""Axes and columns of `stixel study robustness`, `robustness_real` and `accuracy`."""

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from stixel_cli.answers.runs import Runs
from stixel_cli.errors import MissingData
from stixel_cli.results.result import RunResult
from stixel_cli.studies.report import DATA, data_folder, shipped_meshes, with_columns

SETS = "pandaset, lidarrm and kitti_tracking"
"""What the data folder of `robustness_real` has."""

CLIP, CARS = "0005", (31, 0, 1)
"""KITTI tracking's clip with images, and its cars."""

FOUND_AGAIN = 0.4
"""A target is found again if its box has this IoU one second after a gap."""

COLUMNS = {
    "shape": ("road_user.mesh", lambda path: f"{Path(path).stem}, {Path(path).parent.name}"),
    "gap": ("measurement.dropout", lambda ends: f"{-np.subtract(*json.loads(ends)):g} s"),
    "error": ("sensor.disparity_error", lambda pixels: f"{pixels} px"),
    "calibration": (
        "rig.disparity_error",
        lambda curve: "corrected" if any(json.loads(curve)) else "uncorrected",
    ),
    "target": ("source.target", str),
    "recording": ("measurement.path", lambda path: Path(path).parent.name),
    "scans": ("measurement.path", lambda path: Path(path).parent.name.partition("-")[0]),
}
"""Column to the key that it stands for, and to its text."""


shapes, held_out, odd = (partial(shipped_meshes, name) for name in ("shapes", "meshes", "odd"))
"""Axes: plain shapes, meshes that no class was learned from, and road users of no class. The
tracker has the prior of the class in whose folder a mesh is."""


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


def columns(name: str, runs: Runs, results: Sequence[RunResult]) -> Runs:
    """The runs with the columns of `COLUMNS` in place of the keys that these stand for."""
    frame = runs.frame
    known = {new: key for new, (key, _) in COLUMNS.items() if key in runs.axes}
    texts = {
        new: [COLUMNS[new][1](str(value)).replace("_", " ") for value in frame[key]]
        for new, key in known.items()
    }
    keys = ("measurement.", "source.", *known.values())
    axes = tuple(axis for axis in runs.axes if not axis.startswith(keys))
    found = with_columns(Runs(frame, axes), **texts)
    if "gap" in texts:
        found = with_columns(found, found_again=[_found_again(run) for run in results])
    return found


def _found_again(run: RunResult) -> float:
    """Whether the box has an IoU of `FOUND_AGAIN` one second after the gap, 0 or 1."""
    after = run.configuration.measurement.dropout[1] + 1.0
    times = run.scores.times - run.scores.times[0]
    at = int(np.argmin(np.abs(times - after)))
    return float(run.scores.iou_box[at] >= FOUND_AGAIN)
