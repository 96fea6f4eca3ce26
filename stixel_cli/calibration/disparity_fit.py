"""The error of a rig's disparities, fitted to errors at known places."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from stixel_cli.geometry.rig import Rig


@dataclass(frozen=True)
class DisparityFit:
    """The rig's disparity error: offset + slope (u - u0).

    Attributes:
        method: what it was fitted to: "labels", "ground truth" or "ego motion".
        offset: px; and slope: px per px.
        count: number of rows, and unit: their noun.
        median_before, median_after: of the residuals' sizes, px.
    """

    method: str
    offset: float
    slope: float
    count: int
    unit: str
    median_before: float
    median_after: float


def fit_line(
    columns: np.ndarray, errors: np.ndarray, stds: np.ndarray, sloped: bool, rig: Rig
) -> dict[str, Any]:
    """Offset and slope through `errors` (n,) px at `columns` (n,) px, by robust least squares.

    The keys are fields of `DisparityFit`. Residuals beyond two standard deviations `stds` (n,) px
    count by their size, not its square (Huber). The slope is 0 unless `sloped`. `rig` has the
    present offset and slope, which the result includes.
    """
    design = np.stack([np.ones_like(columns), columns - rig.u0], axis=1)
    design = design[:, : 2 if sloped else 1]
    values = np.zeros(design.shape[1])
    for _ in range(30):
        scaled = np.abs(errors - design @ values) / stds
        root = np.sqrt(np.minimum(1.0, 2.0 / np.maximum(scaled, 1e-12))) / stds
        values = np.linalg.lstsq(design * root[:, None], errors * root, rcond=None)[0]
    offset, slope = (*values, 0.0)[:2]
    return {
        "offset": rig.disparity_offset + float(offset),
        "slope": rig.disparity_slope + float(slope),
        "count": len(errors),
        "median_before": float(np.median(np.abs(errors))),
        "median_after": float(np.median(np.abs(errors - design @ values))),
    }
