"""The extended trackers of PyRecEst (https://github.com/FlorianPfaff/PyRecEst) on the same scans.

This module gives them the class's prior, the initial state and the scans' noise, and turns their
estimates into a `Track`. What they do is documented there. Three things differ from their defaults:
the first shape is that of the class; a scan's points are always passed in the layout that the
tracker cannot mistake, also if there are two; and an ellipse's contour is drawn by its semi-axes.
"""

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, directions_of

if TYPE_CHECKING:
    from stixel_cli.tracking.baselines.pyrecest_filters import Ellipse, FourierSeries, StarConvex

Name = Literal[
    "full_scgp",
    "decorrelated_scgp",
    "ekf_spline",
    "fourier_rhm",
    "mem_qkf",
    "mem_ekf_star",
    "vbrm",
    "ggiw",
    "factorised_giw",
]


@parameters
class PyRecEstParameters:
    """An extended tracker of PyRecEst, an extra of `stixel`: `pip install 'stixel[peers]'`.

    Attributes:
        name: of the tracker. Those from `mem_qkf` on estimate an ellipse.
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: the same of the heading, rad/s^1.5.
        measurement_std: m, along each axis, added to the covariance of each point of the scan:
            errors that neighbouring points share.
        basis_points: of the Gaussian process, and control points of the spline.
        gate_probability: chi-square probability of the association's gate; null takes every point.
    """

    kind: Literal["pyrecest"]
    name: Name
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(0), Le(10)]
    basis_points: Annotated[int, Ge(4), Le(200)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    harmonics: ClassVar[int] = 4
    """Of the Fourier series of `fourier_rhm`: more bend between the points of one visible side."""
    contour_points: ClassVar[int] = 72
    """Number M of points of the contour that is reported: no estimate depends on it."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan.

    The std of the contour is the class's, and there is no NIS: the trackers give neither alike.

    Raises:
        UserError: if PyRecEst is not installed.
        ValueError: if it fails, such as after a gap of days.
    """
    adapted = _adapted(initial, prior, tracker)
    size = np.diag([prior.length**2, prior.width**2]) / 12.0
    added, least = tracker.measurement_std**2 * np.eye(2), 1
    if tracker.name == "factorised_giw":
        # It takes the noise off the points' scatter, which errors that they share do not widen.
        added, least = np.zeros((2, 2)), 3
    contours, filtered = [], Filtered(scans, 6)
    try:
        for scan in filtered:
            adapted.predict(float(scan.interval))
            mean, covariance, contour = adapted.estimate()
            turn, noises = rotation(mean[2]), scan.covariances + added
            spread = covariance[:2, :2] + turn @ size @ turn.T + noises
            near = associate(scan.points, mean[:2], spread, tracker.gate_probability)
            near = near if len(near) >= least else near[:0]
            if len(near):
                adapted.update(scan.points[near], noises[near])
                mean, covariance, contour = adapted.estimate()
            filtered.add(mean, covariance, near, degrees=0)
            contours.append(contour)
    except np.linalg.LinAlgError as error:
        raise ValueError(f"{tracker.name} of PyRecEst failed at scan {scan.k}: {error}") from error
    means, covariances = filtered.states
    means[:, 2], contours = np.unwrap(means[:, 2]), np.array(contours)
    std = np.full(contours.shape[:2], np.hypot(prior.sigma_f, prior.sigma_r))
    return filtered.track((contours, directions_of(contours, means), std), (means, covariances))


def _adapted(
    initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters
) -> "StarConvex | FourierSeries | Ellipse":
    """The filter with this name, at the initial state."""
    from stixel_cli.tracking.baselines.pyrecest_filters import Ellipse, FourierSeries, StarConvex

    try:
        # Without it, the module of the Fourier series cannot be imported.
        import pyrecest.distributions  # noqa: F401
    except ImportError as error:
        raise UserError(
            f"tracker=pyrecest: PyRecEst is not installed ({error}): pip install 'stixel[peers]'"
        ) from None
    if tracker.name in ("full_scgp", "decorrelated_scgp", "ekf_spline"):
        return StarConvex(initial, prior, tracker)
    if tracker.name == "fourier_rhm":
        return FourierSeries(initial, prior, tracker)
    return Ellipse(initial, prior, tracker)
