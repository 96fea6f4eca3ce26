"""The computational cost of a scan, compared with the sample time T.

CPU seconds are those that the engine recorded when it computed a result, on one thread.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.report import tables
from stixel_cli.report.blocks import Table
from stixel_cli.report.run_frame import run_frame
from stixel_cli.results.result import RunResult

STAGES = ("match", "free_space", "stixels", "scans", "track")
"""Stages between the images and the track: the work of a system with real cameras."""

SHARED = ("ego_motion", "scenario")
"""Stages that every pipeline begins with; not counted as the cost of a scan."""
SCAN_STAGES = ("render", "add_sensor_noise", "match", "free_space", "stixels", "scans")
"""Further stages of scans, in any pipeline."""

IN_ORDER = ("free_space", "track")
"""Stages that need their result of the scan before."""


def seconds_frame(runs: Sequence[RunResult], stages: Iterable[str]) -> pd.DataFrame:
    """CPU seconds per scan of each run (row) and stage (column); NaN if they are not recorded."""
    seconds = pd.DataFrame([dict(run.cpu_seconds) for run in runs], columns=list(stages))
    scans = np.array([len(run.scores.times) for run in runs], dtype=np.float64)
    return seconds.astype(float).div(scans, axis=0)


def seconds_a_scan(runs: Sequence[RunResult], stages: Sequence[str] = STAGES) -> dict[str, float]:
    """Median over the runs of the CPU seconds per scan, of each of the stages that is recorded."""
    return seconds_frame(runs, stages).median().dropna().to_dict()


def on_cores(seconds: Mapping[str, float]) -> tuple[float, float]:
    """Seconds per scan on one core, and at least on two, of the `seconds` of each stage.

    Two cores need at least half of the sum. They also need at least the longest of `IN_ORDER`,
    which cannot overlap with itself.
    """
    total = sum(seconds.values())
    return total, max([0.5 * total, *(seconds.get(stage, 0.0) for stage in IN_ORDER)])


def real_time_table(name: str, kinds: Mapping[str, Sequence[RunResult]]) -> Table:
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


def cost_of(**kinds: Sequence[RunResult]) -> dict[str, Any]:
    """The computational cost of a scan of two kinds, such as `simulated` and `fabricated`.

    Returns:
        Each kind: stage to CPU seconds a scan, medians over its runs, including the stages of
        `SHARED`. `KIND_total`: median of the runs' sums over the other stages; None if CPU seconds
        are missing. `ratio`: of the totals, or None. `quartiles`: first and third, of the ratios of
        runs with the same scan; None without any.
    """
    totals = {kind: _totals(runs) for kind, runs in kinds.items()}
    one, other = totals.values()
    medians = {k: float(total.median()) if len(total) else None for k, total in totals.items()}
    ours, theirs = medians.values()
    ratios = (one / other[other > 0.0]).dropna()
    return {
        **{kind: seconds_a_scan(runs, (*SHARED, *SCAN_STAGES)) for kind, runs in kinds.items()},
        **{f"{kind}_total": median for kind, median in medians.items()},
        "ratio": ours / theirs if ours is not None and theirs else None,
        "quartiles": ratios.quantile([0.25, 0.75]).tolist() if len(ratios) else None,
    }


def _totals(runs: Sequence[RunResult]) -> pd.Series:
    """CPU seconds of `SCAN_STAGES` per scan, by road user, path and seed, where all are known."""
    totals = [
        # A pipeline lacks some stages; a stage that was run has its seconds, or they are unknown.
        sum(run.cpu_seconds.get(stage, 0.0) / len(run.scores.times) for stage in SCAN_STAGES)
        if "scans" in run.cpu_seconds
        else math.nan
        for run in runs
    ]
    scan = list(tables.PAIR)
    frame = run_frame(runs)[scan].assign(total=np.array(totals, np.float64)).dropna()
    # Trackers of one scan count once.
    return frame.drop_duplicates(scan, keep="last").set_index(scan)["total"]


def cost_table(cost: Mapping[str, Any], kinds: Mapping[str, pd.DataFrame]) -> Table:
    """CPU seconds by stage, and of all stages that are not shared; then of the work in real time.

    `kinds` are the frames of the runs of `cost_of`. The work in real time is that from the images
    to the track. The last columns are relative to the sample time T.
    """
    rows: dict[str, Sequence[float | None]] = {
        stage: [cost[kind].get(stage) for kind in kinds]
        for stage in dict.fromkeys(stage for kind in kinds for stage in cost[kind])
    }
    rows["sum without shared stages"] = [cost[f"{kind}_total"] for kind in kinds]
    first = next(iter(kinds.values()))
    for tracker in tables.names(first, "tracker"):
        own = [tables.chosen(runs, tracker=tracker)["run"].tolist() for runs in kinds.values()]
        seconds = [seconds_a_scan(one) for one in own]
        cores = [on_cores(one) if "track" in one else (None, None) for one in seconds]
        rows[f"track, {tracker}"] = [one.get("track") for one in seconds]
        for i, name in enumerate(("one core", "two cores at least")):
            rows[f"images to track, {tracker}, {name}"] = [one[i] for one in cores]
    sample_time = first["run"].iloc[0].configuration.path.sample_time
    found = []
    for stage, seconds in rows.items():
        of_kind = dict(zip(kinds, seconds, strict=True))
        shares = {f"{k} / T": None if s is None else s / sample_time for k, s in of_kind.items()}
        found.append({"stage": stage, **of_kind, **shares})
    return Table.of("cost", found)
