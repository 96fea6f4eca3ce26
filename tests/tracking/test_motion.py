import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag

from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.motion import intervals, predict, process_noise, transition


def test_first_interval_is_used_twice():
    np.testing.assert_allclose(intervals(np.array([0.0, 0.1, 0.3])), [0.1, 0.1, 0.2])
    assert intervals(np.array([2.0])).tolist() == [0.0]
    assert intervals(np.array([])).tolist() == []


def test_transition_and_noise_equal_the_kronecker_products():
    shift = np.array([[1.0, 0.2], [0.0, 1.0]])
    np.testing.assert_allclose(transition(0.2), np.kron(shift, np.eye(3)))
    moments = np.array([[0.2**3 / 3, 0.2**2 / 2], [0.2**2 / 2, 0.2]])
    expected = np.kron(moments, np.diag([1.5**2, 1.5**2, 0.3**2]))
    np.testing.assert_allclose(process_noise(0.2, 1.5, 0.3), expected)


@given(seed=st.integers(0, 2**31), alpha=st.sampled_from([0.0, 1e-4, 2.0]))
def test_prediction_matches_the_dense_formula(seed, alpha):
    random = np.random.default_rng(seed)
    process = ContourProcess(8, 0.5, 1.0, 0.5, 1e-6)
    mean = random.standard_normal(14)
    root = random.standard_normal((14, 14))
    interval = random.uniform(0.01, 1.0)
    noise = process_noise(interval, 1.0, 0.2)
    dense = block_diag(transition(interval), np.exp(-alpha * interval) * np.eye(8))
    radii_noise = (1.0 - np.exp(-2.0 * alpha * interval)) * process.covariance
    expected = dense @ root @ root.T @ dense.T + block_diag(noise, radii_noise)
    predicted, covariance = predict(mean, root @ root.T, interval, noise, alpha, process)
    np.testing.assert_allclose(predicted, dense @ mean, atol=1e-12)
    np.testing.assert_allclose(covariance, expected, atol=1e-10)
