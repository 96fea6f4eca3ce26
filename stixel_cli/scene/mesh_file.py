"""A road user from the user's own mesh file.

trimesh reads it; what trimesh passes over is checked or mended here: faults, and files referred to.
"""

import json
import logging
import re
import struct
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from hashlib import sha256
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from stixel_cli.border.files import GREATEST_ARRAYS, GREATEST_TEXT, read_bytes, remembered
from stixel_cli.errors import UserError, located, printable
from stixel_cli.geometry.pose import rotation
from stixel_cli.scene.mesh import Mesh, Part, bounding_box, corners, grounded
from stixel_cli.scene.shapes import cube_uvs
from stixel_cli.scene.textures import paint

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
    `read_parts`. ValueError if there is no such file, it is too large, damaged or of an unknown
    format, a number in it is not finite, it has no triangles or one of a vertex that it lacks, it
    has no area seen from above, a side of the box around it is not 0.1 … 30 m, or a texture is too
    large to decode.
    """
    digest = sha256()
    with located("road_user.mesh", ValueError, UserError):
        for file in (Path(path), *referred_files(Path(path))):
            digest.update(sha256(read_bytes(file, GREATEST_ARRAYS)).digest())
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

    ValueError if it cannot be read, see `load_mesh`.
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
        return read_parts(Path(path), placed, contrast)
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


FORMATS = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
"""Suffixes of the files that are read: those whose readers in trimesh need no other package."""

IMAGES = ("BMP", "GIF", "JPEG", "PNG", "TGA", "TIFF", "WEBP")
"""Formats of textures, in Pillow's names. It starts other programs to read some formats."""

MOST_NODES, MOST_TRIANGLES = 10_000, 10_000_000
"""Of a file, whose nodes may place one part many times."""

PAINT = (66, 108, 160)
"""Colour of what has none in the file."""


def read_parts(path: Path, placed: Callable[[np.ndarray], np.ndarray], contrast: float) -> Mesh:
    """The surfaces in the mesh file `path`; their vertices (V, 3) are `placed`.

    They have the file's textures, or colours (as one of each triangle), or are painted with
    `contrast`. Faces of more than three corners are split from their first corner. Materials,
    textures and buffers are read from the folder of the file and those below it, no others.
    An exception of any class if the file is damaged, too large or of an unknown format.
    """
    suffix, content = path.suffix.lower(), read_bytes(path, GREATEST_ARRAYS)
    if suffix not in FORMATS:
        raise ValueError(f"its suffix must be one of {', '.join(FORMATS)}; export it as .glb")
    if suffix == ".obj":
        content = _plain_obj(content.decode("utf-8", "replace")).encode()
    elif suffix == ".ply":
        content = _plain_ply(content)
    elif suffix in (".glb", ".gltf"):
        _check_gltf(content, sum(f.stat().st_size for f in (path, *referred_files(path))))
    import trimesh
    from PIL import Image

    # It logs what it leaves out, which Python prints if there is no handler.
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    with warnings.catch_warnings(action="ignore"):
        # NumPy warns of text that is no number, and leaves out what follows.
        warnings.filterwarnings("error", "string or file could not be read")
        for file in referred_files(path):
            with suppress(OSError):
                Image.open(file).close()  # trimesh passes over pictures that are too large.
        scene = trimesh.load_scene(BytesIO(content), suffix[1:], _Beside(path), process=False)
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
        meshes = [(scene.geometry[name], pose) for pose, name in nodes]
        meshes = [one for one in meshes if isinstance(one[0], trimesh.Trimesh)]
        count = sum(len(mesh.faces) for mesh, _ in meshes)
        least = int(re.sub(rb"#.*", b"", content).split()[2]) if suffix == ".off" else 1
        if not least <= count <= MOST_TRIANGLES:
            raise ValueError(f"{count} triangles, must be {least} to {MOST_TRIANGLES}")
        textures: dict[int, np.ndarray] = {}
        return tuple(_part(*one, placed, contrast, textures) for one in meshes if len(one[0].faces))


class _Beside:
    """trimesh's way to other files: only to those that a stage's key has, see `referred_files`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def get(self, name: str) -> bytes:
        """The content of a file; OSError if the mesh refers to no such file."""
        file = file_beside(self.path, name)
        if file is None or file not in referred_files(self.path):
            raise FileNotFoundError(name)
        return read_bytes(file, GREATEST_ARRAYS)

    __getitem__ = get


def _part(
    mesh: Any,
    pose: np.ndarray,
    placed: Callable[[np.ndarray], np.ndarray],
    contrast: float,
    textures: dict[int, np.ndarray],
) -> Part:
    """A mesh of trimesh where `pose` (4, 4) places it; `textures` has those of earlier parts."""
    triangles, count = mesh.faces, len(mesh.vertices)
    # NumPy takes a negative index for one from the end.
    wrong = triangles[(triangles < 0) | (triangles >= count)]
    if len(wrong):
        raise ValueError(f"a triangle has the vertex {wrong[0]}, counted from 0, of {count}")
    triangles = np.array(triangles, dtype=np.int32)
    vertices, visual = _single(mesh.vertices), mesh.visual
    if not (pose == np.eye(4)).all():
        vertices = vertices @ pose[:3, :3].T + pose[:3, 3]
        if np.linalg.det(pose[:3, :3]) < 0.0:
            triangles = triangles[:, ::-1]
    vertices = placed(vertices)
    uvs, texture, name = cube_uvs(vertices, triangles, 1.1), paint(PAINT, contrast), "body"
    if visual.kind == "texture" and visual.uv is not None and len(visual.uv) == count:
        material = visual.material
        image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        if image is not None:
            uvs, name = _single(visual.uv)[triangles], "textured"
            if id(image) not in textures:
                textures[id(image)] = _texture(image)
            texture = textures[id(image)]
    elif visual.kind in ("vertex", "face"):
        uvs, texture = _coloured(visual.face_colors[:, :3])
        name = "coloured"
    if not (np.isfinite(vertices).all() and np.isfinite(uvs).all()):
        raise ValueError("a coordinate or texture coordinate is not finite")
    return Part(vertices, triangles, uvs, texture, name)


def _single(values: np.ndarray) -> np.ndarray:
    """`values` of single precision, as in binary formats: the sum of their wholes and fractions.

    Assimp, which read meshes before, rounded text so: pictures stay the same to the byte.
    """
    wholes = np.trunc(values)
    return (wholes.astype(np.float32) + (values - wholes).astype(np.float32)).astype(np.float64)


def _texture(image: Any) -> np.ndarray:
    """A picture of Pillow as RGB, its lowest row first; sides are powers of two, 2048 at most."""
    import cv2
    from PIL import Image

    if image.format not in IMAGES:
        raise ValueError(f"a texture in {image.format}, must be in one of {', '.join(IMAGES)}")
    if image.width * image.height > Image.MAX_IMAGE_PIXELS:
        most = Image.MAX_IMAGE_PIXELS // 10**6
        raise ValueError(f"a texture of {image.width} × {image.height}, must be {most} Mpx at most")
    rows = np.ascontiguousarray(np.asarray(image.convert("RGB"))[::-1])
    sides = [min(2048, 1 << max(0, int(side - 1).bit_length())) for side in image.size]
    return cv2.resize(rows, sides, interpolation=cv2.INTER_AREA)


def _coloured(colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (T, 3, 2) of triangles in a texture with a texel for each of `colours` (T, 3)."""
    number, width = np.arange(len(colours)), 256
    height = 1 << int(number[-1] // width).bit_length()
    texture = np.zeros((height, width, 3), dtype=np.uint8)
    texture.reshape(-1, 3)[number] = colours
    middles = np.stack([(number % width + 0.5) / width, (number // width + 0.5) / height], axis=-1)
    return np.repeat(middles[:, None], 3, axis=1), texture


def _plain_obj(text: str) -> str:
    """A Wavefront file with triangles of positive indices for its faces.

    trimesh counts a negative index from the end of the file, and takes the form of the first face
    for that of others with as many numbers.
    """
    counts, greatest = {"v": 0, "vt": 0}, {"v": 0, "vt": 0}

    def absolute(kind: str, index: str) -> str:
        number = int(index) + (counts[kind] + 1 if index.startswith("-") else 0)
        if number < 1:
            raise ValueError(f"a face has the index {index} of {kind}")
        greatest[kind] = max(greatest[kind], number)
        return str(number)

    lines = []
    for line in re.sub(r"\\\r?\n", " ", text).splitlines():
        kind, *words = line.partition("#")[0].split() or [""]
        if kind in counts:
            counts[kind] += 1
            lines.append(" ".join([kind, *words]))
        elif kind in ("mtllib", "usemtl"):
            lines.append(line.strip())
        elif kind == "f":
            indices = [word.split("/")[:2] for word in words]
            kinds = ("v", "vt") if all(len(one) == 2 and one[1] for one in indices) else ("v",)
            first, *rest = ("/".join(map(absolute, kinds, one)) for one in indices)
            lines += [f"f {first} {second} {third}" for second, third in pairwise(rest)]
    for kind, number in greatest.items():
        if number > counts[kind]:
            raise ValueError(f"a face has the index {number} of {kind}, of {counts[kind]}")
    return "\n".join(lines)


_TYPES = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"},
    **{"float": "f", "double": "d", "float32": "f", "float64": "d"},
}
"""The letter of `struct` for each type of a .ply."""


def _plain_ply(content: bytes) -> bytes:
    """The .ply itself, or as text if its faces differ in their number of corners.

    Of a binary file, trimesh takes the number of the first face for all.
    """
    head, end, body = content.partition(b"end_header")
    elements = [
        (*one.split()[:2], re.findall(r"\n\s*property\s+(?:list\s+(\w+)\s+)?(\w+)", one))
        for one in re.split(r"\n\s*element\s+", head.decode("utf-8", "replace"))[1:]
    ]
    if b"format ascii" in head:
        _check_ply(elements, body)
        return content
    order, start = "<" if b"binary_little" in head else ">", body.find(b"\n") + 1
    lines, differ = [re.sub(rb"binary_\w+", b"ascii", head) + end], False
    for _, count, kinds in elements:
        lengths: set[tuple[int, ...]] = set()
        for _ in range(int(count) if kinds else 0):
            values, of_row = [], []
            for of_list, kind in kinds:
                length = 1
                if of_list:
                    (length,) = struct.unpack_from(order + _TYPES[of_list], body, start)
                    start += struct.calcsize(_TYPES[of_list])
                    values.append(length)
                row = f"{order}{length}{_TYPES[kind]}"
                values += struct.unpack_from(row, body, start)
                start += struct.calcsize(row)
                of_row.append(length)
            lines.append(" ".join(map(repr, values)).encode())
            lengths.add(tuple(of_row))
        differ = differ or len(lengths) > 1
    return b"\n".join(lines) if differ else content


def _check_ply(elements: list[tuple[str, str, list[tuple[str, str]]]], body: bytes) -> None:
    """Check the rows of a .ply in text: trimesh takes the form of the first row for all.

    `elements` are names, counts and properties: the type of a list's length, or "", and the type.
    """
    rows = iter(body.splitlines()[1:])
    for name, count, kinds in elements:
        for row in range(int(count)):
            values = [float(word) for word in next(rows, b"").split()]
            place = 0
            for of_list, _ in kinds:
                place += 1 + (int(values[place]) if of_list else 0)
            if place != len(values):
                raise ValueError(f"row {row} of {name} is not as its head declares")


def _check_gltf(content: bytes, size: int) -> None:
    """Check what a glTF file of `size` bytes, buffers included, makes trimesh allocate."""
    start, stop = 0, len(content)
    if content.startswith(b"glTF"):
        start, stop = 20, 20 + int.from_bytes(content[12:16], "little")
    if stop - start > GREATEST_TEXT:
        raise ValueError(f"its JSON has {stop - start} bytes, must be {GREATEST_TEXT} at most")
    tree = json.loads(content[start:stop])
    accessors, nodes = tree.get("accessors", []), tree.get("nodes", [])
    if not all("bufferView" in one and "sparse" not in one for one in accessors):
        raise ValueError("compressed or sparse geometry: export it without compression")
    count = sum(one["count"] for one in accessors)
    if count > size or len(nodes) > MOST_NODES:
        raise ValueError(
            f"{count} elements and {len(nodes)} nodes, must be {size} and {MOST_NODES} at most"
        )


ENDS = re.compile(rb"\.(?:mtl|bin|png|jpe?g|bmp|tga|webp|gif|tiff?)\b", re.IGNORECASE)
"""Ends of the names that are looked for."""

LONGEST = 255
"""Bytes of a line, up to the end of a name, in which the name is looked for."""


def referred_files(path: Path) -> tuple[Path, ...]:
    """Existing files that the mesh file `path` refers to, directly or through a material.

    They are in the folder of `path` or in one below it: others are left out.
    """
    referred: dict[Path, None] = {}
    pending = [path]
    while pending:
        file = pending.pop(0)
        try:
            names = _names(file)
        except UserError:
            # The reader of the mesh reports files that cannot be read.
            continue
        for name in names:
            other = file_beside(path, name)
            if other is not None and other not in referred and other != path:
                referred[other] = None
                pending += [other] if other.suffix.lower() == ".mtl" else []
    return tuple(referred)


def file_beside(path: Path, line: str) -> Path | None:
    """The regular file in the folder of `path`, or in one below, whose name ends `line`, if any.

    A line has a name that may have blanks, or several names, or options and a name.
    """
    words = unquote(line.replace("\\", "/")).split()
    for start in range(len(words)):
        file = path.parent / " ".join(words[start:])
        try:
            if file.is_file() and file.resolve().is_relative_to(path.parent.resolve()):
                return file
        except (OSError, ValueError):
            continue  # Too long for a name, or with a null byte.
    return None


@remembered
def _names(path: Path) -> tuple[str, ...]:
    """Lines that end with a name, read once for all runs of a sweep."""
    content = read_bytes(path, GREATEST_ARRAYS)
    stops = (found.end() for found in ENDS.finditer(content))
    lines = (content[max(0, stop - LONGEST) : stop] for stop in stops)
    ends = (re.split(rb"[\r\n\"]", line)[-1] for line in lines)
    return tuple(dict.fromkeys(end.decode("utf-8", "replace") for end in ends))
