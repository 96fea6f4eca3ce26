"""Parameters from disparity to free space: the groups `road`, `occupancy`, `free_space`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters

Height = Annotated[float, Ge(0), Le(20)]


DisparityMargin = Annotated[float, Ge(0), Le(20)]


Depth = Annotated[float, Gt(0), Le(500)]


DepthStep = Annotated[float, Ge(0.02), Le(10)]


Std = Annotated[float, Ge(0.05), Le(10)]


@parameters(kw_only=True)
class _Road:
    """Obstacles on the road, for every source of its plane.

    Attributes:
        kind: where the road plane is taken from.
        least_height: pixels higher above the road than this are obstacles, m.
        greatest_height: pixels above it are overhanging and do not occupy, m.
        disparity_margin: an obstacle's disparity exceeds the road's in its row by this, px.
    """

    kind: str
    least_height: Height
    greatest_height: Height
    disparity_margin: DisparityMargin

    def check(self) -> None:
        """Raise ValueError if the parameters contradict each other."""
        if self.least_height >= self.greatest_height:
            raise ValueError(
                f"road.least_height: must be < road.greatest_height "
                f"({self.greatest_height}), got {self.least_height}"
            )


@dataclass(frozen=True, kw_only=True)
class RigRoad(_Road):
    """The road plane follows from the rig's mounting height and pitch."""

    kind: Literal["rig"]


@dataclass(frozen=True, kw_only=True)
class EstimatedRoad(_Road):
    """The road plane is found in each disparity image, near the plane of the rig.

    Attributes:
        pitch_range: greatest difference from the rig's pitch, degrees.
        height_range: greatest difference from the rig's mounting height, as a share of it.
        tolerance: pixels nearer to the plane's disparity than this vote for it, px.
        column_step: step from one evaluated column to the next, px.
    """

    kind: Literal["estimated"]
    pitch_range: Annotated[float, Gt(0), Le(15)]
    height_range: Annotated[float, Gt(0), Le(0.5)]
    tolerance: Annotated[float, Ge(0.25), Le(5)]
    column_step: Annotated[int, Ge(1), Le(64)]


RoadParameters = RigRoad | EstimatedRoad


@parameters(kw_only=True)
class _Occupancy:
    """Parameters of every occupancy grid.

    Attributes:
        kind: which grid it is.
        nearest, farthest: depth of the first and the last row, m.
        disparity_std: standard deviation of a disparity, px.
        relief: standard deviation of an obstacle's surface in depth, m.
    """

    kind: str
    nearest: Depth
    farthest: Depth
    disparity_std: Std
    relief: Annotated[float, Ge(0), Le(10)]

    def check(self) -> None:
        """Raise ValueError if the parameters contradict each other."""
        if self.nearest >= self.farthest:
            raise ValueError(
                f"occupancy.nearest: must be < occupancy.farthest ({self.farthest}), "
                f"got {self.nearest}"
            )


@dataclass(frozen=True, kw_only=True)
class PolarOccupancy(_Occupancy):
    """Grid of image column and depth.

    Attributes:
        depth_step: distance of two rows, m.
    """

    kind: Literal["polar"]
    depth_step: DepthStep


@dataclass(frozen=True, kw_only=True)
class ColumnDisparityOccupancy(_Occupancy):
    """Grid of image column and disparity, whose ends are those of the two depths.

    Attributes:
        disparity_step: distance of two rows, px.
    """

    kind: Literal["column_disparity"]
    disparity_step: Annotated[float, Ge(0.05), Le(8)]


@dataclass(frozen=True, kw_only=True)
class CartesianOccupancy(_Occupancy):
    """Grid of lateral position and depth on the ground plane.

    Attributes:
        depth_step: distance of two rows, m.
        half_width: the grid reaches this far to the left and to the right, m.
        lateral_step: width of a cell, m.
        column_std: standard deviation of a pixel's column, px.
    """

    kind: Literal["cartesian"]
    depth_step: DepthStep
    half_width: Annotated[float, Gt(0), Le(200)]
    lateral_step: Annotated[float, Ge(0.02), Le(10)]
    column_std: Std


OccupancyParameters = PolarOccupancy | ColumnDisparityOccupancy | CartesianOccupancy


@parameters
class FreeSpaceParameters:
    """The cheapest path through the occupancy grid.

    A cell costs 1 / D, where D is its occupancy divided by that of the smallest obstacle there. So
    the smallest obstacle costs 1.

    Attributes:
        obstacle_height: vertical extent of the least obstacle, m.
        obstacle_pixels: and its least number of pixels in a column.
        cost_bound: greatest cost of a cell (that of an empty one).
        free_cost: cost of a column without any obstacle; below `cost_bound`.
        spatial_cost: cost of a step in depth between neighbouring columns, 1/m (C_s).
        spatial_limit: greater steps cost no more, m (T_s).
        temporal_cost: cost of a step in depth since the last frame, 1/m (C_t); 0: no cost.
        temporal_limit: greater steps cost no more, m (T_t).
        unknown_height: a place of the road is unknown if, from there up to this height, m, less
            than `least_density` of the pixels have a disparity.
        least_density: share of the pixels; 0: all is known.
    """

    obstacle_height: Annotated[float, Gt(0), Le(5)]
    obstacle_pixels: Annotated[float, Ge(1), Le(200)]
    cost_bound: Annotated[float, Gt(0), Le(1000)]
    free_cost: Annotated[float, Gt(0), Le(1000)]
    spatial_cost: Annotated[float, Ge(0), Le(1000)]
    spatial_limit: Annotated[float, Gt(0), Le(500)]
    temporal_cost: Annotated[float, Ge(0), Le(1000)]
    temporal_limit: Annotated[float, Gt(0), Le(500)]
    unknown_height: Annotated[float, Gt(0), Le(20)]
    least_density: Annotated[float, Ge(0), Le(1)]

    def check(self) -> None:
        """Raise ValueError if the parameters contradict each other."""
        if self.free_cost >= self.cost_bound:
            raise ValueError(
                f"free_space.free_cost: must be < free_space.cost_bound "
                f"({self.cost_bound}), got {self.free_cost}"
            )
