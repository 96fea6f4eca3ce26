"""RQ3: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.studies.prose import (
    capital,
    counted,
    decimals,
    listed,
    number,
    percent,
    quantity,
)
from stixel_cli.studies.rq3.compare import Comparison
from stixel_cli.studies.rq3.price import THESIS, Price
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED

_TOLD = (
    "bias along the ray",
    "bias across the ray",
    "deviation of the disparity",
    "correlation of neighbours",
    "share of the target's columns without a point",
    "reach beyond the silhouette's ends",
)
"""What the answer tells of the points; the table has the rest."""

_DECADES = "log10 of mean "
"""How the labels of measures in decades begin."""

_ORDER = f"({SIMULATED} / {FABRICATED} / {FITTED}; in brackets fabricated minus simulated, 95 %)"


def answer(
    points: Sequence[Comparison],
    tracks: Sequence[Comparison],
    price: Price,
    seeds: int,
    paths: int,
) -> list[str]:
    """The answer in sentences; `seeds` and `paths` are how many the runs have."""
    sentences = [_apart(points)]
    for user in dict.fromkeys(one.road_user for one in points):
        own = [one for one in points if one.road_user == user and one.measure.label in _TOLD]
        pairs = own[0].apart[FABRICATED].n
        sentences.append(f"{capital(user)}, points, n = {pairs} {_ORDER}: {_values(own)}.")
    for tracker in dict.fromkeys(one.tracker for one in tracks):
        own = [one for one in tracks if one.tracker == tracker]
        sentences += [_matters(tracker, own), _tracker_numbers(tracker, own)]
    sentences.append(" ".join([_closed("points'", points), _closed("trackers'", tracks)]))
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


def _values(found: Sequence[Comparison]) -> str:
    return "; ".join(f"{_called(one.measure.label)} {_triple(one)}" for one in found)


def _called(label: str) -> str:
    if not label.startswith(_DECADES):
        return label
    return label.removeprefix(_DECADES) + ", geometric mean,"


def _triple(one: Comparison) -> str:
    gap = one.apart[FABRICATED]
    if one.measure.label.startswith(_DECADES):
        return _factor(one)
    places = None
    if gap.low is not None:
        places = decimals(0.5 * (gap.high - gap.low))
    unit = one.measure.unit
    values = " / ".join(number(value, places) for value in one.means.values())
    shown = values + unit if unit == "°" else f"{values}\u202f{unit}" if unit else values
    if gap.mean is None or gap.low is None:
        return shown
    return f"{shown} [{number(gap.low, places)}, {number(gap.high, places)}]"


def _factor(one: Comparison) -> str:
    """A measure in decades as what it is the logarithm of, and its difference as a factor."""
    gap = one.apart[FABRICATED]
    shown = " / ".join(number(_power(value)) for value in one.means.values())
    if gap.low is None:
        return shown
    return f"{shown} [times {number(_power(gap.low))}, {number(_power(gap.high))}]"


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


def _tracker_numbers(tracker: str, found: Sequence[Comparison]) -> str:
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [one for one in found if one.road_user == user]
        parts.append(f"{user}, n = {own[0].apart[FABRICATED].n}: {_values(own)}")
    return f"{capital(tracker)} {_ORDER}. {'. '.join(map(capital, parts))}."


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
        f"{known}: that the test is silent where paths disagree does not say that they are alike."
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
