"""A road user from the user's own mesh file."""

from collections.abc import Callable
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import GREATEST_ARRAYS, read_bytes
from stixel_cli.geometry.pose import rotation
from stixel_cli.scene.mesh import Mesh, bounding_box, corners, grounded
from stixel_cli.scene.mesh_reading import read_parts, referred_files

LEAST_SIDE, GREATEST_SIDE = 0.1, 30.0
"""Of the box around a road user, m: nothing flat, and no file in millimetres."""

UNITS = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254}
"""Units of mesh files other than metres, m."""

LEAST_FOOTPRINT = 1e-3
"""Area of the projections of all triangles to the ground, m²: no upright plane."""


def load_mesh(
    path: str, contrast: float, scale: float = 1.0, turn: float = 0.0, up: str = "z"
) -> Mesh:
    """The mesh in the file `path`, in the target frame: x forward, y left, z up, m.

    Its coordinates are multiplied by `scale`; if `up` is y, that axis becomes z, and z becomes −y;
    then they are turned about z by `turn` rad, counter-clockwise, and shifted so that its
    footprint's box is centred on the origin and its lowest point is on z = 0. `contrast` is as in
    `read_parts`.

    Raises:
        ValueError: if there is no such file, it is too large, damaged or of an unknown format, a
            number in it is not finite, it has no triangles or one of a vertex that it lacks, it has
            no area seen from above, a side of the box around it is not 0.1 … 30 m, or a texture is
            too large to decode.
    """
    digest = sha256()
    try:
        for file in (Path(path), *referred_files(Path(path))):
            digest.update(sha256(read_bytes(file, GREATEST_ARRAYS)).digest())
    except UserError as error:
        raise ValueError(f"road_user.mesh: {error}") from None
    return _loaded(path, contrast, scale, turn, up, digest.hexdigest())


# Every chunk of frames asks for it.
@lru_cache(maxsize=2)
def _loaded(path: str, contrast: float, scale: float, turn: float, up: str, digest: str) -> Mesh:
    def placed(vertices: np.ndarray) -> np.ndarray:
        vertices = scale * vertices
        if up == "y":
            vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
        if turn:
            vertices[:, :2] = vertices[:, :2] @ rotation(turn).T
        return vertices

    (mesh,) = grounded([_read(path, placed, contrast)])
    low, high = bounding_box(mesh)
    sides = high - low
    if not ((sides >= LEAST_SIDE) & (sides <= GREATEST_SIDE)).all():
        raise ValueError(
            f"road_user.mesh: the mesh in {path!r} is {sides[0]:.3g} × {sides[1]:.3g} × "
            f"{sides[2]:.3g} m large; each side must be {LEAST_SIDE:g} to {GREATEST_SIDE:g} m"
            f"{_other_units(sides.max() / scale)}"
        )
    a, b = np.diff(corners(mesh)[:, :, :2], axis=1).transpose(1, 2, 0)
    if 0.5 * np.abs(a[0] * b[1] - a[1] * b[0]).sum() < LEAST_FOOTPRINT:
        raise ValueError(
            f"road_user.mesh: the mesh in {path!r} has no area seen from above; "
            f"{up} must be up (road_user.mesh_up)"
        )
    return mesh


def mesh_doubt(path: str, scale: float, up: str) -> str | None:
    """What is probably wrong with the pose of the mesh in the file `path`, and what to set.

    Raises:
        ValueError: if it cannot be read, see `load_mesh`.
    """
    low, high = bounding_box(_read(path, lambda vertices: scale * vertices, 0.0))
    axis, other = (2, 1) if up == "z" else (1, 2)
    sides, name = high - low, "xyz"[other]
    # A road user stands on 0, and its left and right sides are alike.
    stands = np.abs(low) < 0.05 * sides
    even = np.abs(low + high) < 0.1 * sides
    if (stands[other] and even[axis]) or (up == "z" and path.lower().endswith((".glb", ".gltf"))):
        return f"road_user.mesh: {path!r} probably has {name} up: set road_user.mesh_up={name}"
    if low[axis] > 0.05 * sides[axis]:
        return (
            f"road_user.mesh: {path!r} is {low[axis]:.2f} m above the ground ({up} = 0) and is put "
            f"on it; if {name} is up, set road_user.mesh_up={name}"
        )
    return None


def _read(path: str, placed: Callable[[np.ndarray], np.ndarray], contrast: float) -> Mesh:
    try:
        return Mesh(read_parts(Path(path), placed, contrast))
    except Exception as error:
        # Readers raise errors of any class where a file is damaged.
        reason = printable(str(error) or type(error).__name__, 200)
        raise ValueError(f"road_user.mesh: {path!r} cannot be read: {reason}") from None


def _other_units(longest: float) -> str:
    """What to set if a file whose longest side is `longest` is in another unit, if that fits."""
    return "".join(
        f"; if the file is in {unit}, set road_user.mesh_scale={metres:g} (then the longest is "
        f"{longest * metres:.3g} m)"
        for unit, metres in UNITS.items()
        if 0.5 < longest * metres < 15.0
    )
