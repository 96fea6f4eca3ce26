"""Plain summaries of the errors of stages, to compare the studies' statistics with.

Bias and RMS leave out gross errors, whose share is a value of its own. A value that cannot be
computed is NaN.
"""

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.validation.stage_errors import (
    GROSS,
    HISTOGRAM_EDGES,
    PHASES,
    ColumnErrors,
    DisparityErrors,
    StageErrors,
    column_kinds,
)
from stixel_cli.validation.stage_stixels import StixelErrors


def histogram_median(histogram: np.ndarray) -> float:
    """Median px of counts (n,) over `HISTOGRAM_EDGES`, even inside a bin; NaN if all are 0."""
    before = np.concatenate([[0], np.cumsum(histogram)])
    if before[-1] == 0:
        return float("nan")
    half = 0.5 * before[-1]
    b = int(np.searchsorted(before, half, side="left")) - 1
    share = (half - before[b]) / (before[b + 1] - before[b])
    return float(HISTOGRAM_EDGES[b] + share * (HISTOGRAM_EDGES[b + 1] - HISTOGRAM_EDGES[b]))


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
        columns: the target's, a frame; elsewhere: share of them in a stixel that is off by more
        than `GROSS` px; overhang: columns beside all that is seen of it a frame that get its
        disparity; hanging: stixels a frame that cover such.
    """
    seen = frames & (errors.columns > 0)
    count, columns = seen.sum(), errors.columns[seen].sum()
    return {
        "columns": _ratio(columns, count),
        "elsewhere": _ratio((errors.covered - errors.matched)[seen].sum(), columns),
        "overhang": _ratio(errors.overhang[seen].sum(), count),
        "hanging": _ratio(errors.hanging[seen].sum(), count),
    }


def pooled(records: Iterable[StageErrors]) -> StageErrors:
    """The frames of all records one after the other; `first` is 0 and means nothing.

    Raises:
        ValueError: if there is no record, or they are of images of different widths.
    """
    records = list(records)
    if not records:
        raise ValueError("no records to pool")
    if len({record.columns.true.shape[1] for record in records}) > 1:
        raise ValueError("cannot pool records of images of different widths")

    def joined(kind, parts):
        names = [field.name for field in fields(kind)]
        return kind(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})

    return StageErrors(
        first=0,
        target_depth=np.concatenate([record.target_depth for record in records]),
        target_pixels=np.concatenate([record.target_pixels for record in records]),
        disparity=joined(DisparityErrors, [record.disparity for record in records]),
        columns=joined(ColumnErrors, [record.columns for record in records]),
        stixels=StixelErrors.joined([record.stixels for record in records]),
    )


def disparity_summary(errors: DisparityErrors, frames: np.ndarray, zone: int) -> dict[str, float]:
    """Sum up the chosen `frames` (n,) bool in a zone of `stage_errors.ZONES`.

    Returns:
        pixels; density: share of pixels with a disparity; gross: share of those that are off by
        more than `GROSS` px; bias, rms: px, of the others; median: px, of all valid ones, from the
        histogram.
    """
    pixels, valid, gross, total, squares = (
        float(getattr(errors, name)[frames, zone].sum())
        for name in ("pixels", "valid", "gross", "total", "squares")
    )
    histogram = errors.histogram[frames, zone].sum(axis=0)
    return {
        "pixels": pixels,
        "density": _ratio(valid, pixels),
        "gross": _ratio(gross, valid),
        "bias": _ratio(total, valid - gross),
        "rms": float(np.sqrt(_ratio(squares, valid - gross))),
        "median": histogram_median(histogram),
    }


def phase_bias(errors: DisparityErrors, zone: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres of the fractional parts (P,) px, mean error (P,) px, pixels (P,) of a zone."""
    count = errors.phase_count[:, zone].sum(axis=0)
    total = errors.phase_total[:, zone].sum(axis=0)
    mean = np.divide(total, count, out=np.full(PHASES, np.nan), where=count > 0)
    return (np.arange(PHASES) + 0.5) / PHASES, mean, count


def stixel_summary(
    errors: StixelErrors, low: float = 0.0, high: float = np.inf
) -> dict[str, float]:
    """Sum up the stixels whose true depth is in [low, high) m.

    Returns:
        stixels; gross: share whose disparity is off by more than `GROSS` px; of the others: spread:
        standard deviation of the depth's error, m; sigma: mean stated, m; nees: mean square of
        error / σ (1 is consistent); within_1, within_2: share within one and two σ; and `…_bias`
        and `…_rms` of depth, lateral and height, m, of disparity, top and base, px, and of the
        depth of the own pixels, m, by face: square, slanted.
    """
    chosen = (errors.true_depth >= low) & (errors.true_depth < high)
    fine = chosen & (np.abs(errors.disparity) <= GROSS)
    ratio = errors.depth[fine] / errors.sigma[fine]
    values = {
        name: getattr(errors, name)[fine]
        for name in ("depth", "disparity", "lateral", "top", "base", "height")
    }
    values |= {face: errors.own_depth[fine & getattr(errors, face)] for face in _FACES}
    return {
        "stixels": float(chosen.sum()),
        "gross": _ratio(chosen.sum() - fine.sum(), chosen.sum()),
        "spread": float(np.std(values["depth"])) if fine.any() else float("nan"),
        "sigma": _mean(errors.sigma[fine]),
        "nees": _mean(ratio**2),
        "within_1": _mean(np.abs(ratio) <= 1.0),
        "within_2": _mean(np.abs(ratio) <= 2.0),
        **{f"{name}_bias": _mean(one) for name, one in values.items()},
        **{f"{name}_rms": _root_mean_square(one) for name, one in values.items()},
    }


_FACES = ("square", "slanted")


def _ratio(part: float, whole: float) -> float:
    return float(part) / float(whole) if whole > 0 else float("nan")


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")
