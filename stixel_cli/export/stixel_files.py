"""Export the stixels of a run as `.stx1`, one file per frame."""

from pathlib import Path

import numpy as np

from stixel_cli.border import write_below
from stixel_cli.engine.progress import Progress
from stixel_cli.experiment.stages import computed_stages
from stixel_cli.export.stx1 import stixel_world
from stixel_cli.measurements.parameters import Gates
from stixel_cli.measurements.scans import Scans
from stixel_cli.measurements.stixel_file import stx1_library
from stixel_cli.results.folder import whole_folder
from stixel_cli.results.result import RunResult
from stixel_cli.stixels.types import Stixels


def export_stx1(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write the stixels of each frame with its left image and the calibration as `000000.stx1`.

    The label of a stixel is that of the road user if the track was updated with the stixel.
    """
    library = stx1_library("--format")
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
                world.image = pairs.left.encoded[i]
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
