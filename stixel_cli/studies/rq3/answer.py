"""RQ3: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.experiment.text import listed
from stixel_cli.studies.nouns import Table
from stixel_cli.studies.prose import (
    capital,
    counted,
    decimals,
    number,
    percent,
    quantity,
)
from stixel_cli.studies.rq3.compare import Comparison
from stixel_cli.studies.rq3.price import THESIS, Price
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED, Measure

_TOLD = (
    "bias along the ray",
    "bias across the ray",
    "deviation of the disparity",
    "correlation of neighbours",
    "share of the target's columns without a point",
    "reach beyond the silhouette's ends",
)
"""What the answer tells of the points; their own table has the rest."""

_DECADES = "log10 of mean "
"""How the labels of measures in decades begin."""


_SILENT = (
    "That the test is silent where paths disagree does not say that the measurements are alike."
)


def answer(
    points: Sequence[Comparison],
    tracks: Sequence[Comparison],
    price: Price,
    seeds: int,
    paths: int,
) -> list[str]:
    """The answer in sentences; `seeds` and `paths` are how many the runs have."""
    sentences = [_apart(points)]
    for tracker in dict.fromkeys(one.tracker for one in tracks):
        sentences.append(_matters(tracker, [one for one in tracks if one.tracker == tracker]))
    sentences.append(" ".join([_closed("points'", points), _closed("trackers'", tracks), _SILENT]))
    sentences.append(_price(price))
    sentences.append(
        f"Brackets are 95 % intervals of a bootstrap over {counted(seeds, 'seed')} in each "
        f"of {counted(paths, 'path')}; "
        "n is the number of pairs of runs of the same path and seed. The fitted noise was judged "
        + (
            "on paths that it was not fitted to"
            if paths > 1
            else "on the path that it was fitted to"
        )
        + ", but of the same road users, street and light: of other shapes it says nothing."
    )
    return sentences


def answer_table(points: Sequence[Comparison], tracks: Sequence[Comparison]) -> Table:
    """The numbers of the answer: of every road user, by all three kinds of measurement."""
    users = list(dict.fromkeys(one.road_user for one in points))
    told = [one for one in points if one.measure.label in _TOLD]
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for one in (*told, *tracks):
        row = rows.setdefault((one.tracker or "points", _called(one.measure)), {})
        row[one.road_user] = _values(one)
    pairs = sorted({one.apart[FABRICATED].n for one in (*told, *tracks)})
    return Table(
        "answer",
        f"{capital(SIMULATED)} / {FABRICATED} / {FITTED}, means over n = {listed(pairs)} runs; * "
        f"where the corrected test tells {FABRICATED} from {SIMULATED}. Intervals and effect sizes "
        "are in the tables below.",
        ("of", "measure", *users),
        tuple((*key, *(row.get(user) for user in users)) for key, row in rows.items()),
    )


def _apart(found: Sequence[Comparison]) -> str:
    apart = sum(one.differs(FABRICATED) for one in found)
    test = "Wilcoxon's signed rank test with Holm's correction"
    if not apart:
        return (
            f"No difference between fabricated and simulated points is shown: {test} tells them "
            f"apart in none of {counted(len(found), 'comparison')} (measures times road users), "
            "which with few pairs it may not be able to."
        )
    verdict = "are not like" if 2 * apart > len(found) else "are in part unlike"
    return (
        f"Fabricated points {verdict} simulated ones: in {apart} of "
        f"{counted(len(found), 'comparison')} (measures times road users) {test} tells them apart."
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
    text = (
        f"To the {tracker} it matters for {shown}."
        if shown
        else f"To the {tracker} it makes no difference that the test shows."
    )
    if leaning:
        text += (
            f" For {leaning} the mean difference's interval leaves out 0, but the corrected test, "
            "which wants one direction in most pairs of all paths, does not show it."
        )
    return f"{text} No difference is shown for {alike}." if alike else text


def _without_zero(one: Comparison, part: str = FABRICATED) -> bool:
    gap = one.apart[part]
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


def _closed(owner: str, found: Sequence[Comparison]) -> str:
    gaps = [one for one in found if one.differs(FABRICATED) and one.closed.share is not None]
    if not gaps:
        return f"Of the {owner} no gap is shown, so there is none to close."
    share = float(np.median([one.closed.share for one in gaps]))
    surely = sum(one.closed.low > 0.0 for one in gaps)
    wider = sum(one.closed.high < 0.0 for one in gaps)
    left = sum(one.differs(FITTED) for one in found)
    known = sum(_without_zero(one, FITTED) for one in found)
    return (
        f"Of the {owner} {counted(len(gaps), 'gap')} that the test shows, the fitted noise closes "
        f"{percent(share)} in the median, path by path; by the 95 % interval it narrows {surely} "
        f"and widens {wider}. Of {counted(len(found), 'comparison')} the test still tells fitted "
        f"from simulated in {left}, and the interval of the mean difference leaves out 0 in "
        f"{known}."
    )


def _price(price: Price) -> str:
    if price.ratio is None:
        return "The price of a scan is not known: not all of its stages' seconds are recorded."
    spread = (
        f" (quartiles over the runs {number(price.quartiles[0])} and {number(price.quartiles[1])})"
        if price.quartiles is not None
        else ""
    )
    verdict = "more" if price.ratio > THESIS else "less"
    return (
        "The price: given the scenario, a simulated scan took "
        f"{quantity(1e3 * price.simulated_total, 'ms')} of computing and a fabricated one "
        f"{quantity(1e3 * price.fabricated_total, 'ms')}: {number(price.ratio)} times as "
        f"much{spread}, {verdict} than the {THESIS:.0f} times that the thesis speaks of."
    )
