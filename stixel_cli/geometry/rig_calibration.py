"""The error of a rig's disparities, as a calibration finds it."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stixel_cli.geometry.rig import Rig

UNKNOWN_STD = (1.0, 0.5, 1.0)
"""Standard deviations of the error of a real rig that is not calibrated, px, see `Rig`."""


@dataclass(frozen=True)
class RigCalibration:
    """The disparity error of a rig, and how it was found.

    Attributes:
        rig: with the error, 0 if none was found, and its standard deviations.
        method: from what it was found.
        note: why no error was found, or how the parts of the data differ; may be empty.
        median_before, median_after: of the residuals' sizes, px; NaN without.
        length_ratio: length of the camera's way by the images over that of its poses, and
            length_ratio_std: its standard deviation; NaN without.
        columns, errors: (n,) px, place and apparent disparity error of each point.
    """

    rig: Rig
    method: str
    note: str = ""
    median_before: float = np.nan
    median_after: float = np.nan
    length_ratio: float = np.nan
    length_ratio_std: float = np.nan
    columns: np.ndarray = field(default_factory=lambda: np.zeros(0))
    errors: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def values(self) -> dict[str, Any]:
        """By name: the error and its standard deviations; the ratio of lengths, and its interval.

        The interval covers 95 %.
        """
        rig, reach = self.rig, 1.96 * self.length_ratio_std
        found = {name: [*getattr(rig, name)] for name in ("disparity_error", "disparity_error_std")}
        if self.length_ratio > 0.0:
            ends = (self.length_ratio - reach, self.length_ratio + reach)
            found["length_ratio"] = round(self.length_ratio, 4)
            found["length_ratio_interval"] = [round(end, 4) for end in ends]
        return found

    @property
    def text(self) -> str:
        """What is known of the rig's disparities, and of the poses' length, in one line."""
        at = self.rig.disparity_error_basis(self.rig.disparity_error_columns)
        values = ", ".join(f"{value:+.2f}" for value in at @ self.rig.disparity_error)
        stds = ", ".join(f"{std:.2f}" for std in self.rig.disparity_error_std)
        known = "corrected" if any(self.rig.disparity_error) else "not corrected"
        known += f": {values} px at the left border, in the middle, at the right border (± {stds})"
        return "; ".join(
            filter(None, [f"disparity error {known}", self.method, self.note, self.length_text])
        )

    @property
    def length_text(self) -> str:
        """By how much the poses are too long or short; "" for less than 1 %, or within error."""
        wrong = 1.0 / self.length_ratio - 1.0
        if not abs(wrong) > max(0.01, 2.0 * self.length_ratio_std):
            return ""
        return (
            f"the poses are {100.0 * abs(wrong):.1f} % too {'long' if wrong > 0 else 'short'} "
            f"(± {200.0 * self.length_ratio_std:.1f} %): if they are odometry with this rig, set "
            f"source.pose_scale={self.length_ratio:.3f} or estimated"
        )


def with_error(rig: Rig, error: np.ndarray, covariance: np.ndarray, more: np.ndarray) -> Rig:
    """The rig with an `error` (3,) px of (1, x, x²) that has a `covariance` (3, 3).

    `more` (3,) px are further standard deviations at the columns of `disparity_error_std`.
    """
    at = rig.disparity_error_basis(rig.disparity_error_columns)
    stds = np.sqrt(np.einsum("ni,ij,nj->n", at, covariance, at) + more**2)
    error, stds = tuple(error.round(4).tolist()), tuple(stds.round(3).tolist())
    return replace(rig, disparity_error=error, disparity_error_std=stds)
