"""RQ2: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

from stixel_cli.studies.field_names import LIDAR, STIXELS
from stixel_cli.studies.prose import (
    capital,
    decimals,
    listed,
    number,
    percent,
    quantity,
    with_interval,
)
from stixel_cli.studies.rq2.contrasts import (
    ERRORS,
    Contrast,
    family,
    is_floor,
    of_kind,
)
from stixel_cli.studies.rq2.runs import (
    Run,
    chosen,
    metric_over_seeds,
    names,
    paired_difference,
)
from stixel_cli.sweeps.statistics import Statistic

_SHORT = {"centre_rmse_m": "centre", "orientation_rmse_deg": "orientation", "iou_mean": "IoU"}


def answer(runs: Sequence[Run]) -> list[str]:
    """The answer in sentences, their numbers computed."""
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    if not stixels or not lidars:
        there = listed(names(runs, "measurement"))
        return [
            f"This study holds {there}: without both stixels and a lidar it answers nothing of "
            "the question itself. What it holds stands below."
        ]
    tested = family(runs)
    trackers = list(dict.fromkeys(one.tracker for one in tested))
    sentences = []
    for tracker in trackers:
        for lidar in lidars:
            own = [one for one in tested if (one.tracker, one.other) == (tracker, lidar)]
            sentences.append(_verdict(own))
        for user in names(runs, "road_user"):
            sentences.append(_numbers(runs, tested, user, tracker))
    floors = [tracker for tracker in names(runs, "tracker") if is_floor(runs, tracker)]
    for tracker in trackers:
        for floor in floors:
            if floor != tracker:
                sentences.append(_against_floor(runs, tracker, floor, stixels[0]))
        sentences.append(_consistency(runs, tracker, (stixels[0], *lidars)))
    return [*sentences, _limits(runs, tested)]


def _verdict(found: Sequence[Contrast]) -> str:
    """For what stixels are worse or better than a lidar, and for what no difference is shown."""
    tracker, lidar = found[0].tracker, found[0].other
    told = {
        verdict: _by_user([one for one in found if one.verdict == verdict])
        for verdict in ("worse", "better", "leaning", "alike")
    }
    sentences = []
    for verdict in ("worse", "better"):
        if told[verdict]:
            sentences.append(
                f"the {tracker} does {verdict} on stixels than on the {lidar} for {told[verdict]}"
            )
    if not sentences:
        sentences.append(
            f"no difference of the {tracker} on stixels from the {lidar} stands up to the test"
        )
    text = capital(", and ".join(sentences)) + "."
    if told["leaning"]:
        text += (
            f" For {told['leaning']} the interval leaves out 0, but not once it is corrected for "
            "the number of tests."
        )
    if told["alike"]:
        text += f" For {told['alike']} no difference is shown."
    return text


def _by_user(found: Sequence[Contrast]) -> str:
    """The road users with the metrics that were found of them."""
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [_SHORT[one.metric] for one in found if one.road_user == user]
        parts.append(f"the {user} ({listed(own)})")
    return listed(parts)


def _numbers(runs: Sequence[Run], tested: Sequence[Contrast], user: str, tracker: str) -> str:
    """The errors on stixels and on each lidar, with the paired differences."""
    own = [one for one in tested if (one.road_user, one.tracker) == (user, tracker)]
    stixels, lidars = own[0].one, list(dict.fromkeys(one.other for one in own))
    parts = []
    for metric, (name, unit, _) in ERRORS.items():
        same = [one for one in own if one.metric == metric and one.one == stixels]
        places = _places(same)
        beside = [
            f"{quantity(one.values[1], unit, places)} on the {one.other} ({_difference(one, unit)})"
            for one in same
        ]
        parts.append(
            f"{name} {quantity(same[0].values[0], unit, places)} on {stixels} against "
            f"{listed(beside)}"
        )
    lost = [
        f"{percent(_metric(runs, user, tracker, measurement, 'lost_share'))} on "
        + (measurement if measurement == stixels else f"the {measurement}")
        for measurement in (stixels, *lidars)
    ]
    return f"{capital(user)}, {tracker}: {'; '.join(parts)}. Scans lost: {listed(lost)}."


def _places(found: Sequence[Contrast]) -> int | None:
    """Decimals that the differences' intervals bear, the coarsest."""
    halves = [
        0.5 * (one.difference.high - one.difference.low)
        for one in found
        if one.difference.low is not None
    ]
    return decimals(max(halves)) if halves else None


def _difference(one: Contrast, unit: str) -> str:
    found = one.difference
    if found.mean is None:
        return "no pair has both"
    return f"difference {with_interval(found.mean, found.low, found.high, unit, sign=True)}"


def _against_floor(runs: Sequence[Run], tracker: str, floor: str, stixels: str) -> str:
    parts = []
    on_stixels = chosen(runs, measurement=stixels)
    for user in names(runs, "road_user"):
        told = []
        for metric, (name, unit, _) in ERRORS.items():
            one = floor_difference(on_stixels, user, tracker, floor, metric)
            told.append(f"{name} {_signed(one, unit)}")
        parts.append(f"{user}: {', '.join(told)}")
    told: dict[str, list[str]] = {}
    for user in names(runs, "road_user"):
        overlap = floor_difference(on_stixels, user, tracker, floor, "iou_mean")
        told.setdefault(_beside_floor(overlap), []).append(f"the {user}")
    verdict = "; ".join(f"{how} for {listed(users)}" for how, users in told.items())
    return (
        f"On stixels the {tracker} beside the {floor}, the least that an extended tracker must "
        f"beat, by the interval of the IoU, which is not corrected for the number of comparisons: "
        f"{verdict}. Differences, {tracker} minus {floor}: {'; '.join(parts)}."
    )


def floor_difference(
    runs: Sequence[Run], user: str, tracker: str, floor: str, metric: str
) -> Statistic:
    """A metric of a tracker minus the floor's, paired by road user, path and seed."""
    sides = [chosen(runs, road_user=user, tracker=one) for one in (tracker, floor)]
    return paired_difference(*sides, metric)


def _beside_floor(iou: Statistic) -> str:
    if iou.low is None or iou.low <= 0.0 <= iou.high:
        return "no difference is shown"
    return "better" if iou.low > 0.0 else "worse"


def _signed(found: Statistic, unit: str) -> str:
    if found.mean is None:
        return "–"
    return with_interval(found.mean, found.low, found.high, unit, sign=True)


def _consistency(runs: Sequence[Run], tracker: str, measurements: Sequence[str]) -> str:
    parts = []
    for user in names(runs, "road_user"):
        shown = [
            f"{number(_metric(runs, user, tracker, one, 'nees_position_mean'))} / "
            f"{number(_metric(runs, user, tracker, one, 'nis_mean'))}"
            for one in measurements
        ]
        parts.append(f"{user} {', '.join(shown)}")
    return (
        f"Consistency of the {tracker}, mean position NEES / 2 and mean NIS / d.o.f. over scans, "
        "paths and seeds: 1 where the stated covariance is right, more where the tracker is too "
        "sure of itself; a mean is moved most by the runs that diverge. On "
        f"{listed(measurements)}, in this order: {'; '.join(parts)}."
    )


def _limits(runs: Sequence[Run], tested: Sequence[Contrast]) -> str:
    seeds = names(runs, "seed")
    return (
        f"Brackets are 95 % intervals over n = {len(seeds)} seeds, each the mean over "
        f"{len(names(runs, 'path'))} paths, differences paired by path and seed; verdicts are of "
        f"{len(tested)} paired t-tests with Holm's correction. The seeds renew the sensors' noise "
        "and the tracker's noisy start, not motion, road user or street: the answer holds for "
        "these rendered scenes, one shape a class, a target that is known to be there, and no "
        "clutter but what the sensors make."
    )


def _metric(
    runs: Sequence[Run], user: str, tracker: str, measurement: str, metric: str
) -> float | None:
    same = chosen(runs, road_user=user, tracker=tracker, measurement=measurement)
    return metric_over_seeds(same, metric).mean
