"""RQ2: the answer in sentences whose numbers are computed."""

from collections.abc import Sequence

from stixel_cli.results.text import listed
from stixel_cli.studies.field_names import LIDAR, STIXELS
from stixel_cli.studies.inference import least_p
from stixel_cli.studies.prose import MINUS, capital, counted, number, with_interval
from stixel_cli.studies.rq2.contrasts import (
    ERRORS,
    Contrast,
    family,
    is_baseline,
    least_effect,
    of_kind,
)
from stixel_cli.studies.rq2.runs import Run, chosen, metric_over_seeds, names, paired_difference
from stixel_cli.studies.types import Table
from stixel_cli.sweeps.statistics import Statistic

_BESIDE = {
    "low_overlap_share": "share of low overlap",
    "nees_position_mean": "position NEES / 2",
    "nis_mean": "NIS / d.o.f.",
}
"""What stands beside the errors, without a test."""
_ONE_SEED = (
    "These runs cannot distinguish stixels from lidar by a test: there is one seed, and a paired "
    "test over seeds, or an interval, takes two or more."
)
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
    n = len(names(runs, "seed"))
    sentences = [] if n > 1 else [_ONE_SEED]
    verdicts = []
    for tracker in dict.fromkeys(one.tracker for one in tested):
        for lidar in lidars:
            own = [one for one in tested if (one.tracker, one.other) == (tracker, lidar)]
            sentences.append(_effects(own))
            verdicts.append(_verdict(own))
        sentences += [
            _against_baseline(runs, tracker, baseline, stixels[0])
            for baseline in _baselines(runs, tracker)
        ]
        sentences.append(_consistency(runs, tracker, stixels[0]))
    if n > 1:
        sentences.append(" ".join([_tests(n, len(tested)), *verdicts]))
    return [*sentences, _limits(runs)]


def answer_tables(runs: Sequence[Run]) -> tuple[Table, ...]:
    """The numbers of the answer; none where there are not both stixels and a lidar."""
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


def _baselines(runs: Sequence[Run], tracker: str) -> list[str]:
    """The trackers that this one is to beat."""
    return [one for one in names(runs, "tracker") if one != tracker and is_baseline(runs, one)]


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
        "is right and more where the tracker is over-confident; a mean of them is moved most "
        "by the runs that diverge. Share of low overlap: of scans with IoU < 0.2.",
        tuple(columns),
        tuple(rows),
    )


def _baseline_table(on_stixels: Sequence[Run], pairs: Sequence[tuple[str, str]]) -> Table:
    rows = []
    for user in names(on_stixels, "road_user"):
        for tracker, baseline in pairs:
            for metric, (name, unit, _) in ERRORS.items():
                values = [
                    metric_over_seeds(chosen(on_stixels, road_user=user, tracker=one), metric).mean
                    for one in (tracker, baseline)
                ]
                apart = baseline_difference(on_stixels, user, tracker, baseline, metric)
                row = (user, tracker, baseline, _with_unit(name, unit), *values)
                rows.append((*row, apart.mean, apart.low, apart.high))
    return Table(
        "answer_baseline",
        "On stixels, a tracker and the baseline: means over paths and seeds, and the tracker minus "
        "the baseline, paired, with its 95 % interval over the seeds; not "
        "corrected for the number of comparisons.",
        (
            "road user",
            "tracker",
            "baseline",
            "mean over paths and seeds",
            "of the tracker",
            "of the baseline",
            "difference",
            "low difference",
            "high difference",
        ),
        tuple(rows),
    )


def _with_unit(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


def _effects(found: Sequence[Contrast]) -> str:
    """Mean paired differences with their intervals, by road user."""
    told = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [_effect(one) for one in found if one.road_user == user]
        told.append(f"{user}: {', '.join(own)}")
    one = found[0]
    return (
        f"{capital(one.tracker)}: mean difference, {one.one} minus {one.other} [95 %]. "
        f"{capital('; '.join(told))}."
    )


def _effect(one: Contrast) -> str:
    name, unit, _ = ERRORS[one.metric]
    apart = one.difference
    return f"{name} {with_interval(apart.mean, apart.low, apart.high, unit, sign=True)}"


def _tests(seeds: int, tests: int) -> str:
    """What is tested, and how large a difference must be for the test to show it."""
    return (
        f"Tests: {tests} paired t-tests over n = {seeds} seeds, with Holm's correction. For any of "
        "them to be significant, a mean difference must exceed "
        f"{number(least_effect(seeds, tests))} standard deviations of the seeds' differences."
    )


def _verdict(found: Sequence[Contrast]) -> str:
    """For what the tests show that stixels are worse or better than a lidar, and for what not."""
    tracker, lidar = found[0].tracker, found[0].other
    told = {
        verdict: _by_user([one for one in found if one.verdict == verdict])
        for verdict in ("worse", "better", "leaning", "alike")
    }
    sentences = [
        f"the {tracker} does {verdict} on stixels than on the {lidar} for {told[verdict]}"
        for verdict in ("worse", "better")
        if told[verdict]
    ] or [f"they show no difference of the {tracker} on stixels from the {lidar}"]
    text = capital(", and ".join(sentences)) + "."
    if told["leaning"]:
        text += f" For {told['leaning']} only the interval, which is not corrected, excludes 0."
    if told["alike"]:
        text += f" For {told['alike']} neither the test nor the interval shows a difference."
    return text


def _by_user(found: Sequence[Contrast]) -> str:
    """The road users with the metrics that were found of them."""
    parts = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [_SHORT[one.metric] for one in found if one.road_user == user]
        parts.append(f"the {user} ({listed(own)})")
    return listed(parts)


def _against_baseline(runs: Sequence[Run], tracker: str, baseline: str, stixels: str) -> str:
    on_stixels = chosen(runs, measurement=stixels)
    effects, verdicts = [], {}
    for user in names(runs, "road_user"):
        apart = baseline_difference(on_stixels, user, tracker, baseline, "iou_mean")
        effects.append(f"{user} {with_interval(apart.mean, apart.low, apart.high, sign=True)}")
        verdicts.setdefault(_beside_baseline(apart), []).append(f"the {user}")
    told = "; ".join(f"{how} for {listed(users)}" for how, users in verdicts.items())
    return (
        f"On stixels, mean IoU of the {tracker} minus that of the {baseline}, the baseline "
        f"[95 %, not corrected for multiplicity]: {', '.join(effects)}. By these intervals: "
        f"{told}."
    )


def baseline_difference(
    runs: Sequence[Run], user: str, tracker: str, baseline: str, metric: str
) -> Statistic:
    """A metric of a tracker minus the baseline's, paired by road user, path and seed."""
    sides = [chosen(runs, road_user=user, tracker=one) for one in (tracker, baseline)]
    return paired_difference(*sides, metric)


def _beside_baseline(iou: Statistic) -> str:
    if iou.low is None:
        return "not known"
    if iou.low <= 0.0 <= iou.high:
        return "not clear"
    return "better" if iou.low > 0.0 else "worse"


def _consistency(runs: Sequence[Run], tracker: str, stixels: str) -> str:
    told = [
        f"{number(_metric(runs, user, tracker, stixels, 'nees_position_mean'))} for the {user}"
        for user in names(runs, "road_user")
    ]
    return (
        f"Consistency of the {tracker} on {stixels}: position NEES / 2 is {listed(told)}, where 1 "
        "is consistent and more is over-confident."
    )


def _limits(runs: Sequence[Run]) -> str:
    n = len(names(runs, "seed"))
    return (
        f"Brackets are 95 % intervals over n = {counted(n, 'seed')} (Student's t), each seed the "
        f"mean over {counted(len(names(runs, 'path')), 'path')}, differences paired by path and "
        "seed. Intervals and tests take these means as normal; an exact test without that "
        f"assumption has no p below {number(least_p(n))} at n = {n}. The seeds renew the sensors' "
        "noise and the tracker's initialisation, not motion, road user or street: the answer holds "
        "for these rendered scenes, one shape a class, a target that is known to be there, and no "
        "clutter but what the sensors make."
    )


def _metric(
    runs: Sequence[Run], user: str, tracker: str, measurement: str, metric: str
) -> float | None:
    same = chosen(runs, road_user=user, tracker=tracker, measurement=measurement)
    return metric_over_seeds(same, metric).mean
