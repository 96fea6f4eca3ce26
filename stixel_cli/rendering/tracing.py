"""Colour, depth and identity of samples: rays to a scene's bodies, and from there to the sun.

For samples and directions see `shading`. The kernels get a camera as its `Camera.pinhole`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning
from stixel_cli.rendering import shading
from stixel_cli.rendering.placement import AMBIENT, EXPOSURE, SUN, SUN_COLOUR, SUNLIGHT, Camera
from stixel_cli.rendering.surfaces import Surfaces

SKY_COLOUR = np.array([0.86, 0.94, 1.10])
GROUND_COLOUR = np.array([0.36, 0.35, 0.33])
ZENITH = np.array([0.24, 0.42, 0.78])
HORIZON = np.array([0.74, 0.80, 0.86])

FINER_TARGET = 2
"""Probes along the short axis of a texture's footprint on all bodies but the first, the static
scene: matching on the target is what is measured, and the scene around it has far more pixels."""

SHADOW_OFFSET = 2e-3
"""Rays to the sun start this far off the surface, m: single precision at 100 m is a tenth of it."""


@dataclass(frozen=True)
class Body:
    """A rigid body and its pose, (4, 4) from the body's frame to the world."""

    surfaces: Surfaces
    world_from_body: np.ndarray


@dataclass(frozen=True)
class Shot:
    """Bodies and camera: a picture depends on nothing else."""

    bodies: tuple[Body, ...]
    """The static scene, then the target, if it has one."""
    camera: Camera
    """In the world."""

    @property
    def tables(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Texture and normals of the first body's triangles, and of the last one's."""
        first, last = self.bodies[0].surfaces, self.bodies[-1].surfaces
        return first.texture, first.normals, last.texture, last.normals


class Hits(NamedTuple):
    """First surfaces that samples (n,) of one camera meet."""

    u: np.ndarray
    v: np.ndarray
    """`u`, `v`: (n,) float64 px, the samples."""
    depth: np.ndarray
    """(n,) float64 m along the optical axis, inf where nothing is met."""
    body: np.ndarray
    """(n,) int8, index of the body; -1 without a hit."""
    triangle: np.ndarray
    """(n,) int32 of that body's surfaces; -1 without a hit."""

    def at(self, index: np.ndarray | slice) -> "Hits":
        """The hits of the samples with the indices `index`."""
        return Hits(*(values[index] for values in self))


def intersect(
    body: Body, camera: Camera, u: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Depths (n,) m (inf without a hit) and triangles (n,) int32 of `body` behind samples (n,)."""
    surfaces = body.surfaces
    pinhole = camera.seen_from(body.world_from_body).pinhole
    hit, triangle = surfaces.tree.first_hits(camera_rays(u, v, pinhole))
    planes = surfaces.normals, surfaces.offsets
    return exact_depths(u, v, triangle, hit, pinhole, planes), triangle


def nearest(shot: Shot, u: np.ndarray, v: np.ndarray) -> Hits:
    """First surfaces that the samples (n,) meet."""
    depth, triangle = intersect(shot.bodies[0], shot.camera, u, v)
    hits = Hits(u, v, depth, np.where(triangle >= 0, 0, -1).astype(np.int8), triangle)
    for index, body in enumerate(shot.bodies[1:], 1):
        depth, triangle = intersect(body, shot.camera, u, v)
        closer = depth < hits.depth
        hits.depth[closer] = depth[closer]
        hits.body[closer] = index
        hits.triangle[closer] = triangle[closer]
    return hits


def sunlit(shot: Shot, hits: Hits, blockers: Iterable[int]) -> np.ndarray:
    """(n,) bool: whether the hits see the sun past the bodies with the indices `blockers`."""
    lit = np.zeros(len(hits.u), dtype=bool)
    for index, body in enumerate(shot.bodies):
        written = np.empty((len(lit), 6), np.float32), np.empty(len(lit), np.int64), np.empty(3)
        pinhole = shot.camera.seen_from(body.world_from_body).pinhole
        sun = body.world_from_body[:3, :3].T @ SUN
        count = sun_rays(written, hits, index, pinhole, body.surfaces.normals, sun)
        rays, facing = (values[:count] for values in written[:2])
        for blocker in blockers:
            other = shot.bodies[blocker]
            asked = rays
            if blocker != index:
                transform = np.linalg.inv(other.world_from_body) @ body.world_from_body
                asked = moved_rays(rays, transform)
            free = ~other.surfaces.tree.blocked(asked)
            rays, facing = rays[free], facing[free]
        lit[facing] = True
    return lit


def light_of(shot: Shot, hits: Hits, lit: np.ndarray, spread: np.ndarray | float) -> np.ndarray:
    """Linear light (n, 3) float32 of samples that each represent a square of `spread` px.

    The samples meet `hits`, which see the sun where `lit` (n,) bool is true.
    """
    camera = shot.camera
    result = np.empty((len(lit), 3), dtype=np.float32)
    spread = np.full(len(lit), spread, dtype=np.float64)
    lights = (
        EXPOSURE * SUNLIGHT * SUN_COLOUR,
        EXPOSURE * AMBIENT * SKY_COLOUR,
        EXPOSURE * AMBIENT * GROUND_COLOUR,
    )
    for index, body in enumerate(shot.bodies):
        surfaces, textures = body.surfaces, body.surfaces.textures
        samples = hits, lit, spread, index, FINER_TARGET if index else 1
        pinhole = camera.seen_from(body.world_from_body).pinhole
        planes = surfaces.normals, surfaces.uv_gradients, surfaces.texture
        tables = textures.texels, textures.levels, textures.first_level
        suns = body.world_from_body[:3, :3].T @ SUN, *lights
        shading.shade(result, samples, pinhole, planes, tables, suns)
    sky = EXPOSURE * ZENITH, EXPOSURE * HORIZON
    shading.sky_light(result, hits, camera.pinhole, camera.stretch, sky)
    return result


@returning(lambda u, *_: np.empty((len(u), 6), dtype=np.float32))
@njit(cache=True, nogil=True, error_model="numpy")
def camera_rays(rays, u, v, pinhole):
    """The rays (n, 6) float32 (origin, direction) through samples (n,) float64."""
    rotation, origin, focal, u0, v0 = pinhole
    for i in range(len(u)):
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        for axis in range(3):
            rays[i, axis] = origin[axis]
            rays[i, 3 + axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2]


@returning(lambda u, *_: np.empty(len(u)))
@njit(cache=True, nogil=True, error_model="numpy")
def exact_depths(depth, u, v, triangle, hit, pinhole, planes):
    """Depths (n,) float64 m of the hits: the ray against the triangle's plane; inf: no hit.

    `hit` (n,) float32 is the caster's own depth, kept where the ray grazes the plane. `planes` are
    the normals and the offsets of all triangles.
    """
    rotation, origin, focal, u0, v0 = pinhole
    normals, offsets = planes
    for i in range(len(u)):
        t = triangle[i]
        if t < 0:
            depth[i] = np.inf
            continue
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        slope, start = 0.0, offsets[t]
        for axis in range(3):
            normal = normals[t, axis]
            slope += normal * (rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2])
            start -= normal * origin[axis]
        depth[i] = hit[i]
        if abs(slope) > 1e-9:
            exact = start / slope
            if abs(exact - hit[i]) < 1e-3 * hit[i]:
                depth[i] = exact


@njit(cache=True, nogil=True, error_model="numpy")
def sun_rays(written, hits, index, pinhole, normals, sun):
    """Write rays from the hits on body `index` that face the sun, and return how many there are.

    `written` gets the rays (n, 6) float32 and their samples (n,) int64, and has working memory
    (3,). `sun` (3,) is the unit vector towards the sun. A back face counts as if it were turned
    round.
    """
    rays, which, direction = written
    u, v, depth, body, triangle = hits
    rotation, origin, focal, u0, v0 = pinhole
    count = 0
    for i in range(len(u)):
        if body[i] != index:
            continue
        t = triangle[i]
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        towards, facing = 0.0, 0.0
        for axis in range(3):
            direction[axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2]
            towards += normals[t, axis] * sun[axis]
            facing += normals[t, axis] * direction[axis]
        side = -1.0 if facing > 0.0 else 1.0
        if towards * side <= 0.0:
            continue
        for axis in range(3):
            rays[count, axis] = (
                origin[axis] + depth[i] * direction[axis] + SHADOW_OFFSET * side * normals[t, axis]
            )
            rays[count, 3 + axis] = sun[axis]
        which[count] = i
        count += 1
    return count


def moved_rays(rays: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """The `rays` (n, 6) float32 in the frame that `transform` (4, 4) leads to."""
    x, y, z = np.moveaxis(rays.reshape(-1, 2, 3), 2, 0)[..., None]
    moved = np.stack([transform[:3, 3], np.zeros(3)])
    for values, column in zip((x, y, z), transform[:3, :3].T, strict=True):
        moved = moved + values * column
    return moved.reshape(-1, 6).astype(np.float32)
