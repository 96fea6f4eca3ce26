"""RQ3: the numbers of the answer."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stixel_cli.report.metrics import listed_by_user
from stixel_cli.report.statistics import SIGNIFICANT, Paired, excludes_zero
from stixel_cli.studies.rq3.compare import Comparison, comparisons_forest, reach_of
from stixel_cli.studies.rq3.measures import DECADES, FABRICATED, FITTED

_LED_BY = (
    "bias along the ray",
    "correlation of neighbours",
    "share of the target's columns without a point",
)
"""Measures of the points in the answer's text."""
_LED_BY_OF_TRACKS = ("centre RMSE", "orientation RMSE", "mean IoU")
THESIS = 60.0
"""The thesis states that simulated scans take more than this many times as long."""
LEAD = "centre RMSE"
"""The measure of the answer's first sentences."""


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
    by_tracker: dict[str, list[Comparison]] = {}
    for one in tracks:
        by_tracker.setdefault(one.tracker, []).append(one)
    families = (("points", points), ("trackers", tracks))
    led = [one for one in tracks if one.measure.label in _LED_BY_OF_TRACKS]
    return {
        "leads": [one for one in tracks if one.measure.label == LEAD],
        "forest": comparisons_forest("answer_forest", led, (FABRICATED,)),
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


def _effects(
    found: Sequence[Comparison], labels: Sequence[str]
) -> dict[str, list[tuple[str, str, Paired]]]:
    """Road user to label, unit and paired difference of fabricated minus simulated."""
    effects: dict[str, list[tuple[str, str, Paired]]] = {one.road_user: [] for one in found}
    for label in labels:
        for one in found:
            if one.measure.label == label:
                effects[one.road_user].append((label, one.measure.unit, one.apart[FABRICATED]))
    return effects


def _verdict(found: Sequence[Comparison]) -> dict[str, str]:
    """The road users and measures whose difference is shown, leaning or not shown."""
    sorts: dict[str, list[tuple[str, str]]] = {"shown": [], "leaning": [], "alike": []}
    for one in found:
        leaning = "leaning" if excludes_zero(one.apart[FABRICATED]) else "alike"
        label = one.measure.label.removeprefix(DECADES).partition(" / ")[0]
        label = label.removeprefix("mean ").removesuffix(" RMSE")
        sorts["shown" if one.differs(FABRICATED) else leaning].append((one.road_user, label))
    return {name: listed_by_user(own) for name, own in sorts.items()}


def _closed(owner: str, found: Sequence[Comparison], tested: bool) -> dict[str, Any]:
    """Fraction of a family's gaps that the fitted noise closes, and the remaining gaps."""
    known = [one for one in found if one.closed.mean is not None]
    gaps = [one for one in known if one.differs(FABRICATED)] if tested else known
    certain = [one.closed for one in gaps if one.closed.low is not None]
    return {
        "owner": owner,
        "tested": tested,
        "gaps": len(gaps),
        "share": float(np.median([one.closed.mean for one in gaps])) if gaps else None,
        "certain": len(certain),
        "narrowed": sum(one.low > 0.0 for one in certain),
        "widened": sum(one.high < 0.0 for one in certain),
        "comparisons": len(found),
        "apart": sum(excludes_zero(one.apart[FITTED]) for one in found),
        "left": sum(one.differs(FITTED) for one in found),
    }
