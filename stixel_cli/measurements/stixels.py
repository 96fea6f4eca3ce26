"""Scans from stixels: the candidate points, gated by the scene."""

from collections.abc import Iterable
from typing import Literal

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotate_covariances, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.parameters import Gated
from stixel_cli.measurements.scans import FieldOfView, Scans, SharedErrors
from stixel_cli.parameters import parameters
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stixels.types import Stixels


@parameters(kw_only=True)
class StixelsParameters(Gated):
    """Scans from stixels."""

    kind: Literal["stixels"]


def gather_scans(
    stixels: Iterable[Stixels], ego_motion: EgoMotion, measurement: StixelsParameters, rig: Rig
) -> Scans:
    """Scans of the stixels inside the gates of height and range, in the world frame.

    Free space is a gate already: a stixel is the nearest obstacle of its columns, or visible behind
    that. `stixels` are chunks in the order of their frames. ValueError unless the chunks have each
    frame of `ego_motion` once, in order.
    """
    chunks = ((chunk, i) for chunk in stixels for i in range(len(chunk.offsets) - 1))
    scans = []
    for k, (pose, (chunk, i)) in enumerate(zip(ego_motion.poses_world, chunks, strict=True)):
        if chunk.first + i != k:
            raise ValueError(f"stixels of frame {k} expected, got {chunk.first + i}")
        rows = chunk.rows(i)
        chosen = np.flatnonzero(chunk.inside(measurement.gates)[rows]) + rows.start
        points = world_from_ego(chunk.points_ego[chosen], pose)
        turn = pose[2] - STRAIGHT_AHEAD
        scans.append((points, rotate_covariances(chunk.covariances_ego[chosen], turn)))
    view = FieldOfView(*rig.field_of_view, rig.baseline)
    # One standard deviation of each of the rig's independent errors of the disparity.
    errors = rig.disparity_error_factor.T / (rig.focal * rig.baseline)
    shared = SharedErrors(disparity=tuple(tuple(one) for one in errors.tolist() if any(one)))
    return Scans.of_each(ego_motion.times, ego_motion.poses_world, scans, view, shared)
