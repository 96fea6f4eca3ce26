"""Clusters of points that are near each other in depth and bearing."""

import numpy as np

GAP = 0.7
"""Stixels of one object have a neighbour this near, m, if nothing is uncertain."""

LEAST = 2
"""Stixels of an object."""


def cluster(points_ego: np.ndarray, covariances_ego: np.ndarray) -> np.ndarray:
    """The cluster (n,) of each point, from 0; -1 without a cluster.

    Args:
        points_ego: (n, 2) m, from the camera.
        covariances_ego: (n, 2, 2) m².
    """
    if len(points_ego) < LEAST:
        return np.full(len(points_ego), -1)
    # It takes a second to import.
    from sklearn.cluster import DBSCAN

    near = distances(points_ego, covariances_ego)
    return DBSCAN(eps=1.0, min_samples=LEAST, metric="precomputed").fit_predict(near)


def distances(points_ego: np.ndarray, covariances_ego: np.ndarray) -> np.ndarray:
    """Distances (n, n) without unit between points: up to 1, they are neighbours on one object.

    Along the ray a step counts in units of `GAP` and the standard deviation of the difference,
    across it, where bearings are exact, in units of `GAP`. So far objects, whose depth is
    uncertain, do not break up, and those next to each other do not merge.

    Args:
        points_ego: (n, 2) m, from the camera.
        covariances_ego: (n, 2, 2) m².
    """
    ranges = np.hypot(*points_ego.T)
    bearings = np.arctan2(points_ego[:, 1], points_ego[:, 0])
    along = points_ego / np.maximum(ranges, 1e-9)[:, None]
    variances = np.einsum("ni,nij,nj->n", along, covariances_ego, along)
    steps = (ranges[:, None] - ranges) ** 2 / (GAP**2 + variances[:, None] + variances)
    across = (bearings[:, None] - bearings) * np.minimum(ranges[:, None], ranges)
    return np.sqrt(steps + (across / GAP) ** 2)
