"""Stixels as `.stx1`, the protobuf of pyStixel-lib.

https://github.com/MarcelVSHNS/pyStixel-lib

Fields of a stixel: u, its left column; vT, its top row; vB, the row below its base; d, depth along
the optical axis, m; label, a class; width, px; confidence, see `CLOSE`; idx, its number in the
frame; cluster, see `TARGET`.
"""

from typing import Any

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.parameters import CLASS_ROWS
from stixel_cli.stixels.types import Stixels

TARGET, OTHER = 0, -1
"""Clusters: stixels of the target, and all others, which the format calls noise."""

CLOSE = 1.0
"""A stixel's confidence: the probability that its disparity is within this of the truth, px."""


def stixel_world(
    library: Any, stixels: Stixels, index: int, of_target: np.ndarray, rig: Rig, kind: str
) -> Any:
    """The `StixelWorld` of one frame, without its image.

    Args:
        library: pyStixel-lib.
        stixels: a chunk of frames, and `index` of the frame in it.
        of_target: (S,) bool, the stixels that the track used.
        rig: of the images.
        kind: class of the target.
    """
    from scipy.special import erf

    world = library.StixelWorld()
    label = library.Segmentation.Type.Value(CLASS_ROWS[kind].stx1_type)
    rows = stixels.rows(index)
    # The format has depths along the optical axis, of the middle of each stixel. Of a point at
    # depth 1 along it, `level` is the depth along the level frame's z axis.
    slope = (0.5 * (stixels.top + stixels.base) - rig.v0) / rig.focal_v
    level = rig.level_from_camera[2, 1] * slope + rig.level_from_camera[2, 2]
    depths = stixels.depth / level
    std = np.sqrt(stixels.disparity_variance)
    confidences = erf(CLOSE / (np.sqrt(2.0) * np.maximum(std, 1e-9)))
    for number, row in enumerate(range(rows.start, rows.stop)):
        world.stixel.add(
            u=int(stixels.left[row]),
            vT=int(stixels.top[row]),
            vB=int(stixels.base[row]) + 1,
            d=float(depths[row]),
            label=label if of_target[row] else 0,
            width=int(stixels.right[row] - stixels.left[row]),
            confidence=float(confidences[row]),
            idx=number,
            cluster=TARGET if of_target[row] else OTHER,
        )
    camera = world.context.calibration
    camera.K.extend([rig.focal, 0.0, rig.u0, 0.0, rig.focal_v, rig.v0, 0.0, 0.0, 1.0])
    camera.T.extend(np.eye(4).ravel().tolist())
    camera.R.extend(np.eye(4).ravel().tolist())
    camera.D.extend([0.0] * 5)
    camera.DistortionModel = library.CameraInfo.MODEL_PLUMB_BOB
    camera.reference = "Self"
    camera.width, camera.height, camera.channels = rig.width, rig.height, 1
    world.context.clusters = TARGET if of_target[rows].any() else OTHER
    return world
