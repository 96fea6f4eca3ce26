"""RQ3: the numbers of the answer."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.results.text import listed
from stixel_cli.studies.forest import Row, forest
from stixel_cli.studies.inference import SIGNIFICANT, Paired
from stixel_cli.studies.rq3.compare import Comparison, reach_of
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED, THESIS, Measure
from stixel_cli.studies.tables import MINUS, capital, decimals, number
from stixel_cli.studies.types import Figure, Table

_LISTED = (
    "bias along the ray",
    "bias across the ray",
    "standard deviation of the disparity",
    "correlation of neighbours",
    "share of the target's columns without a point",
    "reach beyond the silhouette's ends",
)
"""Measures of the points in the answer's table."""

_DECADES = "log10 of mean "
"""Begin of the labels of measures in decades."""

_LED_BY = (
    "bias along the ray",
    "correlation of neighbours",
    "share of the target's columns without a point",
)
"""Measures of the points in the answer's text."""

_LED_BY_OF_TRACKS = ("centre RMSE", "orientation RMSE", "mean IoU")
LEAD = "centre RMSE"
"""The measure of the answer's first sentences."""
_MORE_IS_BETTER = {row.short_label for row in METRICS.values() if row.better == "more"}


def answer_values(
    points: Sequence[Comparison],
    tracks: Sequence[Comparison],
    cost: dict[str, Any],
    seeds: int,
    paths: int,
) -> dict[str, Any]:
    """What the template's answer is filled with.

    `seeds` and `paths` are their numbers. `leads`: the comparisons of `LEAD`; `forest`: the plot of
    the trackers' differences. `effects`: owner (points or a tracker) to road user to
    label, unit and paired difference. `few`: the families without any possibly significant test.
    `points_test`, `tracker_tests`: results of the other families' tests. `closed`: fraction of the
    gaps that the fitted noise closes.
    """
    reaches = {"points": reach_of(points), "trackers": reach_of(tracks)}
    by_tracker = {
        tracker: [one for one in tracks if one.tracker == tracker]
        for tracker in dict.fromkeys(one.tracker for one in tracks)
    }
    families = (("points", points), ("trackers", tracks))
    return {
        "leads": [one for one in tracks if one.measure.label == LEAD],
        "forest": _forest(tracks),
        "effects": {
            "points": _effects(points, _LED_BY),
            **{tracker: _effects(own, _LED_BY_OF_TRACKS) for tracker, own in by_tracker.items()},
        },
        "few": {name: reach for name, reach in reaches.items() if not reach.enough},
        "significant": SIGNIFICANT,
        "points_test": {
            "comparisons": len(points),
            "shown": sum(one.differs(FABRICATED) for one in points),
            "tests": reaches["points"].tests,
        }
        if reaches["points"].enough
        else None,
        "tracker_tests": {tracker: _verdict(own) for tracker, own in by_tracker.items()}
        if reaches["trackers"].enough
        else {},
        "closed": [_closed(name, found, reaches[name].enough) for name, found in families],
        "cost": cost,
        "thesis": THESIS,
        "seeds": seeds,
        "paths": paths,
    }


def _forest(tracks: Sequence[Comparison]) -> Figure | None:
    """Fabricated minus simulated, of the trackers' metrics in the answer's text."""
    rows = [
        Row(
            group=one.road_user,
            series=one.tracker,
            metric=f"{one.measure.label}, {FABRICATED} {MINUS} {SIMULATED}",
            unit=one.measure.unit,
            value=one.apart[FABRICATED].mean,
            low=one.apart[FABRICATED].low,
            high=one.apart[FABRICATED].high,
            tested=one.p.get(FABRICATED) is not None,
            significant=one.differs(FABRICATED),
            more_is_better=one.measure.label in _MORE_IS_BETTER,
        )
        for label in _LED_BY_OF_TRACKS
        for one in tracks
        if one.measure.label == label
    ]
    return forest("answer_forest", rows, "fabricated better", "fabricated worse")


def _effects(
    found: Sequence[Comparison], labels: Sequence[str]
) -> dict[str, list[tuple[str, str, Paired]]]:
    """Road user to label, unit and paired difference of fabricated minus simulated."""
    effects = {}
    for user in dict.fromkeys(one.road_user for one in found):
        own = {one.measure.label: one for one in found if one.road_user == user}
        effects[user] = [
            (label, own[label].measure.unit, own[label].apart[FABRICATED])
            for label in labels
            if label in own
        ]
    return effects


def answer_table(points: Sequence[Comparison], tracks: Sequence[Comparison]) -> Table:
    """The numbers of the answer: each road user with all three kinds of measurement."""
    users = list(dict.fromkeys(one.road_user for one in points))
    listed_points = [one for one in points if one.measure.label in _LISTED]
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for one in (*listed_points, *tracks):
        row = rows.setdefault((one.tracker or "points", _called(one.measure)), {})
        row[one.road_user] = _values(one)
    pairs = sorted({one.apart[FABRICATED].n for one in (*listed_points, *tracks)})
    fewer = "n is smaller where a run lacks the measure. " if len(pairs) > 1 else ""
    starred = (
        f"; * where the corrected test distinguishes {FABRICATED} from {SIMULATED}"
        if any(one.differs(FABRICATED) for one in (*listed_points, *tracks))
        else ""
    )
    return Table(
        "answer",
        f"{capital(SIMULATED)} / {FABRICATED} / {FITTED}, means over n = {listed(pairs)} runs"
        f"{starred}. {fewer}Intervals, effect sizes and each n are in the tables below.",
        ("points or tracker", "measure", *users),
        tuple((*key, *(row.get(user) for user in users)) for key, row in rows.items()),
    )


def _called(measure: Measure) -> str:
    """Name and unit; measures in decades are shown as geometric means."""
    if measure.label.startswith(_DECADES):
        return f"{measure.label.removeprefix(_DECADES)}, geometric mean"
    return f"{measure.label}, {measure.unit}" if measure.unit else measure.label


def _values(one: Comparison) -> str:
    """All three values, with a star if the test distinguishes fabricated from simulated."""
    gap = one.apart[FABRICATED]
    if one.measure.label.startswith(_DECADES):
        shown = [number(_power(value)) for value in one.means.values()]
    else:
        places = None if gap.low is None else decimals(0.5 * (gap.high - gap.low))
        shown = [number(value, places) for value in one.means.values()]
    return " / ".join(shown) + (" *" if one.differs(FABRICATED) else "")


def _power(decades: float | None) -> float | None:
    return None if decades is None else 10.0**decades


def _verdict(found: Sequence[Comparison]) -> dict[str, str]:
    """The road users and measures whose difference is shown, leaning or not shown."""
    shown = [one for one in found if one.differs(FABRICATED)]
    rest = [one for one in found if not one.differs(FABRICATED)]
    return {
        "shown": _by_user(shown),
        "leaning": _by_user([one for one in rest if _without_zero(one)]),
        "alike": _by_user([one for one in rest if not _without_zero(one)]),
    }


def _without_zero(one: Comparison, sweep: str = FABRICATED) -> bool:
    gap = one.apart[sweep]
    return gap.low is not None and not gap.low <= 0.0 <= gap.high


def _by_user(found: Sequence[Comparison]) -> str:
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [_short(one.measure.label) for one in found if one.road_user == user]
        parts.append(f"the {user} ({listed(own)})")
    return listed(parts) if parts else ""


def _short(label: str) -> str:
    label = label.removeprefix(_DECADES).partition(" / ")[0]
    return label.removeprefix("mean ").removesuffix(" RMSE")


def _closed(owner: str, found: Sequence[Comparison], tested: bool) -> dict[str, Any]:
    """Fraction of a family's gaps that the fitted noise closes, and the remaining gaps."""
    known = [one for one in found if one.closed.share is not None]
    gaps = [one for one in known if one.differs(FABRICATED)] if tested else known
    certain = [one.closed for one in gaps if one.closed.low is not None]
    return {
        "owner": owner,
        "tested": tested,
        "gaps": len(gaps),
        "share": float(np.median([one.closed.share for one in gaps])) if gaps else None,
        "certain": len(certain),
        "narrowed": sum(one.low > 0.0 for one in certain),
        "widened": sum(one.high < 0.0 for one in certain),
        "comparisons": len(found),
        "apart": sum(_without_zero(one, FITTED) for one in found),
        "left": sum(one.differs(FITTED) for one in found),
    }
