"""Export a run as a recording of rerun: images, stixels, scans, track and truth over time."""

from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import run_experiment
from stixel_cli.pictures.camera import WIDEST
from stixel_cli.pictures.style import depth_colours
from stixel_cli.results.folder import whole_folder
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.results.result import RunResult

TRACK, TRUTH, POINTS, EGO = (0, 114, 178), (0, 158, 115), (213, 94, 0), (90, 90, 90)
"""Colours, RGB (Okabe & Ito)."""

LINE_RADIUS = 0.1
"""px of the image: half of the width of a stixel's lines. The image is seen between them."""


def export_rerun(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write `run.rrd`, which `rerun FILE` shows."""
    try:
        import rerun as library
    except ImportError:
        raise UserError("--format: rerun needs rerun: pip install 'stixel[rerun]'") from None
    run = run_experiment(stored.composition, progress, pictures=False, camera=True)
    with whole_folder(folder) as partial:
        recording = library.RecordingStream("stixel", recording_id=folder.name)
        recording.save(str(partial / "run.rrd"))
        log_run(library, recording, run)
        recording.flush()
        recording.disconnect()


def log_run(library: Any, recording: Any, run: RunResult) -> None:
    """Log all scans of a run to a recording; positions in m in the world frame, z = 0."""
    scenario, scans, track = run.scenario, run.scans, run.track
    recording.log("world", library.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for k, time in enumerate(scenario.times):
        recording.set_time("k", sequence=k)
        recording.set_time("t", duration=float(time))
        ego = scenario.ego_poses_world[k, :2]
        recording.log("world/ego", library.Points3D(_flat(ego[None]), colors=EGO, radii=0.3))
        points = _flat(scans.points_world[scans.rows(k)])
        recording.log("world/scan", library.Points3D(points, colors=POINTS, radii=0.05))
        _log_outline(library, recording, "world/track", track.contours_world[k], TRACK)
        if scenario.known[k] and scenario.contours_target.size:
            _log_outline(library, recording, "world/truth", scenario.contour_world(k), TRUTH)
        else:
            recording.log("world/truth", library.Clear(recursive=False))
    for chunk in run.camera:
        _log_camera(library, recording, chunk, scenario.times)


def _log_camera(library: Any, recording: Any, chunk: CameraFrames, times: np.ndarray) -> None:
    """The left images and the boxes of their stixels, px of the reduced image: near is yellow."""
    scale = min(1.0, WIDEST / chunk.width)
    for i, image in enumerate(chunk.images["grey"]):
        k = chunk.first + i
        recording.set_time("k", sequence=k)
        recording.set_time("t", duration=float(times[k]))
        encoded = library.EncodedImage(contents=image, media_type="image/jpeg")
        recording.log("camera/image", encoded)
        rows = slice(int(chunk.offsets[i]), int(chunk.offsets[i + 1]))
        low = np.column_stack([chunk.left[rows], chunk.top[rows]])
        sizes = scale * (np.column_stack([chunk.right[rows], chunk.base[rows] + 1]) - low)
        colours = np.round(255.0 * depth_colours(chunk.depth[rows])).astype(np.uint8)
        look = {"colors": colours, "radii": LINE_RADIUS}
        recording.log(
            "camera/image/stixels", library.Boxes2D(mins=scale * low, sizes=sizes, **look)
        )


def _log_outline(library, recording, name: str, outline: np.ndarray, colour) -> None:
    closed = _flat(np.concatenate([outline, outline[:1]]))
    recording.log(name, library.LineStrips3D([closed], colors=[colour]))


def _flat(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) on the ground, (n, 3)."""
    return np.column_stack([points, np.zeros(len(points))])
