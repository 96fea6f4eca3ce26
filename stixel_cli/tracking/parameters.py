"""Parameters of the trackers: the schemas of the groups `prior`, `start` and `tracker`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.rig import STRICT


@dataclass(frozen=True)
class PriorShape:
    """What is known of a class of road users before any is measured; not the true size.

    Attributes:
        length: along the heading, m.
        width: across the heading, m.
        shape: seen from above, a `rectangle` with rounded corners or an `ellipse`.
        corner_radius: of the rectangle's corners, m, at most half of its shorter side.
        sigma_f, sigma_r: the kernel's deviations that suit the class, m, and
        measurement_deviation: of a point, m: noise, and error of the shape that neighbouring points
            share. A tracker's configuration takes the three up, or has its own.
    """

    __pydantic_config__ = STRICT

    length: Annotated[float, Gt(0), Le(30)]
    width: Annotated[float, Gt(0), Le(30)]
    shape: Literal["rectangle", "ellipse"]
    corner_radius: Annotated[float, Ge(0), Le(15)]
    sigma_f: Annotated[float, Gt(0), Le(20)]
    sigma_r: Annotated[float, Ge(0), Le(20)]
    measurement_deviation: Annotated[float, Gt(0), Le(10)]

    def check(self) -> None:
        """Raise ValueError if the rounded corners do not fit."""
        if self.shape == "rectangle" and 2.0 * self.corner_radius > min(self.length, self.width):
            raise ValueError(
                f"prior.corner_radius: {self.corner_radius} m is more than half of the shorter "
                f"side, {min(self.length, self.width)} m"
            )


@dataclass(frozen=True)
class StartParameters:
    """Standard deviations of the noise on the true pose and rates that a tracker starts from.

    Attributes:
        position: of x and of y, m.
        heading: rad.
        velocity: of the rates of x and of y, m/s.
        heading_rate: rad/s.
    """

    __pydantic_config__ = STRICT

    position: Annotated[float, Gt(0), Le(100)]
    heading: Annotated[float, Gt(0), Le(3.2)]
    velocity: Annotated[float, Gt(0), Le(100)]
    heading_rate: Annotated[float, Gt(0), Le(10)]


@dataclass(frozen=True)
class GpEkfParameters:
    """The extended Kalman filter on a Gaussian process contour, [GP] Wahlström & Özkan 2015.

    Attributes:
        basis_points: number N_f of basis angles, even in [0, 2 pi).
        length_scale: kernel's length l, rad.
        sigma_f: kernel's deviation of the radius, m.
        sigma_r: deviation of the unknown mean radius, m.
        forgetting_rate: alpha, 1/s: how fast radii that are not seen return to the kernel's mean.
        jitter: variance, m², added to K's diagonal where K is inverted, and nowhere else.
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: process noise of the heading, rad/s^1.5.
        measurement_covariance: R of a point is `isotropic`, or taken from the scan's `points`.
        measurement_deviation: standard deviation of the isotropic R along each axis, m.
        gate_probability: chi-square probability of the association's gate; null takes every point.
        contour_points: number M of points of the contour that is reported.
    """

    __pydantic_config__ = STRICT

    kind: Literal["gp_ekf"]
    basis_points: Annotated[int, Ge(4), Le(500)]
    length_scale: Annotated[float, Gt(0), Le(10)]
    sigma_f: Annotated[float, Gt(0), Le(20)]
    sigma_r: Annotated[float, Ge(0), Le(20)]
    forgetting_rate: Annotated[float, Ge(0), Le(100)]
    jitter: Annotated[float, Gt(0), Le(1)]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    measurement_covariance: Literal["isotropic", "points"]
    measurement_deviation: Annotated[float, Gt(0), Le(10)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    contour_points: Annotated[int, Ge(8), Le(1000)]


@dataclass(frozen=True)
class PointParameters:
    """The centroid of a scan in a Kalman filter of constant velocity: the floor to compare with.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        measurement_deviation: standard deviation of a point along each axis, m.
        centroid_offset: standard deviation, along each axis, of the distance from the centre to the
            centroid of what is seen, in radii of the circle.
        gate_probability: chi-square probability of the association's gate; null takes every point.
        least_speed: below this speed, m/s, the heading is kept as it was.
        contour_points: number M of points of the circle that is reported.
    """

    __pydantic_config__ = STRICT

    kind: Literal["point"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    measurement_deviation: Annotated[float, Gt(0), Le(10)]
    centroid_offset: Annotated[float, Ge(0), Le(10)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    least_speed: Annotated[float, Gt(0), Le(100)]
    contour_points: Annotated[int, Ge(8), Le(1000)]


Tracker = GpEkfParameters | PointParameters
