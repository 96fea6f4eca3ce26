"""Considered errors: the covariance of an estimate is that of its errors, whatever its gain."""

import numpy as np

from stixel_cli.tracking.consider import FIELD_TIME, NODES, JointCovariance, field_weights

GENERATOR = np.random.default_rng(1000)


def spread(rows, columns):
    return 0.5 * GENERATOR.standard_normal((rows, columns))


def test_the_covariance_is_that_of_the_errors_of_many_runs():
    """Two states, two considered errors, gains that are not the optimal ones."""
    runs, memories = 200_000, np.array([0.5, np.inf])
    start, transition, noise = np.diag([1.0, 0.5]), np.array([[1.0, 0.1], [0.0, 1.0]]), 0.02
    joint = JointCovariance(start, memories)
    errors = GENERATOR.standard_normal((runs, 2)) @ np.sqrt(start)
    considered = GENERATOR.standard_normal((runs, 2))
    for _ in range(4):
        joint.predict(transition, noise**2 * np.eye(2), 0.1)
        errors = errors @ transition.T + noise * GENERATOR.standard_normal((runs, 2))
        kept = np.exp(-0.1 / memories)
        considered = kept * considered + np.sqrt(1.0 - kept**2) * GENERATOR.standard_normal(
            (runs, 2)
        )
        gain, rows, variances = spread(2, 3), spread(3, 4), np.array([0.1, 0.2, 0.3])
        joint.correct(gain, rows, variances)
        residuals = np.hstack([errors, considered]) @ rows.T
        residuals += np.sqrt(variances) * GENERATOR.standard_normal((runs, 3))
        errors = errors - residuals @ gain.T
    found = np.cov(np.hstack([errors, considered]).T)
    np.testing.assert_allclose(joint.matrix, found, rtol=0.05, atol=0.02)


def test_with_the_optimal_gain_and_nothing_considered_it_is_a_kalman_update():
    covariance, rows, noise = spread(3, 3), spread(4, 3), np.array([0.1, 0.2, 0.3, 0.4])
    covariance = covariance @ covariance.T
    innovation = rows @ covariance @ rows.T + np.diag(noise)
    gain = np.linalg.solve(innovation, rows @ covariance).T
    joint = JointCovariance(covariance, np.zeros(0))
    joint.correct(gain, rows, noise)
    np.testing.assert_allclose(joint.matrix, (np.eye(3) - gain @ rows) @ covariance, atol=1e-12)


def test_the_field_has_unit_variance_and_neighbours_share_it():
    angles = np.linspace(-np.pi, np.pi, 101)
    weights = field_weights(angles)
    correlations = weights @ weights.T
    np.testing.assert_allclose(np.diag(correlations), 1.0)
    apart = np.abs(np.angle(np.exp(1j * (angles[:, None] - angles))))
    assert correlations[apart < 0.25 * 2 * np.pi / NODES].min() > 0.7
    assert not correlations[apart > 2.001 * 2 * np.pi / NODES].any()
    assert FIELD_TIME == 0.5


def test_an_estimate_that_goes_back_to_a_mean_errs_by_what_it_goes_back():
    """Of an unseen target the size is the class's, and its error that of the class."""
    std, keep = 0.3, 0.9
    joint = JointCovariance(np.array([[std**2]]), np.array([np.inf]))
    joint.matrix[0, 1] = joint.matrix[1, 0] = std
    for _ in range(5):
        joint.predict(np.array([[keep, (1.0 - keep) * std]]), np.zeros((1, 1)), 0.1)
        np.testing.assert_allclose(joint.matrix[0, 0], std**2)
    # Once it is known exactly, the estimate forgets it.
    joint.matrix[0] = joint.matrix[:, 0] = 0.0
    joint.predict(np.array([[keep, (1.0 - keep) * std]]), np.zeros((1, 1)), 0.1)
    np.testing.assert_allclose(joint.matrix[0, 0], ((1.0 - keep) * std) ** 2)
