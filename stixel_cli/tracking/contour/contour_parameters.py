"""Parameters of the tracker `contour`; its module needs Numba."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters


@parameters
class ContourParameters:
    """A filter that casts the scan's rays on the class's shape.

    Attributes:
        seen_by: kind of measurement; selects the visible shape: `stixels` see less than the
            outline. Other points are on the class's outline or on its box, whichever fits.
        road_user: whether the class is `fixed` as the prior's, or `estimated`: replaced by one that
            the scans make far more probable, if a size that you state fits that class, or by
            `other`, no known class.
        acceleration: process noise of the speed, a white acceleration's root density, m/s^1.5.
        turn_acceleration: process noise of the turn rate, rad/s^1.5.
        slip: process noise of the position, m/s^0.5: motion that is not along the heading.
        noise_factor: factor on the standard deviations of a point's range and of the silhouette.
            The errors of neighbours and of successive scans are correlated, which the gain does not
            model; a factor above 1 stands for that.
        shape_factor: factor on the standard deviation of the visible shape, whose error changes
            even less from scan to scan.
        silhouette_std: standard deviation of the bearing of a silhouette, degrees, beyond that of
            rendered images: a matcher moves the edges of real objects.
        degrees_of_freedom: of the Student distribution of an error.
        iterations: most iterations of the update.
        lag: later scans that a second, smoothed track uses; 0: there is none; null: all of the run.
    """

    kind: Literal["contour"]
    seen_by: Literal["stixels", "fabricated", "lidar", "file", "own"]
    road_user: Literal["estimated", "fixed"]
    acceleration: Annotated[float, Ge(0), Le(100)]
    turn_acceleration: Annotated[float, Ge(0), Le(100)]
    slip: Annotated[float, Ge(0), Le(10)]
    noise_factor: Annotated[float, Gt(0), Le(100)]
    shape_factor: Annotated[float, Ge(0.1), Le(100)]
    silhouette_std: Annotated[float, Ge(0), Le(10)]
    degrees_of_freedom: Annotated[float, Gt(0), Le(1000)]
    iterations: Annotated[int, Ge(1), Le(50)]
    lag: Annotated[int, Ge(0)] | None
    contour_points: ClassVar[int] = 240
    """Number M of points of the contour that is reported: no estimate depends on it."""
