"""RQ2: stixels minus another measurement in pairs, and which differences are significant."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import pandas as pd

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report import tables
from stixel_cli.report.blocks import Cell, Figure, Table
from stixel_cli.report.forest import difference_row, forest
from stixel_cli.report.metrics import MINUS, listed_by_user
from stixel_cli.report.run_frame import BASELINE, LIDAR, STIXELS
from stixel_cli.report.statistics import SIGNIFICANT, Statistic, excludes_zero, holm, t_test

ERRORS = {name: METRICS[name] for name in ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")}
"""The metrics that are tested."""


@dataclass(frozen=True)
class Contrast:
    """One metric of one road user's runs by one tracker, on two measurements.

    Attributes:
        road_user, tracker, one, other, metric: which; `one` and `other` are measurements.
        values: mean over the seeds of each.
        difference: `one` minus `other`, over the seeds.
        tested: whether it belongs to the question, so to the family of tests.
        p: of the paired t-test over the seeds, two-sided, with Holm's correction; None without.
    """

    road_user: str
    tracker: str
    one: str
    other: str
    metric: str
    values: tuple[float | None, float | None]
    difference: Statistic
    tested: bool
    p: float | None = None

    @property
    def verdict(self) -> str:
        """What `one` is: "worse", "better", "leaning" (only the interval excludes 0) or "alike"."""
        if not excludes_zero(self.difference):
            return "alike"
        if self.p is None or self.p >= SIGNIFICANT:
            return "leaning"
        more_is_better = ERRORS[self.metric].better == "more"
        return "better" if (self.difference.mean > 0.0) == more_is_better else "worse"


def contrasts(runs: pd.DataFrame) -> list[Contrast]:
    """Stixels against every other measurement by every tracker.

    The tests are of stixels against every lidar by every extended tracker, with Holm's correction.
    """
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    others = [name for name in tables.names(runs, "measurement") if name not in stixels]
    trackers, users = tables.names(runs, "tracker"), tables.names(runs, "road_user")
    extended = [name for name in trackers if not is_baseline(runs, name)] or trackers
    found = []
    for tracker, one, other, user in product(trackers, stixels, others, users):
        own = tables.chosen(runs, road_user=user, tracker=tracker)
        sides = [tables.chosen(own, measurement=side) for side in (one, other)]
        tested = tracker in extended and other in lidars
        for name in ERRORS:
            values = tuple(tables.mean_over(side, name).mean for side in sides)
            apart = tables.difference(*sides, name)
            found.append(Contrast(user, tracker, one, other, name, values, apart, tested))
    p = holm({i: t_test(one.difference) for i, one in enumerate(found) if one.tested})
    return [replace(one, p=p.get(i)) for i, one in enumerate(found)]


def of_kind(runs: pd.DataFrame, kind: str) -> list[str]:
    """The measurements of a kind."""
    return tables.names(tables.chosen(runs, measurement_kind=kind), "measurement")


def is_baseline(runs: pd.DataFrame, tracker: str) -> bool:
    """Whether a tracker is the baseline."""
    return bool((tables.chosen(runs, tracker=tracker)["tracker_kind"] == BASELINE).all())


def contrasts_table(found: Sequence[Contrast]) -> Table | None:
    """All paired differences, the tested ones with p; None without any."""
    rows: dict[tuple, dict[str, Cell]] = {}
    for one in found:
        sides = f"{one.one}\u00a0{MINUS} {one.other}"
        key = (one.tracker, one.one, one.other, one.road_user)
        begin = {"road user": one.road_user, "tracker": one.tracker, "difference": sides}
        row = rows.setdefault(key, {**begin, "n": one.difference.n})
        row |= tables.ends(tables.with_unit(ERRORS[one.metric]), one.difference)
        row[f"p of {tables.plain_label(ERRORS[one.metric])} (Holm)"] = one.p
    return Table.of("paired_differences", rows.values()) if rows else None


def contrasts_forest(tested: Sequence[Contrast], users: Sequence[str]) -> Figure | None:
    """The tested differences: stixels minus each lidar."""
    several = len({one.tracker for one in tested}) > 1
    rows = [
        difference_row(
            ERRORS[one.metric],
            f"{one.one} {MINUS} lidar",
            one.road_user,
            f"{one.tracker}, {one.other}" if several else one.other,
            one.difference,
            tested=one.p is not None,
            significant=one.verdict in ("worse", "better"),
        )
        for one in sorted(tested, key=lambda one: users.index(one.road_user))
    ]
    return forest("answer_forest", rows, "stixels better", "stixels worse")


def verdicts(found: Sequence[Contrast]) -> dict[str, str]:
    """Verdict to the road users, each with its metrics."""
    return {
        verdict: listed_by_user(
            (one.road_user, tables.plain_label(ERRORS[one.metric]))
            for one in found
            if one.verdict == verdict
        )
        for verdict in ("worse", "better", "leaning", "alike")
    }
