"""Clusters are those of DBSCAN."""

import numpy as np
import pytest
from sklearn.cluster import DBSCAN

from stixel_cli.measurements.clusters import cluster, distances


@pytest.mark.parametrize("least", [1, 2])
def test_clusters_are_those_of_dbscan(least):
    random, single = np.random.default_rng(0), 0
    for count in [1, *random.integers(2, 60, 40)]:
        points = random.uniform([-8.0, 7.0], [8.0, 23.0], (count, 2))
        covariances = np.tile(random.uniform(0.0, 0.3) * np.eye(2), (count, 1, 1))
        found = cluster(points, covariances, least=least)
        near = distances(points, covariances)
        expected = DBSCAN(eps=1.0, min_samples=least, metric="precomputed").fit_predict(near)
        np.testing.assert_array_equal(found, expected)
        single += int(np.sum(found < 0))
    assert (single > 0) == (least == 2)
    assert len(cluster(np.zeros((0, 2)), np.zeros((0, 2, 2)))) == 0
