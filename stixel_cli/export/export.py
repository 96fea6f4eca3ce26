"""Export runs: a rendered clip in KITTI's layout, trajectories for evo; the table of formats."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.config.texts import override_text
from stixel_cli.engine.progress import Progress
from stixel_cli.experiment.run import run_experiment
from stixel_cli.export.csv_tables import export_csv
from stixel_cli.export.kitti_folder import write_clip
from stixel_cli.export.new_folder import (
    stage_results,
    write_new_folder,
    write_texts,
)
from stixel_cli.export.rerun_log import export_rerun
from stixel_cli.export.stixel_files import export_stx1
from stixel_cli.images import encode_png
from stixel_cli.results.result import RunResult
from stixel_cli.scene.classes import CLASS_ROWS
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities

SEQUENCE = "0000"
"""Name of an exported clip."""

FROM_IMAGES = tuple(
    ["road", "stereo", "occupancy", "free_space", "height", "extraction", "measurement"]
)
"""Groups of the stages from the images to the scans."""


def export_kitti(stored: RunResult, folder: Path, progress: Progress | None = None) -> list[str]:
    """Write the images, calibration, labels, ego poses and disparities of a run as a KITTI clip.

    Results that the cache lacks are computed.

    Returns:
        The overrides with which `stixel run` makes the scans of this run from the clip.

    Raises:
        UserError: if the run has no rendered images, or the folder exists or cannot be written.
        StageFailure: if a stage fails.
    """
    configuration = stored.composition.configuration
    user, rig = configuration.road_user, configuration.rig
    wanted = ["add_sensor_noise", "match", "scenario"]
    with stage_results(stored, wanted, "rendered images", progress) as found:
        pairs, disparities, (scenario,) = (found[name] for name in wanted)

        def write(partial: Path) -> None:
            write_clip(
                partial,
                SEQUENCE,
                pairs,
                scenario,
                rig,
                CLASS_ROWS[user.kind].kitti_types[0],
                user.height,
            )
            write_disparities(partial, disparities)

        write_new_folder(folder, write)
    choices = stored.composition.choices
    given = {
        "source": "kitti_tracking",
        "source.folder": str(folder),
        "source.sequence": SEQUENCE,
        "source.target": 0,
        "source.sample_time": configuration.path.sample_time,
        "rig.pitch": rig.pitch,
        "rig.camera_height": rig.camera_height,
        **{group: choices[group] for group in (*FROM_IMAGES, "prior")},
    }
    overrides = [override_text(name, value) for name, value in given.items()]
    # A recording has values of its own, and the run has those of its command line.
    read = compose(overrides).resolved
    return overrides + [
        override_text(f"{group}.{name}", value)
        for group in FROM_IMAGES
        for name, value in stored.settings[group].items()
        if value != read[group][name]
    ]


def write_disparities(folder: Path, disparities: Iterable[Disparities]) -> None:
    """Write the disparities of all frames as KITTI stores them: uint16, 256 per px, 0 is invalid.

    Raises:
        OSError: if a file cannot be written.
    """
    target = folder / "disparity" / SEQUENCE
    target.mkdir(parents=True, exist_ok=True)
    for chunk in disparities:
        for i in range(len(chunk)):
            raw = chunk.raw(i).astype(np.int64)
            stored = np.where(raw == INVALID, 0, np.clip(raw * (256 // SUBPIXELS), 1, 65535))
            file = target / f"{chunk.first + i:06d}.png"
            file.write_bytes(encode_png(stored.astype(np.uint16)))


def export_tum(stored: RunResult, folder: Path, progress: Progress | None = None) -> list[str]:
    """Write the trajectories of the track, the truth and the ego car in TUM's format, as evo reads.

    Each row has the time (s), the place (m, z = 0) and the heading as a quaternion (x, y, z, w).
    Times without truth have no row. Returns the names of the files.

    Raises:
        UserError: if the folder exists or cannot be written, or the run cannot be repeated.
        StageFailure: if a stage fails.
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    scenario = run.scenario
    poses = {
        "track": run.track.means[:, :3],
        "truth": scenario.target_poses_world,
        "ego": scenario.ego_poses_world,
    }
    texts = {f"{name}.tum": tum_text(scenario.times, values) for name, values in poses.items()}
    return write_texts(folder, texts)


def tum_text(times: np.ndarray, poses_world: np.ndarray) -> str:
    """Rows of `times` (K,) s and poses (K, 3) in TUM's format; a pose of NaN has no row."""
    rows = []
    for time, (x, y, heading) in zip(times, poses_world, strict=True):
        if np.isfinite([x, y, heading]).all():
            half = 0.5 * heading
            values = (time, x, y, 0.0, 0.0, 0.0, np.sin(half), np.cos(half))
            rows.append(" ".join(f"{float(value):.9g}" for value in values))
    return "".join(f"{row}\n" for row in rows)


FORMATS: dict[str, Callable[..., list[str]]] = {
    "kitti": export_kitti,
    "csv": export_csv,
    "tum": export_tum,
    "stx1": export_stx1,
    "rerun": export_rerun,
}
