"""The measured values of the tracker `contour` next to the project's goals."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.studies.data import chosen, names
from stixel_cli.studies.runs import metric_over_seeds
from stixel_cli.studies.tables import interval_columns, with_unit
from stixel_cli.studies.types import Table

if TYPE_CHECKING:
    import pandas as pd

TRACKER = "contour"
LIDAR_64 = "64-layer lidar"


@dataclass(frozen=True)
class Goal:
    """A goal for a metric of a road user; `low` or `high` is None without a limit.

    `path` is "" for the mean of the paths; `sweep` is one of the study.
    """

    sweep: str
    user: str
    name: str
    low: float | None
    high: float | None = None
    path: str = ""


IOU, HULL, BOX = "iou_mean", "iou_hull_mean", "iou_box_mean"
CENTRE, ORIENTATION, NEES = "centre_rmse_m", "orientation_rmse_deg", "nees_position_mean"

GOALS = (
    Goal("simulated", "car", IOU, 0.88),
    Goal("simulated", "car", IOU, 0.94, path="turn"),
    Goal("simulated", "car", IOU, 0.90, path="crossing"),
    Goal("simulated", "car", IOU, 0.82, path="approach"),
    Goal("simulated", "car", CENTRE, None, 0.15),
    Goal("simulated", "car", ORIENTATION, None, 1.2),
    Goal("simulated", "car", NEES, 0.8, 1.3),
    Goal("simulated", "cyclist", BOX, 0.70),
    Goal("simulated", "cyclist", HULL, 0.62),
    Goal("simulated", "cyclist", IOU, 0.50),
    Goal("simulated", "cyclist", CENTRE, None, 0.18),
    Goal("simulated", "cyclist", NEES, 0.5, 2.0),
    Goal("simulated", "pedestrian", BOX, 0.75),
    Goal("simulated", "pedestrian", HULL, 0.74),
    Goal("simulated", "pedestrian", IOU, 0.60),
    Goal("simulated", "pedestrian", CENTRE, None, 0.07),
    Goal("simulated", "pedestrian", NEES, 0.7, 1.3),
    *(
        goal
        for user in ("car", "cyclist", "pedestrian")
        for goal in (
            Goal("simulated", user, "track_lost", None, 0.0),
            Goal("simulated", user, "band_coverage", 0.93, 0.97),
        )
    ),
    Goal("long_range", "car", IOU, 0.92),
    Goal("long_range", "car", CENTRE, None, 0.10),
    Goal("long_range", "car", ORIENTATION, None, 1.2),
    Goal("long_range", "cyclist", BOX, 0.78),
    Goal("long_range", "cyclist", HULL, 0.70),
    Goal("long_range", "cyclist", IOU, 0.58),
    Goal("long_range", "cyclist", CENTRE, None, 0.12),
    Goal("long_range", "pedestrian", BOX, 0.82),
    Goal("long_range", "pedestrian", HULL, 0.82),
    Goal("long_range", "pedestrian", IOU, 0.70),
    Goal("long_range", "pedestrian", CENTRE, None, 0.04),
    Goal("fabricated", "car", IOU, 0.95),
    Goal("fabricated", "car", CENTRE, None, 0.05),
    Goal("fabricated", "cyclist", BOX, 0.85),
    Goal("fabricated", "pedestrian", BOX, 0.88),
    Goal("lidar", "car", IOU, 0.95),
    Goal("lidar", "cyclist", BOX, 0.85),
    Goal("lidar", "pedestrian", BOX, 0.85),
)


def goals_table(frames: Mapping[str, "pd.DataFrame"]) -> Table:
    """One row for each goal whose runs exist, and for those of one mesh where it was measured.

    `frames` have the runs of each sweep on the paths of the mean.
    """
    rows = []
    for goal in GOALS:
        label = with_unit(metric(over_runs(goal.name)))
        found = _value(frames[goal.sweep], goal)
        if found is None:
            continue
        mesh = _value(frames["one_mesh"], goal) if goal.sweep == "simulated" else None
        met = (goal.low is None or (found.mean is not None and found.mean >= goal.low)) and (
            goal.high is None or (found.mean is not None and found.mean <= goal.high)
        )
        rows.append(
            (
                goal.user,
                LIDAR_64 if goal.sweep == "lidar" else goal.sweep.replace("_", " "),
                goal.path or "mean of paths",
                label,
                *(found.mean, found.low, found.high),
                *((None,) * 3 if mesh is None else (mesh.mean, mesh.low, mesh.high)),
                goal.low,
                goal.high,
                "yes" if met else "no",
            )
        )
    columns = (
        *("road user", "measurement", "path", "metric"),
        *interval_columns("value", "value"),
        *interval_columns("one mesh", "one mesh"),
        *("goal, at least", "goal, at most", "met"),
    )
    return Table("goals", "", columns, tuple(rows))


def _value(runs: "pd.DataFrame", goal: Goal):
    """The metric of the goal over seeds; None without runs."""
    own = chosen(runs, road_user=goal.user, tracker=TRACKER)
    if goal.path:
        own = chosen(own, path=goal.path)
    if goal.sweep == "lidar":
        layers = [name for name in names(own, "measurement") if LIDAR_64 in name]
        own = own[own["measurement"].isin(layers)]
    return metric_over_seeds(own, goal.name) if len(own) else None
