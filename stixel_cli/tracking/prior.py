"""The prior shape of a class of road users."""

from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters
from stixel_cli.scene.parameters import ROAD_USER_CLASSES, RoadUserClass

NEED_SHAPE = ("point", "rectangle", "pyrecest", "lidar_random_matrix", "gm_mem_ekf")
"""Trackers that read the shape's radii."""


@parameters
class PriorShape:
    """Prior for a class of road users, before any measurement; not the true size.

    Attributes:
        length: along the heading, m.
        width: across the heading, m.
        shape: seen from above, a `rectangle` with rounded corners or an `ellipse`. `none`: the
            radii of `gp_ekf` start at zero, thesis (71b); trackers that need a shape refuse it.
        corner_radius: of the rectangle's corners, m, at most half of its shorter side.
        sigma_f, sigma_r: the kernel's standard deviations that suit the class, m, and
        measurement_std: of a point, m: noise, and error of the shape that neighbouring points
            share. A tracker's configuration refers to the three, or sets its own.
        start_position: standard deviation of x and of y at the start, m, for `start.position`.
        road_user: the class. The tracker `contour` takes the class's outline, with this length and
            width, instead of `shape`. `unknown`: it compares the classes, each with its own size;
            other trackers take the values above and do not report a class. FILE.json: the class
            that `stixel new class` wrote; the scans do not replace it.
        length_std, width_std: of the class's length and width, relative to them.
        outline: table of the target's vertices, `.csv` or `.npz`: x and y, m, along and to the left
            of the heading. `contour` takes it as one more form that the target may have; null: no.
    """

    length: Annotated[float, Gt(0), Le(30)]
    width: Annotated[float, Gt(0), Le(30)]
    shape: Literal["rectangle", "ellipse", "none"]
    corner_radius: Annotated[float, Ge(0), Le(15)]
    sigma_f: Annotated[float, Gt(0), Le(20)]
    sigma_r: Annotated[float, Ge(0), Le(20)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]
    start_position: Annotated[float, Gt(0), Le(100)]
    road_user: Literal[RoadUserClass, "unknown"] | str
    length_std: Annotated[float, Gt(0), Le(1)]
    width_std: Annotated[float, Gt(0), Le(1)]
    outline: str | None

    @property
    def class_file(self) -> str | None:
        """The file of the user's class; None if the class is a known one or unknown."""
        return None if self.road_user in (*ROAD_USER_CLASSES, "unknown") else self.road_user

    def check(self, tracker: Any) -> None:
        """Raise ValueError for wrong corners, an empty name, or a shape that `tracker` lacks."""
        if self.outline == "":
            raise ValueError("prior.outline: is empty: must be the name of a file, or null")
        if self.shape == "none" and tracker.kind in NEED_SHAPE:
            raise ValueError(
                f"prior.shape: tracker={tracker.kind} needs the shape of the class, got none: "
                "choose one, as ellipse"
            )
        if self.shape == "rectangle" and 2.0 * self.corner_radius > min(self.length, self.width):
            raise ValueError(
                f"prior.corner_radius: must be ≤ half of the shorter side "
                f"({0.5 * min(self.length, self.width):g} m), got {self.corner_radius} m"
            )


EVEN = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
"""Angles over which a shape is summed up, rad."""


def fullness_of(prior: PriorShape) -> float:
    """Area of the class's shape over that of its box: 1 for a rectangle, pi / 4 for an ellipse."""
    return float(np.pi * np.mean(prior_radii(prior, EVEN) ** 2) / (prior.length * prior.width))


def prior_radii(prior: PriorShape, angles: np.ndarray) -> np.ndarray:
    """Radius in m of the class's shape at `angles` (n,) rad in the target's frame, shape (n,).

    The shape is symmetric about both axes, so the first quadrant serves. 0 without a shape.
    """
    if prior.shape == "none":
        return np.zeros(len(angles))
    cosine, sine = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    half_length, half_width = 0.5 * prior.length, 0.5 * prior.width
    if prior.shape == "ellipse":
        return half_length * half_width / np.hypot(half_width * cosine, half_length * sine)
    corner = np.array([half_length, half_width]) - prior.corner_radius
    with np.errstate(divide="ignore"):
        front, side = half_length / cosine, half_width / sine
    # A ray that meets neither straight edge meets the circle of the corner, from the inside.
    along = corner[0] * cosine + corner[1] * sine
    across = corner[0] * sine - corner[1] * cosine
    rounded = along + np.sqrt(np.maximum(prior.corner_radius**2 - across**2, 0.0))
    straight = [front * sine <= corner[1], side * cosine <= corner[0]]
    return np.select(straight, [front, side], rounded)
