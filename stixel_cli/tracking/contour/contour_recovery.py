"""How the tracker `contour` finds a target again that its scans contradict.

A thin road user seen from its end looks nearly the same turned to either side, and the update,
which is local, stays on the side where it began. As the target turns on, less and less of it is in
the gate, and the track is lost. The normalised innovation squared (NIS) shows this early: it stays
near its degrees of freedom or below on a target that is tracked, and well above on one that is not.
Then the update is done again with all points of the target's cluster, with a prior that has the
start's uncertainty, too, from its mean and from the headings and places at the borders of its gate;
the most likely result is taken. Where the NIS is small, nothing
changes. At the first scan, and at the first after a gap, this is done in any case, with the prior
as it is: the start or the prediction may be wrong by more than a local update can mend. A state
that goes backwards faster than its class does is turned round.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.clusters import LARGEST
from stixel_cli.tracking.association import GATE_STDS
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Rays, Sight
from stixel_cli.tracking.contour.contour_update import (
    CONTRADICTED,
    Fit,
    Hypothesis,
    Measurement,
)
from stixel_cli.tracking.contour.ray_kernels import NEAR
from stixel_cli.tracking.contour.residual import NODES

RECENT, INCONSISTENT = 3, 1.5
"""A track is inconsistent if the mean NIS / degrees of freedom of so many scans is above this."""

SAME = 0.1
"""Two hypotheses are one if they are no farther apart, rad, and their places are `NEAR`."""


def is_inconsistent(ratios: Sequence[float]) -> bool:
    """Whether the last scans with points contradict the track, by NIS / degrees of freedom."""
    return len(ratios) >= RECENT and float(np.mean(ratios[-RECENT:])) > INCONSISTENT


def detect_again(
    prior: Hypothesis,
    rays: Rays,
    clusters: list[np.ndarray],
    sight: Sight,
    tracker: ContourParameters,
) -> list[Hypothesis]:
    """What a prediction that is inconsistent, the `prior`, may be after the scan.

    `clusters` are those of `clusters_of`; without one it stays as it is.
    """
    mean, covariance, joint = prior.state
    results = []
    turn = min(GATE_STDS * np.sqrt(covariance[2, 2]), np.pi)
    for found in clusters:
        measurement = Measurement(rays, found, sight, tracker)
        taken = measurement.rays
        place, left = taken.points_world.mean(axis=0), taken.normals.mean(axis=0)
        shift = GATE_STDS * np.sqrt(left @ covariance[:2, :2] @ left)
        begins = (0.0, 0.0), (-turn, 0.0), (turn, 0.0), (0.0, -shift), (0.0, shift)
        fits: list[Fit] = []
        for turned_by, moved_by in begins:
            begin = mean.copy()
            begin[:2] = place + rotation(turned_by) @ (mean[:2] - place) + moved_by * left
            begin[2] += turned_by
            fit = measurement.fit(mean, covariance, begin)
            # Most begins end at the same place.
            if all(_apart(fit.mean, other.mean) for other in fits):
                fits.append(fit)
        results += [measurement.posterior(prior, joint, fit) for fit in fits]
    return results or [prior]


def rivals(hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """The likeliest of the `hypotheses`, and those that later scans may prefer to it."""

    def odds(one: Hypothesis) -> float:
        return one.log_likelihood - one.missed

    kept: list[Hypothesis] = []
    for one in sorted(hypotheses, key=odds, reverse=True):
        likely = not kept or odds(one) > odds(kept[0]) - CONTRADICTED
        if likely and all(_apart(one.state[0], other.state[0]) for other in kept):
            kept.append(one)
    return kept


def _apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two means (d,) are not the `SAME`."""
    change = one[:3] - other[:3]
    return bool(np.hypot(*change[:2]) > NEAR or np.abs(wrap_angle(change[2])) > SAME)


def turned(
    mean: np.ndarray, covariance: np.ndarray, joint: JointCovariance
) -> tuple[np.ndarray, np.ndarray, JointCovariance]:
    """The state of a target that faces the other way and moves as before.

    No road user goes backwards fast: its front was taken for its rear.
    """
    order, signs = np.arange(len(mean)), np.ones(len(mean))
    order[7:], signs[3] = 7 + np.roll(np.arange(NODES), NODES // 2), -1.0
    mean = (signs * mean)[order]
    mean[2] += np.pi
    covariance = (signs[:, None] * covariance * signs)[np.ix_(order, order)]
    considered = np.arange(len(mean), len(joint.matrix))
    order, signs = np.append(order, considered), np.append(signs, np.ones(len(considered)))
    joint = joint.copy()
    joint.matrix = (signs[:, None] * joint.matrix * signs)[np.ix_(order, order)]
    return mean, covariance, joint


def clusters_of(rays: Rays, indices: np.ndarray, sight: Sight, after_gap: bool) -> list[np.ndarray]:
    """Which points may be the target's: indices (m,), ascending, of each possibility.

    All clusters of the points at `indices` together, if they are no longer than the class.
    Otherwise `indices`; but `after_gap`, when the points may be another object's, each of the
    clusters that is no longer than the class.
    """
    points = rays.points_world
    labels = np.where(rays.others, -1, rays.labels)
    longest = LARGEST * np.hypot(*sight.table.extents)
    here = np.unique(labels[indices])
    together = np.flatnonzero(np.isin(labels, here))
    found = [together, *(np.flatnonzero(labels == one) for one in here if after_gap)]
    short = [one for one in found if np.hypot(*np.ptp(points[one], axis=0)) <= longest]
    if short and short[0] is together:
        return [together]
    return short if after_gap else [indices]
