"""Plain summaries of columns and of coverage, to compare the studies' statistics with."""

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.validation.stage_stixels import StixelErrors
from stixel_cli.validation.stage_summary import column_kinds


def column_summary(
    true: np.ndarray, found: np.ndarray, there: np.ndarray, rig: Rig
) -> dict[str, float]:
    """Sum up columns (any shape) of pitch-compensated disparities in px, NaN where free.

    Returns:
        columns; missed: share of the columns with an obstacle; below_threshold and false_positive:
        share of all columns, see `ColumnKinds`; bias, rms: px, and bias_m, rms_m: m in depth, of
        the columns that are hit.
    """
    kinds = column_kinds(true, found, there)
    true, found = (one[kinds.hit].astype(np.float64) for one in (true, found))
    metres = rig.depth_from_disparity(found) - rig.depth_from_disparity(true)
    return {
        "columns": float(kinds.real.size),
        "missed": _ratio(kinds.missed.sum(), kinds.real.sum()),
        "below_threshold": _ratio(kinds.below_threshold.sum(), kinds.real.size),
        "false_positive": _ratio(kinds.false_positive.sum(), kinds.real.size),
        "bias": _mean(found - true),
        "rms": _root_mean_square(found - true),
        "bias_m": _mean(metres),
        "rms_m": _root_mean_square(metres),
    }


def coverage_summary(errors: StixelErrors, frames: np.ndarray) -> dict[str, float]:
    """Sum up how the target is covered in the chosen `frames` (n,) bool.

    Returns:
        columns: the target's, a frame; stixels: on it, a frame; missed: share of its columns in no
        stixel; elsewhere: share in a stixel that is off by more than `GROSS` px; unseen: share of
        the columns that show any of it in no stixel of it; overhang: columns
        beside all that is seen of it a frame that get its disparity; hanging: stixels a frame that
        cover such.
    """
    seen = frames & (errors.columns > 0)
    count, columns = float(seen.sum()), float(errors.columns[seen].sum())
    covered, matched = float(errors.covered[seen].sum()), float(errors.matched[seen].sum())
    return {
        "columns": _ratio(columns, count),
        "stixels": _ratio(float(np.diff(errors.offsets)[seen].sum()), count),
        "missed": _ratio(columns - covered, columns),
        "elsewhere": _ratio(covered - matched, columns),
        "unseen": _ratio(float(errors.unseen[seen].sum()), float(errors.shown[seen].sum())),
        "overhang": _ratio(float(errors.overhang[seen].sum()), count),
        "hanging": _ratio(float(errors.hanging[seen].sum()), count),
    }


def _ratio(part: float, whole: float) -> float:
    return float(part) / float(whole) if whole > 0 else float("nan")


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")
