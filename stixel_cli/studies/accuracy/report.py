"""The report of `stixel study accuracy`: trackers, road users, measurements and paths."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.evaluation.evaluate import contour_errors
from stixel_cli.evaluation.metric_table import metric as metric_row
from stixel_cli.evaluation.metric_table import over_runs
from stixel_cli.studies.accuracy.ablation import ablation_table
from stixel_cli.studies.accuracy.goals import TRACKER, goals_table
from stixel_cli.studies.accuracy.wrong_class import wrong_class_table
from stixel_cli.studies.data import StudyData, StudyRun, chosen, names, run_frame
from stixel_cli.studies.forest import difference_row, forest
from stixel_cli.studies.runs import metric_over_seeds, paired_difference
from stixel_cli.studies.tables import MINUS, interval_columns, with_unit
from stixel_cli.studies.types import Figure, Material, Table

if TYPE_CHECKING:
    import pandas as pd

MEASURES = (
    "iou_mean",
    "iou_hull_mean",
    "iou_box_mean",
    "centre_rmse_m",
    "orientation_rmse_deg",
    "nees_position_mean",
    "band_coverage",
    "track_lost",
)
"""Metrics of the tables, in this order."""
COMPARED = ("centre_rmse_m", "orientation_rmse_deg", "iou_box_mean")
"""Metrics of the answer's plot."""
ABLATIONS = ("ablation", "ablation_lidar")
"""Sweeps that leave out one term of `TRACKER` each."""
WRONG_CLASSES = ("wrong_class", "wrong_class_lidar")
"""Sweeps of `TRACKER` with the priors of all classes and of none."""
OWN_TABLES = (*ABLATIONS, *WRONG_CLASSES)
"""Sweeps with tables of their own."""
APART = "s_curve"
"""A path that is reported on its own: the means are over the others."""
NEAR = 30.0
"""With the rig `long_range`, scans with the true centre within this range count, m."""


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    import pandas as pd

    sweeps = {name: sweep for name, sweep in data.sweeps.items() if name not in OWN_TABLES}
    frames = {name: run_frame(sweep.runs) for name, sweep in sweeps.items()}
    frames["long_range"] = _within(frames["long_range"])
    peers = frames["peers"]
    frames["peers"] = peers.assign(tracker="PyRecEst " + peers["tracker.name"])
    fabricated = pd.concat([frames.pop("fabricated_car"), frames["fabricated"]])
    frames["fabricated"] = fabricated.assign(measurement="fabricated")
    simulated = frames["simulated"]
    users = names(simulated, "road_user")
    return Material(
        {
            "users": users,
            "answers": [_answer(user, chosen(simulated, road_user=user)) for user in users],
            "forest": _forest(together(simulated)),
            "seeds": sorted(names(simulated, "seed")),
            "apart": APART,
            "near": NEAR,
            "tables": {
                name: accuracy_table(name, frame, ("road_user", "measurement", "tracker"))
                for name, frame in frames.items()
            },
            "ablations": {name: ablation_table(name, data.sweeps[name].runs) for name in ABLATIONS},
            "wrong_classes": {
                name: wrong_class_table(name, data.sweeps[name].runs) for name in WRONG_CLASSES
            },
            "goals": goals_table({name: together(frame) for name, frame in frames.items()}),
            "by_path": accuracy_table(
                "by_path", simulated, ("road_user", "path", "tracker"), apart=False
            ),
        }
    )


def _answer(user: str, runs: "pd.DataFrame") -> dict[str, Any]:
    """IoU of outline (car) or box, centre error and NEES of each tracker over the seeds.

    `leads`: of the tracker `TRACKER`, and `others`: of the others.
    """
    runs = together(runs)
    of = {
        tracker: {name: metric_over_seeds(chosen(runs, tracker=tracker), name) for name in MEASURES}
        for tracker in names(runs, "tracker")
    }
    return {
        "user": user,
        "iou": "iou_mean" if user == "car" else "iou_box_mean",
        "leads": {tracker: found for tracker, found in of.items() if tracker == TRACKER},
        "others": {tracker: found for tracker, found in of.items() if tracker != TRACKER},
    }


def _forest(runs: "pd.DataFrame") -> Figure | None:
    """`TRACKER` minus each other tracker: pairs of runs with the same scans."""
    rows, label = [], f"{TRACKER} {MINUS} the other"
    for name in COMPARED:
        row = metric_row(over_runs(name))
        for user in names(runs, "road_user"):
            own = chosen(runs, road_user=user)
            for other in names(own, "tracker"):
                if other == TRACKER:
                    continue
                sides = (chosen(own, tracker=one) for one in (TRACKER, other))
                apart = paired_difference(*sides, name)
                series = other.replace("_", " ")
                rows.append(difference_row(row, label, user, series, apart))
    return forest("answer_forest", rows, f"{TRACKER} better", f"{TRACKER} worse")


def together(runs: "pd.DataFrame") -> "pd.DataFrame":
    """The runs on the paths that the means are over."""
    return runs[runs["path"] != APART] if (runs["path"] != APART).any() else runs


def accuracy_table(
    name: str, runs: "pd.DataFrame", keys: Sequence[str], apart: bool = True
) -> Table:
    """One row for each combination of `keys`, with the `MEASURES` and their intervals.

    The value of a seed is its mean over the paths but `APART`, if `apart`, which has rows of its
    own below.
    """
    rows = []
    if apart:
        rows += _rows(together(runs), keys, ("mean of paths",))
        if APART in names(runs, "path"):
            rows += _rows(chosen(runs, path=APART), keys, (APART,))
        columns = (*keys, "path")
    else:
        rows += _rows(runs, keys, ())
        columns = tuple(keys)
    measured = [
        column
        for one in (metric_row(over_runs(name)) for name in MEASURES)
        for column in interval_columns(with_unit(one), one.short_label)
    ]
    return Table(
        name, "", (*(key.replace("_", " ") for key in columns), "n", *measured), tuple(rows)
    )


def _rows(runs: "pd.DataFrame", keys: Sequence[str], label: tuple[str, ...]) -> list[tuple]:
    rows = []
    for values, own in runs.groupby(list(keys), sort=False):
        found = [metric_over_seeds(own, name) for name in MEASURES]
        cells = [cell for one in found for cell in (one.mean, one.low, one.high)]
        rows.append((*values, *label, own["seed"].nunique(), *cells))
    return rows


def _within(runs: "pd.DataFrame") -> "pd.DataFrame":
    """The runs with the errors of the scans within `NEAR` only.

    A lost track is one of all scans.
    """
    columns: dict[str, list[float]] = {name: [] for name in MEASURES if name != "track_lost"}
    for run in runs["run"]:
        near = _near(run)
        scores = run.scores
        columns["iou_mean"].append(_mean(scores.iou[near]))
        columns["iou_box_mean"].append(_mean(scores.iou_box[near]))
        columns["centre_rmse_m"].append(_mean(scores.centre_error[near] ** 2) ** 0.5)
        degrees = np.degrees(scores.orientation_error[near])
        columns["orientation_rmse_deg"].append(_mean(degrees**2) ** 0.5)
        columns["nees_position_mean"].append(_mean(scores.nees_position[near]))
        # Not among the scores over time.
        scenario, track = run.load("scenario"), run.load("track")
        found = contour_errors(track, scenario)
        columns["iou_hull_mean"].append(_mean(found["iou_hull"][near]))
        columns["band_coverage"].append(_mean(found["band_coverage"][near]))
    return runs.assign(**columns)


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _near(run: StudyRun) -> np.ndarray:
    """Whether the target is within `NEAR` at each scan, (K,)."""
    scenario = run.load("scenario")
    away = scenario.target_poses_world[:, :2] - scenario.ego_poses_world[:, :2]
    return np.hypot(*away.T) <= NEAR
