"""RQ2: how accurate is the tracker on stixels, compared with lidar?

Everything follows from the study's runs: the trackers, measurements, road users and paths that
they have. The question names kinds of measurement and tracker.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import pandas as pd

from stixel_cli.report import scan_frame, tables
from stixel_cli.report.blocks import Cell, Material, Table
from stixel_cli.report.example_scans import example_scans
from stixel_cli.report.run_frame import LIDAR, STIXELS, run_frame
from stixel_cli.report.statistics import least_effect, least_p
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq2 import contrasts
from stixel_cli.studies.rq2.figures import CONDITIONS, boxes, condition_values

LEAD = "centre_rmse_m"
"""The metric of the answer's first sentences."""
_TRACKING = (
    *("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "iou_hull_mean", "iou_box_mean"),
    *("low_overlap_share", "track_lost"),
)
"""Metrics with a standard deviation in the tables of tracking."""
_UNTESTED = (
    *("iou_hull_mean", "iou_box_mean", "low_overlap_share", "track_lost"),
    *("nees_position_mean", "nis_mean"),
)
"""Metrics that are listed without a test."""
_SUMMARY = (
    *("iou_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg"),
    *("nees_position_mean", "track_lost"),
)
"""Metrics of the table of the trackers on stixels."""
_TITLES = {
    STIXELS: "Simulated measurements: stixels",
    "fabricated": "Fabricated measurements",
    LIDAR: "Lidar measurements",
}


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template; runs have the results scenario, scans, track."""
    runs = run_frame(run for sweep in data.sweeps.values() for run in sweep.runs)
    scans = scan_frame.scan_frame(runs)
    measurements, users = tables.names(runs, "measurement"), tables.names(runs, "road_user")
    return Material(
        {
            **answer_values(runs),
            "runs": len(runs),
            "users": users,
            "trackers": tables.names(runs, "tracker"),
            "errors": scan_frame.ERROR_LABELS,
            "near": scan_frame.NEAR,
            "chapters": [
                _chapter(
                    user,
                    tables.chosen(runs, road_user=user),
                    tables.chosen(scans, road_user=user),
                    measurements,
                )
                for user in users
            ],
        }
    )


def answer_values(runs: pd.DataFrame) -> dict[str, Any]:
    """What the template's answer is filled with.

    `contrasts`: for each tracker and lidar the road users and metrics of each verdict.
    `headlines`: for each tracker the differences of `LEAD`, `leads` by road user, with the means;
    `forest`: the plot of all tested ones. `baselines`: for each tracker and baseline the `effects`
    on the IoU.
    """
    every = contrasts.contrasts(runs)
    tested = [one for one in every if one.tested]
    trackers = list(dict.fromkeys(one.tracker for one in tested))
    users, seeds = tables.names(runs, "road_user"), tables.names(runs, "seed")
    stixels = contrasts.of_kind(runs, STIXELS)[:1]
    on_stixels = runs[runs["measurement"].isin(stixels)]
    pairs = [
        (tracker, other)
        for tracker in trackers
        for other in tables.names(runs, "tracker")
        if other != tracker and contrasts.is_baseline(runs, other)
    ]
    by = ("road_user", "tracker", "measurement")
    means = tables.rows_by(runs, by, (*contrasts.ERRORS, *_UNTESTED), tables.mean_cell)
    shown = [Table.of("answer_means", means)] if tested else []
    if tested and pairs:
        shown.append(Table.of("answer_baseline", _baseline_rows(on_stixels, pairs)))
    if len(on_stixels):
        rows = tables.rows_by(on_stixels, ("road_user", "tracker"), _SUMMARY, tables.mean_cell)
        shown.append(Table.of("trackers", rows))
    return {
        "answered": bool(tested),
        "headlines": {
            tracker: [
                (
                    one.road_user,
                    one.other if len(contrasts.of_kind(runs, LIDAR)) > 1 else "",
                    one.difference,
                )
                for one in tested
                if (one.tracker, one.metric) == (tracker, LEAD)
            ]
            for tracker in trackers
        },
        "leads": _leads(tested, trackers, users),
        "lead": contrasts.ERRORS[LEAD],
        "forest": contrasts.contrasts_forest(tested, users),
        "measurements": tables.names(runs, "measurement"),
        "paths": tables.names(runs, "path"),
        "seeds": seeds,
        "contrasts": [
            _contrast([one for one in tested if (one.tracker, one.other) == (tracker, lidar)])
            for tracker in trackers
            for lidar in contrasts.of_kind(runs, LIDAR)
        ],
        "baselines": [_baseline(on_stixels, *pair) for pair in pairs],
        "consistency": {
            tracker: [
                (user, tables.mean_over(own, "nees_position_mean").mean)
                for (user,), own in tables.groups(
                    tables.chosen(on_stixels, tracker=tracker), ["road_user"]
                )
            ]
            for tracker in trackers
        },
        "tests": len(tested),
        "least_effect": least_effect(len(seeds), len(tested)) if tested and seeds[1:] else None,
        "least_p": least_p(len(seeds)),
        "differences": contrasts.contrasts_table(every),
        "tables": {table.name: table for table in shown},
    }


def _leads(
    tested: Sequence[contrasts.Contrast], trackers: Sequence[str], users: Sequence[str]
) -> list[dict[str, Any]]:
    """`LEAD` of each road user and tracker: on stixels, on each lidar, and the difference."""
    found = []
    for key in product(users, trackers, [LEAD]):
        own = [one for one in tested if (one.road_user, one.tracker, one.metric) == key]
        if own:
            label = key[0] if len(trackers) == 1 else f"{key[0]}, {key[1]}"
            found.append({"label": label, "value": own[0].values[0], "lidars": own})
    return found


def _contrast(found: Sequence[contrasts.Contrast]) -> dict[str, Any]:
    """The verdicts on one tracker, on stixels and on one lidar."""
    return {"tracker": found[0].tracker, "lidar": found[0].other, **contrasts.verdicts(found)}


def _baseline(on_stixels: pd.DataFrame, tracker: str, baseline: str) -> dict[str, Any]:
    """The IoU of a tracker minus the baseline's, by road user."""
    effects = []
    for (user,), own in tables.groups(on_stixels, ["road_user"]):
        sides = (tables.chosen(own, tracker=one) for one in (tracker, baseline))
        effects.append((user, "", tables.difference(*sides, "iou_mean")))
    return {"tracker": tracker, "baseline": baseline, "effects": effects}


def _baseline_rows(
    on_stixels: pd.DataFrame, pairs: Sequence[tuple[str, str]]
) -> Iterator[dict[str, Cell]]:
    """A tracker minus its baseline, by road user."""
    for ((user,), own), pair in product(tables.groups(on_stixels, ["road_user"]), pairs):
        sides = [tables.chosen(own, tracker=one) for one in pair]
        row: dict[str, Cell] = {"road user": user, "tracker": pair[0], "baseline": pair[1]}
        for name, shown in contrasts.ERRORS.items():
            row |= tables.ends(tables.with_unit(shown), tables.difference(*sides, name))
        yield row


def _chapter(
    user: str, runs: pd.DataFrame, scans: pd.DataFrame, measurements: Sequence[str]
) -> dict[str, Any]:
    """The values of one road user's section."""
    # The scans are the same for every tracker.
    first = {"tracker": runs["tracker"].iloc[0]}
    return {
        "user": user,
        "measured": [
            _scans(user, kind, own, tables.chosen(scans, measurement_kind=kind, **first))
            for (kind,), own in tables.groups(tables.chosen(runs, **first), ["measurement_kind"])
        ],
        "tracking": Table.of(f"{user}_tracking", _tracking_rows(runs, scans)),
        "upper_bounds": scan_frame.upper_bounds_table(
            f"{user}_upper_bounds", runs, ("measurement",)
        ),
        "boxes": boxes(f"{user}_boxes", runs, measurements),
        "over_time": {
            path: scan_frame.over_time(f"{user}_{path}_over_time", own, measurements)
            for (path,), own in tables.groups(scans, ["path"])
        },
        "runs_a_box": len(runs) // len(runs[["tracker", "measurement"]].drop_duplicates()),
        "conditions": [
            condition_values(f"{user}_by_{one.name}", one, scans, measurements)
            for one in CONDITIONS
        ],
    }


def _scans(user: str, kind: str, runs: pd.DataFrame, scans: pd.DataFrame) -> dict[str, Any]:
    """The scans of one kind of measurement, from the runs of one tracker."""
    rows = []
    for row in scan_frame.scan_rows(runs, ["measurement", "path"]):
        key = {name: row[name] for name in ("measurement", "path")}
        own = tables.chosen(scans, **key)
        near, far = float(own["range"].min()), float(own["range"].max())
        key |= {"range from (m)": near, "range to (m)": far}
        rows.append(key | {"points per scan": tables.mean_over(own, "points").mean} | row)
    return {
        "title": _TITLES.get(kind, kind),
        "figure": example_scans(f"{user}_{kind}_examples", runs),
        "table": Table.of(f"{user}_{kind}_scans", rows),
    }


def _tracking_rows(runs: pd.DataFrame, scans: pd.DataFrame) -> Iterator[dict[str, Cell]]:
    keys = ["path", "tracker", "measurement"]
    of_scans = scans.groupby(keys)
    for values, own in tables.groups(runs, keys):
        (row,) = tables.rows_by(own, keys, _TRACKING, tables.spread)
        within = scan_frame.within_bounds(of_scans.get_group(values))
        for name, share in zip(("nees_position_mean", "nis_mean"), within, strict=True):
            label = tables.label_of(name).removeprefix("mean ")
            row |= {
                label: tables.mean_over(own, name).mean,
                f"{label.partition(' ')[0]} within": share,
            }
        unused, others = scan_frame.gate_shares(own["run"])
        yield row | {"target's points not used": unused, "others among the points used": others}
