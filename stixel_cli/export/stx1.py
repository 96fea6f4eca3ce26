"""The stixels of a run as `.stx1`, the protobuf of pyStixel-lib, one file per frame.

https://github.com/MarcelVSHNS/pyStixel-lib

Fields of a stixel: u, its left column; vT, its top row; vB, the row below its base; d, depth along
the optical axis, m; label, a class; width, px; confidence, see `CLOSE`; idx, its number in the
frame; cluster, see `TARGET`.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.border.origins import write_below
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.parameters import Gates
from stixel_cli.measurements.scans import Scans
from stixel_cli.rendering.images import encode_png
from stixel_cli.scene.parameters import CLASS_ROWS
from stixel_cli.stixels.types import Stixels
from stixel_cli.validation.stixel_file import stx1_library

if TYPE_CHECKING:
    from stixel_cli.engine.progress import Progress
    from stixel_cli.results.result import RunResult

TARGET, OTHER = 0, -1
"""Clusters: stixels of the target, and all others, which the format calls noise."""

CLOSE = 1.0
"""A stixel's confidence: the probability that its disparity is within this of the truth, px."""


def stixel_world(
    library: Any, stixels: Stixels, index: int, of_target: np.ndarray, rig: Rig, kind: str
) -> Any:
    """The `StixelWorld` of the frame `index` of a chunk, by pyStixel-lib, without its image.

    `of_target` (S,) bool are the stixels that the track used; the target is of the class `kind`.
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
    camera.K.extend(rig.camera_matrix.ravel().tolist())
    camera.T.extend(np.eye(4).ravel().tolist())
    camera.R.extend(np.eye(4).ravel().tolist())
    camera.D.extend([0.0] * 5)
    camera.DistortionModel = library.CameraInfo.MODEL_PLUMB_BOB
    camera.reference = "Self"
    camera.width, camera.height, camera.channels = rig.width, rig.height, 1
    world.context.clusters = TARGET if of_target[rows].any() else OTHER
    return world


def export_stx1(stored: "RunResult", folder: Path, progress: "Progress | None" = None) -> None:
    """Write the stixels of each frame with its left image and the calibration as `000000.stx1`.

    The label of a stixel is that of the road user if the track was updated with the stixel.
    """
    # The calls on a pair, which use `stixel_world`, import neither engine nor Hydra.
    from stixel_cli.experiment.stages import computed_stages
    from stixel_cli.results.folder import whole_folder

    library = stx1_library("--format stx1")
    configuration = stored.composition.configuration
    rig, kind = configuration.rig, configuration.road_user.kind
    images = "add_sensor_noise" if configuration.source.kind == "rendered" else "pairs"
    wanted = [images, "stixels", "scans", "track"]
    with (
        computed_stages(stored.composition, wanted, progress) as (_, load),
        whole_folder(folder) as partial,
    ):
        chunks_of_images, chunks, (scans,), (track,) = map(load, wanted)
        gates = configuration.measurement.gates
        for pairs, stixels in zip(chunks_of_images, chunks, strict=True):
            of_target = used_stixels(stixels, gates, scans, track.used_points)
            for i in range(len(stixels.offsets) - 1):
                name = f"{stixels.first + i:06d}"
                world = stixel_world(library, stixels, i, of_target, rig, kind)
                world.image = encode_png(pairs.left[i])
                world.context.name = name
                world.context.calibration.img_name = f"{name}.png"
                write_below(partial, {f"{name}.stx1": world.SerializeToString()})


def used_stixels(stixels: Stixels, gates: Gates, scans: Scans, used: np.ndarray) -> np.ndarray:
    """Which stixels (S,) of a chunk are among the points `used` (n,), rows of the scans' arrays.

    A scan has the candidates of its frame, and clutter after them; a dropout empties it.
    """
    found = np.zeros(len(stixels.left), dtype=bool)
    inside = stixels.inside(gates)
    for i in range(len(stixels.offsets) - 1):
        own = np.flatnonzero(inside[stixels.rows(i)]) + stixels.offsets[i]
        points = np.arange(*scans.offsets[stixels.first + i :][:2])[: len(own)]
        found[own[: len(points)]] = np.isin(points, used)
    return found
