"""Rays against contours, beside a brute force of every ray with every edge."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.measurements.rays import first_crossings, spread_rays


def every_ray_with_every_edge(contour, angles):
    """Nearest entering crossing of each ray, by solving 2 x 2 systems; inf where there is none."""
    ranges = np.full(len(angles), np.inf)
    for i, angle in enumerate(angles):
        direction = np.array([np.cos(angle), np.sin(angle)])
        for start, end in zip(contour, np.roll(contour, -1, axis=0), strict=True):
            system = np.stack([direction, start - end], axis=-1)
            if np.linalg.det(system) <= 1e-12:  # parallel, or leaving the contour
                continue
            along, share = np.linalg.solve(system, start)
            if along > 0.0 and -1e-12 <= share <= 1.0 + 1e-12:
                ranges[i] = min(ranges[i], along)
    return ranges


def concave_star(seed, centre, size):
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 25))
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, count))
    gaps = np.diff(np.concatenate([angles, angles[:1] + 2.0 * np.pi]))
    if gaps.max() >= np.pi - 0.05:  # the centre would be outside
        angles = 2.0 * np.pi * np.arange(count) / count
    radii = size * random.uniform(0.2, 1.0, count)
    return centre + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@given(
    seed=st.integers(0, 2**31),
    distance=st.floats(0.0, 30.0),
    bearing=st.floats(-np.pi, np.pi),
    even_tangent=st.booleans(),
    middle=st.floats(-0.5, 0.5),
    half=st.floats(0.1, 1.0),
)
def test_crossings_match_a_brute_force_search(seed, distance, bearing, even_tangent, middle, half):
    # Near ones enclose the sensor, or reach round it past the seam behind.
    centre = distance * np.array([np.cos(bearing), np.sin(bearing)])
    contour = concave_star(seed, centre, 4.0)
    rays = spread_rays(41, (middle - half, middle + half), even_tangent)
    expected = every_ray_with_every_edge(contour, rays.angles)
    hit, ranges = first_crossings(contour, rays)
    found = np.full(41, np.inf)
    found[hit] = ranges
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("even_tangent", [False, True])
def test_rays_span_the_field_of_view_evenly(even_tangent):
    rays = spread_rays(11, (-0.6, 0.9), even_tangent)
    values = np.tan(rays.angles) if even_tangent else rays.angles
    np.testing.assert_allclose(np.diff(values), np.diff(values)[0])
    np.testing.assert_allclose(rays.angles[[0, -1]], [-0.6, 0.9])
    # The step is the derivative of the angle by the ray's index.
    np.testing.assert_allclose(rays.steps[1:-1], np.gradient(rays.angles)[1:-1], rtol=0.02)
