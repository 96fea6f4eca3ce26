"""The scores of one track."""

from dataclasses import dataclass

import numpy as np

LOW_OVERLAP = 0.2
"""A scan has low overlap if its IoU is below this."""


@dataclass(frozen=True)
class Scores:
    """Errors over time and their summary.

    Attributes:
        times: (K,) s.
        centre_error: (K,) m.
        orientation_error: (K,) rad in (-pi, pi], estimated minus true; NaN if missing.
        iou: (K,) intersection over union of the estimated and the true contour, 0 … 1.
        nees_position: (K,) position NEES divided by 2: 1 is consistent.
        nis: (K,) NIS divided by its degrees of freedom: 1 is consistent; NaN for an empty scan.
        metrics: name to value; None if the metric has no value.
    """

    times: np.ndarray
    centre_error: np.ndarray
    orientation_error: np.ndarray
    iou: np.ndarray
    nees_position: np.ndarray
    nis: np.ndarray
    metrics: dict[str, float | int | None]
