"""Differences between measurements and trackers, on hand-made and on real motion.

The unit is a motion: a hand-made path (mean over its seeds) or a real track.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report.blocks import Cell, Figure, Table
from stixel_cli.report.forest import difference_row, forest
from stixel_cli.report.statistics import Statistic, combined_interval
from stixel_cli.report.tables import chosen, difference, ends, names, with_unit
from stixel_cli.studies.data import BASELINE, LIDAR, STIXELS

if TYPE_CHECKING:
    import pandas as pd

ERRORS = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")
LEAD = "centre_rmse_m"
"""The metric of the answer's plot."""
POINTS = {
    "range_bias": "bias of points along the ray (m)",
    "disparity_std": "standard deviation of points (px)",
    "missed": "share of the target's columns without a point",
}
"""Measures of a run's points by their column, with their labels."""

FABRICATED = "fabricated"
HAND, REAL = "hand-made", "real"

SAME, ALIKE = "same sign", "no difference in either"
UNCONFIRMED, NEW, REVERSED, TOO_FEW = "not confirmed", "new", "reversed", "too few motions"


@dataclass(frozen=True)
class Finding:
    """One measure's difference between two kinds of run, on hand-made and on real motion.

    Attributes:
        question: RQ2 or RQ3.
        what: which runs, `one − other`.
        road_user, measure: of the difference.
        hand, real: the difference over the motions of each kind.
    """

    question: str
    what: str
    road_user: str
    measure: str
    hand: Statistic
    real: Statistic

    def __str__(self) -> str:
        return f"{self.what}, {self.road_user}: {label_of(self.measure)}"

    @property
    def change(self) -> tuple[float | None, float | None, float | None]:
        """Real minus hand-made, and the ends of its 95 % interval (Welch 1947); None if unknown."""
        if self.hand.std is None or self.real.std is None:
            return None, None, None
        mean = self.real.mean - self.hand.mean
        parts = [(one.std**2 / one.n, one.n - 1) for one in (self.hand, self.real)]
        return mean, *combined_interval(mean, parts)

    @property
    def changed(self) -> bool:
        """Whether the interval of the change excludes 0."""
        _, low, high = self.change
        return low is not None and not low <= 0.0 <= high

    @property
    def verdict(self) -> str:
        """Whether the intervals exclude 0 on the same side, on either, or on one only."""
        if self.hand.low is None or self.real.low is None:
            return TOO_FEW
        sides = [
            (one.low > 0.0) - (one.high < 0.0)  # -1, 0 or 1
            for one in (self.hand, self.real)
        ]
        if sides[0] * sides[1] < 0:
            return REVERSED
        if sides[0] == sides[1]:
            return SAME if sides[0] else ALIKE
        return UNCONFIRMED if sides[0] else NEW


def findings(hand: "pd.DataFrame", real: "pd.DataFrame") -> list[Finding]:
    """All differences; where one kind of run is missing, they have no motions."""
    extended = [kind for kind in names(hand, "tracker_kind") if kind != BASELINE]
    found = []
    for user in names(hand, "road_user"):
        for tracker in extended:
            for question, one, other, measures in (
                ("RQ2", (STIXELS, tracker), (LIDAR, tracker), ERRORS),
                ("RQ2", (FABRICATED, tracker), (LIDAR, tracker), ERRORS),
                ("RQ2", (STIXELS, tracker), (STIXELS, BASELINE), ERRORS[2:]),
                ("RQ2", (LIDAR, tracker), (LIDAR, BASELINE), ERRORS[2:]),
                ("RQ3", (FABRICATED, tracker), (STIXELS, tracker), (*ERRORS, *POINTS)),
            ):
                what = " − ".join(_named(*side) for side in (one, other))
                pairs = [
                    [
                        chosen(frame, road_user=user, measurement_kind=kind, tracker_kind=by)
                        for kind, by in (one, other)
                    ]
                    for frame in (hand, real)
                ]
                for measure in measures:
                    over = [difference(*p, measure, ("motion", "seed"), "motion") for p in pairs]
                    found.append(Finding(question, what, user, measure, *over))
    return found


def _named(measurement: str, tracker: str) -> str:
    return f"{'stixels' if measurement == STIXELS else measurement} ({tracker})"


def label_of(measure: str) -> str:
    """The label of a metric or of one of `POINTS`, with its unit."""
    return POINTS[measure] if measure in POINTS else with_unit(METRICS[measure])


def findings_forest(found: Sequence[Finding]) -> Figure | None:
    """The differences in `LEAD`, on hand-made and on real motion."""
    rows = [
        difference_row(METRICS[LEAD], one.what, one.road_user, kind, apart)
        for one in found
        if one.measure == LEAD
        for kind, apart in ((HAND, one.hand), (REAL, one.real))
    ]
    return forest("answer_forest", rows, "first better", "first worse")


def findings_table(found: Sequence[Finding]) -> Table:
    """One row for each finding."""
    rows = []
    for one in found:
        row: dict[str, Cell] = {
            "question": one.question,
            "difference": one.what,
            "road user": one.road_user,
            "measure": label_of(one.measure),
        }
        for kind, own in ((HAND, one.hand), (REAL, one.real)):
            row |= {f"n, {kind}": own.n, **ends(kind, own)}
        change = f"{REAL} − {HAND}"
        columns = (change, f"low {change}", f"high {change}")
        row |= dict(zip(columns, one.change, strict=True))
        rows.append({**row, "real against hand-made": one.verdict})
    return Table.of("answers", rows)
