"""A small scene for the renderers' tests: boxes on a plane, seen by a small rig."""

import numpy as np
from constants import with_constants

from stixel_cli.geometry.pose import rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID
from stixel_cli.rendering.parameters import RaycastParameters
from stixel_cli.scene.mesh import Mesh, Part
from stixel_cli.scene.scenario import Scenario

RIG = Rig(128, 96, 60.0, None, 60.5, 50.25, 0.3, camera_height=1.2, pitch=2.0, vertical_fov=None)
RAYCAST = with_constants(RaycastParameters(kind="raycast"), samples=2)
AHEAD = 0.5 * np.pi


def speckle(seed: int, size: int = 64, low: int = 40, high: int = 220) -> np.ndarray:
    grey = np.random.default_rng(seed).integers(low, high, (size // 4, size // 4, 1))
    return np.repeat(np.repeat(np.repeat(grey, 4, 0), 4, 1), 3, 2).astype(np.uint8)


def quad(corners, texture: np.ndarray, repeats: float = 1.0, name: str = "quad") -> Part:
    """A parallelogram, its four corners counter-clockwise seen from its front."""
    uvs = repeats * np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Part(np.array(corners, dtype=np.float64), triangles, uvs[triangles], texture, name)


def box(low, high, texture: np.ndarray) -> Mesh:
    (x0, y0, z0), (x1, y1, z1) = low, high
    faces = (
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
        [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y1, z0), (x1, y1, z0), (x1, y0, z0), (x0, y0, z0)],
    )
    return tuple(quad(face, texture) for face in faces)


def road(texture: np.ndarray, repeats: float = 40.0) -> Mesh:
    corners = [(-60, -10, 0), (60, -10, 0), (60, 110, 0), (-60, 110, 0)]
    return (quad(corners, texture, repeats, "road"),)


def objects() -> list[tuple[int, Mesh]]:
    return [
        (ROAD_ID, road(speckle(1))),
        (BACKGROUND_ID, box((-9, 20, 0), (9, 22, 6), speckle(2))),
        (BACKGROUND_ID + 1, box((1.5, 10, 0), (1.7, 10.2, 4), speckle(3))),
        (BACKGROUND_ID + 2, box((-6, 4, 0), (-4, 9, 3), speckle(5))),
    ]


def target_mesh() -> Mesh:
    body = box((-1.5, -0.7, 0.2), (1.5, 0.7, 0.8), speckle(4, 32))
    antenna = box((-1.0, -0.01, 0.8), (-0.98, 0.01, 1.6), speckle(6, 32))
    return (*body, *antenna)


def scenario(count: int = 4, moving: bool = False) -> Scenario:
    k = np.arange(count)
    ego = np.tile([0.0, 0.0, AHEAD], (count, 1))
    if moving:
        ego[:, 1], ego[:, 2] = 0.3 * k, AHEAD + 0.02 * k
    target = np.stack([-0.6 + 0.5 * k, 8.0 + 0.3 * k, 0.4 + 0.2 * k], axis=1)
    return Scenario(0.1 * k, ego, target, np.zeros((count, 3)), rectangle(3.0, 1.4)[None])
