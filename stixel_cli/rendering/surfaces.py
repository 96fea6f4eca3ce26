"""Triangles in the form of the ray caster: tables of planes, texture gradients and mip-maps."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stixel_cli.rendering.frames import encoded
from stixel_cli.rendering.shading import GREEN, RED, TEXEL_STEP
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.open3d_import import import_open3d_bindings
from stixel_cli.scene.shapes import joined


@dataclass(frozen=True)
class Textures:
    """Mip-maps of every texture, one after the other."""

    texels: np.ndarray
    """(n,) uint64, red, green and blue linear light packed as `shading` adds them up."""
    levels: np.ndarray
    """(m, 3) int64, for each level of each texture its first texel, width and height."""
    first_level: np.ndarray
    """(t + 1,) int32, the first row in `levels` of each texture."""


class RayTree:
    """Triangles in the structure that rays ask (Open3D's RaycastingScene), on one thread."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        library = import_open3d_bindings()
        self._tensor = library.core.Tensor
        self._scene = library.t.geometry.RaycastingScene(nthreads=1)
        arrays = vertices.astype(np.float32), triangles.astype(np.uint32)
        self._scene.add_triangles(*map(self._tensor, arrays))

    def first_hits(self, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameter (n,) float32 and triangle (n,) int32 (-1: no hit) of `rays` (n, 6) float32."""
        if len(rays) == 0:
            return np.empty(0, dtype=np.float32), np.empty(0, dtype=np.int32)
        answer = self._scene.cast_rays(self._tensor.from_numpy(rays), nthreads=1)
        # The caster marks a miss with the greatest uint32, which is -1 here.
        triangles = answer["primitive_ids"].numpy().view(np.int32).copy()
        return answer["t_hit"].numpy().copy(), triangles

    def blocked(self, rays: np.ndarray) -> np.ndarray:
        """Whether each of `rays` (n, 6) float32 meets anything; (n,) bool."""
        if len(rays) == 0:
            return np.zeros(0, dtype=bool)
        tensor = self._tensor.from_numpy(np.ascontiguousarray(rays))
        return self._scene.test_occlusions(tensor, nthreads=1).numpy().copy()


@dataclass(frozen=True)
class Surfaces:
    """One rigid body's triangles in the body's own frame, and the structure that rays ask."""

    tree: RayTree
    """All triangles, in the order of the tables."""
    corners: np.ndarray
    """(T, 3, 3) float64 m."""
    normals: np.ndarray
    """(T, 3) float64 unit vectors, outward."""
    offsets: np.ndarray
    """(T,) float64 m, a triangle's plane is normal · point = offset."""
    uv_gradients: np.ndarray
    """(T, 2, 4) float64; a row times (x, y, z, 1) is a texture coordinate."""
    texture: np.ndarray
    """(T,) int32, the texture of each triangle."""
    object_ids: np.ndarray
    """(T,) uint8, as in `RenderedFrames.ids`."""
    textures: Textures
    """What `texture` counts."""


def build_surfaces(objects: Iterable[tuple[int, Mesh]]) -> Surfaces:
    """Surfaces of `objects`, meshes with their ids, all in one frame.

    ValueError as `build_textures` does.
    """
    ids, parts = zip(*((number, part) for number, mesh in objects for part in mesh), strict=True)
    images = {id(part.texture): part.texture for part in parts}
    numbers = {identity: number for number, identity in enumerate(images)}
    counts = [len(part.triangles) for part in parts]
    texture = np.array([numbers[id(part.texture)] for part in parts], dtype=np.int32)
    return Surfaces(
        **of_vertices(parts),
        texture=np.repeat(texture, counts),
        object_ids=np.repeat(np.array(ids, dtype=np.uint8), counts),
        textures=build_textures(images.values()),
    )


def of_vertices(parts: Mesh) -> dict[str, Any]:
    """The attributes of `Surfaces` that depend on vertices."""
    vertices, triangles = joined([(part.vertices, part.triangles) for part in parts])
    uvs = np.concatenate([part.uvs for part in parts])
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    normals = cross / np.where(length > 0, length, 1.0)
    return {
        "tree": RayTree(vertices, triangles),
        "corners": corners,
        "normals": normals,
        "offsets": np.einsum("ij,ij->i", normals, corners[:, 0]),
        "uv_gradients": _uv_gradients(corners, normals, uvs),
    }


def _uv_gradients(corners: np.ndarray, normals: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Affine maps (T, 2, 4) from a point to texture coordinates, constant along the normal."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # Dual basis of the two edges inside the triangle's plane.
    across_first, across_second = np.cross(second, normals), np.cross(normals, first)
    area = np.einsum("ij,ij->i", first, across_first)[:, None]
    area = np.where(np.abs(area) > 0, area, 1.0)
    dual = np.stack([across_first, across_second], axis=1) / area[:, :, None]
    change = np.stack([uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]], axis=2)
    gradient = change @ dual
    constant = uvs[:, 0] - np.einsum("tij,tj->ti", gradient, corners[:, 0])
    return np.ascontiguousarray(np.concatenate([gradient, constant[:, :, None]], axis=2))


def build_textures(images: Iterable[np.ndarray]) -> Textures:
    """Mip-maps of `images`, (h, w, 3) uint8 sRGB with sides that are powers of two.

    Averages are taken in linear light, for that is what a pixel collects. ValueError if a side is
    not a power of two.
    """
    images = [np.asarray(image) for image in images]
    levels, first_level, count = [], [0], 0
    for image in images:
        height, width = image.shape[:2]
        if height & (height - 1) or width & (width - 1):
            raise ValueError(f"a texture has the size {(height, width)}: must be powers of two")
        while True:
            levels.append((count, width, height))
            count += width * height
            if width == height == 1:
                break
            height, width = max(height // 2, 1), max(width // 2, 1)
        first_level.append(len(levels))
    texels = np.zeros(count, dtype=np.uint64)
    for image, first, stop in zip(images, first_level, first_level[1:], strict=False):
        # Channel by channel: NumPy is slow where the last axis has three values.
        for channel, shift in zip(np.moveaxis(image, 2, 0), (RED, GREEN, 0), strict=True):
            level = linear_from_srgb(channel)
            for start, width, height in levels[first:stop]:
                if level.shape[0] > height:
                    level = np.float32(0.5) * (level[::2] + level[1::2])
                if level.shape[1] > width:
                    level = np.float32(0.5) * (level[:, ::2] + level[:, 1::2])
                steps = np.rint(level / np.float32(TEXEL_STEP)).astype(np.uint64)
                texels[start : start + width * height] |= (steps << np.uint64(shift)).ravel()
    return Textures(texels, np.array(levels, dtype=np.int64), np.array(first_level, dtype=np.int32))


def srgb_from_linear(light: np.ndarray) -> np.ndarray:
    """sRGB uint8 of linear light, any shape, with full scale 1 (IEC 61966-2-1)."""
    top = np.float32(len(_ENCODE) - 1)
    return _ENCODE[(np.clip(light, 0.0, 1.0) * top + np.float32(0.5)).astype(np.int32)]


def linear_from_srgb(image: np.ndarray) -> np.ndarray:
    """Linear light, float32 in [0, 1], of sRGB uint8, any shape (IEC 61966-2-1)."""
    return _DECODE[image]


_VALUES = np.arange(256) / 255.0
_DECODE = np.where(_VALUES <= 0.04045, _VALUES / 12.92, ((_VALUES + 0.055) / 1.055) ** 2.4)
_DECODE = _DECODE.astype(np.float32)

_ENCODE = np.rint(255.0 * encoded(np.arange(1 << 16) / ((1 << 16) - 1))).astype(np.uint8)
