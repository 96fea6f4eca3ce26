"""The covariance that `gp_ekf` states of a target of which one side is seen.

The estimate's gain takes neighbouring points for independent ones, with a noise so large that their
shared error hardly matters. The covariance that goes with that gain alone is too large where the
errors are small, and too small where they are shared. This is the covariance of the same estimate
with the errors that are there (`consider.py`): the points' own noise, the size and shape of the
class, its limbs, the shape that the sensor sees, and what all scans share.
"""

import numpy as np
from scipy.linalg import block_diag

from stixel_cli.tracking.consider import FIELD_TIME, NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_rays import Rays
from stixel_cli.tracking.gp_ekf_update import Linearisation
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.one_side import OneSide


class StatedCovariance:
    """The joint covariance of the state of `gp_ekf` and of the errors that it considers."""

    def __init__(
        self, initial: np.ndarray, radii: np.ndarray, forgetting_rate: float, side: OneSide
    ):
        """From the covariances (6, 6) of the start and (N, N) of radii of an unknown class.

        Radii that are not seen are forgotten at the `forgetting_rate`, 1/s.
        """
        radii = radii if side.radii_covariance is None else side.radii_covariance
        self._limbs, self._side = side.limbs, side
        memory = 1.0 / forgetting_rate if forgetting_rate else np.inf
        of_radii, of_shape = [memory] * len(radii), [FIELD_TIME] * (len(side.limbs) + NODES)
        memories = np.array(of_radii + of_shape + [np.inf] * side.shared_errors)
        self._joint = JointCovariance(block_diag(initial, radii), memories, len(radii))
        self._moves = slice(self._joint.size, self._joint.size + len(side.limbs))

    @property
    def reported(self) -> np.ndarray:
        """Covariance (6 + N, 6 + N) of pose, rates, and radii with the limbs where they are."""
        size, limbs, matrix = self._joint.size, self._moves, self._joint.matrix
        reported = matrix[:size, :size].copy()
        if not len(self._limbs):
            return reported
        cross = matrix[:size, limbs] @ self._limbs
        reported[:, 6:] += cross
        reported[6:] += cross.T
        reported[6:, 6:] += self._limbs.T @ matrix[limbs, limbs] @ self._limbs
        return 0.5 * (reported + reported.T)

    def predict(self, noise: np.ndarray, interval: float) -> None:
        """One `interval` in s later; `noise` (6, 6) of pose and rates."""
        self._joint.predict(transition(interval), noise, interval)

    def correct_by_one(self, gain: np.ndarray, row: np.ndarray, std: float) -> None:
        """After `gain` (6 + N,) used one scalar of this `std`, with derivatives `row` (6 + N,)."""
        whole = np.zeros(len(self._joint.matrix))
        whole[: len(row)], whole[self._moves] = row, self._limbs @ row[6:]
        self._joint.correct_by_one(gain, whole, std**2)

    @property
    def position(self) -> np.ndarray:
        """Covariance (2, 2) m² of the centre."""
        return self._joint.matrix[:2, :2]

    def correct(
        self, gain: np.ndarray, model: Linearisation, rays: Rays, shape_stds: np.ndarray
    ) -> float:
        """After the update of the `model` of a scan by `gain` (6 + N, n); returns the NIS.

        `rays` are those of its points, `shape_stds` (n,) m the standard deviations of the visible
        shape.
        """
        gradients, (matrix, variances) = model.gradients, model.rows
        along = (gradients * rays.directions).sum(axis=1)
        squares = (gradients**2).sum(axis=1)
        # Of what the process leaves out, neighbours share a part as large as each point's own.
        rough = self._side.roughness**2 * squares
        own = (self._side.std_factor * rays.stds * along) ** 2 + rough + variances
        own += (squares - along**2) * rays.across_variances
        field = np.copysign(np.sqrt(rough + (shape_stds * along) ** 2), along)
        shared = (gradients[:, None] @ rays.shared)[:, 0]
        weights = field_weights(model.angles)
        rows = [matrix, matrix[:, 6:] @ self._limbs.T, field[:, None] * weights, shared]
        rows, residuals = np.hstack(rows), model.residuals
        spread = self._joint.correct(gain, rows, gain * own) @ rows.T
        spread.flat[:: len(own) + 1] += own
        return float(residuals @ np.linalg.solve(spread, residuals))
