import json
import os
import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from stixel_cli.config.compose import compose
from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.scene.contours import outline
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.mesh_file import load_mesh, mesh_doubt, referred_files
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.road_user import road_user_meshes


def wedge(header="", uvs="", corner="{0}"):
    faces = [(1, 3, 2), (1, 2, 4), (2, 3, 4), (3, 1, 4)]
    lines = ["f " + " ".join(corner.format(vertex) for vertex in face) for face in faces]
    return f"{header}v 1 1 3\nv 3 1 3\nv 1 2 3\nv 1 1 4\n{uvs}" + "\n".join([*lines, ""])


def test_user_mesh_keeps_its_texture_upright(tmp_path):
    import cv2

    image = np.zeros((6, 6, 3), np.uint8)
    image[:3], image[3:] = (0, 0, 255), (255, 0, 0)  # BGR: red above, blue below
    cv2.imwrite(str(tmp_path / "image.png"), image)
    (tmp_path / "wedge.mtl").write_text("newmtl coat\nmap_Kd image.png\n")
    uvs = "vt 0 0.1\nvt 1 0.1\nvt 0.5 0.1\nvt 0.5 0.9\nusemtl coat\n"
    path = tmp_path / "wedge.obj"
    path.write_text(wedge("mtllib wedge.mtl\n", uvs, "{0}/{0}"))
    (part,) = load_mesh(str(path), 0.5)
    assert part.texture.shape == (8, 8, 3)
    heights = part.vertices[part.triangles][:, :, 2]
    rows = np.floor(part.uvs[:, :, 1] * 8).astype(int)
    above, below = rows[heights > 0.5], rows[heights < 0.5]
    assert (part.texture[above, 0] == [255, 0, 0]).all()
    assert (part.texture[below, 0] == [0, 0, 255]).all()


def huge_picture():
    """A PNG that says that it has 1.6e9 pixels."""
    size = struct.pack(">IIBBBBB", 40000, 40000, 8, 2, 0, 0, 0)
    bodies = b"IHDR" + size, b"IDAT" + zlib.compress(b"")
    chunks = [struct.pack(">I", len(b) - 4) + b + struct.pack(">I", zlib.crc32(b)) for b in bodies]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


POSTSCRIPT = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EOF\n"
"""Pillow would give it to another program."""


@pytest.mark.parametrize(
    ("picture", "said"),
    [(huge_picture(), r"wedge\.obj.*1600000000 pixels"), (POSTSCRIPT, "a texture in EPS")],
)
def test_a_texture_that_is_not_decoded_gives_a_one_line_error(tmp_path, picture, said):
    (tmp_path / "image.png").write_bytes(picture)
    (tmp_path / "wedge.mtl").write_text("newmtl coat\nmap_Kd image.png\n")
    path = tmp_path / "wedge.obj"
    path.write_text(wedge("mtllib wedge.mtl\n", "vt 0 0\n" * 4 + "usemtl coat\n", "{0}/{0}"))
    with pytest.raises(ValueError, match=rf"^road_user\.mesh: .*{said}"):
        load_mesh(str(path), 0.5)


def test_user_mesh_keeps_vertex_colours(tmp_path):
    path = tmp_path / "wedge.ply"
    colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    rows = "1 1 3 250 10 10\n3 1 3 250 10 10\n1 2 3 250 10 10\n1 1 4 250 10 10\n"
    path.write_text(ply_head(4, 4, colours=colours) + rows + "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n")
    (part,) = load_mesh(str(path), 0.5)
    u, v = part.uvs[:, 0, 0], part.uvs[:, 0, 1]
    height, width = part.texture.shape[:2]
    colours = part.texture[np.floor(v * height).astype(int), np.floor(u * width).astype(int)]
    assert np.abs(colours.astype(int) - [250, 10, 10]).max() <= 5


BOX = [(x, y, z) for x in (-2, 2) for y in (-1, 1) for z in (0, 1.5)]
TRIANGLES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
TRIANGLES += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
OBJ, OFF, PLY = "box.obj", "box.off", "box.ply"


def box(name, change=lambda vertex: vertex, last=(1, 7, 3), count=8):
    """The text of a box in the format of `name`, its vertices changed and its last triangle."""
    vertices = [" ".join(map(str, change(vertex))) + "\n" for vertex in BOX]
    faces = [*TRIANGLES[:-1], last]
    if name == OBJ:
        lines = ["f {} {} {}\n".format(*(i + 1 for i in face)) for face in faces]
        return "".join([f"v {vertex}" for vertex in vertices] + lines)
    lines = "".join(vertices) + "".join("3 {} {} {}\n".format(*face) for face in faces)
    if name == OFF:
        return f"OFF\n{count} {len(faces)} 0\n{lines}"
    return ply_head(count, len(faces)) + lines


def ply_head(vertices, faces, order="ascii", colours=""):
    coordinates = "property float x\nproperty float y\nproperty float z\n"
    head = f"ply\nformat {order} 1.0\nelement vertex {vertices}\n{coordinates}{colours}"
    return f"{head}element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"


@pytest.mark.parametrize("name", [OBJ, OFF, PLY])
def test_user_mesh_far_from_the_origin_is_centred(tmp_path, name):
    path = tmp_path / name
    path.write_text(box(name, lambda v: (v[0] + 1e6, *v[1:])))
    np.testing.assert_allclose(bounding_box(load_mesh(str(path), 0.5)), [[-2, -1, 0], [2, 1, 1.5]])


@pytest.mark.parametrize(
    ("forward", "corner"),
    [("x", (-1, -0.5)), ("-x", (1, 0.5)), ("y", (-0.5, 1)), ("-y", (0.5, -1))],
)
def test_user_mesh_in_millimetres_and_turned(tmp_path, forward, corner):
    """The wedge's right angle is at its file's least x and y."""
    path = tmp_path / "wedge.obj"
    path.write_text(wedge())
    user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, str(path), 2.0, forward)
    mesh = road_user_meshes(user)[0]
    contour = {tuple(point) for point in np.round(outline(corners(mesh)), 3)}
    x, y = (2.0 * side for side in corner)
    assert contour == {(x, y), (-x, y), (x, -y)}


ONE_LESS = ("-2 -1 1.5\n", "-2 -1\n")
SHORT = {"vertex.ply": box(PLY).replace(*ONE_LESS), "vertex.off": box(OFF).replace(*ONE_LESS)}
SHORT |= {"head.off": box(OFF).replace("OFF", "\ufeffOFF")}


@pytest.mark.parametrize("name", SHORT)
def test_a_short_line_gives_a_mesh_or_one_line(tmp_path, capfd, name):
    path = tmp_path / name
    path.write_text(SHORT[name])
    with suppress(ValueError):
        load_mesh(str(path), 0.5)
    assert capfd.readouterr() == ("", "")


def test_a_changed_mesh_is_read_again_though_its_size_and_time_are_the_same(tmp_path):
    path = tmp_path / OBJ
    path.write_text(box(OBJ))
    load_mesh(str(path), 0.5)
    time = path.stat().st_mtime_ns
    path.write_text(box(OBJ, lambda v: (v[0] + (v[0] > 0), *v[1:])))
    os.utime(path, ns=(time, time))
    assert bounding_box(load_mesh(str(path), 0.5))[1, 0] == 2.5


DAMAGED = [
    (name, box(name, **change), message)
    for name in (OBJ, OFF, PLY)
    for change, message in (
        ({"change": lambda v: (*v[:2], 0)}, r"is 4 × 2 × 0 m large; each side must be 0.1 to 30 m"),
        ({"change": lambda v: (v[0], 0, v[2])}, r"is 4 × 0 × 1.5 m large"),
        ({"change": lambda v: (v[0], v[0], v[2])}, r"no area seen from above; z must be up"),
        ({"change": lambda v: (*v[:2], v[2] * 1e6)}, r"is 4 × 2 × 1.5e\+06 m large"),
        ({"change": lambda v: [1e6 * x for x in v]}, r"is 4e\+06 × 2e\+06 × 1.5e\+06 m large"),
        ({"change": lambda v: ("nan", *v[1:])}, "is not finite"),
        ({"change": lambda v: ("1e39", *v[1:])}, "is not finite"),
        ({"change": lambda v: ("1x", *v[1:])}, "cannot be read"),
        ({"change": lambda v: v[: 2 if v[2] else 3]}, "cannot be read"),
        ({"last": (1, 7, 99)}, "cannot be read"),
        ({"last": (1, 7, -10)}, "cannot be read"),
    )
]
for name in (OFF, PLY):
    texts = [box(name, count=count) for count in (2 * 10**9, 9, 7, -8)]
    texts.append("".join(box(name).splitlines(keepends=True)[:-1]))
    DAMAGED += [(name, text, "cannot be read") for text in texts]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent.obj", None, "absent.obj is missing"),
        ("text.ply", "this is no mesh\n", "cannot be read"),
        ("text.glb", "this is no mesh\n", "cannot be read"),
        ("deep.gltf", "[" * 100_000, "cannot be read"),
        ("strange.xyz", "1 2 3\n", "export it as .glb"),
        ("scene.dae", "<COLLADA/>\n", "export it as .glb"),
        ("empty.obj", "", "cannot be read"),
        ("wide.off", "OFF \x008\x00 12 0\n", "cannot be read"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "0 triangles"),
        ("small.obj", "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\n", "0.1 to 30 m"),
        *DAMAGED,
    ],
)
def test_invalid_user_mesh_gives_a_one_line_error(tmp_path, capfd, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with refused(name, match=rf"^road_user\.mesh: .*(?:{message})", error=ValueError):
        load_mesh(str(path), 0.5)
    assert capfd.readouterr() == ("", "")


QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
VERTICES = "".join("v {} {} {}\n".format(*vertex) for vertex in BOX)
TEXTURED = "vt 0 0\nvt 1 0\nvt 1 1\n"


def faces(form="{0}", offset=1):
    return "".join("f " + " ".join(form.format(i + offset) for i in q) + "\n" for q in QUADS)


OF_FORMS = {
    "quads": VERTICES + faces(),
    "negative": VERTICES + faces(offset=-8),
    "negative, and more vertices later": VERTICES + faces(offset=-8) + "v 9 9 9\n" * 3,
    "quads and triangles": VERTICES + faces().replace("f 2 6 8 4\n", "f 2 6 8\nf 2 8 4\n"),
    # With the lower quad again.
    "six corners next to three with two numbers": VERTICES
    + TEXTURED
    + "f 1/1 2/2 4/3\nf 1 4 3\n"
    + faces().split("\n", 1)[1]
    + "f 1 1 3 3 7 5\n",
    "normals only": VERTICES + "vn 0 0 1\n" + faces("{0}//1"),
    "normals of some": VERTICES + TEXTURED + "vn 0 0 1\n" + faces("{0}/1/1").replace("2/1/1", "2"),
    "continued lines": VERTICES + faces().replace(" 4 3", " 4 \\\n 3"),
}


@pytest.mark.parametrize("form", OF_FORMS)
def test_wavefront_faces_of_every_form(tmp_path, form):
    path = tmp_path / OBJ
    path.write_text(OF_FORMS[form])
    mesh = load_mesh(str(path), 0.5)
    np.testing.assert_allclose(bounding_box(mesh), [[-2, -1, 0], [2, 1, 1.5]])
    a, b = np.diff(corners(mesh), axis=1).transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(a, b), axis=1).sum()
    assert area == pytest.approx(34.0 + 8.0 * form.startswith("six corners"))


MIXED = [*TRIANGLES[:2], *QUADS[1:]]
"""Quads and two triangles, as Blender writes them."""
CUT = [*QUADS[:4], (0, 2, 6), (0, 6, 2, 6, 4), *QUADS[5:]]
"""A triangle and a face of five corners: as many bytes as if all were quads."""


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("polygons", [QUADS, MIXED, CUT])
def test_ply_of_polygons(tmp_path, order, polygons):
    path = tmp_path / PLY
    head = ply_head(8, len(polygons), order)
    end = "><"["little" in order]
    if order == "ascii":
        rows = [" ".join(map(str, row)) for row in (*BOX, *((len(q), *q) for q in polygons))]
        body = "".join(f"{row}\n" for row in rows).encode()
    else:
        body = np.array(BOX, f"{end}f4").tobytes()
        body += b"".join(bytes([len(q)]) + np.array(q, f"{end}i4").tobytes() for q in polygons)
    path.write_bytes(head.encode() + body)
    mesh = load_mesh(str(path), 0.5)
    found = {frozenset(one) for one in mesh[0].triangles.tolist()}
    fans = [(q[0], *q[i : i + 2]) for q in polygons for i in range(1, len(q) - 1)]
    assert found == {frozenset(one) for one in fans}
    np.testing.assert_allclose(bounding_box(mesh), [[-2, -1, 0], [2, 1, 1.5]])


def test_stl(tmp_path):
    triangles = np.array(BOX, "<f4")[np.array(TRIANGLES)]
    rows = b"".join(bytes(12) + one.tobytes() + bytes(2) for one in triangles)
    path = tmp_path / "box.stl"
    path.write_bytes(bytes(80) + np.array(12, "<u4").tobytes() + rows)
    np.testing.assert_allclose(bounding_box(load_mesh(str(path), 0.5)), [[-2, -1, 0], [2, 1, 1.5]])


def gltf(folder: Path, name: str, **changes) -> Path:
    """A box with y up, which looks along its z, placed twice by nodes; its texture is red.

    `changes` replace entries of the JSON.
    """
    import cv2

    positions = np.array([(y, z, x) for x, y, z in BOX], "<f4")  # left, up, forward
    indices = np.array(TRIANGLES, "<u2")
    uvs = np.full((8, 2), 0.5, "<f4")
    image = cv2.imencode(".png", np.full((4, 4, 3), (0, 0, 250), np.uint8))[1].tobytes()
    chunks = [positions.tobytes(), uvs.tobytes(), indices.tobytes(), image]
    starts = np.cumsum([0] + [len(chunk) for chunk in chunks])
    shape = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    turned = {"translation": [0.0, 0.0, -2.0], "rotation": [0.0, 1.0, 0.0, 0.0]}
    nodes = [{"children": [1, 2], "scale": [2.0, 2.0, 2.0]}]
    nodes += [{"mesh": 0, "translation": [0.0, 0.0, 2.0]}, {"mesh": 0} | turned]
    kinds = (5126, 8, "VEC3"), (5126, 8, "VEC2"), (5123, 36, "SCALAR")
    names = ("bufferView", "componentType", "count", "type")
    accessors = [dict(zip(names, (i, *kind), strict=True)) for i, kind in enumerate(kinds)]
    places = zip(starts, map(len, chunks), strict=False)
    views = [{"buffer": 0, "byteOffset": int(at), "byteLength": size} for at, size in places]
    tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes}
    tree |= {"meshes": [{"primitives": [shape]}], "accessors": accessors, "bufferViews": views}
    tree |= {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}
    tree |= {"images": [{"bufferView": 3, "mimeType": "image/png"}], "textures": [{"source": 0}]}
    tree |= {"buffers": [{"byteLength": int(starts[-1])}]} | changes
    data = b"".join(chunks)
    path = folder / name
    if path.suffix == ".gltf":
        if "uri" not in tree["buffers"][0]:
            tree["buffers"] = [{"byteLength": len(data), "uri": "a%20box.bin"}]
        (folder / "a box.bin").write_bytes(data)
        path.write_text(json.dumps(tree))
        return path
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    return path


@pytest.mark.parametrize("name", ["box.glb", "box.gltf"])
def test_gltf_is_placed_by_its_nodes_and_textured(tmp_path, name):
    path = gltf(tmp_path, name)
    user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, str(path), 0.5, "z", "y")
    (mesh,) = road_user_meshes(user)
    # Two boxes of 4 × 2 × 1.5 m in a row, once doubled and once halved.
    np.testing.assert_allclose(bounding_box(mesh), [[-4, -1, 0], [4, 1, 1.5]], atol=1e-6)
    assert len(mesh) == 2
    assert mesh[0].texture is mesh[1].texture
    assert (mesh[0].texture == [250, 0, 0]).all()


def test_gltf_reads_nothing_outside_of_its_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    path = gltf(inside, "box.gltf")
    (tmp_path / "box.bin").write_bytes((inside / "a box.bin").read_bytes())
    (inside / "link.bin").symlink_to(tmp_path / "box.bin")
    for uri in ("../box.bin", str(tmp_path / "box.bin"), "link.bin", "file:///etc/passwd"):
        gltf(inside, "box.gltf", buffers=[{"byteLength": 1, "uri": uri}])
        assert referred_files(path) == ()
        with pytest.raises(ValueError, match=r"road_user\.mesh: .*cannot be read"):
            load_mesh(str(path), 0.5)


@pytest.mark.parametrize(
    "changes",
    [
        {"accessors": [{"componentType": 5126, "count": 10**12, "type": "VEC3"}]},
        {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}]},
        {"nodes": [{"mesh": 0}] * 10_001},
        {"nodes": [{"children": [0]}]},
        {"meshes": 3},
        {"scenes": [{"nodes": [7]}]},
    ],
)
def test_gltf_that_is_too_large_or_damaged_gives_one_line(tmp_path, changes):
    path = gltf(tmp_path, "box.glb", **changes)
    with pytest.raises(ValueError, match=r"^road_user\.mesh: .*box\.glb.* cannot be read"):
        load_mesh(str(path), 0.5)


@pytest.mark.parametrize(
    ("unit", "scale"), [("millimetres", 0.001), ("centimetres", 0.01), ("inches", 0.0254)]
)
def test_a_mesh_in_another_unit_gets_the_scale_to_set(tmp_path, unit, scale):
    path = tmp_path / OBJ
    path.write_text(box(OBJ, lambda v: [x / scale for x in v]))
    with pytest.raises(ValueError, match=f"in {unit}, set road_user.mesh_scale={scale} "):
        load_mesh(str(path), 0.5)


def test_the_axis_that_is_up(tmp_path):
    """The box of `BOX` with its height along y and its length along x; along z: a glTF above."""
    path = tmp_path / OBJ
    path.write_text(box(OBJ, lambda v: (v[0], v[2], -v[1])))
    user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, str(path), 1.0, "x", "y")
    found = bounding_box(road_user_meshes(user)[0])
    np.testing.assert_allclose(found, [[-2, -1, 0], [2, 1, 1.5]], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "up", "doubt"),
    [
        (lambda v: v, "z", None),
        (lambda v: (v[0], v[1], v[2] - 0.75), "z", None),
        (lambda v: (v[0], v[2], -v[1]), "y", None),
        (lambda v: (v[0], v[2], -v[1]), "z", "set road_user.mesh_up=y"),
        (lambda v: v, "y", "set road_user.mesh_up=z"),
        (lambda v: (v[0], v[1], v[2] + 1.0), "z", "is 1.00 m above the ground"),
    ],
)
def test_a_mesh_that_lies_or_floats_gets_a_line(tmp_path, change, up, doubt):
    path = tmp_path / OBJ
    path.write_text(box(OBJ, change))
    found = mesh_doubt(str(path), 1.0, up)
    assert found is None if doubt is None else doubt in found
    assert doubt is None or found.startswith("road_user.mesh: ")


def test_gltf_has_y_up(tmp_path):
    assert "road_user.mesh_up=y" in mesh_doubt(str(gltf(tmp_path, "box.glb")), 0.5, "z")
    assert mesh_doubt(str(gltf(tmp_path, "box.glb")), 0.5, "y") is None


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps").mkdir()
    for name in ("maps/body.png", "a b.png", "data.bin", "beside.png"):
        (tmp_path / name).write_bytes(b"1")
    (tmp_path / "car.mtl").write_text(
        "newmtl a\nmap_Kd -clamp on maps\\body.png\nmap_Bump a b.png\nKd 1 1 1\nmap_Ka none.png\n"
    )
    (tmp_path / "car.obj").write_text("# a car\nmtllib none.mtl car.mtl\nv 0 0 0\n")
    return tmp_path


def names(folder: Path, mesh: str) -> set[str]:
    return {str(path.relative_to(folder)) for path in referred_files(folder / mesh)}


def test_referred_files_lists_existing_references(folder):
    assert names(folder, "car.obj") == {"car.mtl", "maps/body.png", "a b.png"}
    tree = {"buffers": [{"uri": "data.bin"}, {"uri": "data:text/plain,a"}]}
    tree["images"] = [{"uri": "a%20b.png"}, {"bufferView": 1}]
    (folder / "car.gltf").write_text(json.dumps(tree))
    assert names(folder, "car.gltf") == {"data.bin", "a b.png"}
    (folder / "car.ply").write_bytes(b"ply\ncomment TextureFile a b.png\nend_header\n\xff\x00")
    assert names(folder, "car.ply") == {"a b.png"}


@pytest.mark.parametrize(
    "mesh", ["none.obj", "car.stl", "bad.gltf", "deep.gltf", "maps", "fifo.obj", "zero.mtl"]
)
def test_referred_files_is_empty_without_references(folder, mesh):
    (folder / "car.stl").write_bytes(b"solid car")
    (folder / "bad.gltf").write_text("[")
    (folder / "deep.gltf").write_text("[" * 100_000)
    (folder / "zero.mtl").symlink_to("/dev/zero")
    os.mkfifo(folder / "fifo.obj")
    assert names(folder, mesh) == set()


def test_changed_texture_changes_the_keys_of_stages_that_read_the_mesh(folder):
    def keys():
        overrides = [f"road_user.mesh={folder / 'car.obj'}"]
        composition = compose(overrides)
        count = composition.scan_count
        return GraphBuilder().build(pipeline_stages(composition), count, count).stages

    before = keys()
    (folder / "beside.png").write_bytes(b"2")
    assert keys() == before
    (folder / "maps/body.png").write_bytes(b"2")
    after = keys()
    assert after["render"] != before["render"] and after["scenario"] != before["scenario"]
    assert after["ego_motion"] == before["ego_motion"]
    (folder / "car.obj").write_text("v 1 0 0\n")
    assert keys()["scenario"] != after["scenario"]
