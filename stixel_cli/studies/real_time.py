"""The computational cost of a scan, compared with the sample time T.

CPU seconds are those that the engine recorded when it computed a result, on one thread.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from stixel_cli.studies.data import StudyRun
from stixel_cli.studies.types import Table

STAGES = ("match", "free_space", "stixels", "scans", "track")
"""Stages between the images and the track: the work of a system with real cameras."""

IN_ORDER = ("free_space", "track")
"""Stages that need their result of the scan before."""


def seconds_a_scan(runs: Sequence[StudyRun]) -> dict[str, float]:
    """Median over the runs of the CPU seconds per scan, of each of `STAGES` that is recorded."""
    found = {}
    for stage in STAGES:
        seconds = [run.cpu_seconds.get(stage, np.nan) / len(run.scores.times) for run in runs]
        known = [one for one in seconds if np.isfinite(one)]
        if known:
            found[stage] = float(np.median(known))
    return found


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
        stages = (1e3 * seconds[stage] if stage in seconds else None for stage in STAGES)
        rows.append((kind, *stages, 1e3 * one, one / sample_time, two / sample_time))
    columns = (
        *(f"{stage} (ms)" for stage in STAGES),
        "sum (ms)",
        "one core / T",
        "two cores at least / T",
    )
    return Table(name, "", ("runs", *columns), tuple(rows))
