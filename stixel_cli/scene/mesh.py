"""Textured triangle meshes, made by shapes and used by renderers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import rotation


@dataclass(frozen=True)
class Part:
    """A surface of one texture."""

    vertices: np.ndarray
    """(V, 3) float64, m."""
    triangles: np.ndarray
    """(T, 3) int32 rows of `vertices`, counter-clockwise seen from outside."""
    uvs: np.ndarray
    """(T, 3, 2) float64, texture coordinates of the triangles' corners, repeated beyond [0, 1); u
    along the texture's columns, v along its rows, downwards."""
    texture: np.ndarray
    """(h, w, 3) uint8 RGB, h and w powers of two."""
    name: str
    """Of the surface."""


Mesh = tuple[Part, ...]
"""The surfaces that make up one object."""


def bounding_box(*meshes: Mesh) -> np.ndarray:
    """Least and greatest coordinates, (2, 3) m, of the vertices that triangles of `meshes` use."""
    used = np.concatenate(
        [part.vertices[np.unique(part.triangles)] for mesh in meshes for part in mesh]
    )
    return np.array([used.min(axis=0), used.max(axis=0)])


def corners(mesh: Mesh) -> np.ndarray:
    """The corners of all triangles, (T, 3, 3) m: triangle, corner, coordinate."""
    return np.concatenate([part.vertices[part.triangles] for part in mesh])


def scaled(mesh: Mesh, factors: np.ndarray) -> Mesh:
    """`mesh` with its coordinates multiplied by `factors` (3,), all positive."""
    return tuple(replace(part, vertices=part.vertices * factors) for part in mesh)


def moved(mesh: Mesh, offset: np.ndarray, turn: float = 0.0) -> Mesh:
    """`mesh` turned about z by `turn` rad, counter-clockwise, then shifted by `offset` (3,) m."""
    matrix = np.eye(3)
    matrix[:2, :2] = rotation(turn)
    return tuple(replace(part, vertices=part.vertices @ matrix.T + offset) for part in mesh)


def fitted(meshes: Sequence[Mesh], length: float, width: float, height: float) -> tuple[Mesh, ...]:
    """`meshes`, all in the same way scaled and shifted to a box of `length` × `width` × `height` m.

    It is the box around all of them: its footprint is centred on the origin, its floor is z = 0.
    """
    low, high = bounding_box(*meshes)
    factors = np.array([length, width, height]) / (high - low)
    return grounded([scaled(mesh, factors) for mesh in meshes])


def grounded(meshes: Sequence[Mesh]) -> tuple[Mesh, ...]:
    """`meshes`, all shifted in the same way: as `fitted`, in their own size."""
    low, high = bounding_box(*meshes)
    centre = 0.5 * (low + high)
    return tuple(moved(mesh, -np.array([centre[0], centre[1], low[2]])) for mesh in meshes)
