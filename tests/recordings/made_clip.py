"""Small look-alikes of KITTI's tracking benchmark, written as `stixel export` writes them."""

import shutil

import numpy as np

from stixel_cli.export.export import labels_text, write_clip
from stixel_cli.geometry.pose import ego_from_world, rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.parameters import KittiTracking, LabelledFolder
from stixel_cli.recordings.truth import recorded_motion, recorded_scenario
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack
from stixel_cli.scene.ego import Turning, ego_motion
from stixel_cli.scene.scenario import Scenario

LENGTH, WIDTH, HEIGHT = 4.2, 1.8, 1.5


def small_rig(**changes) -> Rig:
    values = {"width": 160, "height": 96, "horizontal_fov": None, "vertical_fov": None}
    values |= {"focal_length": 150.0, "principal_u": 78.0, "principal_v": 40.0}
    values |= {"baseline": 0.5, "camera_height": 1.65, "pitch": 0.0}
    return Rig(**values | changes)


def small_scenario(count=5, speed=2.0, yaw_rate=4.0) -> Scenario:
    """A car ahead that drives straight on; the ego car follows along an arc."""
    ego = ego_motion(Turning("turning", speed, yaw_rate), 0.1 * count, 0.1)
    heading = 1.5
    velocity = 3.0 * np.array([np.cos(heading), np.sin(heading)])
    places = np.array([0.4, 9.0]) + ego.times[:, None] * velocity
    poses = np.column_stack([places, np.full(count, heading)])
    rates = np.tile([*velocity, 0.0], (count, 1))
    return Scenario(ego.times, ego.poses_world, poses, rates, rectangle(LENGTH, WIDTH)[None])


def stereo_pairs(scenario: Scenario, rig: Rig) -> StereoPairs:
    """Textured pairs of a road, a far wall and the car's rear, exact but for interpolation."""
    random = np.random.default_rng(3)
    left, right = [], []
    u, v = np.arange(rig.width, dtype=float), np.arange(rig.height, dtype=float)[:, None]
    for ego, target in zip(scenario.ego_poses_world, scenario.target_poses_world, strict=True):
        x, y = ego_from_world(target[None, :2], ego)[0]
        depth = y - 0.5 * LENGTH
        road = np.maximum(rig.baseline * (v - rig.v0) / rig.camera_height, 1.0)
        disparity = np.repeat(road, rig.width, axis=1)
        lateral = (u - rig.u0) * depth / rig.focal - x
        up = rig.camera_height - (v - rig.v0) * depth / rig.focal_v
        rear = (np.abs(lateral) <= 0.5 * WIDTH)[None] & (up >= 0.0) & (up <= HEIGHT)
        disparity[rear] = rig.focal * rig.baseline / depth
        texture = random.integers(0, 256, (rig.height, rig.width)).astype(float)
        rows = [np.interp(u - d, u, t) for d, t in zip(disparity, texture, strict=True)]
        left.append(np.rint(rows).astype(np.uint8))
        right.append(texture.astype(np.uint8))
    return StereoPairs(0, ImageStack.from_images(left), ImageStack.from_images(right))


def make_clip(folder, scenario=None, rig=None, sequence="0003", label="Car"):
    """Write a clip below `folder`; return its scenario and rig."""
    scenario = small_scenario() if scenario is None else scenario
    rig = small_rig() if rig is None else rig
    pairs = [stereo_pairs(scenario, rig)]
    write_clip(folder, sequence, pairs, scenario, rig, labels_text(scenario, rig, label, HEIGHT))
    return scenario, rig


def plain_folder(clip, folder):
    """The clip in the plain layout."""
    for camera, name in (("image_02", "left"), ("image_03", "right")):
        shutil.copytree(clip / camera / "0003", folder / name)
    for kind, name in (("label_02", "labels"), ("ego_poses", "poses")):
        shutil.copy(clip / kind / "0003.txt", folder / f"{name}.txt")
    image = "focal_length: 150\nprincipal_u: 78\nprincipal_v: 40\n"
    (folder / "rig.yaml").write_text(f"{image}baseline: 0.5\ncamera_height: 1.65\n")
    return LabelledFolder(kind="folder", folder=str(folder), target=0, frames=None, sample_time=0.1)


def tracking(folder, **changes):
    """A recording in KITTI tracking's layout, as `source=kitti_tracking` names it."""
    values = {"sequence": "0003", "target": 0, "frames": None, "sample_time": 0.1}
    return KittiTracking(kind="kitti_tracking", folder=str(folder), **values | changes)


def truth_of(found, rig=None):
    """The scenario of a recording that was made here."""
    rig, tables = rig or small_rig(), found.tables
    motion = recorded_motion(found.pose_files, tables, found.count, 0.1, rig)
    return recorded_scenario(motion, found.truth_files, rig, tables, found.target)
