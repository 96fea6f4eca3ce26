"""RQ2: the numbers of the answer."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from stixel_cli.evaluation.metric_table import metric as row_of
from stixel_cli.evaluation.metric_table import over_runs
from stixel_cli.results.text import listed
from stixel_cli.studies.data import LIDAR, STIXELS, chosen, names
from stixel_cli.studies.forest import Row, forest
from stixel_cli.studies.inference import least_p
from stixel_cli.studies.rq2.contrasts import (
    ERRORS,
    Contrast,
    family,
    is_baseline,
    least_effect,
    of_kind,
)
from stixel_cli.studies.runs import metric_over_seeds, paired_difference, quantity
from stixel_cli.studies.tables import MINUS, interval_columns, with_unit
from stixel_cli.studies.types import Column, Figure, Table
from stixel_cli.sweeps.statistics import Statistic

if TYPE_CHECKING:
    import pandas as pd

_UNTESTED = (
    *("iou_hull_mean", "iou_box_mean", "low_overlap_share", "track_lost"),
    *("nees_position_mean", "nis_mean"),
)
"""Metrics that are listed without a test."""
LEAD = "centre_rmse_m"
"""The metric of the answer's first sentences."""


def answer_values(runs: "pd.DataFrame") -> dict[str, Any]:
    """What the template's answer is filled with.

    `contrasts`: a mapping for each tracker and lidar, with its `effects` by road user, and the road
    users and metrics of each verdict. `leads`: the same differences of `LEAD` for each tracker and
    road user; `forest`: the plot of all tested differences. `baselines`: a mapping for each tracker
    and baseline, with the `effects` on the IoU by road user, and the road users of each verdict.
    """
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    tested = family(runs)
    trackers = list(dict.fromkeys(one.tracker for one in tested))
    seeds = len(names(runs, "seed"))
    users = names(runs, "road_user")
    on_stixels = chosen(runs, measurement=stixels[0]) if stixels else runs[:0]
    return {
        "answered": bool(tested),
        "leads": _leads(tested, trackers, users),
        "lead": ERRORS[LEAD],
        "forest": _forest(tested, trackers, users),
        "measurements": names(runs, "measurement"),
        "paths": names(runs, "path"),
        "seeds": names(runs, "seed"),
        "contrasts": [
            _contrast([one for one in tested if (one.tracker, one.other) == (tracker, lidar)])
            for tracker in trackers
            for lidar in lidars
        ],
        "baselines": [
            _baseline(on_stixels, users, tracker, baseline)
            for tracker in trackers
            for baseline in _baselines(runs, tracker)
        ],
        "consistency": {
            tracker: [
                (user, _metric(on_stixels, user, tracker, stixels[0], "nees_position_mean"))
                for user in users
            ]
            for tracker in trackers
        },
        "tests": len(tested),
        "least_effect": least_effect(seeds, len(tested)) if tested and seeds > 1 else None,
        "least_p": least_p(seeds),
        "tables": {table.name: table for table in answer_tables(runs)},
    }


def _leads(
    tested: Sequence[Contrast], trackers: Sequence[str], users: Sequence[str]
) -> list[dict[str, Any]]:
    """`LEAD` of each road user and tracker: on stixels, on each lidar, and the difference."""
    found = []
    for user in users:
        for tracker in trackers:
            own = [
                one
                for one in tested
                if (one.road_user, one.tracker, one.metric) == (user, tracker, LEAD)
            ]
            if own:
                label = user if len(trackers) == 1 else f"{user}, {tracker}"
                found.append({"label": label, "value": own[0].values[0], "lidars": own})
    return found


def _forest(
    tested: Sequence[Contrast], trackers: Sequence[str], users: Sequence[str]
) -> Figure | None:
    """The tested differences: stixels minus each lidar."""
    rows = [
        Row(
            group=one.road_user,
            series=one.other if len(trackers) == 1 else f"{one.tracker}, {one.other}",
            metric=f"{ERRORS[one.metric].short_label}, {one.one} {MINUS} lidar",
            unit=ERRORS[one.metric].unit,
            value=one.difference.mean,
            low=one.difference.low,
            high=one.difference.high,
            tested=one.p is not None,
            significant=one.verdict in ("worse", "better"),
            more_is_better=ERRORS[one.metric].better == "more",
        )
        for user in users
        for one in tested
        if one.road_user == user
    ]
    return forest("answer_forest", rows, "stixels better", "stixels worse")


def _contrast(found: Sequence[Contrast]) -> dict[str, Any]:
    """The differences of one tracker on stixels and on one lidar, and the verdicts."""
    effects: dict[str, list[tuple[str, str, Statistic]]] = {}
    for one in found:
        metric = ERRORS[one.metric]
        effect = (metric.short_label, metric.unit, one.difference)
        effects.setdefault(one.road_user, []).append(effect)
    return {
        "tracker": found[0].tracker,
        "stixels": found[0].one,
        "lidar": found[0].other,
        "effects": effects,
        **{
            verdict: _by_user([one for one in found if one.verdict == verdict])
            for verdict in ("worse", "better", "leaning", "alike")
        },
    }


def _baseline(
    on_stixels: "pd.DataFrame", users: Sequence[str], tracker: str, baseline: str
) -> dict[str, Any]:
    """The IoU of a tracker minus the baseline's, and the road users by what its intervals show."""
    effects = {
        user: baseline_difference(on_stixels, user, tracker, baseline, "iou_mean") for user in users
    }
    verdicts: dict[str, list[str]] = {}
    for user, iou in effects.items():
        verdicts.setdefault(_of_interval(iou), []).append(f"the {user}")
    return {"tracker": tracker, "baseline": baseline, "effects": effects, "verdicts": verdicts}


def answer_tables(runs: "pd.DataFrame") -> tuple[Table, ...]:
    """The numbers of the answer; empty unless there are stixels and a lidar."""
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    tested = family(runs)
    if not tested:
        return ()
    trackers = list(dict.fromkeys(one.tracker for one in tested))
    tables = [_lidar_table(runs, tested, trackers, stixels[0], lidars)]
    baselines = [
        (tracker, baseline) for tracker in trackers for baseline in _baselines(runs, tracker)
    ]
    if baselines:
        tables.append(_baseline_table(chosen(runs, measurement=stixels[0]), baselines))
    return tuple(tables)


def _baselines(runs: "pd.DataFrame", tracker: str) -> list[str]:
    """The baselines other than this tracker."""
    return [one for one in names(runs, "tracker") if one != tracker and is_baseline(runs, one)]


def _lidar_table(
    runs: "pd.DataFrame",
    tested: Sequence[Contrast],
    trackers: Sequence[str],
    stixels: str,
    lidars: Sequence[str],
) -> Table:
    columns: list[str | Column] = ["road user", "tracker", "metric", stixels]
    for lidar in lidars:
        columns += [lidar, *interval_columns(f"{stixels} {MINUS} {lidar}", lidar)]
    rows = []
    for user in names(runs, "road_user"):
        for tracker in trackers:
            own = [one for one in tested if (one.road_user, one.tracker) == (user, tracker)]
            for metric in ERRORS:
                row = [user, tracker, with_unit(ERRORS[metric], "{}, {}")]
                for i, one in enumerate(one for one in own if one.metric == metric):
                    row += one.values if i == 0 else one.values[1:]
                    row += [one.difference.mean, one.difference.low, one.difference.high]
                rows.append(tuple(row))
            for metric in _UNTESTED:
                name = row_of(over_runs(metric)).short_label
                row = [user, tracker, name, _metric(runs, user, tracker, stixels, metric)]
                for lidar in lidars:
                    row += [_metric(runs, user, tracker, lidar, metric), None, None, None]
                rows.append(tuple(row))
    return Table(
        "answer_lidar",
        "",
        tuple(columns),
        tuple(rows),
    )


def _baseline_table(on_stixels: "pd.DataFrame", pairs: Sequence[tuple[str, str]]) -> Table:
    rows = []
    for user in names(on_stixels, "road_user"):
        for tracker, baseline in pairs:
            for metric in ERRORS:
                values = [
                    metric_over_seeds(chosen(on_stixels, road_user=user, tracker=one), metric).mean
                    for one in (tracker, baseline)
                ]
                apart = baseline_difference(on_stixels, user, tracker, baseline, metric)
                row = (user, tracker, baseline, with_unit(ERRORS[metric], "{}, {}"), *values)
                rows.append((*row, apart.mean, apart.low, apart.high))
    return Table(
        "answer_baseline",
        "",
        (
            "road user",
            "tracker",
            "baseline",
            "metric",
            "mean of the tracker",
            "mean of the baseline",
            *interval_columns("difference", "difference"),
        ),
        tuple(rows),
    )


def _by_user(found: Sequence[Contrast]) -> str:
    """The road users, each with its metrics."""
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [quantity(ERRORS[one.metric]) for one in found if one.road_user == user]
        parts.append(f"the {user} ({listed(own)})")
    return listed(parts)


def baseline_difference(
    runs: "pd.DataFrame", user: str, tracker: str, baseline: str, metric: str
) -> Statistic:
    """A metric of a tracker minus the baseline's, paired by road user, path and seed."""
    sides = [chosen(runs, road_user=user, tracker=one) for one in (tracker, baseline)]
    return paired_difference(*sides, metric)


def _of_interval(iou: Statistic) -> str:
    """Verdict by the interval of the tracker's IoU minus the baseline's."""
    if iou.low is None:
        return "not comparable (no interval)"
    if iou.low <= 0.0 <= iou.high:
        return "not shown to differ"
    return "better" if iou.low > 0.0 else "worse"


def _metric(
    runs: "pd.DataFrame", user: str, tracker: str, measurement: str, metric: str
) -> float | None:
    same = chosen(runs, road_user=user, tracker=tracker, measurement=measurement)
    return metric_over_seeds(same, metric).mean
