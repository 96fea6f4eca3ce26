"""RQ2: stixels minus another measurement in pairs, and which differences are significant."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from scipy.stats import t as student

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.studies.data import BASELINE, LIDAR, STIXELS, chosen, names
from stixel_cli.studies.inference import SIGNIFICANT, holm
from stixel_cli.studies.runs import metric_over_seeds, paired_difference, quantity
from stixel_cli.studies.tables import MINUS, interval_columns, with_unit
from stixel_cli.studies.types import Column, Table
from stixel_cli.sweeps.statistics import Statistic

if TYPE_CHECKING:
    import pandas as pd

ERRORS = {name: METRICS[name] for name in ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")}
"""The metrics that are tested."""


@dataclass(frozen=True)
class Contrast:
    """One metric of one road user's runs by one tracker, on two measurements.

    Attributes:
        road_user, tracker, one, other, metric: which; `one` and `other` are measurements.
        values: mean over the seeds of each.
        difference: `one` minus `other`, over the seeds.
        p: of the paired t-test over the seeds, two-sided; corrected once it is in a family.
    """

    road_user: str
    tracker: str
    one: str
    other: str
    metric: str
    values: tuple[float | None, float | None]
    difference: Statistic
    p: float | None

    @property
    def verdict(self) -> str:
        """What `one` is: "worse", "better", "leaning" (only the interval excludes 0) or "alike"."""
        low, high = self.difference.low, self.difference.high
        if low is None or low <= 0.0 <= high:
            return "alike"
        if self.p is None or self.p >= SIGNIFICANT:
            return "leaning"
        more_is_better = ERRORS[self.metric].better == "more"
        return "better" if (self.difference.mean > 0.0) == more_is_better else "worse"


def contrasts(runs: "pd.DataFrame", tracker: str, one: str, other: str) -> list[Contrast]:
    """Every road user and metric of two measurements; p not corrected."""
    found = []
    for user in names(runs, "road_user"):
        sides = [
            chosen(runs, road_user=user, tracker=tracker, measurement=measurement)
            for measurement in (one, other)
        ]
        for metric in ERRORS:
            difference = paired_difference(*sides, metric)
            values = tuple(metric_over_seeds(side, metric).mean for side in sides)
            p = p_value(difference)
            found.append(Contrast(user, tracker, one, other, metric, values, difference, p))
    return found


def family(runs: "pd.DataFrame") -> list[Contrast]:
    """Stixels against every lidar by every extended tracker, with Holm's correction of p."""
    stixels, lidars = of_kind(runs, STIXELS), of_kind(runs, LIDAR)
    extended = [tracker for tracker in names(runs, "tracker") if not is_baseline(runs, tracker)]
    found = [
        contrast
        for tracker in extended or names(runs, "tracker")
        for one in stixels
        for other in lidars
        for contrast in contrasts(runs, tracker, one, other)
    ]
    return corrected(found)


def corrected(found: Sequence[Contrast]) -> list[Contrast]:
    """The same with p corrected over all of them by Holm (1979)."""
    known = {str(i): one.p for i, one in enumerate(found) if one.p is not None}
    p = holm(known)
    return [replace(one, p=p.get(str(i))) for i, one in enumerate(found)]


def p_value(difference: Statistic) -> float | None:
    """p of the t-test that a mean of paired differences is 0, two-sided; None below two pairs."""
    if difference.std is None:
        return None
    if difference.std == 0.0:
        return 1.0 if difference.mean == 0.0 else 0.0
    ratio = difference.mean / (difference.std / math.sqrt(difference.n))
    return float(2.0 * student.sf(abs(ratio), difference.n - 1))


def least_effect(seeds: int, tests: int) -> float:
    """Mean difference above which one of so many tests can be significant after `holm`.

    In standard deviations of the differences over two or more seeds.
    """
    return float(student.isf(0.5 * SIGNIFICANT / tests, seeds - 1)) / math.sqrt(seeds)


def of_kind(runs: "pd.DataFrame", kind: str) -> list[str]:
    """The measurements of a kind."""
    return names(chosen(runs, measurement_kind=kind), "measurement")


def is_baseline(runs: "pd.DataFrame", tracker: str) -> bool:
    """Whether a tracker is the baseline."""
    return bool((chosen(runs, tracker=tracker)["tracker_kind"] == BASELINE).all())


def contrasts_table(runs: "pd.DataFrame") -> Table | None:
    """All paired differences, those of `family` with p; None without any."""
    stixels = of_kind(runs, STIXELS)
    others = [name for name in names(runs, "measurement") if name not in stixels]
    tested = {(c.road_user, c.tracker, c.one, c.other, c.metric): c.p for c in family(runs)}
    rows = []
    for tracker in names(runs, "tracker"):
        for one in stixels:
            for other in others:
                rows += _rows(contrasts(runs, tracker, one, other), tested)
    if not rows:
        return None
    columns: list[str | Column] = ["road user", "tracker", "difference", "n"]
    for metric in ERRORS.values():
        columns += interval_columns(with_unit(metric), metric.short_label)
        columns.append(f"p of {quantity(metric)} (Holm)")
    return Table("paired_differences", "", tuple(columns), tuple(rows))


def _rows(found: Sequence[Contrast], tested: dict) -> list[tuple]:
    rows = []
    for user in dict.fromkeys(one.road_user for one in found):
        own = [one for one in found if one.road_user == user]
        cells: list[str | float | int | None] = [user, own[0].tracker]
        cells.append(f"{own[0].one}\u00a0{MINUS} {own[0].other}")
        cells.append(own[0].difference.n)
        for one in own:
            cells += [one.difference.mean, one.difference.low, one.difference.high]
            cells.append(tested.get((one.road_user, one.tracker, one.one, one.other, one.metric)))
        rows.append(tuple(cells))
    return rows
