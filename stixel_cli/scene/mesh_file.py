"""A road user from the user's own mesh file."""

import os
import re
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import opened
from stixel_cli.scene.mesh import Mesh, Part, bounding_box, corners, grounded
from stixel_cli.scene.open3d_import import import_open3d_bindings
from stixel_cli.scene.shapes import cube_uvs
from stixel_cli.scene.textures import paint

LEAST_SIDE, GREATEST_SIDE = 0.1, 30.0
"""Of the box around a road user, m: nothing flat, and no file in millimetres."""

LEAST_FOOTPRINT = 1e-3
"""Area of the projections of all triangles to the ground, m²: no upright plane."""

LEVELS = 32
"""Shades of each primary colour that vertex colours are rounded to."""


def load_mesh(path: str, contrast: float) -> Mesh:
    """The mesh in the file `path`, in the target frame: x forward, y left, z up, m.

    It is shifted so that its footprint's box is centred on the origin and its lowest point is on
    z = 0; its size does not change. Where the file has textures or vertex colours they are kept
    (the latter as one mean colour a triangle); otherwise it is painted with `contrast`. Open3D
    passes over faces of more than three corners.

    Raises:
        ValueError: if there is no such file, Open3D cannot read it, a number in it is not finite,
            it has no triangles or one of a vertex that it lacks, it has no area seen from above,
            or a side of the box around it is not 0.1 … 30 m.
    """
    _check_counts(path)
    open3d = import_open3d_bindings()
    # Without this, Open3D would print a second message.
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        found = open3d.io.read_triangle_mesh(path)
    vertices = np.asarray(found.vertices, dtype=np.float64)
    triangles = np.asarray(found.triangles, dtype=np.int32)
    if len(triangles) == 0:
        raise ValueError(
            f"road_user.mesh: Open3D finds no triangles in {path!r}: the file is damaged, or all "
            "its faces have four corners or more (triangulate them)"
        )
    if not all(
        np.isfinite(np.asarray(a)).all()
        for a in (vertices, found.triangle_uvs, found.vertex_colors)
    ):
        raise ValueError(
            f"road_user.mesh: a coordinate, texture coordinate or colour in {path!r} is not finite"
        )
    # NumPy takes a negative index for one from the end.
    wrong = triangles[(triangles < 0) | (triangles >= len(vertices))]
    if len(wrong):
        raise ValueError(
            f"road_user.mesh: a triangle in {path!r} has the vertex {wrong[0]}, counted from 0; "
            f"the file has {len(vertices)} vertices"
        )
    mesh = grounded(Mesh(tuple(_parts(found, vertices, triangles, contrast))))
    low, high = bounding_box(mesh)
    sides = high - low
    if not ((sides >= LEAST_SIDE) & (sides <= GREATEST_SIDE)).all():
        raise ValueError(
            f"road_user.mesh: the mesh in {path!r} is {sides[0]:.3g} × {sides[1]:.3g} × "
            f"{sides[2]:.3g} m large, each must be {LEAST_SIDE:g} to {GREATEST_SIDE:g} m "
            "(is the file in metres?)"
        )
    a, b = np.diff(corners(mesh)[:, :, :2], axis=1).transpose(1, 2, 0)
    if 0.5 * np.abs(a[0] * b[1] - a[1] * b[0]).sum() < LEAST_FOOTPRINT:
        raise ValueError(
            f"road_user.mesh: the mesh in {path!r} has no area seen from above (z must be up)"
        )
    return mesh


def _check_counts(path: str) -> None:
    """Check that the file can have as many elements as it declares: Open3D takes memory for all.

    Raises:
        ValueError: if it cannot, or is no regular file.
    """
    if not os.path.exists(path):
        raise ValueError(f"road_user.mesh: there is no file {path!r}")
    try:
        with opened(Path(path)) as stream:
            head, size = stream.read(2**16), os.fstat(stream.fileno()).st_size
    except UserError as error:
        raise ValueError(f"road_user.mesh: {error}") from None
    counts: list[bytes] = []
    if path.lower().endswith(".ply"):
        header = head.partition(b"end_header")[0]
        counts = re.findall(rb"^element\s+\S+\s+(\S+)", header, re.MULTILINE)
    elif path.lower().endswith(".off"):
        counts = re.sub(rb"#.*", b"", head).split()[1:3]
    for count in counts:
        if not count.isdigit() or int(count[:20]) > size:
            raise ValueError(
                f"road_user.mesh: {path!r} declares {count[:20].decode('ascii', 'replace')} "
                f"elements, which a file of {size} bytes cannot have"
            )


def _parts(found, vertices, triangles, contrast):
    # An empty image (a material without a texture), made an array, would abort the process.
    textures = [
        None if image.is_empty() else _power_of_two(np.asarray(image)) for image in found.textures
    ]
    if found.has_triangle_uvs() and any(image is not None for image in textures):
        uvs = np.asarray(found.triangle_uvs, dtype=np.float64).reshape(-1, 3, 2)
        material = np.asarray(found.triangle_material_ids)
        if len(material) != len(triangles):
            material = np.zeros(len(triangles), dtype=int)
        for number in np.unique(material):
            rows = material == number
            image = textures[number] if number < len(textures) else None
            if image is None:
                yield _painted(vertices, triangles[rows], contrast)
            else:
                yield Part(vertices, triangles[rows], uvs[rows], image, f"material {number}")
    elif found.has_vertex_colors():
        colours = np.asarray(found.vertex_colors)[triangles].mean(axis=1)
        shades = np.clip(np.rint(colours * (LEVELS - 1)), 0, LEVELS - 1).astype(int)
        yield Part(vertices, triangles, _palette_uvs(shades), _palette(), "vertex colours")
    else:
        yield _painted(vertices, triangles, contrast)


def _painted(vertices, triangles, contrast):
    uvs = cube_uvs(vertices, triangles, 1.1)
    return Part(vertices, triangles, uvs, paint((66, 108, 160), contrast), "body")


def _palette() -> np.ndarray:
    """Every rounded colour once, (128, 256, 3)."""
    shades = np.arange(LEVELS**3)
    index = np.stack([shades // LEVELS**2, shades // LEVELS % LEVELS, shades % LEVELS], axis=-1)
    colours = np.rint(index * (255.0 / (LEVELS - 1))).astype(np.uint8)
    return colours.reshape(128, 256, 3)


def _palette_uvs(shades: np.ndarray) -> np.ndarray:
    """Texture coordinates (T, 3, 2): all three corners at the colour's texel, at its middle."""
    number = (shades[:, 0] * LEVELS + shades[:, 1]) * LEVELS + shades[:, 2]
    uvs = np.stack([(number % 256 + 0.5) / 256.0, (number // 256 + 0.5) / 128.0], axis=-1)
    return np.repeat(uvs[:, None], 3, axis=1)


def _power_of_two(image: np.ndarray) -> np.ndarray:
    """An image as RGB with sides that are powers of two, 2048 at most."""
    import cv2

    if image.ndim == 2:
        image = image[..., None]
    if image.shape[2] < 3:
        image = np.repeat(image[..., :1], 3, axis=2)
    sides = [min(2048, 1 << max(0, int(side - 1).bit_length())) for side in image.shape[:2]]
    image = np.ascontiguousarray(image[..., :3], dtype=np.uint8)
    return cv2.resize(image, (sides[1], sides[0]), interpolation=cv2.INTER_AREA)
