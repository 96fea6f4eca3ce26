"""Colour, depth and identity of samples: rays to a scene's bodies, and from there to the sun."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stixel_cli.rendering import shading
from stixel_cli.rendering.camera_rays import Camera
from stixel_cli.rendering.placement import SUN_COLOUR
from stixel_cli.rendering.surfaces import Surfaces
from stixel_cli.scene.world_parameters import Light

SKY_COLOUR = np.array([0.86, 0.94, 1.10])
GROUND_COLOUR = np.array([0.36, 0.35, 0.33])
ZENITH = np.array([0.24, 0.42, 0.78])
HORIZON = np.array([0.74, 0.80, 0.86])


FINER_TARGET = 2
"""Probes along the short axis of a texture's footprint on all bodies but the first, the static
scene: matching on the target is what is measured, and the scene around it has far more pixels."""


@dataclass(frozen=True)
class Body:
    """A rigid body and its pose, (4, 4) from the body's frame to the world."""

    surfaces: Surfaces
    world_from_body: np.ndarray


@dataclass(frozen=True)
class Hits:
    """First surfaces that samples (n,) of one camera meet.

    Attributes:
        depth: (n,) float64 m along the optical axis, inf where nothing is met.
        body: (n,) int8, index of the body; -1 without a hit.
        triangle: (n,) int32 of that body's surfaces; -1 without a hit.
    """

    depth: np.ndarray
    body: np.ndarray
    triangle: np.ndarray

    def at(self, index: np.ndarray) -> "Hits":
        """Those of the samples with the indices `index`."""
        return Hits(self.depth[index], self.body[index], self.triangle[index])


def intersect(
    body: Body,
    camera: Camera,
    rows: np.ndarray,
    columns: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Depths (n s,) m (inf without a hit) and triangles (n s,) int32 of `body` behind samples.

    Pixels in `rows` and `columns` (n,) have s samples each, `right` and `down` (s,) px
    from the centre.
    """
    u, v = np.add.outer(columns, right).ravel(), np.add.outer(rows, down).ravel()
    surfaces = body.surfaces
    seen = pinhole(camera.seen_from(body.world_from_body))
    rays, depth = np.empty((len(u), 6), dtype=np.float32), np.empty(len(u))
    shading.camera_rays(rays, u, v, *seen)
    hit, triangle = surfaces.tree.first_hits(rays)
    shading.exact_depths(depth, u, v, triangle, hit, *seen, surfaces.normals, surfaces.offsets)
    return depth, triangle


def nearest(
    bodies: list[Body],
    camera: Camera,
    rows: np.ndarray,
    columns: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
) -> Hits:
    """First surfaces that the samples of `intersect` meet."""
    depth, triangle = intersect(bodies[0], camera, rows, columns, right, down)
    hits = Hits(depth, np.where(triangle >= 0, 0, -1).astype(np.int8), triangle)
    for index in range(1, len(bodies)):
        depth, triangle = intersect(bodies[index], camera, rows, columns, right, down)
        closer = depth < hits.depth
        hits.depth[closer] = depth[closer]
        hits.body[closer] = index
        hits.triangle[closer] = triangle[closer]
    return hits


def sunlit(
    bodies: list[Body],
    camera: Camera,
    u: np.ndarray,
    v: np.ndarray,
    hits: Hits,
    sun: np.ndarray,
    blockers: Iterable[int],
) -> np.ndarray:
    """Whether the hits (n,) see the sun past the bodies whose indices are in `blockers`; (n,) bool.

    `u`, `v` (n,) px are the samples that hit; `sun` (3,) points to the sun in the world.
    """
    lit = np.zeros(len(u), dtype=bool)
    for index, body in enumerate(bodies):
        rays = np.empty((len(u), 6), dtype=np.float32)
        facing = np.empty(len(u), dtype=np.int64)
        count = shading.sun_rays(
            rays,
            facing,
            np.empty(3),
            u,
            v,
            hits.depth,
            hits.body,
            hits.triangle,
            index,
            *pinhole(camera.seen_from(body.world_from_body)),
            body.surfaces.normals,
            body.world_from_body[:3, :3].T @ sun,
        )
        rays, facing = rays[:count], facing[:count]
        for blocker in blockers:
            other = bodies[blocker]
            asked = rays
            if blocker != index:
                asked = np.empty_like(rays)
                shading.moved_rays(
                    asked, rays, np.linalg.inv(other.world_from_body) @ body.world_from_body
                )
            free = ~other.surfaces.tree.blocked(asked)
            rays, facing = rays[free], facing[free]
        lit[facing] = True
    return lit


def light_of(
    bodies: list[Body],
    camera: Camera,
    u: np.ndarray,
    v: np.ndarray,
    hits: Hits,
    lit: np.ndarray,
    sun: np.ndarray,
    light: Light,
    spread: np.ndarray | float,
) -> np.ndarray:
    """Linear light (n, 3) float32 of samples that each represent a square of `spread` px.

    Samples `u`, `v` (n,) px meet `hits`, which see the sun where `lit` (n,) bool is true; `sun`
    (3,) points to it in the world.
    """
    result = np.empty((len(u), 3), dtype=np.float32)
    spread = np.full(len(u), spread, dtype=np.float64)
    for index, body in enumerate(bodies):
        surfaces = body.surfaces
        shading.shade(
            result,
            u,
            v,
            hits.depth,
            hits.body,
            hits.triangle,
            lit,
            index,
            FINER_TARGET if index else 1,
            spread,
            *pinhole(camera.seen_from(body.world_from_body)),
            surfaces.normals,
            surfaces.uv_gradients,
            surfaces.texture,
            surfaces.textures.texels,
            surfaces.textures.levels,
            surfaces.textures.first_level,
            body.world_from_body[:3, :3].T @ sun,
            light.exposure * light.sun * SUN_COLOUR,
            light.exposure * light.ambient * SKY_COLOUR,
            light.exposure * light.ambient * GROUND_COLOUR,
        )
    shading.sky_light(
        result,
        u,
        v,
        hits.body,
        camera.rotation,
        camera.focal,
        camera.u0,
        camera.v0,
        camera.stretch,
        light.exposure * ZENITH,
        light.exposure * HORIZON,
    )
    return result


def pinhole(camera: Camera) -> tuple[np.ndarray, np.ndarray, float, float, float]:
    """The camera as the kernels take it: rotation, origin, focal, u0, v0."""
    return camera.rotation, camera.origin, camera.focal, camera.u0, camera.v0
