"""RQ3: the computational cost of a scan, from the CPU seconds that the stages took."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.studies.rq3.runs import FABRICATED, SIMULATED, pairing
from stixel_cli.studies.types import StudyRun, StudySweep, Table

SHARED = ("ego_motion", "scenario")
"""Steps that both kinds of scan begin with; not counted as the cost of either."""

STAGES = ("render", "add_sensor_noise", "match", "free_space", "stixels", "scans")
"""Steps that lead from there to scans, in any pipeline of the study."""

THESIS = 60.0
"""The thesis states that simulated scans take more than this many times as long."""


@dataclass(frozen=True)
class Cost:
    """CPU seconds a scan by stage, medians over the runs, and the sum of each run, their median.

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


def cost_of(simulated: StudySweep, fabricated: StudySweep) -> Cost:
    """The computational cost of scans of both kinds."""
    ours, theirs = _totals(simulated.runs), _totals(fabricated.runs)
    ratios = [ours[key] / theirs[key] for key in ours if theirs.get(key)]
    return Cost(
        _median_stages(simulated.runs),
        _median_stages(fabricated.runs),
        _median(ours),
        _median(theirs),
        tuple(np.quantile(ratios, [0.25, 0.75]).tolist()) if ratios else None,
    )


def cost_table(cost: Cost) -> Table:
    """CPU seconds by stage, and of all stages that are not shared."""
    stages = dict.fromkeys((*cost.simulated, *cost.fabricated))
    rows = [(stage, cost.simulated.get(stage), cost.fabricated.get(stage)) for stage in stages]
    rows.append(("all that is not shared", cost.simulated_total, cost.fabricated_total))
    return Table("cost", "", ("stage", SIMULATED, FABRICATED), tuple(rows))


def _median_stages(points: Sequence[StudyRun]) -> dict[str, float]:
    found = {}
    for stage in (*SHARED, *STAGES):
        values = [p.cpu_seconds.get(stage, np.nan) / len(p.scores.times) for p in points]
        if np.isfinite(values).any():
            found[stage] = float(np.nanmedian(values))
    return found


def _totals(points: Sequence[StudyRun]) -> dict[tuple, float]:
    """CPU seconds a scan by road user, path and seed, of the runs all of whose stages have them."""
    found = {}
    for point in points:
        seconds = sum(point.cpu_seconds.get(stage, 0.0) for stage in STAGES)
        if "scans" in point.cpu_seconds and np.isfinite(seconds):
            key = pairing(point)
            found[key.road_user, key.path, key.seed] = seconds / len(point.scores.times)
    return found


def _median(totals: Mapping[tuple, float]) -> float | None:
    return float(np.median(list(totals.values()))) if totals else None
