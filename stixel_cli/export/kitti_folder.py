"""Export a rendered run as a clip of KITTI's tracking benchmark, as `kitti_tracking` reads it."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from stixel_cli.border import Origin, write_below
from stixel_cli.config.compose import Composer
from stixel_cli.config.override_checks import read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.engine.progress import Progress
from stixel_cli.experiment.stages import computed_stages
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotation, world_from_target
from stixel_cli.geometry.rig import Rig
from stixel_cli.images import encode_png
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.results.folder import whole_folder
from stixel_cli.results.result import RunResult
from stixel_cli.scene.parameters import CLASS_ROWS
from stixel_cli.scene.scenario import Scenario
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities

SEQUENCE = "0000"
"""Name of an exported clip."""

FROM_IMAGES = ("road", "stereo", "occupancy", "free_space", "height", "extraction", "measurement")
"""Groups of the stages from the images to the scans."""


def export_kitti(stored: RunResult, folder: Path, progress: Progress | None = None) -> list[str]:
    """Write the images, calibration, labels, ego poses and disparities of a run as a KITTI clip.

    Returns:
        The overrides with which `stixel run` makes the scans of this run from the clip.
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
        write_disparities(partial / "disparity" / SEQUENCE, disparities)
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


def write_disparities(folder: Path, disparities: Iterable[Disparities]) -> None:
    """Write the disparities of all frames as KITTI does: uint16, 256 per px, 0 is invalid."""
    for chunk in disparities:
        for i in range(len(chunk)):
            raw = chunk.raw(i).astype(np.int64)
            stored = np.where(raw == INVALID, 0, np.clip(raw * (256 // SUBPIXELS), 1, 65535))
            png = encode_png(stored.astype(np.uint16))
            write_below(folder, {f"{chunk.first + i:06d}.png": png})


def write_clip(
    folder: Path,
    sequence: str,
    pairs: Iterable[StereoPairs],
    scenario: Scenario,
    rig: Rig,
    labels: str,
) -> None:
    """Write images, calibration, labels and ego poses of one clip below `folder`.

    The ego poses are in the frame of the left camera.

    Args:
        folder: gets `image_02`, `image_03`, `calib`, `label_02`, `ego_poses`.
        sequence: name of the clip, such as 0000.
        pairs: all frames, in order.
        scenario: the truth.
        rig: of the images.
        labels: of the target, by `labels_text`.
    """
    for chunk in pairs:
        for camera, images in (("image_02", chunk.left), ("image_03", chunk.right)):
            for i, data in enumerate(images.encoded):
                write_below(folder, {f"{camera}/{sequence}/{chunk.first + i:06d}.png": data})
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
    flat = 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
    flat = flat @ rotation(heading).T + ground
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
