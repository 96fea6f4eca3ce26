import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.tracking.kernel import ContourProcess, kernel

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
    slope = process.slope(directions, process.correlations(directions), radii)
    difference = (process.at(angles + step)[0] - process.at(angles - step)[0]) @ radii
    np.testing.assert_allclose(slope, difference / (2 * step), atol=1e-5)
