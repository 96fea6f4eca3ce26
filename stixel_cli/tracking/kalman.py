"""The Kalman update, in information form, and smoothing.

Fixed-lag smoothing gives estimates that also use some later scans: they are not causal. It is the
backward pass of Rauch, Tung & Striebel 1965 (Särkkä & Svensson 2023, *Bayesian Filtering and
Smoothing*, 12.2, 13.2). With the estimate m, P of a scan, its prediction m⁻, P⁻ of the next one and
the smoothed estimate mˢ, Pˢ there,

    G = P Fᵀ (P⁻)⁻¹      m + G (mˢ - m⁻)      P + G (Pˢ - P⁻) Gᵀ
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stixel_cli.geometry.pose import wrap_angle

PLACE = np.eye(2, 4)
"""The place as a function of the four states of place and velocity."""

CENTROID_STD = 0.3
"""Standard deviation of the centroid of a target's points, m: from scan to scan another part is
seen. Where clusters are followed, with 0.15 a car is not found, with 0.6 starts are worse."""


def correct(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """A Kalman update: correction (d,), covariance (d, d) and NIS.

    `covariance` (d, d) is the prior's, `matrix` (n, d) the measurement's. `noise`: (n,) variances
    of independent errors, or their covariance (n, n), far above rounding. In the information form
    the cost of independent ones grows with n and not with n³.
    """
    if noise.ndim == 2:
        whitening = np.linalg.inv(np.linalg.cholesky(noise))
        matrix, innovation, noise = whitening @ matrix, whitening @ innovation, np.ones(len(noise))
    weighted = matrix.T / noise
    posterior = np.linalg.solve(_scale(covariance, weighted @ matrix), covariance)
    posterior, pull = 0.5 * (posterior + posterior.T), weighted @ innovation
    correction = posterior @ pull
    return correction, posterior, float(innovation @ (innovation / noise) - pull @ correction)


def normalised_innovation_squared(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[float, float]:
    """NIS of an `innovation` (n,), and the logarithm of its density; the others as of `correct`."""
    weighted = matrix.T / noise
    scale, pull = _scale(covariance, weighted @ matrix), weighted @ innovation
    nis = innovation @ (innovation / noise) - pull @ np.linalg.solve(scale, covariance @ pull)
    volume = np.log(2.0 * np.pi * noise).sum() + np.linalg.slogdet(scale)[1]
    return float(nis), float(-0.5 * (nis + volume))


def _scale(covariance: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """I + P Hᵀ R⁻¹ H: the prior's covariance (d, d) is so many times that of the posterior."""
    scale = covariance @ precision
    scale.flat[:: len(scale) + 1] += 1.0
    return scale


def unit_variance(nis: np.ndarray | float, degrees: np.ndarray | int) -> np.ndarray:
    """By how much innovations are greater than a filter states, from sums up to a scan; 1 or more.

    The variance of unit weight, which a covariance is multiplied by: what is wrong of a target's
    shape is so in all scans, and makes all innovations greater. Smaller ones prove nothing.
    """
    return np.maximum(nis / np.maximum(degrees, 1), 1.0)


def mixture(
    shares: np.ndarray, means: np.ndarray, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) of n Gaussians with `shares` (n,), whose sum is 1.

    Their `means` are (n, d), their `covariances` (n, d, d).
    """
    mean = shares @ means
    away = means - mean
    whole = np.einsum("j,jab->ab", shares, covariances + away[:, :, None] * away[:, None, :])
    return mean, 0.5 * (whole + whole.T)


LEAST_SHARE = 1e-12
"""A direction whose predicted variance is below this share of the greatest one is not smoothed: it
is that of rounding."""


@dataclass(frozen=True)
class Step:
    """What a filter has at one scan."""

    mean: np.ndarray
    covariance: np.ndarray
    """`mean`, `covariance`: (d,) and (d, d), after the scan."""
    predicted_mean: np.ndarray
    predicted_covariance: np.ndarray
    """`predicted_mean`, `predicted_covariance`: before it."""
    before: "Step | None" = None
    """The step that was predicted; None at the first scan."""
    transition: np.ndarray | None = None
    """(d, d) Jacobian F of that prediction; None where the filter started again: nothing of this
    scan and of later ones changes the estimates before."""

    @cached_property
    def gain(self) -> np.ndarray:
        """G (d, d), of the state before; zero where the filter began anew."""
        if self.transition is None:
            return np.zeros_like(self.covariance)
        inverse = np.linalg.pinv(self.predicted_covariance, LEAST_SHARE, hermitian=True)
        return self.before.covariance @ self.transition.T @ inverse


def smooth(steps: Sequence[Step], lag: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Means (K, d) and covariances (K, d, d) of K scans, given those up to `lag` later.

    The third state is a heading, whose differences are wrapped.

    Args:
        steps: what is reported after each scan. It need not be predicted from what was reported
            before: an estimate follows from the `before` of the step that is reported `lag` later.
        lag: number of scans; None for all.
    """
    last = len(steps) - 1
    lag = last if lag is None else min(lag, last)
    estimates = [_backward(step, lag)[0] for step in steps[lag:last]]
    means, covariances = zip(*estimates, *_backward(steps[last], lag), strict=True)
    return np.stack(means), np.stack(covariances)


def _backward(step: Step, lag: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Mean and covariance of each of the last `lag` + 1 scans up to that of `step`."""
    mean, covariance = step.mean, step.covariance
    estimates = [(mean, covariance)]
    for _ in range(lag):
        change, excess = mean - step.predicted_mean, covariance - step.predicted_covariance
        change[2] = wrap_angle(change[2])
        gain, step = step.gain, step.before
        mean = step.mean + gain @ change
        covariance = step.covariance + gain @ excess @ gain.T
        covariance = 0.5 * (covariance + covariance.T)
        estimates.append((mean, covariance))
    return estimates[::-1]
