"""Content of the world for both renderers: numbered objects, the target, the sun, the cameras."""

from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.parameters import World
from stixel_cli.scene.scenario import Scenario
from stixel_cli.scene.world import occluder, roadside_objects, world_objects

SUN_COLOUR = np.array([1.0, 0.96, 0.88])
"""Linear red, green and blue of the sun's light."""

SUNLIGHT, AMBIENT = 1.2, 0.34
"""Irradiance over pi of a surface that faces the sun, and from the sky of one that faces up: a
white surface in full light shines with about 1."""

EXPOSURE = 0.85
"""Factor from light to the image's linear grey, with full scale 1: white stays below it."""

_AZIMUTH, _ELEVATION = np.radians(200.0), np.radians(38.0)
_LEVEL = np.cos(_ELEVATION)
SUN = np.array([_LEVEL * np.cos(_AZIMUTH), _LEVEL * np.sin(_AZIMUTH), np.sin(_ELEVATION)])
"""Unit vector in the world towards the sun: 200° counter-clockwise from the +x axis (the ego car
looks along +90° at k = 0), 38° above the horizon."""


Motion = tuple[tuple[float, ...], ...]
"""The motion that a world depends on: x, y, heading of the ego car and x, y of the target."""


def motion_of(world: World, scenario: Scenario) -> Motion:
    """The motion that the objects of `world` depend on; () for a world that is always the same."""
    if (world.kind, world.occluder) == ("street", "none"):
        return ()
    rows = np.concatenate([scenario.ego_poses_world, scenario.target_poses_world[:, :2]], axis=1)
    return tuple(map(tuple, rows.tolist()))


def numbered_objects(world: World, motion: Motion = ()) -> list[tuple[int, Mesh]]:
    """Object ids (as in `RenderedFrames.ids`) and meshes in the world of the road and background.

    `motion` is that of `motion_of`. ValueError if there are more objects than ids.
    """
    poses, ids = np.array(motion).reshape(-1, 5), [ROAD_ID, *range(BACKGROUND_ID, 256)]
    ways = poses[:, :3], poses[:, 3:]
    meshes = world_objects(world) if world.kind == "street" else roadside_objects(world, *ways)
    if world.occluder != "none":
        meshes.append(occluder(world, *ways))
    if len(meshes) > len(ids):
        raise ValueError(f"world: {len(meshes)} objects, but at most {len(ids)} have an id")
    return list(zip(ids, meshes, strict=False))


def world_from_target_3d(pose_world: np.ndarray) -> np.ndarray:
    """Rigid transform (4, 4) to the world from a target at `pose_world` (3,) = x, y, heading."""
    transform = np.eye(4)
    transform[:2, :2] = rotation(pose_world[2])
    transform[:2, 3] = pose_world[:2]
    return transform


NEAR = 0.05
"""Points nearer to the camera than this along its axis, m, are not on the screen."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; pixel (u, v) has its centre at integer coordinates."""

    rotation: np.ndarray
    """(3, 3), from the camera (x right, y down, z forward) to the frame; its second column is times
    `stretch`, so that one focal length serves both axes of a ray."""
    origin: np.ndarray
    """(3,) m, the camera's centre in the frame."""
    focal: float
    """Focal length, px."""
    u0: float
    v0: float
    """`u0`, `v0`: principal point, px."""
    width: int
    height: int
    """`width`, `height`: image size, px."""
    stretch: float
    """f_u / f_v, 1 for square pixels."""

    def seen_from(self, world_from_body: np.ndarray) -> "Camera":
        """This camera of the world in the frame of a body with the pose (4, 4)."""
        turn, shift = world_from_body[:3, :3], world_from_body[:3, 3]
        seen = turn.T @ self.rotation, turn.T @ (self.origin - shift)
        rotation, origin = map(np.ascontiguousarray, seen)
        return replace(self, rotation=rotation, origin=origin)

    @property
    def pinhole(self) -> tuple[np.ndarray, np.ndarray, float, float, float]:
        """The camera as kernels take it: rotation, origin, focal, u0, v0."""
        return self.rotation, self.origin, self.focal, self.u0, self.v0

    @property
    def projection(self) -> np.ndarray:
        """(3, 3): (points - `origin`) times this is (x, y, z) with u = f x / z, v = f y / z."""
        return self.rotation / np.array([1.0, self.stretch**2, 1.0])

    def project(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) = (u px, v px, depth m) of points (n, 3) in m in the camera's frame of reference.

        Points behind the camera have a depth that is not positive and no meaningful pixel.
        """
        x, y, depth = ((points - self.origin) @ self.projection).T
        u, v = self.focal * x / depth + self.u0, self.focal * y / depth + self.v0
        return np.stack([u, v, depth], axis=1)

    def rectangle_of(self, points: np.ndarray, margin: int) -> tuple[int, int, int, int]:
        """Pixels that the convex hull of `points` (n, 3) can touch, grown by `margin` px.

        Returns (row of the top, past the bottom, column of the left, past the right), cut at the
        image; empty (equal numbers) where nothing of the hull is in front of the camera.
        """
        depth = (points - self.origin) @ self.rotation[:, 2]
        front = depth >= NEAR
        if not front.any():
            return 0, 0, 0, 0
        # The hull, cut at the near plane, has its corners there on segments between the points.
        behind, ahead = np.nonzero(~front[:, None] & front)
        share = (NEAR - depth[behind]) / (depth[ahead] - depth[behind])
        cut = points[behind] + share[:, None] * (points[ahead] - points[behind])
        u, v, _ = self.project(np.concatenate([points[front], cut])).T
        ends = [
            int(np.clip(end, 0, size))
            for values, size in ((v, self.height), (u, self.width))
            for end in (np.floor(values.min()) - margin, np.ceil(values.max()) + margin + 1)
        ]
        return (0, 0, 0, 0) if ends[0] >= ends[1] or ends[2] >= ends[3] else tuple(ends)


def rig_cameras(rig: Rig, ego_pose_world: np.ndarray) -> tuple[Camera, Camera]:
    """Left and right camera in the world of a rig on the ego car at `ego_pose_world` (3,)."""
    transform = rig.world_from_camera(ego_pose_world)
    stretch = float(rig.focal / rig.focal_v)
    rotation = transform[:3, :3] * [1.0, stretch, 1.0]
    left = transform[:3, 3].copy()
    right = left + rotation[:, 0] * rig.baseline
    size = rig.width, rig.height
    return tuple(
        Camera(rotation, origin, float(rig.focal), float(u0), float(rig.v0), *size, stretch)
        for origin, u0 in ((left, rig.u0), (right, rig.u0_right))
    )
