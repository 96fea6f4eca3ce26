"""RQ2: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

from stixel_cli.experiment.text import listed
from stixel_cli.studies.field_names import LIDAR, STIXELS
from stixel_cli.studies.nouns import Table
from stixel_cli.studies.prose import MINUS, capital, number
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

_BESIDE = {
    "low_overlap_share": "low overlap share",
    "nees_position_mean": "position NEES / 2",
    "nis_mean": "NIS / d.o.f.",
}
"""What stands beside the errors, without a test."""
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
    sentences = []
    for tracker in dict.fromkeys(one.tracker for one in tested):
        for lidar in lidars:
            own = [one for one in tested if (one.tracker, one.other) == (tracker, lidar)]
            sentences.append(_verdict(own))
        sentences += [
            _against_floor(runs, tracker, floor, stixels[0]) for floor in _floors(runs, tracker)
        ]
        sentences.append(_consistency(runs, tracker, stixels[0]))
    return [*sentences, _limits(runs, tested)]


def answer_tables(runs: Sequence[Run]) -> tuple[Table, ...]:
    """The numbers of the answer; none where there are not both stixels and a lidar."""
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    tested = family(runs)
    if not tested:
        return ()
    trackers = list(dict.fromkeys(one.tracker for one in tested))
    tables = [_lidar_table(runs, tested, trackers, stixels[0], lidars)]
    floors = [(tracker, floor) for tracker in trackers for floor in _floors(runs, tracker)]
    if floors:
        tables.append(_floor_table(chosen(runs, measurement=stixels[0]), floors))
    return tuple(tables)


def _floors(runs: Sequence[Run], tracker: str) -> list[str]:
    """The trackers that this one is to beat."""
    return [one for one in names(runs, "tracker") if one != tracker and is_floor(runs, one)]


def _lidar_table(
    runs: Sequence[Run],
    tested: Sequence[Contrast],
    trackers: Sequence[str],
    stixels: str,
    lidars: Sequence[str],
) -> Table:
    columns = ["road user", "tracker", "mean over paths and seeds", stixels]
    for lidar in lidars:
        columns += [lidar, f"{stixels} {MINUS} {lidar}", f"low {lidar}", f"high {lidar}"]
    rows = []
    for user in names(runs, "road_user"):
        for tracker in trackers:
            own = [one for one in tested if (one.road_user, one.tracker) == (user, tracker)]
            for metric, (name, unit, _) in ERRORS.items():
                row = [user, tracker, _with_unit(name, unit)]
                for i, one in enumerate(one for one in own if one.metric == metric):
                    row += one.values if i == 0 else one.values[1:]
                    row += [one.difference.mean, one.difference.low, one.difference.high]
                rows.append(tuple(row))
            for metric, name in _BESIDE.items():
                row = [user, tracker, name, _metric(runs, user, tracker, stixels, metric)]
                for lidar in lidars:
                    row += [_metric(runs, user, tracker, lidar, metric), None, None, None]
                rows.append(tuple(row))
    return Table(
        "answer_lidar",
        "Stixels against lidar: means over paths and seeds, and the difference, paired, with its "
        "95 % interval over the seeds. Of the errors a positive difference, of the IoU a negative "
        "one, is worse for stixels. NEES / 2 and NIS / d.o.f. are 1 where the stated covariance "
        "is right and more where the tracker is too sure of itself; a mean of them is moved most "
        "by the runs that diverge. Low overlap share: share of scans with IoU < 0.2.",
        tuple(columns),
        tuple(rows),
    )


def _floor_table(on_stixels: Sequence[Run], pairs: Sequence[tuple[str, str]]) -> Table:
    rows = []
    for user in names(on_stixels, "road_user"):
        for tracker, floor in pairs:
            for metric, (name, unit, _) in ERRORS.items():
                values = [
                    metric_over_seeds(chosen(on_stixels, road_user=user, tracker=one), metric).mean
                    for one in (tracker, floor)
                ]
                apart = floor_difference(on_stixels, user, tracker, floor, metric)
                row = (user, tracker, floor, _with_unit(name, unit), *values)
                rows.append((*row, apart.mean, apart.low, apart.high))
    return Table(
        "answer_floor",
        "On stixels, a tracker beside the least that it must beat: means over paths and seeds, and "
        "the tracker minus that floor, paired, with its 95 % interval over the seeds; not "
        "corrected for the number of comparisons.",
        (
            "road user",
            "tracker",
            "floor",
            "mean over paths and seeds",
            "of the tracker",
            "of the floor",
            "difference",
            "low difference",
            "high difference",
        ),
        tuple(rows),
    )


def _with_unit(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


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


def _against_floor(runs: Sequence[Run], tracker: str, floor: str, stixels: str) -> str:
    on_stixels = chosen(runs, measurement=stixels)
    told: dict[str, list[str]] = {}
    for user in names(runs, "road_user"):
        overlap = floor_difference(on_stixels, user, tracker, floor, "iou_mean")
        told.setdefault(_beside_floor(overlap), []).append(f"the {user}")
    verdict = "; ".join(f"{how} for {listed(users)}" for how, users in told.items())
    return (
        f"On stixels the {tracker} beside the {floor}, the least that an extended tracker must "
        "beat, by the interval of the IoU, which is not corrected for the number of comparisons: "
        f"{verdict}."
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


def _consistency(runs: Sequence[Run], tracker: str, stixels: str) -> str:
    told = [
        f"{number(_metric(runs, user, tracker, stixels, 'nees_position_mean'))} for the {user}"
        for user in names(runs, "road_user")
    ]
    return (
        f"Consistency of the {tracker} on {stixels}: position NEES / 2 is {listed(told)}, where 1 "
        "is right and more is too sure of itself."
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
