"""The occupancy grid of one frame, for its picture."""

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.occupancy import accumulate, layout
from stixel_cli.stixels.parameters import OccupancyParameters, RoadParameters
from stixel_cli.stixels.types import FreeSpace, OccupancyGrid


def picture_grid(
    disparities: Disparities,
    free_space: FreeSpace,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    frame: int,
) -> OccupancyGrid:
    """The occupancy grid of frame `frame`, with the road line that free space was found with."""
    index = frame - disparities.first
    columns = np.ascontiguousarray(disparities.raw(index).T)
    line = free_space.road[frame - free_space.first]
    grid = layout(occupancy, rig, disparities.count)
    _, values = accumulate(columns, line, road, grid)
    return OccupancyGrid(
        kind=occupancy.kind,
        values=np.ascontiguousarray(values.T),
        depths=grid.depths,
        disparities=grid.disparities,
        laterals=grid.laterals
        if occupancy.kind == "cartesian"
        else np.arange(rig.width, dtype=np.float32),
    )
