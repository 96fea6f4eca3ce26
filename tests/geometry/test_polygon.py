import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.geometry.polygon import first_hits

SQUARE = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])


@given(seed=st.integers(0, 2**31))
def test_hits_are_those_of_another_program(seed):
    """Of a star with arms: where a long line first crosses its area."""
    random = np.random.default_rng(seed)
    angles = np.linspace(0.0, 2.0 * np.pi, 14, endpoint=False)
    polygon = random.uniform(0.4, 2.0, 14)[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
    area = shapely.Polygon(polygon)
    origin = 9.0 * np.array([np.cos(seed), np.sin(seed)])
    towards = np.arctan2(*-origin[::-1]) + random.uniform(-0.3, 0.3, 20)
    directions = np.stack([np.cos(towards), np.sin(towards)], axis=-1)
    found = first_hits(polygon, origin, directions)
    for direction, hit in zip(directions, found, strict=True):
        crossed = area.intersection(shapely.LineString([origin, origin + 30.0 * direction]))
        if crossed.is_empty:
            assert np.isinf(hit)
        else:
            assert hit == pytest.approx(crossed.distance(shapely.Point(origin)), abs=1e-9)


def test_a_ray_along_an_edge_or_through_a_corner_meets_it_and_one_behind_does_not():
    origins = np.array([[3.0, 1.0], [3.0, 3.0], [3.0, 0.0], [3.0, 1.1]])
    directions = np.array([[-1.0, 0.0], [-np.sqrt(0.5), -np.sqrt(0.5)], [1.0, 0.0], [-1.0, 0.0]])
    found = first_hits(SQUARE, origins, directions)
    np.testing.assert_allclose(found, [2.0, 2.0 * np.sqrt(2.0), np.inf, np.inf], atol=1e-12)
