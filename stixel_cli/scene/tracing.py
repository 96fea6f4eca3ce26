"""Colour, depth and identity of samples: rays to a scene's bodies, and from there to the sun."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.scene import shading
from stixel_cli.scene.camera_rays import Camera
from stixel_cli.scene.placement import SUN_COLOUR
from stixel_cli.scene.renderer_parameters import Light
from stixel_cli.scene.surfaces import NO_TRIANGLE, Surfaces

SKY_COLOUR = np.array([0.86, 0.94, 1.10])
GROUND_COLOUR = np.array([0.36, 0.35, 0.33])
ZENITH = np.array([0.24, 0.42, 0.78])
HORIZON = np.array([0.74, 0.80, 0.86])


@dataclass(frozen=True)
class Body:
    """A rigid body and its pose, (4, 4) from the body's frame to the world."""

    surfaces: Surfaces
    world_from_body: np.ndarray


@dataclass(frozen=True)
class Hits:
    """What samples (n,) of one camera meet first.

    Attributes:
        depth: (n,) float64 m along the optical axis, inf where nothing is met.
        body: (n,) int8, index of the body; -1 for none.
        triangle: (n,) int32 of that body's surfaces; `NO_TRIANGLE` for none.
    """

    depth: np.ndarray
    body: np.ndarray
    triangle: np.ndarray


def intersect(body: Body, camera: Camera, u, v) -> tuple[np.ndarray, np.ndarray]:
    """Depths (n,) m (inf if none) and triangles (n,) int32 of `body` behind samples (n,)."""
    surfaces = body.surfaces
    pinhole = _pinhole(camera.seen_from(body.world_from_body))
    hit, triangle = surfaces.tree.first_hits(shading.camera_rays(u, v, *pinhole))
    depth = shading.exact_depths(u, v, triangle, hit, *pinhole, surfaces.normals, surfaces.offsets)
    return depth, triangle


def nearest(bodies: list[Body], camera: Camera, u, v) -> Hits:
    """What samples (u, v), each (n,) px, meet first."""
    hits = Hits(
        np.full(len(u), np.inf),
        np.full(len(u), -1, dtype=np.int8),
        np.full(len(u), NO_TRIANGLE, dtype=np.int32),
    )
    for index, body in enumerate(bodies):
        depth, triangle = intersect(body, camera, u, v)
        closer = depth < hits.depth
        hits.depth[closer] = depth[closer]
        hits.body[closer] = index
        hits.triangle[closer] = triangle[closer]
    return hits


def sunlit(bodies: list[Body], camera: Camera, u, v, hits: Hits, sun, blockers) -> np.ndarray:
    """Whether the hits (n,) see the sun past the bodies whose indices are in `blockers`; (n,) bool.

    `sun` (3,) points to the sun in the world.
    """
    lit = np.zeros(len(u), dtype=bool)
    for index, body in enumerate(bodies):
        mine = np.flatnonzero(hits.body == index)
        if len(mine) == 0:
            continue
        turn = body.world_from_body[:3, :3]
        rays, facing = shading.sun_rays(
            u[mine],
            v[mine],
            hits.depth[mine],
            hits.triangle[mine],
            *_pinhole(camera.seen_from(body.world_from_body)),
            body.surfaces.normals,
            turn.T @ sun,
        )
        free = np.ones(len(rays), dtype=bool)
        for blocker in blockers:
            other = bodies[blocker]
            asked = np.flatnonzero(free)
            moved = rays[asked]
            if blocker != index:
                moved = shading.moved_rays(
                    moved, np.linalg.inv(other.world_from_body) @ body.world_from_body
                )
            free[asked] = ~other.surfaces.tree.blocked(moved)
        lit[mine[facing[free]]] = True
    return lit


def light_of(
    bodies: list[Body], camera: Camera, u, v, hits: Hits, lit, sun, light: Light, spread: float
) -> np.ndarray:
    """Linear light (n, 3) float32 of samples that each stand for a square of `spread` px."""
    result = np.empty((len(u), 3), dtype=np.float32)
    for index, body in enumerate(bodies):
        mine = np.flatnonzero(hits.body == index)
        if len(mine) == 0:
            continue
        surfaces = body.surfaces
        result[mine] = shading.shade(
            u[mine],
            v[mine],
            hits.depth[mine],
            hits.triangle[mine],
            lit[mine],
            spread,
            *_pinhole(camera.seen_from(body.world_from_body)),
            surfaces.normals,
            surfaces.uv_gradients,
            surfaces.texture,
            surfaces.textures.texels,
            surfaces.textures.decode,
            surfaces.textures.levels,
            surfaces.textures.first_level,
            body.world_from_body[:3, :3].T @ sun,
            light.exposure * light.sun * SUN_COLOUR,
            light.exposure * light.ambient * SKY_COLOUR,
            light.exposure * light.ambient * GROUND_COLOUR,
        )
    sky = np.flatnonzero(hits.body < 0)
    if len(sky):
        result[sky] = shading.sky_light(
            u[sky],
            v[sky],
            camera.rotation,
            camera.focal,
            camera.u0,
            camera.v0,
            light.exposure * ZENITH,
            light.exposure * HORIZON,
        )
    return result


def sample_offsets(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n²,) right and down of a pixel's n² samples from its centre, px; n = `samples`.

    One sample in each cell of n × n, and no two in one of n² columns or of n² rows: an edge along
    an axis, the commonest, gets n² shades and not n. For n = 2 this is the rotated grid.
    """
    row, column = np.divmod(np.arange(samples * samples), samples)
    fine = samples * samples
    down = (row * samples + column + 0.5) / fine - 0.5
    right = (column * samples + (samples - 1 - row) + 0.5) / fine - 0.5
    return right, down


def supersampled(
    bodies: list[Body], camera: Camera, rows, columns, sun, light: Light, samples: int
) -> np.ndarray:
    """Linear light (n, 3) float32 of pixels (n,), the mean of `samples`² rays through each."""
    right, down = sample_offsets(samples)
    u = np.add.outer(columns, right).ravel()
    v = np.add.outer(rows, down).ravel()
    hits = nearest(bodies, camera, u, v)
    lit = sunlit(bodies, camera, u, v, hits, sun, range(len(bodies)))
    colours = light_of(bodies, camera, u, v, hits, lit, sun, light, 1.0 / samples)
    return colours.reshape(len(rows), samples * samples, 3).mean(axis=1)


def _pinhole(camera: Camera) -> tuple:
    return camera.rotation, camera.origin, camera.focal, camera.u0, camera.v0
