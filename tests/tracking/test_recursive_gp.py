"""The kernel, and the recursive regression beside the whole one."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.tracking.kernel import ContourProcess, kernel

NOISE = 0.05
EXAMPLE = Path(__file__).parents[2] / "examples" / "recursive_gp.py"
FUNCTIONS = runpy.run_path(str(EXAMPLE))
radius, start, update = (FUNCTIONS[name] for name in ("radius", "start", "update"))


def contour(angles):
    return 1.5 + 0.5 * np.cos(2.0 * angles) + 0.2 * np.sin(3.0 * angles)


def batch(angles, radii, at, length_scale, sigma_f, sigma_r):
    """The textbook's Gaussian process regression, thesis (45)-(46)."""
    covariance = kernel(angles, angles, length_scale, sigma_f, sigma_r)
    covariance += NOISE**2 * np.eye(len(angles))
    cross = kernel(at, angles, length_scale, sigma_f, sigma_r)
    mean = cross @ np.linalg.solve(covariance, radii)
    spread = sigma_f**2 + sigma_r**2 - np.sum(cross * np.linalg.solve(covariance, cross.T).T, 1)
    return mean, np.sqrt(spread)


@pytest.mark.parametrize("exact", [True, False])
def test_recursion_is_the_regression_at_basis_points_and_near_it_between_them(exact):
    """Thesis, below (49): exact where the inputs are a subset of the basis points."""
    process = ContourProcess(32 if exact else 50, np.pi / 8, 1.0, 0.5, 1e-9 if exact else 1e-6)
    random, (mean, covariance), batches = np.random.default_rng(2), start(process), []
    for _ in range(20):
        anywhere = random.uniform(0.0, 2.0 * np.pi, 15)
        angles = random.choice(process.basis_angles, 15) if exact else anywhere
        batches.append((angles, contour(angles) + NOISE * random.standard_normal(15)))
        mean, covariance = update(mean, covariance, *batches[-1], NOISE, process)
    at = process.basis_angles if exact else np.linspace(0.0, 2.0 * np.pi, 200)
    found, std = mean, np.sqrt(np.diag(covariance))
    if not exact:
        found, std = radius(mean, covariance, at, process)
    angles, radii = (np.concatenate(part) for part in zip(*batches, strict=True))
    expected, expected_std = batch(angles, radii, at, np.pi / 8, 1.0, 0.5)
    tolerance = 1e-5 if exact else 0.05 * NOISE
    np.testing.assert_allclose(found, expected, atol=tolerance)
    np.testing.assert_allclose(std, expected_std, atol=tolerance)
    assert np.sqrt(np.mean((found - contour(at)) ** 2)) < 0.5 * NOISE


def test_example_writes_its_picture(tmp_path, monkeypatch):
    picture = tmp_path / "regression.png"
    monkeypatch.setattr("sys.argv", ["recursive_gp.py", str(picture)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert picture.read_bytes()[:4] == b"\x89PNG"


LENGTH = np.pi / 8
SIGMA = 1.7
"""Neither 1 nor 2, whose square is the double: a missing square would not be seen."""

ANGLES = st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=8).map(np.array)


@given(angles=ANGLES, turns=st.integers(-3, 3))
def test_kernel_is_periodic_and_symmetric_with_the_variance_on_the_diagonal(angles, turns):
    covariance = kernel(angles, angles, LENGTH, SIGMA, 0.8)
    np.testing.assert_allclose(covariance, covariance.T)
    np.testing.assert_allclose(np.diag(covariance), SIGMA**2 + 0.8**2)
    turned = kernel(angles + 2.0 * np.pi * turns, angles, LENGTH, SIGMA, 0.8)
    np.testing.assert_allclose(turned, covariance, atol=1e-9)


@pytest.mark.parametrize("basis_points", [4, 20, 50])
@pytest.mark.parametrize("sigma_r", [0.0, 0.8])
def test_regression_matches_the_textbook(basis_points, sigma_r):
    process = ContourProcess(basis_points, LENGTH, SIGMA, sigma_r, 1e-6)
    basis, angles = process.basis_angles, np.linspace(-7.0, 7.0, 61)
    matrix, variance = process.at(angles)
    cross = kernel(angles, basis, LENGTH, SIGMA, sigma_r)
    padded = kernel(basis, basis, LENGTH, SIGMA, sigma_r) + 1e-6 * np.eye(basis_points)
    expected = np.linalg.solve(padded, cross.T).T
    np.testing.assert_allclose(matrix, expected, atol=1e-6)
    explained = np.sum(expected * cross, axis=1)
    np.testing.assert_allclose(variance, SIGMA**2 + sigma_r**2 - explained, atol=1e-6)
    assert np.all(variance >= 0.0)


def test_slope_is_the_derivative_of_the_regression():
    process = ContourProcess(30, LENGTH, SIGMA, 0.8, 1e-6)
    radii = 2.0 + 0.3 * np.cos(2.0 * process.basis_angles) + 0.1 * np.sin(process.basis_angles)
    angles, step = np.linspace(-3.0, 3.0, 40), 1e-4
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    radius, slope = process.radius(directions, process.correlations(directions), radii)
    np.testing.assert_allclose(radius, process.at(angles)[0] @ radii, atol=1e-8)
    difference = (process.at(angles + step)[0] - process.at(angles - step)[0]) @ radii
    np.testing.assert_allclose(slope, difference / (2 * step), atol=1e-5)
