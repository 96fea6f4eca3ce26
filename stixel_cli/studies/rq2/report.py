"""RQ2: how accurate is the tracker on stixels, compared with lidar?

Everything follows from the study's runs: the trackers, measurements, road users and paths that
they have. The question names kinds of measurement and tracker.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.studies.data import (
    LIDAR,
    STIXELS,
    StudyData,
    StudyRun,
    chosen,
    names,
    run_frame,
)
from stixel_cli.studies.rq2.answer import answer_values
from stixel_cli.studies.rq2.conditions import CONDITIONS, condition_table
from stixel_cli.studies.rq2.contrasts import contrasts_table
from stixel_cli.studies.rq2.figures import boxes, by_condition, example_scans, over_time
from stixel_cli.studies.runs import (
    SCAN_ERRORS,
    ceilings_table,
    contour_distances,
    metric_over_seeds,
    of_runs,
    quantity,
    scan_frame,
    within_bounds,
)
from stixel_cli.studies.tables import number, over_seeds, std_columns, with_unit
from stixel_cli.studies.types import Material, Table

if TYPE_CHECKING:
    import pandas as pd

_TRACKING = [
    METRICS[name]
    for name in (
        *("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "iou_hull_mean", "iou_box_mean"),
        *("low_overlap_share", "track_lost"),
    )
]
"""Metrics with a standard deviation in the tables of tracking."""
NEAR = 2.0
"""Points within this distance of the true contour, m, are taken for the target's."""

_TITLES = {
    STIXELS: "Simulated measurements: stixels",
    "fabricated": "Fabricated measurements",
    LIDAR: "Lidar measurements",
}


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template; runs have the results scenario, scans, track."""
    runs = run_frame(run for sweep in data.sweeps.values() for run in sweep.runs)
    scans = scan_frame(runs)
    measurements, users = names(runs, "measurement"), names(runs, "road_user")
    return Material(
        {
            **answer_values(runs),
            "runs": len(runs),
            "users": users,
            "trackers": names(runs, "tracker"),
            "errors": {name: quantity(metric) for name, metric in SCAN_ERRORS.items()},
            "near": NEAR,
            "differences": contrasts_table(runs),
            "chapters": [
                _chapter(
                    user, chosen(runs, road_user=user), chosen(scans, road_user=user), measurements
                )
                for user in users
            ],
        }
    )


def _chapter(
    user: str, runs: "pd.DataFrame", scans: "pd.DataFrame", measurements: Sequence[str]
) -> dict[str, Any]:
    """The values of one road user's section."""
    first = chosen(runs, tracker=runs["tracker"].iloc[0])
    conditions = []
    for condition in CONDITIONS:
        name = f"{user}_by_{condition.name}"
        conditions.append(
            {
                "what": condition.what,
                "figure": by_condition(name, condition, scans, measurements),
                "table": condition_table(name, condition, scans),
            }
        )
    return {
        "user": user,
        # The scans are the same for every tracker.
        "measured": [
            _scans(
                user,
                kind,
                chosen(first, measurement_kind=kind),
                chosen(scans, measurement_kind=kind, tracker=runs["tracker"].iloc[0]),
            )
            for kind in names(runs, "measurement_kind")
        ],
        "ranking": _ranking(runs),
        "tracking": _tracking_table(user, runs, scans),
        "ceilings": ceilings_table(f"{user}_ceilings", runs, ("measurement",)),
        "boxes": boxes(f"{user}_boxes", runs, measurements),
        "over_time": {
            path: over_time(f"{user}_{path}_over_time", chosen(scans, path=path), measurements)
            for path in names(runs, "path")
        },
        "runs_a_box": len(runs) // len(runs[["tracker", "measurement"]].drop_duplicates()),
        "conditions": conditions,
    }


def _scans(user: str, kind: str, runs: "pd.DataFrame", scans: "pd.DataFrame") -> dict[str, Any]:
    """The scans of one kind of measurement, from the runs of one tracker."""
    rows, measurements = [], []
    for measurement in names(runs, "measurement"):
        for path in names(runs, "path"):
            same = chosen(runs, measurement=measurement, path=path)
            if len(same):
                own = chosen(scans, measurement=measurement, path=path)
                rows.append((measurement, path, *_scan_cells(same, own)))
        own = [row for row in rows if row[0] == measurement]
        measurements.append(
            {
                "name": measurement,
                "points": _range([row[5] for row in own]),
                "distance": _range([row[10] for row in own]),
                "empty": max((row[7] for row in own), default=0.0),
            }
        )
    table = Table(
        f"{user}_{kind}_scans",
        "",
        (
            "measurement",
            "path",
            "range from (m)",
            "range to (m)",
            "points per scan",
            *std_columns("points on the target", "points"),
            "share of scans without points on the target",
            *std_columns("mean distance from the contour (m)", "mean distance"),
            *std_columns("RMS distance (m)", "RMS distance"),
        ),
        tuple(rows),
    )
    return {
        "title": _TITLES.get(kind, kind),
        "measurements": measurements,
        "figure": example_scans(f"{user}_{kind}_examples", runs),
        "table": table,
    }


def _scan_cells(runs: "pd.DataFrame", scans: "pd.DataFrame") -> tuple[float | None, ...]:
    """Ranges, points and distances from the contour of one measurement's runs on one path."""
    near = [_near_points(run) for run in runs["run"]]
    on_target = over_seeds([float(counts.mean()) for counts, _ in near])
    away = [distances for _, distances in near if len(distances)]
    bias = over_seeds([float(d.mean()) for d in away])
    spread = over_seeds([float(np.sqrt(np.mean(np.square(d)))) for d in away])
    return (
        float(scans["range"].min()),
        float(scans["range"].max()),
        over_seeds(scans.groupby("seed")["points"].mean()).mean,
        on_target.mean,
        on_target.std,
        over_seeds([float((counts == 0).mean()) for counts, _ in near]).mean,
        bias.mean,
        bias.std,
        spread.mean,
        spread.std,
    )


def _near_points(run: StudyRun) -> tuple[np.ndarray, np.ndarray]:
    """Number of points of each scan (K,) near the true contour, and their distances, m."""
    scans = run.load("scans")
    distances = contour_distances(scans, run.load("scenario"))
    near = distances < NEAR
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return np.bincount(k[near], minlength=len(scans)), distances[near]


def gate_shares(runs: Iterable[StudyRun]) -> tuple[float | None, float | None]:
    """Share of the target's points that a tracker did not use, and of others in those it used."""
    near = lost = used = others = 0
    for run in runs:
        is_near = contour_distances(run.load("scans"), run.load("scenario")) < NEAR
        used_points = run.load("track").used_points
        own = np.count_nonzero(is_near[used_points])
        near += np.count_nonzero(is_near)
        lost += np.count_nonzero(is_near) - own
        used += len(used_points)
        others += len(used_points) - own
    return (lost / near if near else None), (others / used if used else None)


def _ranking(runs: "pd.DataFrame") -> dict[str, list[tuple[str, float]]]:
    """Tracker to its measurements and mean IoU, the best first; trackers without one left out."""
    found = {}
    for tracker in names(runs, "tracker"):
        values = {
            m: metric_over_seeds(chosen(runs, tracker=tracker, measurement=m), "iou_mean").mean
            for m in names(runs, "measurement")
        }
        known = {m: value for m, value in values.items() if value is not None}
        if known:
            found[tracker] = sorted(known.items(), key=lambda item: item[1], reverse=True)
    return found


def _tracking_table(user: str, runs: "pd.DataFrame", scans: "pd.DataFrame") -> Table:
    rows = []
    keys = ["path", "tracker", "measurement"]
    of_scans = scans.groupby(keys)
    for path in names(runs, "path"):
        for tracker in names(runs, "tracker"):
            for measurement in names(runs, "measurement"):
                key = {"path": path, "tracker": tracker, "measurement": measurement}
                same = chosen(runs, **key)
                if same.empty:
                    continue
                cells: list[str | float | int | None] = [*key.values(), len(same)]
                for metric in _TRACKING:
                    one = metric_over_seeds(same, metric.name)
                    cells += [one.mean, one.std]
                nees, nis = within_bounds(of_scans.get_group(tuple(key.values())))
                cells += [metric_over_seeds(same, "nees_position_mean").mean, nees]
                cells += [metric_over_seeds(same, "nis_mean").mean, nis, *gate_shares(same["run"])]
                rows.append(tuple(cells))
    nees, nis = (quantity(METRICS[name]) for name in ("nees_position_mean", "nis_mean"))
    columns = (
        *(*keys, "n"),
        *(
            column
            for metric in map(of_runs, _TRACKING)
            for column in std_columns(with_unit(metric), quantity(metric))
        ),
        *(nees, f"{nees.partition(' ')[0]} within", nis, f"{nis.partition(' ')[0]} within"),
        *("target's points not used", "others among the points used"),
    )
    return Table(f"{user}_tracking", "", columns, tuple(rows))


def _range(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    low, high = number(min(known)), number(max(known))
    return low if low == high else f"{low} to {high}"
