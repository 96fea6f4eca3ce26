"""The computational cost of a scan, compared with the sample time T.

CPU seconds are those that the engine recorded when it computed a result, on one thread.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.report.blocks import Table
from stixel_cli.studies.data import StudyRun

if TYPE_CHECKING:
    import pandas as pd

STAGES = ("match", "free_space", "stixels", "scans", "track")
"""Stages between the images and the track: the work of a system with real cameras."""

IN_ORDER = ("free_space", "track")
"""Stages that need their result of the scan before."""


def seconds_frame(runs: Sequence[StudyRun], stages: Sequence[str]) -> "pd.DataFrame":
    """CPU seconds per scan of each run (row) and stage (column); NaN if they are not recorded."""
    import pandas as pd

    seconds = pd.DataFrame([dict(run.cpu_seconds) for run in runs], columns=list(stages))
    scans = np.array([len(run.scores.times) for run in runs], dtype=np.float64)
    return seconds.astype(float).div(scans, axis=0)


def seconds_a_scan(runs: Sequence[StudyRun], stages: Sequence[str] = STAGES) -> dict[str, float]:
    """Median over the runs of the CPU seconds per scan, of each of the stages that is recorded."""
    return seconds_frame(runs, stages).median().dropna().to_dict()


def on_cores(seconds: Mapping[str, float]) -> tuple[float, float]:
    """Seconds per scan on one core, and at least on two, of the `seconds` of each stage.

    Two cores need at least half of the sum. They also need at least the longest of `IN_ORDER`,
    which cannot overlap with itself.
    """
    total = sum(seconds.values())
    return total, max([0.5 * total, *(seconds.get(stage, 0.0) for stage in IN_ORDER)])


def real_time_table(name: str, kinds: Mapping[str, Sequence[StudyRun]]) -> Table:
    """Milliseconds per scan of each stage, and their sum relative to T, on one core and at
    least on two.

    `kinds` are runs of one pipeline and one tracker each, by name.
    """
    rows = []
    for kind, runs in kinds.items():
        seconds = seconds_a_scan(runs)
        sample_time = runs[0].configuration.path.sample_time
        one, two = on_cores(seconds)
        row = {"runs": kind}
        row |= {f"{s} (ms)": 1e3 * seconds[s] if s in seconds else None for s in STAGES}
        row |= {"sum (ms)": 1e3 * one, "one core / T": one / sample_time}
        rows.append(row | {"two cores at least / T": two / sample_time})
    return Table.of(name, rows)
