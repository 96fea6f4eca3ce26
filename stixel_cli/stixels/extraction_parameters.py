"""Parameters of the way from free space to stixels: the groups `height` and `extraction`."""

from typing import Annotated, ClassVar

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters


@parameters
class HeightParameters:
    """Where the obstacles end upwards, Badino, Franke, Pfeiffer 2009.

    Attributes:
        depth_margin: surfaces this much behind the obstacle do not belong to it, m (ΔZ).
        smoothness: cost of one row's step of the top between neighbouring columns (C_s).
        depth_scale: neighbours this far apart in depth are not tied to each other, m (N_Z).
        hidden_rows: rows at an obstacle's upper edge to which a matcher gives the disparity of what
            is behind, about half of its block, px. They are added to the stixels' tops.
    """

    depth_margin: Annotated[float, Gt(0), Le(100)]
    smoothness: Annotated[float, Ge(0), Le(1000)]
    depth_scale: Annotated[float, Gt(0), Le(500)]
    hidden_rows: Annotated[int, Ge(0), Le(64)]


@parameters
class ExtractionParameters:
    """How columns become stixels.

    Attributes:
        width: columns of a stixel, px. A part of an object that is narrower (`width` z / f metres)
            may make no stixel, such as a wheel seen end-on or a handlebar: half of a stixel's
            columns must have an obstacle, which is `free_space.obstacle_height` high.
        smoothing: standard deviation of the kernel that smooths the histogram, px.
        front_margin: pixels more than this behind the front face are another surface, px: a
            windscreen behind a bonnet does not move the stixel. 1024: no split.
        refinement: weight of the disparity that aligns the stixel's patches in both images; the
            matcher's has the rest. 0: no alignment.
        least_std: standard deviation of a stixel's disparity amid others of its object, px.
        edge_std: what is added to it, in square, with fewer than three of the two neighbours on
            either side: at an object's edge a matcher blends it with what is behind, px.
        relief: standard deviation of a flat surface's depth, m. That of other surfaces is added:
            how uneven the depths around a stixel are, and half of the step to its neighbours.
    """

    width: Annotated[int, Ge(1), Le(64)]
    smoothing: Annotated[float, Ge(0.1), Le(4)]
    front_margin: Annotated[float, Gt(0), Le(1024)]
    refinement: Annotated[float, Ge(0), Le(1)]
    least_std: Annotated[float, Ge(0), Le(5)]
    edge_std: Annotated[float, Ge(0), Le(5)]
    relief: Annotated[float, Ge(0), Le(5)]

    least_height: ClassVar[float] = 0.25
    """Pixels lower above the road than this do not count, m: at the foot of an obstacle a matcher
    blends it with the road. It is that of `road`."""
    least_pixels: ClassVar[int] = 10
    """Fewer pixels of the obstacle's disparity make no stixel: they are a matcher's error."""
    front_height: ClassVar[float] = 0.5
    """The front face is the nearest part of the stixel that is this high, m: a bonnet is."""
