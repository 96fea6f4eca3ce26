"""Parameters of the trackers of PyRecEst."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.parameters import parameters

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
