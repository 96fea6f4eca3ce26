"""How far a target's outline is from that of its form: a residual along the normals, in the state.

The residual is linear between nodes that are even in the angle of a point seen from the centre, in
units of half the length and half the width: so a change of the size moves no point to another node.
A ray that meets the outline at an angle to its normal changes by the residual over the cosine; an
end changes by the residual itself. Neighbours and successive scans share the residual, so what they
have in common is estimated, and the size and the pose need not absorb it.
"""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.contour.class_shape import ClassShape

NODES = 16
"""Four on each side of a box."""

RESIDUAL_STD = 0.06
"""Of each node before the first scan, m: from 0.03 to 0.12 on tuning seeds, this was the best."""

LEAST_COSINE = 0.25
"""Of the angle between ray and normal: where a ray grazes, the residual changes little."""


class Residual:
    """The normals of a form's outline, and the weights of the nodes along it.

    Attributes:
        std: m, of each node before the first scan.
    """

    def __init__(self, shape: ClassShape, std: float = RESIDUAL_STD):
        self.std = std
        outline = shape.outline
        edges = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
        self._outline, self._half = outline, 0.5 * shape.size
        self._normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
        angles = self._angles(outline)
        self._weights = _weights(angles)
        self._order = np.argsort(angles)
        self._sorted = angles[self._order]

    def slopes(
        self,
        state: np.ndarray,
        sensor: np.ndarray,
        directions: np.ndarray,
        ranges: np.ndarray,
        ends: tuple[int, int],
    ) -> np.ndarray:
        """Slopes (n + 2, NODES) of n ranges and of minus the two insets, by the residual.

        `state` (7 + NODES,) and the rays' `directions` (n, 2) are in the world, `sensor` (2,) m is
        their origin, `ranges` (n,) m those that are predicted; `ends` names the first and the last
        ray.
        """
        factors, to_target = np.exp(state[5:7]), rotation(-state[2])
        rays = directions @ to_target.T
        hits = ((sensor - state[:2]) @ to_target.T + ranges[:, None] * rays) / factors
        angles = self._angles(hits)
        nearest = self._order[np.searchsorted(self._sorted, angles) % len(self._sorted)]
        normals = _unit(self._normals[nearest] / factors)
        cosines = np.maximum(-np.einsum("ni,ni->n", normals, rays), LEAST_COSINE)
        slopes = np.empty((len(ranges) + 2, NODES))
        slopes[:-2] = -_weights(angles) / cosines[:, None]
        outline = self._outline * factors
        for row, ray, side in ((-2, ends[0], -1.0), (-1, ends[1], 1.0)):
            left = np.array([-rays[ray, 1], rays[ray, 0]])
            slopes[row] = -self._weights[np.argmax(outline @ (side * left))]
        return slopes

    def outline(self, state: np.ndarray) -> np.ndarray:
        """The outline (N, 2) m of a `state` (7 + NODES,), in the target's frame."""
        factors = np.exp(state[5:7])
        return self._outline * factors + (self._weights @ state[7:])[:, None] * _unit(
            self._normals / factors
        )

    def weights_at(self, outline: np.ndarray, state: np.ndarray) -> np.ndarray:
        """The weights (n, NODES) at points of an `outline` (n, 2) m of the `state`."""
        return _weights(self._angles(outline / np.exp(state[5:7])))

    def box_centre(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far the residual moves the middle of the box, (2,) m; slopes (2, NODES) by it."""
        factors = np.exp(state[5:7])
        plain, outline = self._outline * factors, self.outline(state)
        normals = _unit(self._normals / factors)
        shift, slopes = np.zeros(2), np.zeros((2, NODES))
        for extreme in (np.max, np.min):
            ends = extreme(outline, axis=0)
            shift += 0.5 * (ends - extreme(plain, axis=0))
            # Of a straight side, all of its points: which is the farthest is rounding.
            at = np.abs(outline - ends) < 1e-6
            weights = np.einsum("na,na,nk->ak", at, normals, self._weights)
            slopes += 0.5 * weights / at.sum(axis=0)[:, None]
        return shift, slopes

    def _angles(self, points: np.ndarray) -> np.ndarray:
        return np.arctan2(points[:, 1] / self._half[1], points[:, 0] / self._half[0])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.hypot(*vectors.T)[:, None]


def _weights(angles: np.ndarray) -> np.ndarray:
    """Weights (n, NODES) of the nodes at `angles` (n,) rad."""
    position = (angles / (2.0 * np.pi) * NODES) % NODES
    node = np.floor(position).astype(int)
    weights, rows = np.zeros((len(angles), NODES)), np.arange(len(angles))
    weights[rows, node % NODES] = 1.0 - (position - node)
    weights[rows, (node + 1) % NODES] += position - node
    return weights
