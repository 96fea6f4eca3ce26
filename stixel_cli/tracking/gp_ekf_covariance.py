"""The covariance that `gp_ekf` states of a target of which one side is seen.

The estimate's gain takes neighbouring points for independent ones, with a noise so large that their
shared error hardly matters. The covariance that goes with that gain alone is too large where the
errors are small, and too small where they are shared. This is the covariance of the same estimate
with the errors that are there (`consider.py`): the points' own noise, the size of the class, the
shape that the sensor sees, in which road users differ and limbs swing, and what all scans share.
"""

import numpy as np
from scipy.linalg import block_diag

from stixel_cli.tracking.consider import FIELD_TIME, NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_rays import Rays
from stixel_cli.tracking.gp_ekf_update import Linearisation
from stixel_cli.tracking.one_side import OneSide


class StatedCovariance(JointCovariance):
    """That of the state of `gp_ekf` and of the errors that it considers, seen from one `side`."""

    def __init__(self, initial: np.ndarray, forgetting_rate: float, side: OneSide):
        """From the covariance (6, 6) of the start.

        Radii that are not seen are forgotten at the `forgetting_rate`, 1/s.
        """
        self.side, count = side, len(side.radii)
        memories = np.repeat(
            [1.0 / forgetting_rate if forgetting_rate else np.inf, FIELD_TIME, np.inf],
            [count, NODES, side.face_errors],
        )
        super().__init__(block_diag(initial, side.radii_covariance), memories, count)

    @property
    def reported(self) -> np.ndarray:
        """Covariance (6 + N, 6 + N) of pose, rates, and radii of this target in this moment."""
        reported = self.matrix[: self.size, : self.size].copy()
        reported[6:, 6:] += self.side.shape_covariance
        return reported

    def correct_by_scan(
        self, gain: np.ndarray, model: Linearisation, rays: Rays, shape_stds: np.ndarray
    ) -> float:
        """After the update of the `model` of a scan by `gain` (6 + N, n); returns the NIS.

        `rays` are those of its points, `shape_stds` (n,) m the standard deviations of the visible
        shape.
        """
        gradients, (matrix, variances) = model.gradients, model.rows
        along = (gradients * rays.directions).sum(axis=1)
        squares = (gradients**2).sum(axis=1)
        own = (self.side.std_factor * rays.stds * along) ** 2 + variances
        own += self.side.roughness**2 * squares
        own += (squares - along**2) * rays.across_variances
        field = (shape_stds * along)[:, None] * field_weights(model.angles)
        shared = (gradients[:, None] @ rays.shared)[:, 0]
        rows, residuals = np.hstack([matrix, field, shared]), model.residuals
        spread = self.correct(gain, rows, gain * own) @ rows.T
        spread.flat[:: len(own) + 1] += own
        return float(residuals @ np.linalg.solve(spread, residuals))
