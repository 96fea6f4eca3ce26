"""`stixel study rq1`: the errors of each stage, one row for each run and class of range."""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from stixel_cli.answers.runs import Runs
from stixel_cli.results.result import RunResult
from stixel_cli.studies.report import Material, StudyData, rows_of
from stixel_cli.validation.stage_errors import GROSS

SW_DEPTH, SW_STD = 28.0, 0.1
"""Badino, Franke, Pfeiffer 2009 state an uncertainty below 0.1 m at 28 m."""
RANGES = ((5.0, 10.0), (10.0, 20.0), (20.0, 30.0), (25.0, 31.0), (30.0, 40.0), (40.0, 50.0))
"""Classes of the range, m: of a stixel its own true depth, else the target's. The class 25 to 31 m
is that in which The Stixel World is compared."""


def columns(name: str, runs: Runs, results: Sequence[RunResult]) -> Runs:
    """Of a sweep whose `results` are errors of stages, these by range in the place of scores."""
    if not all({*run.graph.stages["stage_errors"]}.issubset(run.targets) for run in results):
        return runs
    return rows_of(runs, [_rows(run) for run in results], ("range",))


def material(data: StudyData) -> Material:
    """What 0.1 m at 28 m asks of each rig: the standard deviation of its disparity."""
    rows = {}
    for run in (run for sweep in data.sweeps.values() for run in sweep.runs):
        rig = run.configuration.rig
        # f B σ_z / z².
        needed = rig.focal * rig.baseline * SW_STD / SW_DEPTH**2
        rows[rig.width, rig.height, float(rig.focal), float(rig.baseline)] = needed
    columns = ("image (px)", "f (px)", "B (m)", "needed σ of the disparity (px)")
    found = [(f"{w} × {h}", f, b, needed) for (w, h, f, b), needed in rows.items()]
    table = pd.DataFrame(found, columns=columns)
    return Material(tables={f"What {SW_STD:g} m at {SW_DEPTH:g} m needs": table})


def _rows(run: RunResult) -> list[dict[str, object]]:
    records = run.load("stage_errors")
    frames, stixels = (
        pd.concat([pd.DataFrame(getattr(record, name)) for record in records], ignore_index=True)
        for name in ("frames", "stixels")
    )
    found = []
    for low, high in RANGES:
        own = (t[t["depth"].between(low, high, inclusive="left")] for t in (frames, stixels))
        found.append({"range": f"{low:g}–{high:g} m", **stage_metrics(*own)})
    return found


def stage_metrics(frames: pd.DataFrame, stixels: pd.DataFrame) -> dict[str, float]:
    """Metrics of the stages from tables of `StageErrors`; NaN where nothing is measured.

    Errors are found minus true. Gross errors have their own share, and are in no other metric.
    """
    gross = stixels["disparity"].abs() > GROSS
    fine, inside = stixels[~gross], frames["valid"] - frames["gross"]
    return {
        "depth_bias_m": _mean(fine["error"]),
        "depth_rms_m": _rms(fine["error"]),
        "own_pixels_rms_m": _rms(fine["square"]),
        "stixel_disparity_rms_px": _rms(fine["disparity"]),
        "stixel_gross_share": _mean(gross),
        "squared_error_over_variance": _mean((fine["error"] / fine["sigma"]) ** 2),
        "height_bias_m": _mean(fine["height"]),
        "columns_without_stixel_share": _share(frames["uncovered"], frames["columns"]),
        "missed_columns_share": _share(frames["missed"], frames["columns"]),
        "pixel_density_share": _share(frames["valid"], frames["pixels"]),
        "pixel_rms_px": float(np.sqrt(_share(frames["squares"], inside))),
    }


def _mean(values: pd.Series, of: Callable = np.asarray) -> float:
    known = of(values.to_numpy(float))
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else float("nan")


def _rms(values: pd.Series) -> float:
    return float(np.sqrt(_mean(values, np.square)))


def _share(part: pd.Series, whole: pd.Series) -> float:
    total = float(whole.sum())
    return float(part.sum()) / total if total else float("nan")
