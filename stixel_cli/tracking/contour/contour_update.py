"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stixel_cli.tracking.association import GATE_STDS, uncut
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Rays, Sight, sampling_inset
from stixel_cli.tracking.contour.ray_kernels import NEAR, OUTLINE_STD, Measured, Rows, rows_at
from stixel_cli.tracking.kalman import (
    Step,
    correct,
    normalised_innovation_squared,
    unit_variance,
)

SEEN = np.array([0, 1, 2, 5, 6])
"""Indices of the states that a ray sees: the pose and the two sizes."""

CONTRADICTED = 50.0
"""Log odds beyond which the scans contradict an assumption: a hypothesis, that the target is of a
class, or of any. The errors of successive scans are alike, so what is wrong may be more likely for
some scans: at odds of 100 : 1 a wrong class was so in one of 45 runs of tuning seeds."""

CLUTTER = 0.5 * GATE_STDS**2
"""Log odds against a ray that passes by the shape, at most: then its point is clutter."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""

State = tuple[np.ndarray, np.ndarray, JointCovariance]
"""Mean (d,), the covariance (d, d) that makes the gain, and the joint covariance: of the error that
the mean has with these gains, and of the errors that are considered."""


@dataclass(frozen=True)
class Hypothesis:
    """Where the target may be after a scan."""

    state: State
    """After the scan."""
    log_likelihood: float = 0.0
    """Of all scans."""
    indices: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """Of the scan's points that were used."""
    nis: float = np.nan
    degrees: int = 0
    """`nis`, `degrees`: of the scan; NaN and 0 without points."""
    sums: tuple[float, int] = (0.0, 0)
    """NIS and degrees of freedom of all scans."""
    missed: float = 0.0
    """Log odds against the scan's rays that pass by the shape, at most `CLUTTER` each. They count
    between places of one class, and not between classes, whose sizes may be wrong."""
    prior: "Hypothesis | None" = None
    """Itself before the scan's update; None without points."""
    before: "Hypothesis | None" = None
    """The hypothesis that was predicted; None before the first scan."""
    transition: np.ndarray | None = None
    """(d, d) Jacobian of that prediction; None where the filter started again."""

    @property
    def stated(self) -> np.ndarray:
        """(d, d) covariance of the error of the mean."""
        joint = self.state[2]
        return unit_variance(*self.sums) * joint.matrix[: joint.size, : joint.size]

    @cached_property
    def step(self) -> Step:
        """What smoothing needs of this scan."""
        states = *self.state[:2], *(self.prior or self).state[:2]
        return Step(*states, self.before and self.before.step, self.transition)


class Fit(NamedTuple):
    """What an update finds."""

    mean: np.ndarray
    covariance: np.ndarray
    """`mean`, `covariance`: (d,) and (d, d) of the state."""
    rows: Rows
    """Of the last iterate."""
    innovations: np.ndarray
    """(k,) m, of the rows: of the mean before the update, linear from the iterate."""
    noise: np.ndarray
    """(k,) m², of the rows in the gain."""


class Measurement:
    """What n > 0 of a scan's `rays`, at `indices`, measure of a target that is seen as `sight`."""

    def __init__(self, rays: Rays, indices: np.ndarray, sight: Sight, tracker: ContourParameters):
        self.rays = rays = rays.subset(indices)
        self._indices, self._tracker, self._hidden_ends = indices, tracker, 0
        self._table = sight.table.arrays
        count = len(rays.ranges)
        ends = np.array([rays.bearings.argmin(), rays.bearings.argmax()])
        inset, variance = sampling_inset(rays, sight)
        of_edges = (np.radians(tracker.silhouette_std) * rays.ranges) ** 2
        silhouettes = uncut(rays.bearings[ends], rays.ranges[ends], rays.field_of_view)
        # A single ray does not show where an outline begins or ends.
        silhouettes &= ~np.array(rays.hidden) & (count > 1 or not sight.outline)
        self._measured = Measured(
            rays.sensor,
            rays.directions,
            rays.ranges - sight.bias_per_std * rays.stds,
            ends,
            inset,
            np.append(np.ones(count, bool), silhouettes),
            np.append((sight.std_factor * rays.stds) ** 2, variance + of_edges[ends]),
            rays.across_variances,
            OUTLINE_STD**2 + rays.across_variances + of_edges,
            tracker.noise_factor**2,
            tracker.shape_factor**2,
        )

    def fit(self, mean: np.ndarray, covariance: np.ndarray, begin: np.ndarray) -> Fit:
        """An iterated update of a `mean` (d,) and `covariance` (d, d), which starts at `begin`."""
        iterate, posterior, freedom = begin, covariance, self._tracker.degrees_of_freedom
        for _ in range(self._tracker.iterations):
            rows = rows_at(iterate, posterior, self._measured, self._table)
            weights = (freedom + 1.0) / (freedom + rows.errors**2 / rows.noise)
            noise = rows.noise / np.minimum(weights, 1.0)
            innovations = rows.errors + rows.matrix @ (iterate - mean)
            change, posterior, _ = correct(covariance, rows.matrix, noise, innovations)
            before, iterate = iterate, mean + change
            if np.abs(iterate - before).max() < CONVERGED:
                break
        return Fit(iterate, posterior, rows, innovations, noise)

    def update(self, prior: Hypothesis) -> Hypothesis:
        """The `prior`, updated."""
        mean, covariance, joint = prior.state
        if self._tracker.seen_by in ("file", "own"):
            self._leave_out_hidden_end(mean, covariance, joint)
        return self.posterior(prior, joint, self.fit(mean, covariance, mean))

    def _leave_out_hidden_end(
        self, mean: np.ndarray, covariance: np.ndarray, joint: JointCovariance
    ) -> None:
        """Of two ends that are too near each other, use the one that is less far inside.

        Less is seen of the target than is known of its size: at the other end something hides it,
        which a scan that is cut out of a recording need not show. So a size that was well seen is
        not unlearned. A class that is too large for the target pays for it as for an end at the
        gate.
        """
        measured, first = self._measured, len(self.rays.ranges)
        ends = slice(first, first + 2)
        if not measured.used[ends].all():
            return
        rows = rows_at(mean, covariance, measured, self._table)
        missing, slopes = rows.errors[ends], rows.matrix[ends].sum(axis=0)
        noise = measured.variances[ends] + measured.across_variances[measured.ends]
        variance = slopes @ joint.matrix[: joint.size, : joint.size] @ slopes
        variance += (noise + rows.stds[ends] ** 2).sum()
        if missing.sum() > GATE_STDS * np.sqrt(variance):
            measured.used[first + missing.argmax()] = False
            self._hidden_ends = 1

    def posterior(self, prior: Hypothesis, joint: JointCovariance, found: Fit) -> Hypothesis:
        """The `prior` after an update that is `found`, with the `joint` covariance before it.

        NIS and log likelihood are those of the innovation as the joint covariance has it, at the
        last iterate.
        """
        rows, measured = found.rows, self._measured
        gain = found.covariance @ (rows.matrix.T / found.noise)
        matrix, noise = self._stated(rows, len(joint.matrix))
        used = np.flatnonzero(measured.used)
        nis, likelihood = normalised_innovation_squared(
            joint.matrix, matrix[used], noise[used], found.innovations[used]
        )
        likelihood += np.log(2.0 * (NEAR + GATE_STDS * self.rays.stds)).sum()
        likelihood -= 0.5 * GATE_STDS**2 * self._hidden_ends
        missed = np.minimum(rows.insides, 0.0) ** 2 / measured.miss_variances
        joint = joint.copy()
        joint.correct(gain, matrix, gain * noise)
        return replace(
            prior,
            state=(found.mean, found.covariance, joint),
            log_likelihood=prior.log_likelihood + likelihood,
            indices=self._indices,
            nis=nis,
            degrees=len(used),
            sums=(prior.sums[0] + nis, prior.sums[1] + len(used)),
            missed=float(np.minimum(0.5 * missed, CLUTTER).sum()),
            prior=prior,
        )

    def _stated(self, rows: Rows, size: int) -> tuple[np.ndarray, np.ndarray]:
        """What the `rows` measure of all errors (k, size), and their own variances (k,) m².

        A ray that passes by is a penalty of the gain, and measures no considered error.
        """
        rays, measured = self.rays, self._measured
        count, states = len(rays.ranges), rows.matrix.shape[1]
        of_rays, to_ends = slice(count + 2), np.append(np.arange(count), measured.ends)
        slants = np.append(rows.slants, [1.0, 1.0])
        own = measured.variances + slants**2 * rays.across_variances[to_ends]
        matrix = np.zeros((len(rows.errors), size))
        matrix[:, :states] = rows.matrix
        # To move a point changes the innovation as to move the target does, on oblique faces, too.
        considered = np.einsum("ni,nim->nm", rows.matrix[of_rays, :2], rays.shared[to_ends])
        matrix[of_rays, states : states + considered.shape[1]] = considered
        squared = rows.errors[of_rays] ** 2 / (own + (considered**2).sum(axis=1))
        freedom = self._tracker.degrees_of_freedom
        own *= np.maximum((freedom + squared) / (freedom + 1.0), 1.0)
        return matrix, np.append(own, measured.miss_variances[rows.insides < 0.0])
