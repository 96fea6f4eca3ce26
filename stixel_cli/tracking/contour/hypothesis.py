"""Where a target of the tracker `contour` may be: one hypothesis, or two after a new detection."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.tracking.contour.class_probabilities import log_likelihood
from stixel_cli.tracking.contour.contour_update import Posterior

State = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Mean (d,), covariance (d, d) and `of_errors` (d, 2), see `contour_update.py`."""


@dataclass(frozen=True)
class Hypothesis:
    """Where the target may be after a scan.

    Attributes:
        state: after the scan, and
        predicted: before its update.
        log_likelihood: of all scans, and
        log_likelihood_before: of all before this one.
        indices: of the scan's points that were used.
        nis, degrees: of the scan; NaN and 0 without points.
    """

    state: State
    predicted: State
    log_likelihood: float
    log_likelihood_before: float
    indices: np.ndarray
    nis: float = np.nan
    degrees: int = 0

    @classmethod
    def unseen(cls, state: State, log_likelihood: float = 0.0) -> "Hypothesis":
        """The hypothesis of a `state` at a scan without points."""
        return cls(state, state, log_likelihood, log_likelihood, np.zeros(0, np.int64))

    @classmethod
    def updated(
        cls, predicted: State, before: float, indices: np.ndarray, posterior: Posterior
    ) -> "Hypothesis":
        """The hypothesis with the `posterior` of the points at `indices`."""
        *state, nis, degrees, stated = posterior
        after = before + log_likelihood(stated, nis, degrees)
        return cls(tuple(state), predicted, after, before, indices, nis, degrees)
