"""Parameters of the two ways to scans: the schema of the group `measurement`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.rig import STRICT, Rig


@dataclass(frozen=True)
class SimulatedParameters:
    """Scans from stixels. The gates look at the stixel alone: at no tracker and at no truth.

    Attributes:
        height_min, height_max: a stixel's height above the road, m, to be a candidate: below are
            kerbs and errors of the road, above are walls, poles and trees.
        range_min, range_max: distance from the sensor on the ground plane, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["simulated"]
    height_min: Annotated[float, Ge(0), Le(10)]
    height_max: Annotated[float, Gt(0), Le(100)]
    range_min: Annotated[float, Ge(0), Le(1000)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self) -> None:
        """Raise ValueError unless both gates are open."""
        if self.height_max <= self.height_min:
            raise ValueError(
                f"measurement.height_max: {self.height_max} m is not above "
                f"measurement.height_min, {self.height_min} m"
            )
        if self.range_max <= self.range_min:
            raise ValueError(
                f"measurement.range_max: {self.range_max} m is not above "
                f"measurement.range_min, {self.range_min} m"
            )


@dataclass(frozen=True)
class FabricatedParameters:
    """Scans straight from the true contour, thesis (16)-(17).

    Attributes:
        rays: number of rays n_a over the field of view; null is the image's width.
        spacing: rays even in the `angle`, or even in its `tangent` as a pinhole's columns are.
        noise: along the ray, `stereo` (from the depth) or `constant`.
        disparity_deviation: standard deviation of the disparity, px, of the stereo noise.
        range_deviation: standard deviation of the range, m, of the constant noise.
        clutter_rate: mean number of clutter points a scan, uniform over field of view and range.
        missed_probability: probability that a ray which hits gives no point.
        range_max: farthest range that is measured, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["fabricated"]
    rays: Annotated[int, Ge(2), Le(4096)] | None
    spacing: Literal["angle", "tangent"]
    noise: Literal["stereo", "constant"]
    disparity_deviation: Annotated[float, Ge(0), Le(10)]
    range_deviation: Annotated[float, Ge(0), Le(10)]
    clutter_rate: Annotated[float, Ge(0), Le(1000)]
    missed_probability: Annotated[float, Ge(0), Le(1)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self, rig: Rig) -> None:
        """Raise ValueError if there are more rays than the image of `rig` has columns."""
        if self.rays is not None and self.rays > rig.width:
            raise ValueError(
                f"measurement.rays: {self.rays} rays are more than the {rig.width} columns of the "
                "image (rig.width)"
            )


MeasurementParameters = SimulatedParameters | FabricatedParameters
