"""How far a target's outline is from that of its form: a residual along the normals, in the state.

The residual is linear between nodes that are even in the angle of a point seen from the centre, in
units of half the length and half the width: so a change of the size moves no point to another node.
A ray that meets the outline at an angle to its normal changes by the residual over the cosine; an
end changes by the residual itself. Neighbours and successive scans share the residual, so what they
have in common is estimated, and the size and the pose need not absorb it.
"""

import numpy as np

from stixel_cli.tracking.contour.class_shape import ClassShape

NODES = 16
"""Over the outline: a metre of a car's."""

RESIDUAL_STD = 0.06
"""Of each node before the first scan, m: from 0.03 to 0.12 on tuning seeds, this was the best."""


class Residual:
    """The normals of a form's outline, and the weights of the nodes along it."""

    def __init__(self, shape: ClassShape):
        outline = shape.outline
        edges = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
        self._outline, self._half = outline, 0.5 * np.ptp(outline, axis=0)
        self._normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
        self._weights = self.weights_at(outline, np.zeros(7))

    def outline(self, state: np.ndarray) -> np.ndarray:
        """The outline (N, 2) m of a `state` (7 + NODES,), in the target's frame."""
        factors = np.exp(state[5:7])
        return self._outline * factors + (self._weights @ state[7:])[:, None] * _unit(
            self._normals / factors
        )

    def weights_at(self, outline: np.ndarray, state: np.ndarray) -> np.ndarray:
        """The weights (n, NODES) at points of an `outline` (n, 2) m of the `state`."""
        x, y = (outline / np.exp(state[5:7]) / self._half).T
        positions = np.arctan2(y, x) * (NODES / (2.0 * np.pi))
        nodes, rows = np.floor(positions).astype(int), np.arange(len(outline))
        weights = np.zeros((len(outline), NODES))
        weights[rows, nodes % NODES] = 1.0 - (positions - nodes)
        weights[rows, (nodes + 1) % NODES] = positions - nodes
        return weights

    def box_centre(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far the residual moves the middle of the box, (2,) m; slopes (2, NODES) by it."""
        factors, outline = np.exp(state[5:7]), self.outline(state)
        shift, slopes = np.zeros(2), np.zeros((2, NODES))
        for extreme in (np.max, np.min):
            ends = extreme(outline, axis=0)
            shift += 0.5 * (ends - extreme(self._outline, axis=0) * factors)
            for axis, end in enumerate(ends):
                # Of a straight side, all of its points: which is the farthest is rounding.
                at = np.abs(outline[:, axis] - end) < 1e-6
                normals = _unit(self._normals[at] / factors)
                moved = normals[:, axis, None] * self._weights[at]
                slopes[axis] += 0.5 * moved.sum(axis=0) / len(moved)
        return shift, slopes


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.hypot(*vectors.T)[:, None]
