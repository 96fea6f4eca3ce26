"""RQ2: how does the tracker do on stixels against lidar?

Everything follows from the study's runs: the trackers, measurements, road users and paths that
they have. The question names kinds of measurement and tracker.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stixel_cli.studies.field_names import LIDAR, STIXELS
from stixel_cli.studies.prose import number
from stixel_cli.studies.rq2.answer import answer_values
from stixel_cli.studies.rq2.conditions import CONDITIONS, condition_table
from stixel_cli.studies.rq2.contrasts import ERRORS, contrasts_table
from stixel_cli.studies.rq2.figures import boxes, by_condition, example_scans, over_time
from stixel_cli.studies.rq2.runs import (
    Run,
    chosen,
    contour_distances,
    metric_over_seeds,
    names,
    runs_of,
    within_bounds,
)
from stixel_cli.studies.tables import over_seeds
from stixel_cli.studies.types import Material, StudyData, Table

NEAR = 2.0
"""Points within this distance of the true contour, m, are taken for the target's."""

_TITLES = {
    STIXELS: "Simulated measurements: stixels",
    "fabricated": "Fabricated measurements",
    LIDAR: "Lidar measurements",
}


def report(data: StudyData) -> Material:
    """What the template is filled with; every run has scenario, scans and track."""
    runs = runs_of(data)
    measurements, users = names(runs, "measurement"), names(runs, "road_user")
    return Material(
        {
            **answer_values(runs),
            "runs": len(runs),
            "users": users,
            "trackers": names(runs, "tracker"),
            "near": NEAR,
            "differences": contrasts_table(runs),
            "chapters": [_chapter(u, chosen(runs, road_user=u), measurements) for u in users],
        }
    )


def _chapter(user: str, runs: Sequence[Run], measurements: Sequence[str]) -> dict[str, Any]:
    """The values of one road user's chapter."""
    return {
        "user": user,
        "measured": [_scans(user, kind, chosen(runs, kind=kind)) for kind in names(runs, "kind")],
        "ranking": _ranking(runs),
        "tracking": _tracking_table(user, runs),
        "boxes": boxes(f"{user}_boxes", runs, measurements),
        "over_time": [
            over_time(f"{user}_{path}_over_time", chosen(runs, path=path), measurements)
            for path in names(runs, "path")
        ],
        "conditions": [
            {
                "what": condition.what,
                "figure": by_condition(
                    f"{user}_by_{condition.name}", condition, runs, measurements
                ),
                "table": condition_table(f"{user}_by_{condition.name}", condition, runs),
            }
            for condition in CONDITIONS
        ],
    }


def _scans(user: str, kind: str, runs: Sequence[Run]) -> dict[str, Any]:
    """The scans of one kind of measurement; they are the same for every tracker."""
    runs = chosen(runs, tracker=names(runs, "tracker")[0])
    rows, measurements = [], []
    for measurement in names(runs, "measurement"):
        for path in names(runs, "path"):
            same = chosen(runs, measurement=measurement, path=path)
            if same:
                rows.append((measurement, path, *_scan_cells(same)))
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
            "points a scan",
            "points on the target",
            "± points",
            "share of scans without",
            "mean distance from the contour (m)",
            "± mean distance",
            "RMS distance (m)",
            "± RMS distance",
        ),
        tuple(rows),
    )
    return {
        "title": _TITLES.get(kind, kind),
        "measurements": measurements,
        "figure": example_scans(f"{user}_{kind}_examples", runs),
        "table": table,
    }


def _scan_cells(runs: Sequence[Run]) -> tuple[float | None, ...]:
    """Ranges, points and distances from the contour of one measurement's runs on one path."""
    near = [_near_points(run) for run in runs]
    on_target = over_seeds([float(counts.mean()) for counts, _ in near])
    away = [distances for _, distances in near if len(distances)]
    bias = over_seeds([float(d.mean()) for d in away])
    spread = over_seeds([float(np.sqrt(np.mean(np.square(d)))) for d in away])
    ranges = np.concatenate([run.ranges for run in runs])
    return (
        float(ranges.min()),
        float(ranges.max()),
        over_seeds([float(run.scan_points.mean()) for run in runs]).mean,
        on_target.mean,
        on_target.std,
        over_seeds([float((counts == 0).mean()) for counts, _ in near]).mean,
        bias.mean,
        bias.std,
        spread.mean,
        spread.std,
    )


def _near_points(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """How many points of each scan (K,) are near the true contour, and their distances m."""
    scans = run.point.load("scans")
    distances = contour_distances(scans, run.point.load("scenario"))
    near = distances < NEAR
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return np.bincount(k[near], minlength=len(scans)), distances[near]


def _ranking(runs: Sequence[Run]) -> dict[str, list[tuple[str, float]]]:
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


def _tracking_table(user: str, runs: Sequence[Run]) -> Table:
    rows = []
    for path in names(runs, "path"):
        for tracker in names(runs, "tracker"):
            for measurement in names(runs, "measurement"):
                same = chosen(runs, path=path, tracker=tracker, measurement=measurement)
                if not same:
                    continue
                cells: list[str | float | int | None] = [path, tracker, measurement, len(same)]
                for metric in (*ERRORS, "low_overlap_share"):
                    one = metric_over_seeds(same, metric)
                    cells += [one.mean, one.std]
                nees, nis = within_bounds(same)
                cells += [metric_over_seeds(same, "nees_position_mean").mean, nees]
                cells += [metric_over_seeds(same, "nis_mean").mean, nis]
                rows.append(tuple(cells))
    return Table(
        f"{user}_tracking",
        "",
        (
            "path",
            "tracker",
            "measurement",
            "n",
            "centre RMSE (m)",
            "± centre",
            "orientation RMSE (°)",
            "± orientation",
            "mean IoU",
            "± IoU",
            "share of low overlap",
            "± share of low overlap",
            "NEES / 2",
            "NEES within",
            "NIS / d.o.f.",
            "NIS within",
        ),
        tuple(rows),
    )


def _range(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    low, high = number(min(known)), number(max(known))
    return low if low == high else f"{low} to {high}"
