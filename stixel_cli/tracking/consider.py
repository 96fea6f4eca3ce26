"""Errors that a tracker does not estimate but considers: Schmidt's covariance, for any gain.

With the error e of an estimate, considered errors q of unit variance, and an innovation
v = H e + G q + w, an update of the estimate by K v leaves the error e - K v. With A = [H G] and
V = A J Aᵀ + R, the joint covariance J of (e, q) becomes

    J - [K; 0] A J - J Aᵀ [K; 0]ᵀ + [K; 0] V [K; 0]ᵀ

Joseph's form: true for any K, so for a gain that was computed from another covariance, too. With
K = (J Aᵀ)ₑ V⁻¹ it is the filter of Schmidt 1966, *Application of state-space methods to navigation
problems*. The considered errors are not corrected; each is forgotten in its own time.
"""

from copy import copy

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning

NODES = 16
"""Nodes over the outline of what neighbouring points share of a shape's error: 1 m of a car."""

FIELD_TIME = 0.5
"""Time in which that error is forgotten, s: the aspect changes, limbs swing."""


class JointCovariance:
    """The covariance (d + m, d + m) of the errors of d states and of m considered errors.

    Attributes:
        matrix: that covariance, the states first.
        size: d.
    """

    def __init__(self, covariance: np.ndarray, memories: np.ndarray, fading: int = 0):
        """From the covariance (d, d) of the states, and the `memories` (fading + m,), s.

        They are those of so many last states that are `fading`, and of the considered errors. An
        error is correlated with itself by e⁻¹ after its memory; with an infinite one it stays.
        """
        self.size = len(covariance)
        self.matrix = np.eye(self.size + len(memories) - fading)
        self.matrix[: self.size, : self.size] = covariance
        lasting = np.full(len(self.matrix) - len(memories), np.inf)
        self._memories, self._initial = np.append(lasting, memories), self.matrix.copy()

    def copy(self) -> "JointCovariance":
        """Another one, which changes alone."""
        other = copy(self)
        other.matrix = self.matrix.copy()
        return other

    def predict(self, transition: np.ndarray, noise: np.ndarray, interval: float) -> None:
        """One `interval` in s later, by `transition` and `noise` of the states that do not fade."""
        states = slice(0, len(transition))
        self.matrix[states] = transition @ self.matrix[states]
        self.matrix[:, states] = self.matrix[:, states] @ transition.T
        self.matrix[states, states] += noise
        kept = np.exp(-interval / self._memories)
        kept = kept[:, None] * kept
        self.matrix = kept * self.matrix + (1.0 - kept) * self._initial

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


@returning(lambda angles: np.zeros((len(angles), NODES)))
@njit(cache=True)
def node_weights(weights, angles):
    """Weights (n, 16) of nodes that are even over a turn, at `angles` (n,) rad: linear between."""
    for i in range(len(angles)):
        position = angles[i] * (NODES / (2.0 * np.pi))
        node = int(np.floor(position))
        weights[i, node % NODES] = 1.0 - (position - node)
        weights[i, (node + 1) % NODES] = position - node


def field_weights(angles: np.ndarray) -> np.ndarray:
    """`node_weights` (n, 16) of unit norm, as the field's nodes have unit variance."""
    weights = node_weights(angles)
    return weights / np.sqrt(np.einsum("ij,ij->i", weights, weights))[:, None]
