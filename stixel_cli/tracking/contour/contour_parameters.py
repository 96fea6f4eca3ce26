"""Parameters of the tracker `contour`; its module needs Numba."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters


@parameters
class ContourParameters:
    """A filter that casts the scan's rays on the class's shape.

    Attributes:
        seen_by: kind of measurement; selects the visible shape: `stixels` see less than the
            outline. Points of a `file` or of the user's `own` source are on the class's outline
            or on its box, whichever fits, with a residual.
        road_user: whether the class is `fixed` as the prior's, or `estimated`: replaced by one that
            the scans make far more probable, if a size that you state fits that class, or by
            `other`, no known class.
        sees: where on the target the points of a file or of your own source are: where rays meet
            it first (`first_surface`, as of a lidar or a radar), or on its whole `contour`.
        acceleration: process noise of the speed, a white acceleration's root density, m/s^1.5.
        turn_acceleration: process noise of the turn rate, rad/s^1.5.
        slip: process noise of the position, m/s^0.5: motion that is not along the heading.
        length_std, width_std: standard deviation of the factors on the class's length and width,
            relative to the prior's.
        noise_factor: factor on the standard deviation of a point's range. The errors of
            successive scans are correlated, which the filter does not model; a factor above 1
            stands for that.
        shape_factor: factor on the standard deviation of the visible shape. Neighbours share its
            error, and it changes little from scan to scan, so this factor is larger.
        silhouette_factor: factor on the standard deviation of the silhouette.
        silhouette_std: standard deviation of the bearing of a silhouette, degrees, beyond that of
            rendered images: a matcher moves the edges of real objects.
        degrees_of_freedom: of the Student distribution of an error.
        iterations: most iterations of the update.
        gate_std: width of the association's gate in standard deviations.
        lag: later scans that a second, smoothed track uses; 0: there is none; null: all of the run.
    """

    kind: Literal["contour"]
    seen_by: Literal["stixels", "fabricated", "lidar", "file", "own"]
    sees: Literal["first_surface", "contour"]
    road_user: Literal["estimated", "fixed"]
    acceleration: Annotated[float, Ge(0), Le(100)]
    turn_acceleration: Annotated[float, Ge(0), Le(100)]
    slip: Annotated[float, Ge(0), Le(10)]
    length_std: Annotated[float, Gt(0), Le(1)]
    width_std: Annotated[float, Gt(0), Le(1)]
    noise_factor: Annotated[float, Gt(0), Le(100)]
    shape_factor: Annotated[float, Ge(0.1), Le(100)]
    silhouette_factor: Annotated[float, Ge(0.1), Le(100)]
    silhouette_std: Annotated[float, Ge(0), Le(10)]
    degrees_of_freedom: Annotated[float, Gt(0), Le(1000)]
    iterations: Annotated[int, Ge(1), Le(50)]
    gate_std: Annotated[float, Gt(0), Le(20)]
    lag: Annotated[int, Ge(0)] | None
    contour_points: ClassVar[int] = 240
    """Number M of points of the contour that is reported: no estimate depends on it."""

    def check(self) -> None:
        """Raise ValueError if `sees` would have no effect."""
        if self.sees == "contour" and self.seen_by not in ("file", "own"):
            raise ValueError(
                f"tracker.sees: contour is for points of a file or of your own source; "
                f"{self.seen_by} has the surface that rays meet first: leave tracker.sees out"
            )
