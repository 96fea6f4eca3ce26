"""Where a target of the tracker `contour` may be: one hypothesis, or two after a new detection."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.contour_update import Posterior, constant_errors
from stixel_cli.tracking.smoothing import Step

State = tuple[np.ndarray, np.ndarray, JointCovariance]
"""Mean (d,), covariance (d, d) of the gain and joint covariance, see `contour_update.py`."""


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
        missed: log odds against the scan's rays that pass by the shape. They count between places
            of one class, and not between classes, whose sizes may be wrong.
        before: the hypothesis that was predicted; None before the first scan.
        transition: (d, d) Jacobian of that prediction; None where the filter began anew.
    """

    state: State
    predicted: State
    log_likelihood: float
    log_likelihood_before: float
    indices: np.ndarray
    nis: float = np.nan
    degrees: int = 0
    missed: float = 0.0
    before: "Hypothesis | None" = None
    transition: np.ndarray | None = None

    @classmethod
    def unseen(cls, state: State, log_likelihood: float = 0.0) -> "Hypothesis":
        """The hypothesis of a `state` at a scan without points."""
        return cls(state, state, log_likelihood, log_likelihood, np.zeros(0, np.int64))

    @cached_property
    def step(self) -> Step:
        """What smoothing needs of this scan.

        What errors that all scans share move goes through the filter as the mean does: no scan
        shows it.
        """
        states = []
        for mean, covariance, joint in (self.state, self.predicted):
            states += [np.column_stack([mean, constant_errors(joint)]), covariance]
        return Step(*states, self.before and self.before.step, self.transition)

    @classmethod
    def updated(
        cls, predicted: State, before: float, indices: np.ndarray, posterior: Posterior
    ) -> "Hypothesis":
        """The hypothesis with the `posterior` of the points at `indices`."""
        *state, nis, degrees, missed, stated = posterior
        after = before + stated
        return cls(tuple(state), predicted, after, before, indices, nis, degrees, missed)
