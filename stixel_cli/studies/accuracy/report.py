"""The report of `stixel study accuracy`: trackers, road users, measurements and paths."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.evaluation.evaluate import contour_errors
from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.evaluation.verdict import misfits_class
from stixel_cli.report import tables
from stixel_cli.report.blocks import Cell, Figure, Material, Table
from stixel_cli.report.example_scans import first_runs, scenes
from stixel_cli.report.forest import difference_row, forest
from stixel_cli.report.metrics import MINUS
from stixel_cli.report.run_frame import run_frame
from stixel_cli.report.statistics import Statistic
from stixel_cli.results.result import RunResult
from stixel_cli.studies.data import StudyData, shipped_meshes

TRACKER = "contour"
MEASURES = (
    *("iou_mean", "iou_hull_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg"),
    *("nees_position_mean", "band_coverage", "track_lost"),
)
"""Metrics of the tables, in this order."""
COMPARED = ("centre_rmse_m", "orientation_rmse_deg", "iou_box_mean")
"""Metrics of the answer's plot."""
ABLATIONS = ("ablation", "ablation_lidar")
"""Sweeps whose variants leave out one term of `TRACKER` each; the first has all terms."""
WRONG_CLASSES = ("wrong_class", "wrong_class_lidar")
"""Sweeps whose variants of `TRACKER` have the priors of all classes and of none."""
OWN_TABLES = (*ABLATIONS, *WRONG_CLASSES)
REPLACED, WARNED = "class_replaced_share", "warned_of_the_class"
APART, TOGETHER = "s_curve", "mean of paths"
"""A path that is reported on its own; the means are over the others."""
NEAR = 30.0
"""With the rig `long_range`, scans with the true centre within this range count, m."""


def held_out() -> list[dict[str, list]]:
    """Axes: the shipped meshes that no class was learned from."""
    return shipped_meshes("meshes")


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    frames = {name: run_frame(sweep.runs) for name, sweep in data.sweeps.items()}
    effects = {name: _effects(name, frames.pop(name)) for name in OWN_TABLES}
    far = frames["long_range"]
    near = pd.DataFrame([_errors_within(run) for run in far["run"]], index=far.index)
    frames["long_range"] = far.assign(**near)
    peers = frames["peers"]
    frames["peers"] = peers.assign(tracker="PyRecEst " + peers["tracker.name"])
    meshes = frames["held_out"]
    files = [Path(file).stem.replace("_", " ") for file in meshes["road_user.mesh"]]
    frames["held_out"] = meshes.assign(road_user=files)
    fabricated = pd.concat([frames.pop("fabricated_car"), frames["fabricated"]])
    frames["fabricated"] = fabricated.assign(measurement="fabricated")
    simulated = frames["simulated"]
    users = tables.names(simulated, "road_user")
    # One name for all paths but `APART`.
    pooled = {
        name: frame.assign(path=frame["path"].where(frame["path"] == APART, TOGETHER))
        for name, frame in frames.items()
    }
    keys = ("road_user", "measurement", "tracker", "path")
    return Material(
        {
            "users": users,
            "scenes": scenes(first_runs(simulated, frames["fabricated"], frames["lidar"])),
            "headlines": _headlines(_together(simulated)),
            "answers": [_answer(user, tables.chosen(simulated, road_user=user)) for user in users],
            "forest": _forest(_together(simulated)),
            "seeds": sorted(tables.names(simulated, "seed")),
            "apart": APART,
            "near": NEAR,
            "tables": {
                name: Table.of(name, tables.rows_by(frame, keys, MEASURES))
                for name, frame in pooled.items()
            },
            "effects": effects,
            "by_path": Table.of(
                "by_path", tables.rows_by(simulated, ("road_user", "path", "tracker"), MEASURES)
            ),
        }
    )


def _together(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs on the paths that the means are over."""
    return runs[runs["path"] != APART] if (runs["path"] != APART).any() else runs


def _answer(user: str, runs: pd.DataFrame) -> dict[str, Any]:
    """IoU of outline (car) or box, centre error and NEES of each tracker over the seeds.

    `leads`: of the tracker `TRACKER`, and `others`: of the others.
    """
    found = {
        tracker: {name: tables.mean_over(own, name) for name in MEASURES}
        for (tracker,), own in tables.groups(_together(runs), ["tracker"])
    }
    lead = {tracker: found.pop(tracker) for tracker in [TRACKER] if tracker in found}
    iou = "iou_mean" if user == "car" else "iou_box_mean"
    return {"user": user, "iou": iou, "leads": lead, "others": found}


def _headlines(runs: pd.DataFrame) -> dict[str, list[tuple[str, str, Statistic]]]:
    """Each other tracker to the first of `COMPARED`, `TRACKER` minus the other."""
    return {
        other: [
            (user, "", tables.difference(tables.chosen(own, tracker=TRACKER), theirs, COMPARED[0]))
            for (user,), own in tables.groups(runs, ["road_user"])
            for theirs in [tables.chosen(own, tracker=other)]
            if len(theirs)
        ]
        for other in tables.names(runs, "tracker")
        if other != TRACKER
    }


def _forest(runs: pd.DataFrame) -> Figure | None:
    """`TRACKER` minus each other tracker: pairs of runs with the same scans."""
    sides = f"{TRACKER} {MINUS} the other"
    rows = [
        difference_row(
            metric(over_runs(name)),
            sides,
            user,
            other.replace("_", " "),
            tables.difference(tables.chosen(runs, road_user=user, tracker=TRACKER), own, name),
        )
        for name in COMPARED
        for (user, other), own in tables.groups(runs, ["road_user", "tracker"])
        if other != TRACKER
    ]
    return forest("answer_forest", rows, f"{TRACKER} better", f"{TRACKER} worse")


def _effects(name: str, runs: pd.DataFrame) -> Table:
    """What each variant gains or loses against the reference, of the same runs."""
    if name in ABLATIONS:
        # A track of the prior's class has no such metric.
        replaced = runs.get(REPLACED, 0.0)
        runs = runs.assign(**{REPLACED: replaced}).fillna({REPLACED: 0.0})
        whole = runs["variant"].iloc[0]
        measures = ("iou_mean", "iou_hull_mean", "iou_box_mean", "centre_rmse_m")
        others = ("nees_position_mean", "band_coverage", "track_lost", REPLACED)
        rows = effect_rows(runs, "without", lambda user: whole, {"gain": measures, "": others})
    else:
        warned = [float(misfits_class(run.metrics)) for run in runs["run"]]
        runs = runs.assign(**{WARNED: warned, "class_error": runs.get("class_error", np.nan)})
        others = ("centre_rmse_m", "track_lost", WARNED, "class_error")
        measures = {"loss": ("iou_mean", "iou_box_mean"), "": others}
        rows = effect_rows(runs, "prior", lambda user: user, measures)
    return Table.of(name, rows)


def effect_rows(
    runs: pd.DataFrame,
    heading: str,
    reference: Callable[[str], str],
    measures: Mapping[str, Sequence[str]],
) -> Iterator[dict[str, Cell]]:
    """One row for each road user and variant, with the reference minus the variant.

    Args:
        heading: of the variants.
        reference: road user to the variant with which the others are compared.
        measures: name of an effect, such as "gain", to the metrics with it; "" to those without.
    """
    for (user, variant), own in tables.groups(runs, ["road_user", "variant"]):
        whole = reference(user)
        with_all = tables.chosen(runs, road_user=user, variant=whole)
        row = {"road user": user, heading: variant, "n": own["seed"].nunique()}
        for effect, name in ((kind, name) for kind, names in measures.items() for name in names):
            label = tables.label_of(name)
            row |= tables.ends(label, tables.mean_over(own, name))
            if effect:
                apart = None if variant == whole else tables.difference(with_all, own, name)
                row |= tables.ends(f"{effect}, {label}", apart)
        yield row


def _errors_within(run: RunResult) -> dict[str, float]:
    scenario, scores = run.load("scenario"), run.scores
    away = scenario.target_poses_world[:, :2] - scenario.ego_poses_world[:, :2]
    near = np.hypot(*away.T) <= NEAR
    # Not among the scores over time.
    found = contour_errors(run.load("track"), scenario)

    def mean(values: np.ndarray) -> float:
        return float(values[near].mean()) if near.any() else float("nan")

    return {
        "iou_mean": mean(scores.iou),
        "iou_box_mean": mean(scores.iou_box),
        "centre_rmse_m": mean(scores.centre_error**2) ** 0.5,
        "orientation_rmse_deg": mean(np.degrees(scores.orientation_error) ** 2) ** 0.5,
        "nees_position_mean": mean(scores.nees_position),
        "iou_hull_mean": mean(found["iou_hull"]),
        "band_coverage": mean(found["band_coverage"]),
    }
