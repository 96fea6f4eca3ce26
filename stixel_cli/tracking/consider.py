"""Errors that a tracker does not estimate but considers: Schmidt's covariance, for any gain.

With the error e of an estimate, considered errors q of unit variance, and an innovation
v = H e + G q + w, an update of the estimate by K v leaves the error e - K v. With A = [H G] and
V = A J Aᵀ + R, the joint covariance J of (e, q) becomes

    J - [K; 0] A J - J Aᵀ [K; 0]ᵀ + [K; 0] V [K; 0]ᵀ

Joseph's form: true for any K, so for a gain that was computed from another covariance, too. With
K = (J Aᵀ)ₑ V⁻¹ it is the filter of Schmidt 1966, *Application of state-space methods to navigation
problems*. The considered errors stay, and are not corrected.
"""

from copy import copy

import numpy as np
from numba import njit


class JointCovariance:
    """The covariance (d + m, d + m) of the errors of d states and of m considered errors.

    Attributes:
        matrix: that covariance, the states first.
        size: d.
    """

    def __init__(self, covariance: np.ndarray, considered: int):
        """From the covariance (d, d) of the states, and the number m of considered errors."""
        self.size = len(covariance)
        self.matrix = np.eye(self.size + considered)
        self.matrix[: self.size, : self.size] = covariance

    def copy(self) -> "JointCovariance":
        """Another one, which changes alone."""
        other = copy(self)
        other.matrix = self.matrix.copy()
        return other

    def predict(self, transition: np.ndarray, noise: np.ndarray) -> None:
        """Later, by the `transition` (d, d) of the states and its `noise` (d, d)."""
        states = slice(0, self.size)
        self.matrix[states] = transition @ self.matrix[states]
        self.matrix[:, states] = self.matrix[:, states] @ transition.T
        self.matrix[states, states] += noise

    def correct(self, gain: np.ndarray, rows: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """After an update by `gain` K (d, n) with `rows` A (n, d + m); the `noise` (d, n) is K R.

        Returns A J (n, d + m), of J before it.
        """
        # Factor by factor: the sum of the three terms loses its definiteness.
        size, moved = self.size, rows @ self.matrix
        self.matrix[:size] -= gain @ moved
        left = self.matrix[:size] @ rows.T - noise
        states = self.matrix[:size, :size] - left @ gain.T
        self.matrix[:size, :size] = 0.5 * (states + states.T)
        self.matrix[size:, :size] = self.matrix[:size, size:].T
        return moved

    def correct_by_one(self, gain: np.ndarray, row: np.ndarray, variance: float) -> None:
        """The same of one scalar of this `variance`: `gain` (d,), and `row` (d,) or longer."""
        _correct_by_one(self.matrix, np.zeros(len(self.matrix)), gain, row, variance)


@njit(cache=True)
def _correct_by_one(matrix, spread, gain, row, variance):
    """`JointCovariance.correct` by one scalar of this `variance`; A J is added to `spread`."""
    for k in range(len(row)):
        if row[k] != 0.0:
            for j in range(len(matrix)):
                spread[j] += row[k] * matrix[k, j]
    for i in range(len(gain)):
        left = -variance * gain[i]
        for j in range(len(matrix)):
            matrix[i, j] -= gain[i] * spread[j]
        for j in range(len(row)):
            left += matrix[i, j] * row[j]
        for j in range(len(gain)):
            matrix[i, j] -= left * gain[j]
    for i in range(len(gain)):
        for j in range(i + 1, len(matrix)):
            matrix[j, i] = matrix[i, j]
