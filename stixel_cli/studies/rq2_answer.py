"""RQ2: the answer in sentences whose numbers are computed."""

from collections.abc import Mapping, Sequence

from stixel_cli.report.metrics import format_value
from stixel_cli.studies.rq2_runs import (
    FLOOR,
    LIDAR,
    STIXELS,
    Run,
    chosen,
    metric_over_seeds,
    names,
    paired_difference,
)
from stixel_cli.sweeps.statistics import Statistic

ERRORS = {
    "centre_rmse_m": ("centre RMSE", "m", False),
    "orientation_rmse_deg": ("orientation RMSE", "°", False),
    "iou_mean": ("mean IoU", "", True),
}
"""Metric to its name, unit, and whether more is better."""


def answer(runs: Sequence[Run]) -> list[str]:
    """The answer in sentences, their numbers computed."""
    users, trackers = names(runs, "road_user"), _trackers(runs)
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    seeds = names(runs, "seed")
    if not stixels or not lidars:
        there = ", ".join(names(runs, "measurement"))
        return [
            f"This study holds {there}: without both stixels and a lidar it answers nothing of "
            "the question itself. What it holds stands below."
        ]
    sentences = []
    extended = [tracker for tracker in trackers if not _is_floor(runs, tracker)]
    for tracker in extended or trackers:
        for lidar in lidars:
            worse, better, neither = _verdicts(runs, tracker, stixels[0], lidar)
            sentences.append(
                f"{tracker} on stixels does worse than on {lidar} for {worse}; better for "
                f"{better}; not told apart for {neither}. (Differences paired by seed, n = "
                f"{len(seeds)}; 95 % intervals, not corrected for the number of comparisons.)"
            )
        for user in users:
            sentences.append(_sentence(runs, user, tracker, stixels[0], lidars[0]))
    for floor in (tracker for tracker in trackers if _is_floor(runs, tracker)):
        for tracker in extended:
            sentences.append(_against_floor(runs, tracker, floor, stixels[0]))
    for tracker in extended or trackers:
        shown = ", ".join(
            f"{user} {format_value(_metric(runs, user, tracker, stixels[0], 'nees_position_mean'))}"
            for user in users
        )
        sentences.append(
            f"Consistency of {tracker} on stixels: position NEES / 2 (1 is consistent, more is "
            f"overconfident) is on average {shown}."
        )
    return sentences


def _sentence(runs: Sequence[Run], user: str, tracker: str, stixels: str, lidar: str) -> str:
    parts = []
    for metric, (name, unit, _) in ERRORS.items():
        values = [_metric(runs, user, tracker, one, metric) for one in (stixels, lidar)]
        difference = paired_difference(
            chosen(runs, road_user=user, tracker=tracker, measurement=stixels),
            chosen(runs, road_user=user, tracker=tracker, measurement=lidar),
            metric,
        )
        unit = unit if unit == "°" else f" {unit}" if unit else ""
        parts.append(
            f"{name} {format_value(values[0])}{unit} against {format_value(values[1])}{unit} "
            f"({_signed(difference)}{unit})"
        )
    lost = [_metric(runs, user, tracker, one, "lost_share") for one in (stixels, lidar)]
    return (
        f"{capital(user)}, {tracker}, stixels against {lidar}: {'; '.join(parts)}; share of scans "
        f"lost {format_value(lost[0])} against {format_value(lost[1])}."
    )


def _against_floor(runs: Sequence[Run], tracker: str, floor: str, stixels: str) -> str:
    parts = []
    for user in names(runs, "road_user"):
        ours, theirs = (
            chosen(runs, road_user=user, tracker=one, measurement=stixels)
            for one in (tracker, floor)
        )
        centre = paired_difference(ours, theirs, "centre_rmse_m")
        iou = paired_difference(ours, theirs, "iou_mean")
        parts.append(f"{user} centre RMSE {_signed(centre)} m, IoU {_signed(iou)}")
    return f"On stixels {tracker} against the floor {floor}, paired by seed: {'; '.join(parts)}."


def _verdicts(runs: Sequence[Run], tracker: str, one: str, other: str) -> tuple[str, str, str]:
    """For what `one` is worse than, better than, and not told apart from `other`."""
    worse: dict[str, list[str]] = {}
    better: dict[str, list[str]] = {}
    neither: dict[str, list[str]] = {}
    for user in names(runs, "road_user"):
        for metric, (name, _, more_is_better) in ERRORS.items():
            difference = paired_difference(
                chosen(runs, road_user=user, tracker=tracker, measurement=one),
                chosen(runs, road_user=user, tracker=tracker, measurement=other),
                metric,
            )
            if difference.low is None or difference.low <= 0.0 <= difference.high:
                found = neither
            elif (difference.mean > 0.0) == more_is_better:
                found = better
            else:
                found = worse
            found.setdefault(user, []).append(name.removesuffix(" RMSE").removeprefix("mean "))
    return _listed(worse), _listed(better), _listed(neither)


def _listed(found: Mapping[str, Sequence[str]]) -> str:
    return ", ".join(f"{user} ({', '.join(names)})" for user, names in found.items()) or "nothing"


def _metric(
    runs: Sequence[Run], user: str, tracker: str, measurement: str, metric: str
) -> float | None:
    same = chosen(runs, road_user=user, tracker=tracker, measurement=measurement)
    return metric_over_seeds(same, metric).mean


def of_kind(runs: Sequence[Run], kind: str) -> list[str]:
    """The measurements of a kind."""
    return names(chosen(runs, kind=kind), "measurement")


def _trackers(runs: Sequence[Run]) -> list[str]:
    return names(runs, "tracker")


def _is_floor(runs: Sequence[Run], tracker: str) -> bool:
    return all(run.tracker_kind == FLOOR for run in chosen(runs, tracker=tracker))


def _signed(one: Statistic) -> str:
    """A difference with its interval."""
    if one.mean is None:
        return "no pair has both"
    text = f"difference {one.mean:+.3f}"
    return text if one.low is None else f"{text} [{one.low:+.3f}, {one.high:+.3f}]"


def capital(text: str) -> str:
    """The text with a capital letter."""
    return text[:1].upper() + text[1:]
