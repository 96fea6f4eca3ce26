"""The formats of exports.

CSV tables with a table of their columns, trajectories for evo, a clip of KITTI's tracking benchmark
as `kitti_tracking` reads it, and a recording of rerun.
"""

import csv
import io
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stixel_cli.border.origins import Origin, write_below
from stixel_cli.config.compose import Composer
from stixel_cli.config.overrides import read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError, located
from stixel_cli.experiment.run import run_experiment
from stixel_cli.experiment.stages import computed_stages, pipeline_stages
from stixel_cli.export.stx1 import export_stx1
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rectangle, world_from_target
from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures.camera import WIDEST
from stixel_cli.pictures.style import depth_colours
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import encode_png
from stixel_cli.results.folder import csv_text, whole_folder, write_whole_folder
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.results.result import RunResult
from stixel_cli.scene.parameters import CLASS_ROWS
from stixel_cli.scene.scenario import Scenario
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.track import REPORTED, STATE, state_columns

SEQUENCE = "0000"
"""Name of an exported clip of KITTI."""

FROM_IMAGES = ("road", "stereo", "occupancy", "free_space", "height", "extraction", "measurement")
"""Groups of the stages from the images to the scans."""

TRACK, TRUTH, POINTS, EGO = (0, 114, 178), (0, 158, 115), (213, 94, 0), (90, 90, 90)
"""Colours in rerun, RGB (Okabe & Ito)."""

LINE_RADIUS = 0.1
"""px of the image: half of the width of a stixel's lines. The image is seen between them."""

COLUMNS: dict[str, tuple[str, str]] = {
    "k": ("", "index of the scan, from 0"),
    "t": ("s", "time of the scan"),
    "x": ("m", "position, to the right of the ego car's pose at k = 0"),
    "y": ("m", "position, ahead of the ego car's pose at k = 0"),
    "heading": ("rad", "counter-clockwise from +x"),
    "x_rate": ("m/s", "derivative of x"),
    "y_rate": ("m/s", "derivative of y"),
    "heading_rate": ("rad/s", "derivative of heading"),
    **{
        f"std_{name}": (unit, f"standard deviation of {name}")
        for name, unit in zip(STATE, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True)
    },
    "var_xx": ("m²", "variance of x"),
    "var_xy": ("m²", "covariance of x and y"),
    "var_yy": ("m²", "variance of y"),
    "z": ("m", "height above the road"),
    "used": ("", "1 if the track was updated with the point, else 0"),
    "points_used": ("", "number of points with which the track was updated"),
    "nis": ("", "normalised innovation squared; nan without a point"),
    "nis_degrees_of_freedom": ("", "degrees of freedom of nis"),
    **{
        f"{name}_probability": ("", f"probability of the class {name}, given the scans up to k")
        for name in REPORTED
    },
    "length": ("m", "length of the true box"),
    "width": ("m", "width of the true box"),
    "i": ("", "number of the contour's point, counter-clockwise, from 0"),
    "std": ("m", "standard deviation of the contour along the ray from the centre"),
}
"""Unit and meaning of each column; all positions are in the world frame."""


def export_csv(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write scans, start, track, truth, contours and ego poses as CSV, and `columns.csv`.

    Without truth, its tables are missing.
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    names = ("scans", "track", "truth", "ego")
    tables = {name: run.tables[name] for name in names if name in run.tables}
    used = np.zeros(len(run.scans.points_world), dtype=np.int64)
    used[run.track.used_points] = 1
    tables["scans"] = tables["scans"] | {"used": used}
    contours = _contour(np.arange(len(run.track.times)), run.track.contours_world)
    tables["contour"] = contours | {"std": run.track.contour_std.ravel()}
    if "truth" in tables:
        known = np.flatnonzero(run.scenario.known)
        true_contours = np.stack([run.scenario.contour_world(k) for k in known])
        tables["true_contour"] = _contour(known, true_contours)
    with computed_stages(stored.composition, ["start"], progress) as (_, load):
        starts = load("start")
    for start in starts:
        # One sample before the first scan.
        before = run.scans.times[:1] - intervals(run.scans.times)[:1]
        state = state_columns(start.mean[None], start.covariance[None])
        tables["start"] = {"t": before, **state}
    rows = [("table", "column", "unit", "meaning")]
    rows += [(table, name, *COLUMNS[name]) for table, names in tables.items() for name in names]
    csv.writer(meanings := io.StringIO(), lineterminator="\n").writerows(rows)
    files = {f"{table}.csv": csv_text(columns) for table, columns in tables.items()}
    write_whole_folder(folder, files | {"columns.csv": meanings.getvalue()})


def _contour(k: np.ndarray, contours_world: np.ndarray) -> dict[str, np.ndarray]:
    """Polygons (K, M, 2) m of the scans `k` (K,) as a table, one row a point."""
    count = contours_world.shape[1]
    x, y = contours_world.reshape(-1, 2).T
    return {"k": np.repeat(k, count), "i": np.tile(np.arange(count), len(k)), "x": x, "y": y}


def export_tum(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write the trajectories of the track, the truth and the ego car in TUM's format, as evo reads.

    Each row has the time (s), the place (m, z = 0) and the heading as a quaternion (x, y, z, w).
    Times without truth have no row.
    """
    run = run_experiment(stored.composition, progress, pictures=False, camera=False)
    poses = {
        "track": run.track.means[:, :3],
        "truth": run.scenario.target_poses_world,
        "ego": run.scenario.ego_poses_world,
    }
    files = {}
    for name, values in poses.items():
        np.savetxt(rows := io.BytesIO(), tum_rows(run.scenario.times, values), "%.9g")
        files[f"{name}.tum"] = rows.getvalue()
    write_whole_folder(folder, files)


def tum_rows(times: np.ndarray, poses_world: np.ndarray) -> np.ndarray:
    """Rows (n, 8) of `times` (K,) s and poses (K, 3) as TUM has them; a pose of NaN has no row."""
    known = np.isfinite(poses_world).all(axis=1)
    x, y, heading = poses_world[known].T
    zero = np.zeros(len(x))
    quaternion = (zero, zero, np.sin(0.5 * heading), np.cos(0.5 * heading))
    return np.column_stack([times[known], x, y, zero, *quaternion])


def export_kitti(stored: RunResult, folder: Path, progress: Progress | None = None) -> list[str]:
    """Write the images, calibration, labels, ego poses and disparities of a run as a KITTI clip.

    Returned are the overrides with which `stixel run` makes the scans of this run from the clip.
    """
    configuration = stored.composition.configuration
    user, rig = configuration.road_user, configuration.rig
    wanted = ["add_sensor_noise", "match", "scenario"]
    with (
        computed_stages(stored.composition, wanted, progress) as (_, load),
        whole_folder(folder) as partial,
    ):
        pairs, disparities, (scenario,) = map(load, wanted)
        labels = labels_text(scenario, rig, CLASS_ROWS[user.kind].kitti_types[0], user.height)
        write_clip(partial, SEQUENCE, pairs, scenario, rig, labels)
        # As KITTI does: uint16, 256 per px, 0 is invalid.
        for chunk in disparities:
            for i in range(len(chunk)):
                raw = chunk.raw(i).astype(np.int64)
                found = np.where(raw == INVALID, 0, np.clip(raw * (256 // SUBPIXELS), 1, 65535))
                name = f"disparity/{SEQUENCE}/{chunk.first + i:06d}.png"
                write_below(partial, {name: encode_png(found.astype(np.uint16))})
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
    read = Composer().compose(read_overrides(overrides, Origin(str(stored.folder)))).resolved
    return overrides + [
        override_text(f"{group}.{name}", value)
        for group in FROM_IMAGES
        for name, value in stored.settings[group].items()
        if value != read[group][name]
    ]


def write_clip(
    folder: Path,
    sequence: str,
    pairs: Iterable[StereoPairs],
    scenario: Scenario,
    rig: Rig,
    labels: str,
) -> None:
    """Write images, calibration, labels and ego poses of one clip below `folder`.

    That gets `image_02`, `image_03`, `calib`, `label_02` and `ego_poses`, in which the poses are in
    the frame of the left camera. `sequence` is the name of the clip, such as 0000; `pairs` are all
    frames, in order; `labels` those of the target, by `labels_text`.
    """
    for chunk in pairs:
        for camera, images in (("image_02", chunk.left), ("image_03", chunk.right)):
            for k, image in enumerate(images, chunk.first):
                write_below(folder, {f"{camera}/{sequence}/{k:06d}.png": encode_png(image)})
    # The left camera's poses, in the frame of the first.
    poses = list(map(rig.world_from_camera, scenario.ego_poses_world))
    first = np.linalg.inv(poses[0])
    texts = {
        "calib": calibration_text(rig),
        "label_02": labels,
        "ego_poses": "".join(f"{_numbers((first @ pose)[:3])}\n" for pose in poses),
    }
    write_below(folder, {f"{name}/{sequence}.txt": text for name, text in texts.items()})


def calibration_text(rig: Rig) -> str:
    """The rows P0 … P3: the left camera is that of the labels' frame."""
    rows = []
    left, right = (rig.u0, 0.0), (rig.u0_right, rig.baseline)
    for name, (u0, shift) in (("P0", left), ("P1", right), ("P2", left), ("P3", right)):
        of_u = [rig.focal, 0.0, u0, -rig.focal * shift]
        of_v = [0.0, rig.focal_v, rig.v0, 0.0]
        rows.append(f"{name}: {_numbers([of_u, of_v, [0.0, 0.0, 1.0, 0.0]])}\n")
    return "".join(rows)


def labels_text(scenario: Scenario, rig: Rig, label: str, target_height: float) -> str:
    """One row per frame in which the target has a pose, in the frame of the left camera.

    The target has the track id 0, the type `label`, and its height in m. Its box is that round its
    contour; its box in the image is that of the projected corners.
    """
    low, high = scenario.box_target
    length, width = high - low
    rows = []
    for k, (ego, pose) in enumerate(
        zip(scenario.ego_poses_world, scenario.target_poses_world, strict=True)
    ):
        if not np.isfinite(pose).all():
            continue
        ground = world_from_target(0.5 * (low + high)[None], pose)[0]
        camera = np.linalg.inv(rig.world_from_camera(ego))
        place = (camera @ [*ground, 0.0, 1.0])[:3]
        yaw = ego[2] - STRAIGHT_AHEAD - pose[2]
        box, cut = _image_box(camera, ground, pose[2], (length, width, target_height), rig)
        alpha = yaw - np.arctan2(place[0], place[2])
        values = _numbers([alpha, *box, target_height, width, length, *place, yaw])
        rows.append(f"{k} 0 {label} {int(cut)} 0 {values}")
    return "\n".join(rows) + "\n"


def _image_box(camera, ground, heading, sizes, rig: Rig) -> tuple[np.ndarray, bool]:
    """Left, top, right, bottom (px) of a box's corners, and whether the image cuts it."""
    length, width, height = sizes
    flat = world_from_target(rectangle(length, width), np.array([*ground, heading]))
    corners = [[x, y, z, 1.0] for x, y in flat for z in (0.0, height)]
    x, y, z = (camera @ np.array(corners).T)[:3]
    z = np.maximum(z, 0.1)
    u, v = rig.focal * x / z + rig.u0, rig.focal_v * y / z + rig.v0
    box = np.array([u.min(), v.min(), u.max(), v.max()])
    bounds = np.array([rig.width - 1.0, rig.height - 1.0] * 2)
    inside = np.clip(box, 0.0, bounds)
    return inside, bool((inside[[0, 2]] != box[[0, 2]]).any())


def _numbers(values: ArrayLike) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def export_rerun(stored: RunResult, folder: Path, progress: Progress | None = None) -> None:
    """Write `run.rrd`, which `rerun FILE` shows: all scans, in m in the world frame, z = 0."""
    with located("--format: rerun needs rerun: pip install 'stixel[rerun]'", caught=ImportError):
        import rerun as library
    run = run_experiment(stored.composition, progress, pictures=False, camera=True)
    scenario, scans, track = run.scenario, run.scans, run.track
    with whole_folder(folder) as partial:
        recording = library.RecordingStream("stixel", recording_id=folder.name)
        recording.save(str(partial / "run.rrd"))
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
        recording.flush()
        recording.disconnect()


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
        boxes = library.Boxes2D(mins=scale * low, sizes=sizes, colors=colours, radii=LINE_RADIUS)
        recording.log("camera/image/stixels", boxes)


def _log_outline(library, recording, name: str, outline: np.ndarray, colour) -> None:
    closed = _flat(np.concatenate([outline, outline[:1]]))
    recording.log(name, library.LineStrips3D([closed], colors=[colour]))


def _flat(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) on the ground, (n, 3)."""
    return np.column_stack([points, np.zeros(len(points))])


FORMATS: dict[str, Callable[..., list[str] | None]] = {
    "kitti": export_kitti,
    "csv": export_csv,
    "tum": export_tum,
    "stx1": export_stx1,
    "rerun": export_rerun,
}

NEEDED = {"kitti": ("add_sensor_noise", "rendered images"), "stx1": ("stixels", "stixels")}
"""The stage that a format needs, and the noun of its result."""


def export(
    stored: RunResult, folder: Path, format: str, progress: Progress | None = None
) -> list[str] | None:
    """Write a run in one of `FORMATS` into a new folder, which appears complete or not at all.

    Results that the cache lacks are computed. Returned is what the format's function returns.
    UserError if the folder cannot be written or exists by then, the run lacks what the format needs
    or cannot be repeated, or the format's package is not installed.
    """
    stage, noun = NEEDED.get(format, ("track", "track"))
    if stage not in {one.name for one in pipeline_stages(stored.composition)}:
        raise UserError(f"{stored.folder}: has no {noun} to export")
    return FORMATS[format](stored, folder, progress)
