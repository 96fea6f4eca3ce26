"""RQ3: the answer in sentences whose numbers are computed."""

from collections.abc import Mapping, Sequence

import numpy as np

from stixel_cli.results.text import listed
from stixel_cli.studies.inference import SIGNIFICANT
from stixel_cli.studies.prose import (
    capital,
    counted,
    decimals,
    number,
    percent,
    quantity,
    with_interval,
)
from stixel_cli.studies.rq3.compare import Comparison, Reach, reach_of
from stixel_cli.studies.rq3.cost import THESIS, Cost
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED, Measure
from stixel_cli.studies.types import Table

_TOLD = (
    "bias along the ray",
    "bias across the ray",
    "standard deviation of the disparity",
    "correlation of neighbours",
    "share of the target's columns without a point",
    "reach beyond the silhouette's ends",
)
"""What the answer tells of the points; their own table has the rest."""

_DECADES = "log10 of mean "
"""How the labels of measures in decades begin."""


_LED_BY = (
    "bias along the ray",
    "correlation of neighbours",
    "share of the target's columns without a point",
)
"""Effects on the points that the answer begins with; their own table has the rest."""

_LED_BY_OF_TRACKS = ("centre RMSE", "orientation RMSE", "mean IoU")

_SILENT = "A test that shows no difference does not show that the measurements are alike."


def answer(
    points: Sequence[Comparison],
    tracks: Sequence[Comparison],
    cost: Cost,
    seeds: int,
    paths: int,
) -> list[str]:
    """The answer in sentences: what no test can show, effects, tests, what the fit closes, cost.

    `seeds` and `paths` are how many the runs have.
    """
    reaches = {"points": reach_of(points), "trackers": reach_of(tracks)}
    sentences = [_beyond(reaches)] if not all(one.enough for one in reaches.values()) else []
    sentences.append(f"Points: {_effects(points, _LED_BY)}")
    by_tracker = {
        tracker: [one for one in tracks if one.tracker == tracker]
        for tracker in dict.fromkeys(one.tracker for one in tracks)
    }
    sentences += [
        f"{capital(tracker)}: {_effects(own, _LED_BY_OF_TRACKS)}"
        for tracker, own in by_tracker.items()
    ]
    if reaches["points"].enough:
        sentences.append(_apart(points, reaches["points"]))
    if reaches["trackers"].enough:
        sentences += [_matters(tracker, own) for tracker, own in by_tracker.items()]
    if any(reach.enough for reach in reaches.values()):
        sentences.append(_SILENT)
    owned = (("points'", points, reaches["points"]), ("trackers'", tracks, reaches["trackers"]))
    sentences.append(" ".join(_closed(own, found, reach.enough) for own, found, reach in owned))
    sentences.append(_cost(cost))
    sentences.append(
        f"Brackets are 95 % intervals over {counted(seeds, 'seed')} in each "
        f"of {counted(paths, 'path')} (Student's t; a bootstrap for the share of a gap that is "
        "closed), not corrected for their number; "
        "n is the number of pairs of runs of the same path and seed. The fitted noise was judged "
        + (
            "on paths that it was not fitted to"
            if paths > 1
            else "on the path that it was fitted to"
        )
        + ", but of the same road users, street and light: of other shapes it says nothing."
    )
    return sentences


def _beyond(reaches: Mapping[str, Reach]) -> str:
    """Of which families no test can be significant, whatever the runs are."""
    short = {what: one for what, one in reaches.items() if not one.enough}
    told = [
        f"{number(one.least)} for the {counted(one.tests, 'test')} of the {what}"
        for what, one in short.items()
    ]
    return (
        "These runs cannot distinguish fabricated from simulated measurements "
        f"({listed(list(short))}): at n = "
        f"{counted(max(one.pairs for one in short.values()), 'pair')} the smallest p that "
        f"Wilcoxon's signed rank test with Holm's correction can give is {listed(told)}. To come "
        f"below {SIGNIFICANT:g} it takes n = {max(one.needed for one in short.values())} pairs."
    )


def _effects(found: Sequence[Comparison], labels: Sequence[str]) -> str:
    """Mean paired differences with their intervals, by road user."""
    told = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = {one.measure.label: one for one in found if one.road_user == user}
        shown = [_effect(own[label]) for label in labels if label in own]
        told.append(f"{user}: {', '.join(shown)}")
    return f"mean difference, {FABRICATED} minus {SIMULATED} [95 %]. {capital('; '.join(told))}."


def _effect(one: Comparison) -> str:
    gap = one.apart[FABRICATED]
    shown = with_interval(gap.mean, gap.low, gap.high, one.measure.unit, sign=True)
    return f"{one.measure.label} {shown}"


def answer_table(points: Sequence[Comparison], tracks: Sequence[Comparison]) -> Table:
    """The numbers of the answer: of every road user, by all three kinds of measurement."""
    users = list(dict.fromkeys(one.road_user for one in points))
    told = [one for one in points if one.measure.label in _TOLD]
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for one in (*told, *tracks):
        row = rows.setdefault((one.tracker or "points", _called(one.measure)), {})
        row[one.road_user] = _values(one)
    pairs = sorted({one.apart[FABRICATED].n for one in (*told, *tracks)})
    starred = (
        f"; * where the corrected test distinguishes {FABRICATED} from {SIMULATED}"
        if any(one.differs(FABRICATED) for one in (*told, *tracks))
        else ""
    )
    return Table(
        "answer",
        f"{capital(SIMULATED)} / {FABRICATED} / {FITTED}, means over n = {listed(pairs)} runs"
        f"{starred}. Intervals and effect sizes are in the tables below.",
        ("of", "measure", *users),
        tuple((*key, *(row.get(user) for user in users)) for key, row in rows.items()),
    )


def _apart(found: Sequence[Comparison], reach: Reach) -> str:
    apart = sum(one.differs(FABRICATED) for one in found)
    verdict = (
        "differ from simulated ones"
        if 2 * apart > len(found)
        else "differ in part from simulated ones"
        if apart
        else "cannot be distinguished from simulated ones by the test"
    )
    return (
        f"Fabricated points {verdict}: in {apart} of {counted(len(found), 'comparison')} (measures "
        "times road users) Wilcoxon's signed rank test, with Holm's correction over "
        f"{counted(reach.tests, 'test')}, distinguishes them."
    )


def _called(measure: Measure) -> str:
    """Name and unit; what is measured in decades is shown as its geometric mean."""
    if measure.label.startswith(_DECADES):
        return f"{measure.label.removeprefix(_DECADES)}, geometric mean"
    return f"{measure.label}, {measure.unit}" if measure.unit else measure.label


def _values(one: Comparison) -> str:
    """Of all three, to the digits that the difference bears; starred if the test tells them."""
    gap = one.apart[FABRICATED]
    if one.measure.label.startswith(_DECADES):
        shown = [number(_power(value)) for value in one.means.values()]
    else:
        places = None if gap.low is None else decimals(0.5 * (gap.high - gap.low))
        shown = [number(value, places) for value in one.means.values()]
    return " / ".join(shown) + (" *" if one.differs(FABRICATED) else "")


def _power(decades: float | None) -> float | None:
    return None if decades is None else 10.0**decades


def _matters(tracker: str, found: Sequence[Comparison]) -> str:
    shown = _by_user([one for one in found if one.differs(FABRICATED)])
    rest = [one for one in found if not one.differs(FABRICATED)]
    leaning = _by_user([one for one in rest if _without_zero(one)])
    alike = _by_user([one for one in rest if not _without_zero(one)])
    told = []
    if shown:
        told.append(f"the corrected test shows a difference for {shown}")
    if leaning:
        told.append(
            f"the interval of the mean excludes 0, and the corrected test shows no difference, "
            f"for {leaning}"
        )
    if alike:
        told.append(f"neither shows a difference for {alike}")
    return f"{capital(tracker)}: {'; '.join(told)}."


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


def _closed(owner: str, found: Sequence[Comparison], tested: bool) -> str:
    known = [one for one in found if one.closed.share is not None]
    gaps = [one for one in known if one.differs(FABRICATED)] if tested else known
    by = "that the test shows" if tested else "whose interval excludes 0"
    if not gaps:
        return f"Of the {owner} measures, no gap {by} remains to be closed."
    share = float(np.median([one.closed.share for one in gaps]))
    certain = [one.closed for one in gaps if one.closed.low is not None]
    narrowed = sum(one.low > 0.0 for one in certain)
    widened = sum(one.high < 0.0 for one in certain)
    ends = f"; by the 95 % interval it narrows {narrowed} and widens {widened}" if certain else ""
    left = sum(one.differs(FITTED) for one in found)
    clear = sum(_without_zero(one, FITTED) for one in found)
    text = (
        f"Of the {owner} {counted(len(gaps), 'gap')} {by}, the fitted noise closes "
        f"{percent(share)} in the median, path by path{ends}. Of "
        f"{counted(len(found), 'comparison')} of fitted with simulated, the interval of the mean "
        f"difference excludes 0 in {clear}"
    )
    return f"{text}, and the test shows a difference in {left}." if tested else f"{text}."


def _cost(cost: Cost) -> str:
    if cost.ratio is None:
        return (
            "The computational cost of a scan is not known: the CPU seconds of its stages are not "
            "all recorded."
        )
    spread = (
        f" (quartiles over the runs {number(cost.quartiles[0])} and {number(cost.quartiles[1])})"
        if cost.quartiles is not None
        else ""
    )
    verdict = "more" if cost.ratio > THESIS else "less"
    return (
        "Computational cost, given the scenario: a simulated scan took "
        f"{quantity(1e3 * cost.simulated_total, 'ms')} of CPU time, a fabricated one "
        f"{quantity(1e3 * cost.fabricated_total, 'ms')}. That is {number(cost.ratio)} times as "
        f"much{spread}, {verdict} than the {THESIS:.0f} times that the thesis states."
    )
