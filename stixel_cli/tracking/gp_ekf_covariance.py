"""The covariance that `gp_ekf` states of a target of which one side is seen.

The estimate's gain takes neighbouring points for independent ones, with a noise so large that their
shared error hardly matters. The covariance that goes with that gain alone is too large where the
errors are small, and too small where they are shared. This is the covariance of the same estimate
with the errors that are there (`consider.py`): the points' own noise, the size and shape of the
class, its limbs, the shape that the sensor sees, and what all scans share.
"""

import numpy as np
from scipy.linalg import block_diag

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.consider import FIELD_TIME, NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_rays import Rays
from stixel_cli.tracking.gp_ekf_update import Linearisation
from stixel_cli.tracking.kalman import normalised_innovation_squared
from stixel_cli.tracking.motion import velocity_across
from stixel_cli.tracking.one_side import END_STD, OneSide


class StatedCovariance:
    """The joint covariance of the state of `gp_ekf` and of the errors that it considers."""

    def __init__(self, initial: np.ndarray, radii: np.ndarray, side: OneSide):
        """From the covariances (6, 6) of the start and (N, N) of radii of an unknown class."""
        self._radii = radii if side.radii_covariance is None else side.radii_covariance
        self._limbs, self._side = side.limbs, side
        count = len(self._limbs)
        memories = np.full(count + NODES + side.shared_errors, np.inf)
        memories[: count + NODES] = FIELD_TIME
        self._joint = JointCovariance(block_diag(initial, self._radii), memories)

    @property
    def reported(self) -> np.ndarray:
        """Covariance (6 + N, 6 + N) of pose, rates, and radii with the limbs where they are."""
        size, limbs = self._joint.size, slice(self._joint.size, self._joint.size + len(self._limbs))
        matrix = self._joint.matrix
        reported = matrix[:size, :size].copy()
        cross = matrix[:size, limbs] @ self._limbs
        reported[:, 6:] += cross
        reported[6:] += cross.T
        reported[6:, 6:] += self._limbs.T @ matrix[limbs, limbs] @ self._limbs
        return 0.5 * (reported + reported.T)

    def predict(self, transition: np.ndarray, noise: np.ndarray, interval: float) -> None:
        """One `interval` in s later; `transition` (6 + N, 6 + N), `noise` (6, 6) of the pose."""
        all_noise = np.zeros_like(transition)
        all_noise[:6, :6] = noise
        all_noise[6:, 6:] = (1.0 - transition[-1, -1] ** 2) * self._radii
        self._joint.predict(transition, all_noise, interval)

    def tie(self, gain: np.ndarray, mean: np.ndarray, slip: float) -> None:
        """After `gain` (6 + N,) drew heading and velocity of the `mean` (6 + N,) together."""
        rows = np.zeros((1, len(self._joint.matrix)))
        rows[0, : len(mean)] = velocity_across(mean)[1]
        self._joint.correct(gain[:, None], rows, np.array([slip**2]))

    def between_ends(self, gain: np.ndarray, row: np.ndarray) -> None:
        """After `gain` (6 + N,) took the ends, whose derivative is the `row` (6 + N + L,)."""
        rows = np.zeros((1, len(self._joint.matrix)))
        rows[0, : len(row)] = row
        self._joint.correct(gain[:, None], rows, np.array([END_STD**2]))

    @property
    def position(self) -> np.ndarray:
        """Covariance (2, 2) m² of the centre."""
        return self._joint.matrix[:2, :2]

    def rows(
        self, model: Linearisation, rays: Rays, shape_stds: np.ndarray, mean: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """A (n, 6 + N + m) and own variances (n,) m² of the residuals of a scan's used points.

        `rays` are theirs, `shape_stds` (n,) m the standard deviations of the visible shape, `mean`
        is the state of the `model`.
        """
        gradients = model.gradients
        along = (gradients * rays.directions).sum(axis=1)
        across = (gradients * rays.normals).sum(axis=1)
        own = (self._side.std_factor * rays.stds * along) ** 2 + across**2 * rays.across_variances
        directions = model.directions @ rotation(mean[2])
        angles = np.arctan2(directions[:, 1], directions[:, 0])
        limbs = [
            np.interp(angles, self._side.basis_angles, limb, period=2.0 * np.pi)
            for limb in self._limbs
        ]
        # Of what the process leaves out, neighbours share a part as large as each point's own.
        rough = self._side.roughness**2 * (gradients**2).sum(axis=1)
        field = np.copysign(np.sqrt(rough + (shape_stds * along) ** 2), along)
        considered = [
            np.reshape(limbs, (len(limbs), len(angles))).T,
            field[:, None] * field_weights(angles),
            np.einsum("ni,nij->nj", gradients, rays.shared),
        ]
        return np.hstack([model.state_matrix, *considered]), own + rough + model.radius_variances

    def correct(
        self, gain: np.ndarray, rows: np.ndarray, noise: np.ndarray, residuals: np.ndarray
    ) -> float:
        """After the update by `gain` (6 + N, n); returns the NIS of its `residuals` (n,)."""
        nis = normalised_innovation_squared(self._joint.matrix, rows, noise, residuals)
        self._joint.correct(gain, rows, noise)
        return nis
