"""What can be chosen on the way from disparity to stixels; the defaults are in conf/."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.rig import STRICT

Height = Annotated[float, Ge(0), Le(20)]
DisparityMargin = Annotated[float, Ge(0), Le(20)]
Depth = Annotated[float, Gt(0), Le(500)]
DepthStep = Annotated[float, Ge(0.02), Le(10)]
Deviation = Annotated[float, Ge(0.05), Le(10)]


@dataclass(frozen=True)
class RigRoad:
    """The road plane follows from the rig's mounting height and pitch.

    Attributes:
        kind: "rig".
        least_height: pixels that stand higher above the road are obstacles, m.
        greatest_height: pixels above it are overhanging and do not occupy, m.
        disparity_margin: an obstacle's disparity exceeds the road's in its row by this, px.
    """

    __pydantic_config__ = STRICT

    kind: Literal["rig"]
    least_height: Height
    greatest_height: Height
    disparity_margin: DisparityMargin

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_heights(self)


@dataclass(frozen=True)
class EstimatedRoad:
    """The road plane is found in each disparity image, near the one that the rig says.

    Attributes:
        kind: "estimated".
        least_height: pixels that stand higher above the road are obstacles, m.
        greatest_height: pixels above it are overhanging and do not occupy, m.
        disparity_margin: an obstacle's disparity exceeds the road's in its row by this, px.
        pitch_range: greatest difference from the rig's pitch, degrees.
        height_range: greatest difference from the rig's mounting height, as a share of it.
        tolerance: pixels nearer to the plane's disparity than this vote for it, px.
        column_step: every how many-th column is looked at.
    """

    __pydantic_config__ = STRICT

    kind: Literal["estimated"]
    least_height: Height
    greatest_height: Height
    disparity_margin: DisparityMargin
    pitch_range: Annotated[float, Gt(0), Le(15)]
    height_range: Annotated[float, Gt(0), Le(0.5)]
    tolerance: Annotated[float, Ge(0.25), Le(5)]
    column_step: Annotated[int, Ge(1), Le(64)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_heights(self)


RoadParameters = RigRoad | EstimatedRoad


@dataclass(frozen=True)
class PolarOccupancy:
    """Grid of image column and depth.

    Attributes:
        kind: "polar".
        nearest, farthest: depth of the first and the last row, m.
        depth_step: distance of two rows, m.
        disparity_deviation: standard deviation of a disparity, px.
        relief: standard deviation of an obstacle's surface in depth, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["polar"]
    nearest: Depth
    farthest: Depth
    depth_step: DepthStep
    disparity_deviation: Deviation
    relief: Annotated[float, Ge(0), Le(10)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_range(self)


@dataclass(frozen=True)
class ColumnDisparityOccupancy:
    """Grid of image column and disparity.

    Attributes:
        kind: "column_disparity".
        nearest, farthest: depths whose disparities are the grid's ends, m.
        disparity_step: distance of two rows, px.
        disparity_deviation: standard deviation of a disparity, px.
        relief: standard deviation of an obstacle's surface in depth, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["column_disparity"]
    nearest: Depth
    farthest: Depth
    disparity_step: Annotated[float, Ge(0.05), Le(8)]
    disparity_deviation: Deviation
    relief: Annotated[float, Ge(0), Le(10)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_range(self)


@dataclass(frozen=True)
class CartesianOccupancy:
    """Grid of lateral position and depth on the ground plane.

    Attributes:
        kind: "cartesian".
        nearest, farthest: depth of the first and the last row, m.
        depth_step: distance of two rows, m.
        half_width: the grid reaches this far to the left and to the right, m.
        lateral_step: width of a cell, m.
        disparity_deviation: standard deviation of a disparity, px.
        relief: standard deviation of an obstacle's surface in depth, m.
        column_deviation: standard deviation of a pixel's column, px.
    """

    __pydantic_config__ = STRICT

    kind: Literal["cartesian"]
    nearest: Depth
    farthest: Depth
    depth_step: DepthStep
    half_width: Annotated[float, Gt(0), Le(200)]
    lateral_step: Annotated[float, Ge(0.02), Le(10)]
    disparity_deviation: Deviation
    relief: Annotated[float, Ge(0), Le(10)]
    column_deviation: Deviation

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_range(self)


OccupancyParameters = PolarOccupancy | ColumnDisparityOccupancy | CartesianOccupancy


@dataclass(frozen=True)
class FreeSpaceParameters:
    """The cheapest path through the occupancy grid; costs are in units of the least obstacle's.

    A cell costs 1 / D, D being its occupancy over what the least obstacle would give there.

    Attributes:
        obstacle_height: vertical extent of the least obstacle, m.
        obstacle_pixels: and its least number of pixels in a column.
        cost_bound: greatest cost of a cell (that of an empty one).
        free_cost: cost of a column without any obstacle; below `cost_bound`.
        spatial_cost: cost of a step in depth between neighbouring columns, 1/m (C_s).
        spatial_limit: greater steps cost no more, m (T_s).
        temporal_cost: cost of a step in depth since the last frame, 1/m (C_t); 0: none.
        temporal_limit: greater steps cost no more, m (T_t).
    """

    __pydantic_config__ = STRICT

    obstacle_height: Annotated[float, Gt(0), Le(5)]
    obstacle_pixels: Annotated[float, Ge(1), Le(200)]
    cost_bound: Annotated[float, Gt(0), Le(1000)]
    free_cost: Annotated[float, Gt(0), Le(1000)]
    spatial_cost: Annotated[float, Ge(0), Le(1000)]
    spatial_limit: Annotated[float, Gt(0), Le(500)]
    temporal_cost: Annotated[float, Ge(0), Le(1000)]
    temporal_limit: Annotated[float, Gt(0), Le(500)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        if self.free_cost >= self.cost_bound:
            raise ValueError(
                f"free_space.free_cost: {self.free_cost} must be below free_space.cost_bound, "
                f"which is {self.cost_bound}"
            )


@dataclass(frozen=True)
class HeightParameters:
    """Where the obstacles end upwards, Badino, Franke, Pfeiffer 2009.

    Attributes:
        depth_margin: what lies this much behind the obstacle is no part of it, m (ΔZ).
        smoothness: cost of one row's step of the top between neighbouring columns (C_s).
        depth_scale: neighbours this far apart in depth are not tied to each other, m (N_Z).
    """

    __pydantic_config__ = STRICT

    depth_margin: Annotated[float, Gt(0), Le(100)]
    smoothness: Annotated[float, Ge(0), Le(1000)]
    depth_scale: Annotated[float, Gt(0), Le(500)]


@dataclass(frozen=True)
class ExtractionParameters:
    """How columns become stixels.

    Attributes:
        width: columns of a stixel, px.
        smoothing: standard deviation of the kernel that smooths the histogram, px.
        least_height: pixels that stand lower above the road do not count, m: at the foot of an
            obstacle a matcher blends it with the road.
        least_pixels: fewer pixels of the obstacle's disparity make no stixel.
        least_deviation: part of the disparity's standard deviation that no averaging removes, px.
        correlated_pixels: that many neighbouring pixels count as one independent measurement.
        relief: standard deviation of an object's surface round the flat stixel, in depth, m.
    """

    __pydantic_config__ = STRICT

    width: Annotated[int, Ge(1), Le(64)]
    smoothing: Annotated[float, Ge(0.1), Le(4)]
    least_height: Height
    least_pixels: Annotated[int, Ge(1), Le(10000)]
    least_deviation: Annotated[float, Ge(0), Le(5)]
    correlated_pixels: Annotated[float, Ge(1), Le(10000)]
    relief: Annotated[float, Ge(0), Le(5)]


def _check_heights(road) -> None:
    if road.least_height >= road.greatest_height:
        raise ValueError(
            f"road.least_height: {road.least_height} must be below road.greatest_height, "
            f"which is {road.greatest_height}"
        )


def _check_range(occupancy) -> None:
    if occupancy.nearest >= occupancy.farthest:
        raise ValueError(
            f"occupancy.nearest: {occupancy.nearest} must be below occupancy.farthest, "
            f"which is {occupancy.farthest}"
        )
