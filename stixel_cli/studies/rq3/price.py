"""RQ3: what a scan costs, from the seconds that the stages took."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.studies.nouns import Part, StudyPoint
from stixel_cli.studies.rq3.runs import pairing

SHARED = ("ego_motion", "scenario")
"""Steps that both kinds of scan begin with; not counted as the price of either."""

STAGES = ("render", "expose", "match", "free_space", "stixels", "scans")
"""Steps that lead from there to scans, in any pipeline of the study."""

THESIS = 60.0
"""Simulated scans took more than this many times as long, says the thesis."""


@dataclass(frozen=True)
class Price:
    """Seconds a scan by stage, medians over the runs, and the sum of each run, their median.

    Attributes:
        simulated, fabricated: stage to seconds, those that both share included.
        simulated_total, fabricated_total: of the stages that are not shared; None if one was not
            recorded.
        quartiles: first and third, of the ratio of the runs of the same road user, path and seed.
    """

    simulated: dict[str, float]
    fabricated: dict[str, float]
    simulated_total: float | None
    fabricated_total: float | None
    quartiles: tuple[float, float] | None

    @property
    def ratio(self) -> float | None:
        """Of the totals; None without both."""
        if self.simulated_total is None or not self.fabricated_total:
            return None
        return self.simulated_total / self.fabricated_total


def price_of(simulated: Part, fabricated: Part) -> Price:
    """The price of scans of both kinds."""
    ours, theirs = _totals(simulated.points), _totals(fabricated.points)
    ratios = [ours[key] / theirs[key] for key in ours if theirs.get(key)]
    return Price(
        _median_stages(simulated.points),
        _median_stages(fabricated.points),
        _median(ours),
        _median(theirs),
        tuple(np.quantile(ratios, [0.25, 0.75]).tolist()) if ratios else None,
    )


def _median_stages(points: Sequence[StudyPoint]) -> dict[str, float]:
    found = {}
    for stage in (*SHARED, *STAGES):
        values = [p.seconds[stage] / len(p.scores.times) for p in points if stage in p.seconds]
        if values:
            found[stage] = float(np.median(values))
    return found


def _totals(points: Sequence[StudyPoint]) -> dict[tuple, float]:
    """Seconds a scan by road user, path and seed, of the runs with most of the stages recorded."""
    most = max((sum(stage in p.seconds for stage in STAGES) for p in points), default=0)
    found = {}
    for point in points:
        there = sum(stage in point.seconds for stage in STAGES)
        if "scans" in point.seconds and there == most:
            key = pairing(point)
            seconds = sum(point.seconds.get(stage, 0.0) for stage in STAGES)
            found[key.road_user, key.path, key.seed] = seconds / len(point.scores.times)
    return found


def _median(totals: Mapping[tuple, float]) -> float | None:
    return float(np.median(list(totals.values()))) if totals else None
