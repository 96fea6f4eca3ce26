"""A fabricated scan of 640 rays beside a plain one of every ray with every edge.

`pytest bench/bench_fabricated.py`.
"""

import dataclasses

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters, fabricate_scan
from stixel_cli.measurements.rays import FittedNoise, StereoNoise, first_crossings, spread_rays
from stixel_cli.randomness import generator

RIG = Rig(640, 480, 60.0, None, None, None, 0.3, 1.2, 1.0, None)
STEREO = FabricatedParameters(
    kind="fabricated",
    rays=None,
    spacing="tangent",
    noise=StereoNoise("stereo", disparity_std=0.1),
    dropout=None,
    clutter_rate=0.0,
    missed_probability=0.0,
    range_max=80.0,
)
# As fitted to a cyclist; every ray gives a point, which is the most there can be.
FITTED = dataclasses.replace(
    STEREO,
    noise=FittedNoise("fitted", 1, 0.16, 0.23, 9.0, -0.04, 0.09, 0.14, 0.014, 7.3),
)
RAYS = spread_rays(640, RIG.field_of_view, True)
SENSOR = np.array([0.0, 0.0, np.pi / 2])


@pytest.fixture(autouse=True)
def _one_thread():
    with threadpool_limits(1):
        yield


@pytest.fixture
def contour_world():
    """A car's size, 200 vertices, wavy so that it is concave; 12 m ahead, turned."""
    angles = 2.0 * np.pi * np.arange(200) / 200
    wave = 1.0 + 0.02 * np.cos(25.0 * angles)
    outline = wave[:, None] * np.stack([2.25 * np.cos(angles), 0.9 * np.sin(angles)], axis=-1)
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    return outline @ turn.T + [1.0, 12.0]


def every_ray_with_every_edge(contour_sensor, rays):
    """Nearest crossing with an edge that faces the sensor, for every pair of ray and edge."""
    d = np.stack([np.cos(rays.angles), np.sin(rays.angles)], axis=-1)[:, None]
    a, b = contour_sensor, np.roll(contour_sensor, -1, axis=0)
    edge = b - a
    rate = d[..., 0] * edge[:, 1] - d[..., 1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (a[:, 0] * edge[:, 1] - a[:, 1] * edge[:, 0]) / rate
        share = (a[:, 0] * d[..., 1] - a[:, 1] * d[..., 0]) / rate
    ranges[~((rate < 0.0) & (share >= 0.0) & (share <= 1.0) & (ranges > 0.0))] = np.inf
    nearest = ranges.min(axis=1)
    hit = np.flatnonzero(np.isfinite(nearest))
    return hit, nearest[hit]


@pytest.mark.parametrize("measurement", [STEREO, FITTED], ids=["stereo", "fitted"])
def test_scan(benchmark, contour_world, measurement):
    """A whole scan: generator, crossings, noise, points and covariances."""

    def scan():
        random = generator(0, "fabricate")
        return fabricate_scan(contour_world, SENSOR, RAYS, RIG, measurement, random)

    points, _ = benchmark(scan)
    assert len(points) > 150


@pytest.mark.parametrize("crossings", [first_crossings, every_ray_with_every_edge])
def test_crossings(benchmark, crossings, contour_world):
    """The crossings alone, beside the plain way."""
    contour_sensor = np.stack([contour_world[:, 1], -contour_world[:, 0]], axis=-1)
    hit, ranges = benchmark(crossings, contour_sensor, RAYS)
    plain_hit, plain_ranges = every_ray_with_every_edge(contour_sensor, RAYS)
    np.testing.assert_array_equal(hit, plain_hit)
    np.testing.assert_allclose(ranges, plain_ranges)
