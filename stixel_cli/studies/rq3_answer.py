"""RQ3: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.report.metrics import format_value
from stixel_cli.studies.rq3_compare import Comparison
from stixel_cli.studies.rq3_price import THESIS, Price
from stixel_cli.studies.rq3_runs import FABRICATED, FITTED, SIMULATED


def answer(points: Sequence[Comparison], tracks: Sequence[Comparison], price: Price) -> list[str]:
    """The answer in sentences."""
    sentences = [_counted("Points", points), _counted("Tracker", tracks)]
    for user in dict.fromkeys(one.road_user for one in points):
        sentences.append(_point_sentence([one for one in points if one.road_user == user]))
    for tracker in dict.fromkeys(one.tracker for one in tracks):
        sentences.append(_track_sentence([one for one in tracks if one.tracker == tracker]))
    sentences.append(_price_sentence(price))
    return sentences


def _counted(what: str, found: Sequence[Comparison]) -> str:
    apart = [sum(one.differs(part) for one in found) for part in (FABRICATED, FITTED)]
    shares = [one.closed.share for one in found if one.closed.share is not None]
    closed = sum(one.closed.low > 0.0 for one in found if one.closed.low is not None)
    wider = sum(one.closed.high < 0.0 for one in found if one.closed.high is not None)
    text = (
        f"{what}: of {len(found)} comparisons, Wilcoxon's test with Holm's correction tells "
        f"fabricated from simulated in {apart[0]}, fitted from simulated in {apart[1]}."
    )
    if shares:
        text += (
            f" In {len(shares)} the 95 % interval of the gap leaves out 0; of these gaps the "
            f"fitted noise closes {_percent(float(np.median(shares)))} in the median, surely part "
            f"of it in {closed}, and makes it surely wider in {wider}."
        )
    else:
        text += " No gap's 95 % interval leaves out 0, so there is none to close."
    return text


def _point_sentence(found: Sequence[Comparison]) -> str:
    parts = [
        _values(one)
        for one in found
        if one.measure.label
        in ("bias along the ray", "deviation of the disparity", "correlation of neighbours")
        or one.measure.label.startswith(("reach", "share of the target's"))
    ]
    return (
        f"{found[0].road_user.capitalize()}, points, {SIMULATED} / {FABRICATED} / {FITTED}: "
        f"{'; '.join(parts)}."
    )


def _track_sentence(found: Sequence[Comparison]) -> str:
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [one for one in found if one.road_user == user]
        shown = [_values(one) for one in own if not one.measure.label.startswith("log10")]
        parts.append(f"{user}: {', '.join(shown)}")
    return (
        f"{found[0].tracker}, {SIMULATED} / {FABRICATED} / {FITTED} (n = "
        f"{max(one.apart[FABRICATED].n for one in found)} pairs a road user): {'; '.join(parts)}."
    )


def _values(one: Comparison) -> str:
    values = " / ".join(format_value(value) for value in one.means.values())
    unit = one.measure.unit
    unit = unit if unit in ("", "°") else f" {unit}"
    closed = one.closed
    more = (
        f" (gap closed {_percent(closed.share)}, {_percent(closed.low)} to {_percent(closed.high)})"
        if closed.share is not None
        else ""
    )
    return f"{one.measure.label} {values}{unit}{more}"


def _price_sentence(price: Price) -> str:
    if price.ratio is None:
        return "The price of a scan is not known: not all of its stages' seconds are recorded."
    more = "more" if price.ratio > THESIS else "less"
    return (
        f"Given the scenario, a simulated scan took {format_value(1e3 * price.simulated_total)} ms "
        "of computing, a "
        f"fabricated one {format_value(1e3 * price.fabricated_total)} ms: "
        f"{format_value(price.ratio)} times as much, {more} than the {THESIS:.0f} times "
        "that the thesis speaks of."
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"
