"""RQ3: what a scan costs, from the seconds that the stages took."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.studies.nouns import Part, StudyPoint

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
    """

    simulated: dict[str, float]
    fabricated: dict[str, float]
    simulated_total: float | None
    fabricated_total: float | None

    @property
    def ratio(self) -> float | None:
        """Of the totals; None without both."""
        if self.simulated_total is None or not self.fabricated_total:
            return None
        return self.simulated_total / self.fabricated_total


def price_of(simulated: Part, fabricated: Part) -> Price:
    """The price of scans of both kinds."""
    return Price(
        _median_stages(simulated.points),
        _median_stages(fabricated.points),
        _total(simulated.points),
        _total(fabricated.points),
    )


def _median_stages(points: Sequence[StudyPoint]) -> dict[str, float]:
    found = {}
    for stage in (*SHARED, *STAGES):
        values = [p.seconds[stage] / len(p.scores.times) for p in points if stage in p.seconds]
        if values:
            found[stage] = float(np.median(values))
    return found


def _total(points: Sequence[StudyPoint]) -> float | None:
    """Median over the runs that have the scans' own seconds recorded, and all before them."""
    most = max((sum(stage in p.seconds for stage in STAGES) for p in points), default=0)
    sums = [
        sum(p.seconds.get(stage, 0.0) for stage in STAGES) / len(p.scores.times)
        for p in points
        if "scans" in p.seconds and sum(stage in p.seconds for stage in STAGES) == most
    ]
    return float(np.median(sums)) if sums else None
