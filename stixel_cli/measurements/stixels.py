"""Scans from stixels: the candidate points, gated by the scene."""

from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotate_covariances, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.disturbance_parameters import Disturbance
from stixel_cli.measurements.gates import Gates, candidates
from stixel_cli.measurements.scans import FieldOfView, Scans, check_gates
from stixel_cli.parameters import parameters
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.types import Stixels


@parameters
class StixelsParameters(Disturbance):
    """Scans from stixels. The gates see only the stixel: no tracker and no truth.

    Attributes:
        height_min, height_max: a stixel's height above the road, m, to be a candidate: below are
            kerbs and errors of the road, above are walls, poles and trees.
        range_min, range_max: distance from the sensor on the ground plane, m.
    """

    kind: Literal["stixels"]
    height_min: Annotated[float, Ge(0), Le(10)]
    height_max: Annotated[float, Gt(0), Le(100)]
    range_min: Annotated[float, Ge(0), Le(1000)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    @property
    def gates(self) -> Gates:
        """The gates of height and range, m."""
        return self.height_min, self.height_max, self.range_min, self.range_max

    def check(self) -> None:
        """Raise ValueError unless both gates are open."""
        check_gates(*self.gates)


def gather_scans(
    stixels: Iterable[Stixels],
    ego_motion: EgoMotion,
    measurement: StixelsParameters,
    rig: Rig,
) -> Scans:
    """Scans of the stixels inside the gates of height and range, in the world frame.

    Free space is a gate already: a stixel is the nearest obstacle of its columns. `stixels` are
    chunks in the order of their frames.

    Raises:
        ValueError: unless the chunks have each frame of `ego_motion` once, in order.
    """
    scans: list[tuple[np.ndarray, np.ndarray]] = []
    for chunk in stixels:
        if chunk.first != len(scans):
            raise ValueError(f"stixels of frame {len(scans)} expected, got {chunk.first}")
        inside = candidates(chunk, measurement.gates)
        for i in range(len(chunk.offsets) - 1):
            if len(scans) == len(ego_motion.times):
                raise ValueError(f"more stixels than the {len(scans)} frames of the ego motion")
            pose = ego_motion.poses_world[len(scans)]
            rows = chunk.rows(i)
            chosen = np.flatnonzero(inside[rows]) + rows.start
            points = world_from_ego(chunk.points_ego[chosen], pose)
            turn = pose[2] - STRAIGHT_AHEAD
            scans.append((points, rotate_covariances(chunk.covariances_ego[chosen], turn)))
    if len(scans) != len(ego_motion.times):
        raise ValueError(f"stixels of {len(scans)} frames, but {len(ego_motion.times)} scans")
    view = FieldOfView(*rig.field_of_view, rig.baseline)
    return Scans.of_each(ego_motion.times, ego_motion.poses_world, scans, view)
