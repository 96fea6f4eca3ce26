"""Parameters of the groups `road`, `occupancy`, `free_space`, `height` and `extraction`."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters

Depth = Annotated[float, Gt(0), Le(500)]


@parameters(kw_only=True)
class _Road:
    """Obstacles on the road, for every source of its plane.

    Attributes:
        kind: where the road plane is taken from.
    """

    kind: str

    least_height: ClassVar[float] = 0.25
    """Pixels higher above the road than this are obstacles, m."""
    greatest_height: ClassVar[float] = 3.0
    """Pixels above it are overhanging and do not occupy, m: higher than any car or cyclist."""
    disparity_margin: ClassVar[float] = 1.0
    """An obstacle's disparity exceeds the road's in its row by this, px, as in an error's bound."""


@dataclass(frozen=True, kw_only=True)
class RigRoad(_Road):
    """The road plane follows from the rig's mounting height and pitch."""

    kind: Literal["rig"]


@dataclass(frozen=True, kw_only=True)
class EstimatedRoad(_Road):
    """The road plane is found in each disparity image, near the plane of the rig.

    Attributes:
        pitch_range: greatest difference from the rig's pitch, degrees.
    """

    kind: Literal["estimated"]
    pitch_range: Annotated[float, Gt(0), Le(15)]

    height_range: ClassVar[float] = 0.1
    """Greatest difference from the rig's mounting height, as a share of it: of load and springs."""
    tolerance: ClassVar[float] = 1.0
    """Pixels nearer to the plane's disparity than this vote for it, px: a matcher's gross error."""
    column_step: ClassVar[int] = 3
    """Step from one evaluated column to the next, px: all columns take three times as long."""


RoadParameters = RigRoad | EstimatedRoad


@parameters(kw_only=True)
class OccupancyParameters:
    """An occupancy grid.

    Attributes:
        kind: its coordinates: image column and depth; lateral position and depth on the ground
            plane; or image column and disparity, with the ends of the two depths.
        nearest, farthest: depth of the first and the last row, m.
    """

    kind: Literal["polar", "cartesian", "column_disparity"]
    nearest: Depth
    farthest: Depth

    disparity_std: ClassVar[float] = 0.5
    """Standard deviation of a disparity, px."""
    relief: ClassVar[float] = 0.25
    """Standard deviation of an obstacle's surface in depth, m."""
    depth_step: ClassVar[float] = 0.25
    """Distance of two rows of a grid of depths, m."""
    disparity_step: ClassVar[float] = 0.5
    """Distance of two rows of a grid of disparities, px."""
    lateral_step: ClassVar[float] = 0.1
    """Width of a Cartesian grid's cell, m: a pixel of the default rig is as wide at 55 m."""
    half_width: ClassVar[float] = 40.0
    """A Cartesian grid reaches this far to the left and to the right, m: about
    half of the default rig's view at 60 m."""
    column_std: ClassVar[float] = 1.0
    """Standard deviation of a pixel's column in a Cartesian grid, px."""

    def check(self) -> None:
        """Raise ValueError if the parameters contradict each other."""
        if self.nearest >= self.farthest:
            raise ValueError(
                f"occupancy.nearest: must be < occupancy.farthest ({self.farthest}), "
                f"got {self.nearest}"
            )


@parameters
class FreeSpaceParameters:
    """The cheapest path through the occupancy grid.

    A cell costs 1 / D, where D is its occupancy divided by that of the smallest obstacle there. So
    the smallest obstacle costs 1.

    Attributes:
        obstacle_height: vertical extent of the least obstacle, m.
        spatial_cost: cost of a step in depth between neighbouring columns, 1/m (C_s).
        temporal_cost: cost of a step in depth since the last frame, 1/m (C_t); 0: no cost.
    """

    obstacle_height: Annotated[float, Gt(0), Le(5)]
    spatial_cost: Annotated[float, Ge(0), Le(1000)]
    temporal_cost: Annotated[float, Ge(0), Le(1000)]

    # Limits that follow from the units: the other costs are relative to them.
    free_cost: ClassVar[float] = 1.0
    """Cost of a column without any obstacle: that of the smallest obstacle."""
    spatial_limit: ClassVar[float] = 8.0
    """Greater steps between neighbouring columns cost no more, m (T_s)."""
    temporal_limit: ClassVar[float] = 3.0
    """Greater steps since the last frame cost no more, m (T_t)."""
    obstacle_pixels: ClassVar[float] = 5.0
    """Least number of pixels of the least obstacle in a column: fewer are a matcher's error."""
    cost_bound: ClassVar[float] = 1.5
    """Greatest cost of a cell, that of an empty one; the smallest obstacle costs 1."""
    unknown_height: ClassVar[float] = 0.5
    """A place of the road is unknown if, from there up to this height, m, less than
    `least_density` of the pixels have a disparity."""
    least_density: ClassVar[float] = 0.5


@parameters
class HeightParameters:
    """Where the obstacles end upwards, Badino, Franke, Pfeiffer 2009.

    Attributes:
        depth_margin: surfaces this much behind the obstacle do not belong to it, m (ΔZ).
        hidden_rows: rows at an obstacle's upper edge to which a matcher gives the disparity of what
            is behind, about half of its block, px. They are added to the stixels' tops.
    """

    depth_margin: Annotated[float, Gt(0), Le(100)]
    hidden_rows: Annotated[int, Ge(0), Le(64)]

    smoothness: ClassVar[float] = 2.0
    """Cost of one row's step of the top between neighbouring columns (C_s)."""
    depth_scale: ClassVar[float] = 5.0
    """Neighbours this far apart in depth are not tied to each other, m (N_Z)."""


@parameters
class ExtractionParameters:
    """How columns become stixels.

    Attributes:
        width: columns of a stixel, px. A part of an object that is narrower (`width` z / f metres)
            may make no stixel, such as a wheel seen end-on or a handlebar: half of a stixel's
            columns must have an obstacle, which is `free_space.obstacle_height` high.
        front_margin: pixels more than this behind the front face are another surface, px: a
            windscreen behind a bonnet does not move the stixel. 1024: no split.
        refinement: weight of the disparity that aligns the stixel's patches in both images; the
            matcher's has the rest. 0: no alignment.
        layers: whether a column has only its nearest obstacle, or also what is visible behind it.
    """

    width: Annotated[int, Ge(1), Le(64)]
    front_margin: Annotated[float, Gt(0), Le(1024)]
    refinement: Annotated[float, Ge(0), Le(1)]
    layers: Literal["one", "many"] = "one"

    smoothing: ClassVar[float] = 0.2
    """Standard deviation of the kernel that smooths the histogram, px."""
    least_std: ClassVar[float] = 0.045
    """Standard deviation of a stixel's disparity amid others of its object, px."""
    edge_std: ClassVar[float] = 0.155
    """What is added to it, in square, with fewer than three of the two neighbours on either side:
    at an object's edge a matcher blends it with what is behind, px."""
    surface_std: ClassVar[float] = 0.01
    """Standard deviation of a flat surface's depth, m. That of other surfaces is added: how uneven
    the depths around a stixel are, and half of the step to its neighbours."""
    least_height: ClassVar[float] = _Road.least_height
    """Pixels lower above the road do not count, m: a matcher blends them with the road."""
    greatest_height: ClassVar[float] = 2.0
    """Pixels higher above the road than this count only where there are too few below, m: a tree
    or a façade overhangs what stands on the road."""
    least_pixels: ClassVar[int] = 10
    """Fewer pixels of the obstacle's disparity make no stixel: they are a matcher's error."""
    front_height: ClassVar[float] = 0.5
    """The front face is the nearest part of the stixel that is this high, m: a bonnet is."""
