"""The errors of stages as tidy tables, one row per stixel, column, zone or frame."""

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.validation.stage_errors import GROSS, PHASES, StageErrors, column_kinds


def stage_tables(record: StageErrors, rig: Rig, columns: str) -> dict[str, dict[str, np.ndarray]]:
    """The tidy tables of a record, name to column to values: one row per stixel, zone or frame.

    `every_stixel`, `pixels` and `frames`; and `columns`, "" without, "target" or "all". The column
    `frame` is the index of the record's frame, `depth`, m, that of a stixel.
    """
    n, of, pixels = len(record.target_depth), record.stixels, record.disparity
    ratio = np.abs(of.depth / of.sigma)
    found = {
        "every_stixel": {
            "frame": np.repeat(np.arange(n), np.diff(of.offsets)),
            "depth": of.true_depth,
            "gross": 1.0 * (np.abs(of.disparity) > GROSS),
            "error": of.depth,
            "disparity": of.disparity,
            "square": np.where(of.square, of.own_depth, np.nan),
            "slanted": np.where(of.slanted, of.own_depth, np.nan),
            "sigma": of.sigma,
            "ratio": of.depth / of.sigma,
            "ratio²": ratio**2,
            "in 1": 1.0 * (ratio <= 1.0),
            "in 2": 1.0 * (ratio <= 2.0),
            **{name: getattr(of, name) for name in ("height", "lateral", "top", "base")},
        },
        "frames": {
            "frame": np.arange(n),
            "columns": of.columns,
            "uncovered": of.columns - of.covered,
            "elsewhere": of.covered - of.matched,
            "stixels": np.diff(of.offsets),
            "overhang": of.overhang.sum(axis=1),
            "shown": of.shown,
            "unseen": of.unseen,
        },
        "pixels": {
            "frame": np.repeat(np.arange(n), pixels.pixels.shape[1]),
            "zone": np.tile(np.arange(pixels.pixels.shape[1]), n),
            **{
                name: getattr(pixels, name).ravel()
                for name in ("pixels", "valid", "gross", "total", "squares")
            },
            "fine": (pixels.valid - pixels.gross).ravel(),
            "histogram": list(pixels.histogram.reshape(-1, pixels.histogram.shape[-1])),
            **{f"phase {i}": pixels.phase_total[..., i].ravel() for i in range(PHASES)},
            **{f"in phase {i}": pixels.phase_count[..., i].ravel() for i in range(PHASES)},
        },
    }
    steps = [_columns(record, rig, step, columns) for step in ("grid", "path") if columns]
    if steps:
        found["columns"] = {key: np.concatenate([one[key] for one in steps]) for key in steps[0]}
    return found


def _columns(record: StageErrors, rig: Rig, step: str, columns: str) -> dict[str, np.ndarray]:
    """One row for each column of the image, or of the target, of a step."""
    of = record.columns
    true, found = of.true.astype(np.float64), getattr(of, step).astype(np.float64)
    kinds = column_kinds(true, found, getattr(of, f"{step}_there"))
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = rig.depth_from_disparity(found) - rig.depth_from_disparity(true)
    rows = {
        "frame": np.broadcast_to(np.arange(len(true))[:, None], true.shape),
        "step": np.full(true.shape, step, dtype=object),
        "of_target": of.of_target,
        "missed": np.where(kinds.real, 1.0 * kinds.missed, np.nan),
        "px": np.where(kinds.hit, found - true, np.nan),
        "m": np.where(kinds.hit, metres, np.nan),
        "below threshold": 1.0 * kinds.below_threshold,
        "false positive": 1.0 * kinds.false_positive,
    }
    chosen = of.of_target if columns == "target" else np.ones(true.shape, dtype=bool)
    return {key: values[chosen] for key, values in rows.items()}
