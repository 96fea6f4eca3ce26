"""A road user from the user's own mesh file, and the files that a mesh file refers to.

References (materials, textures, buffers) are read from the text of Wavefront's .obj and .mtl, of
.gltf, and of the head of .ply. The other formats contain what they need, or refer to it in ways
that this module does not read.
"""

import io
import os
import re
import subprocess
import sys
import warnings
from collections.abc import Iterator
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import GREATEST_ARRAYS, opened, read_bytes, read_json
from stixel_cli.geometry.pose import rotation
from stixel_cli.remembered import remembered
from stixel_cli.scene.mesh import Mesh, Part, bounding_box, corners, grounded
from stixel_cli.scene.open3d_import import read_mesh
from stixel_cli.scene.shapes import cube_uvs
from stixel_cli.scene.textures import paint

COMMAND = (sys.executable, "-m", read_mesh.__module__)

LEAST_SIDE, GREATEST_SIDE = 0.1, 30.0
"""Of the box around a road user, m: nothing flat, and no file in millimetres."""

LEAST_FOOTPRINT = 1e-3
"""Area of the projections of all triangles to the ground, m²: no upright plane."""

LEVELS = 32
"""Shades of each primary colour that vertex colours are rounded to."""


def load_mesh(path: str, contrast: float, scale: float = 1.0, turn: float = 0.0) -> Mesh:
    """The mesh in the file `path`, in the target frame: x forward, y left, z up, m.

    Its coordinates are multiplied by `scale`, turned about z by `turn` rad, counter-clockwise, and
    shifted so that its footprint's box is centred on the origin and its lowest point is on z = 0.
    Where the file has textures or vertex colours they are kept (the latter as one mean colour a
    triangle); otherwise it is painted with `contrast`. Open3D passes over faces of more than three
    corners.

    Raises:
        ValueError: if there is no such file, Open3D cannot read it, a number in it is not finite,
            it has no triangles or one of a vertex that it lacks, it has no area seen from above,
            a side of the box around it is not 0.1 … 30 m, or a texture is too large to decode.
    """
    _check_counts(path)
    _check_textures(path)
    digest = sha256()
    for file in (Path(path), *referred_files(Path(path))):
        digest.update(sha256(read_bytes(file, GREATEST_ARRAYS)).digest())
    return _loaded(path, contrast, scale, turn, digest.hexdigest())


# Every chunk of frames asks for it, and a child process takes half a second.
@lru_cache(maxsize=2)
def _loaded(path: str, contrast: float, scale: float, turn: float, digest: str) -> Mesh:
    arrays = _read_in_child(path)
    vertices, triangles = scale * arrays["vertices"], arrays["triangles"]
    if turn:
        vertices[:, :2] = vertices[:, :2] @ rotation(turn).T
    arrays["vertices"] = vertices
    if len(triangles) == 0:
        raise ValueError(
            f"road_user.mesh: Open3D finds no triangles in {path!r}: the file is damaged, or all "
            "its faces have four corners or more (triangulate them)"
        )
    if not all(np.isfinite(arrays[name]).all() for name in ("vertices", "uvs", "colours")):
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
    (mesh,) = grounded([Mesh(tuple(_parts(arrays, contrast)))])
    low, high = bounding_box(mesh)
    sides = high - low
    if not ((sides >= LEAST_SIDE) & (sides <= GREATEST_SIDE)).all():
        raise ValueError(
            f"road_user.mesh: the mesh in {path!r} is {sides[0]:.3g} × {sides[1]:.3g} × "
            f"{sides[2]:.3g} m large; each side must be {LEAST_SIDE:g} to {GREATEST_SIDE:g} m "
            "(give road_user.mesh_scale if the file is not in metres)"
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
        raise ValueError(f"road_user.mesh: file not found: {path!r}")
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
                f"road_user.mesh: {path!r} declares {printable(count[:20].decode('latin-1'))} "
                f"elements, which a file of {size} bytes cannot have"
            )


def _check_textures(path: str) -> None:
    """Check the sizes of the images that the mesh refers to: Open3D decodes each of them whole.

    Raises:
        ValueError: if one has more pixels than Pillow takes for harmless.
    """
    from PIL import Image

    for file in referred_files(Path(path)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", Image.DecompressionBombWarning)
                Image.open(file).close()
        except (Image.DecompressionBombWarning, Image.DecompressionBombError):
            raise ValueError(
                f"road_user.mesh: {str(file)!r}, a texture of {path!r}, has more than "
                f"{Image.MAX_IMAGE_PIXELS // 10**6} million pixels"
            ) from None
        except (OSError, ValueError):
            # No image, or one that Open3D reports.
            continue


def _read_in_child(path: str) -> dict[str, np.ndarray]:
    """The arrays of `read_mesh`; no triangles if the file ends the child process."""
    child = subprocess.run((*COMMAND, path), stdin=subprocess.DEVNULL, capture_output=True)
    if child.returncode < 0:
        return {"vertices": np.empty((0, 3)), "triangles": np.empty((0, 3), np.int32)}
    if child.returncode > 0:
        reason = child.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        raise ValueError(f"road_user.mesh: Open3D cannot read {path!r}: {printable(reason)}")
    with np.load(io.BytesIO(child.stdout), allow_pickle=False) as arrays:
        return dict(arrays)


def _parts(arrays: dict[str, np.ndarray], contrast: float) -> Iterator[Part]:
    vertices, triangles, uvs = arrays["vertices"], arrays["triangles"], arrays["uvs"]
    if len(uvs) == 3 * len(triangles) and any(name.startswith("texture_") for name in arrays):
        uvs, material = uvs.reshape(-1, 3, 2), arrays["materials"]
        if len(material) != len(triangles):
            material = np.zeros(len(triangles), dtype=int)
        for number in np.unique(material):
            rows = material == number
            image = arrays.get(f"texture_{number}")
            if image is None:
                yield _painted(vertices, triangles[rows], contrast)
            else:
                image = _power_of_two(image)
                yield Part(vertices, triangles[rows], uvs[rows], image, f"material {number}")
    elif len(arrays["colours"]) == len(vertices):
        colours = arrays["colours"][triangles].mean(axis=1)
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


REFERENCES = {
    ".obj": re.compile(rb"\s*mtllib\S*\s+(.*)"),
    ".mtl": re.compile(rb"\s*(?:map_|bump|disp|decal|refl|norm)\S*\s+(.*)", re.IGNORECASE),
    ".ply": re.compile(rb"comment TextureFile\S*\s+(.*)"),
}
"""Lines that name other files, by the suffix of the file that has them."""


def referred_files(path: Path) -> tuple[Path, ...]:
    """Existing files that the mesh file `path` refers to, directly or through a material."""
    referred: dict[Path, None] = {}
    pending = [path]
    while pending:
        file = pending.pop(0)
        try:
            names = _names(file)
        except (OSError, UserError):
            # The reader of the mesh reports files that cannot be read.
            continue
        for other in (file.parent / name for name in names):
            if other not in referred and other != path and other.is_file():
                referred[other] = None
                pending.append(other)
    return tuple(referred)


@remembered
def _names(path: Path) -> tuple[str, ...]:
    """The names in a file, read once for all runs of a sweep."""
    suffix = path.suffix.lower()
    if suffix == ".gltf":
        names = _of_gltf(path)
    elif suffix in REFERENCES:
        names = _of_lines(path, REFERENCES[suffix])
    else:
        return ()
    return tuple(name for name in names if "\0" not in name)


def _of_lines(path: Path, reference: re.Pattern[bytes]) -> Iterator[str]:
    with opened(path) as file:
        for line in file:
            if line.startswith(b"end_header"):
                return  # The rest of a .ply may be binary.
            if match := reference.match(line):
                # Several names, or one with blanks in it, or options and a name.
                rest = match[1].decode("utf-8", "replace").strip().replace("\\", "/")
                yield from dict.fromkeys((rest, *rest.split()))


def _of_gltf(path: Path) -> Iterator[str]:
    try:
        tree = read_json(path)
        entries = [*tree.get("buffers", ()), *tree.get("images", ())]
        names = [entry["uri"] for entry in entries if "uri" in entry]
        yield from (unquote(name) for name in names if not name.startswith("data:"))
    except (TypeError, AttributeError):
        return
