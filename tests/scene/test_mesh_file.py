import json
import os
import struct
import sys
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.engine.graph import build_graph
from stixel_cli.experiment.stages import pipeline_stages, scan_count
from stixel_cli.scene import mesh_file, open3d_import
from stixel_cli.scene.contours import outline
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.mesh_file import load_mesh, referred_files
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.road_user import road_user_meshes

WEDGE = """{header}v 1 1 3
v 3 1 3
v 1 2 3
v 1 1 4
{uvs}f {f1}
f {f2}
f {f3}
f {f4}
"""


def wedge(header="", uvs="", corner="{0}"):
    faces = [(1, 3, 2), (1, 2, 4), (2, 3, 4), (3, 1, 4)]
    texts = {
        f"f{i + 1}": " ".join(corner.format(vertex) for vertex in face)
        for i, face in enumerate(faces)
    }
    return WEDGE.format(header=header, uvs=uvs, **texts)


def test_user_mesh_is_placed_on_the_ground_and_keeps_its_size(tmp_path):
    path = tmp_path / "wedge.obj"
    path.write_text(wedge())
    mesh = road_user_meshes(RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, str(path), 1.0, "x"))[0]
    np.testing.assert_allclose(bounding_box(mesh), [[-1, -0.5, 0], [1, 0.5, 1]], atol=1e-9)
    contour = outline(corners(mesh))
    assert {tuple(point) for point in np.round(contour, 3)} == {(-1, -0.5), (1, -0.5), (-1, 0.5)}


def test_user_mesh_keeps_its_texture_upright(tmp_path):
    import cv2

    image = np.zeros((6, 6, 3), np.uint8)
    image[:3], image[3:] = (0, 0, 255), (255, 0, 0)  # BGR: red above, blue below
    cv2.imwrite(str(tmp_path / "image.png"), image)
    (tmp_path / "wedge.mtl").write_text("newmtl coat\nmap_Kd image.png\n")
    uvs = "vt 0 0.1\nvt 1 0.1\nvt 0.5 0.1\nvt 0.5 0.9\nusemtl coat\n"
    path = tmp_path / "wedge.obj"
    path.write_text(wedge("mtllib wedge.mtl\n", uvs, "{0}/{0}"))
    (part,) = load_mesh(str(path), 0.5).parts
    assert part.texture.shape == (8, 8, 3)
    heights = part.vertices[part.triangles][:, :, 2]
    rows = np.floor(part.uvs[:, :, 1] * 8).astype(int)
    above, below = rows[heights > 0.5], rows[heights < 0.5]
    assert (part.texture[above, 0] == [255, 0, 0]).all()
    assert (part.texture[below, 0] == [0, 0, 255]).all()


def test_a_texture_that_is_too_large_to_decode_gives_a_one_line_error(tmp_path):
    size = struct.pack(">IIBBBBB", 40000, 40000, 8, 2, 0, 0, 0)
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in ((b"IHDR", size), (b"IDAT", zlib.compress(b"")))
    ]
    (tmp_path / "image.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    (tmp_path / "wedge.mtl").write_text("newmtl coat\nmap_Kd image.png\n")
    path = tmp_path / "wedge.obj"
    path.write_text(wedge("mtllib wedge.mtl\nusemtl coat\n"))
    with pytest.raises(ValueError, match=r"image\.png.*more than 89 million pixels"):
        load_mesh(str(path), 0.5)


def test_user_mesh_keeps_vertex_colours(tmp_path):
    path = tmp_path / "wedge.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        "1 1 3 250 10 10\n3 1 3 250 10 10\n1 2 3 250 10 10\n1 1 4 250 10 10\n"
        "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    )
    (part,) = load_mesh(str(path), 0.5).parts
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
    return (
        f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\n"
        f"end_header\n{lines}"
    )


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


SHORT = {
    "vertex.ply": box(PLY).replace("-2 -1 1.5\n", "-2 -1\n"),
    "vertex.off": box(OFF).replace("-2 -1 1.5\n", "-2 -1\n"),
    "head.off": box(OFF).replace("OFF", "\ufeffOFF"),
}


@pytest.mark.parametrize("name", SHORT)
def test_a_short_line_gives_a_mesh_or_one_line(tmp_path, capfd, name):
    path = tmp_path / name
    path.write_text(SHORT[name])
    with suppress(ValueError):
        load_mesh(str(path), 0.5)  # the first ends the process inside of Open3D
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("ending", ["import os; os.abort()", "print('a second line'); 1 / 0"])
def test_a_library_that_dies_or_speaks_gives_one_line(tmp_path, monkeypatch, capfd, ending):
    monkeypatch.setattr(mesh_file, "COMMAND", (sys.executable, "-c", ending))
    path = tmp_path / OBJ
    path.write_text(box(OBJ))
    with pytest.raises(ValueError, match=r"^road_user\.mesh: Open3D .*box\.obj") as caught:
        load_mesh(str(path), 0.5)
    assert "\n" not in str(caught.value)
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
        ({"change": lambda v: (v[0], v[0], v[2])}, r"no area seen from above \(z must be up\)"),
        ({"change": lambda v: (*v[:2], v[2] * 1e6)}, r"is 4 × 2 × 1.5e\+06 m large"),
        ({"change": lambda v: [1e6 * x for x in v]}, r"is 4e\+06 × 2e\+06 × 1.5e\+06 m large"),
        ({"change": lambda v: ("nan", *v[1:])}, "is not finite|no triangles"),
        ({"change": lambda v: ("1e39", *v[1:])}, "is not finite|no triangles"),
        ({"last": (1, 7, 99)}, "has the vertex 99, counted from 0; the file has 8|no triangles"),
    )
]
DAMAGED += [
    (name, box(name, **change), message)
    for name in (OFF, PLY)
    for change, message in (
        ({"last": (1, 7, -9)}, "has the vertex -9, counted from 0; the file has 8 vertices"),
        ({"count": 2 * 10**9}, "declares 2000000000 elements, which a file of"),
        ({"count": -8}, "declares -8 elements"),
    )
]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent.obj", None, "file not found"),
        ("text.ply", "this is no mesh\n", "no triangles"),
        ("strange.xyz", "1 2 3\n", "no triangles"),
        ("empty.obj", "", "no triangles"),
        ("wide.off", "OFF \x008\x00 12 0\n", r"declares .x008.x00 elements"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "no triangles"),
        ("large.obj", wedge().replace("v 3 1 3", "v 3000 1 3"), "0.1 to 30 m"),
        ("small.obj", "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\n", "0.1 to 30 m"),
        *DAMAGED,
    ],
)
def test_invalid_user_mesh_gives_a_one_line_error(tmp_path, monkeypatch, name, text, message):
    # Here: a child process for each takes half a second.
    monkeypatch.setattr(mesh_file, "_read_in_child", open3d_import.read_mesh)
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        load_mesh(str(path), 0.5)
    assert str(caught.value).startswith("road_user.mesh: ")
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


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
    tree = {
        "buffers": [{"uri": "data.bin"}, {"uri": "data:text/plain,a"}],
        "images": [{"uri": "a%20b.png"}, {"bufferView": 1}],
    }
    (folder / "car.gltf").write_text(json.dumps(tree))
    assert names(folder, "car.gltf") == {"data.bin", "a b.png"}
    (folder / "car.ply").write_bytes(b"ply\ncomment TextureFile a b.png\nend_header\n\xff\x00")
    assert names(folder, "car.ply") == {"a b.png"}


@pytest.mark.parametrize(
    "mesh", ["none.obj", "car.stl", "bad.gltf", "deep.gltf", "maps", "fifo.obj", "zero.mtl"]
)
def test_referred_files_is_empty_without_references(folder, mesh):
    (folder / "car.stl").write_bytes(b"solid car.mtl")
    (folder / "bad.gltf").write_text("[")
    (folder / "deep.gltf").write_text("[" * 100_000)
    (folder / "zero.mtl").symlink_to("/dev/zero")
    os.mkfifo(folder / "fifo.obj")
    assert names(folder, mesh) == set()


def test_changed_texture_changes_the_keys_of_stages_that_read_the_mesh(folder):
    def keys():
        overrides = [f"road_user.mesh={folder / 'car.obj'}"]
        composition = compose(overrides)
        count = scan_count(composition)
        return build_graph(pipeline_stages(composition), count, count).stages

    before = keys()
    (folder / "beside.png").write_bytes(b"2")
    assert keys() == before
    (folder / "maps/body.png").write_bytes(b"2")
    after = keys()
    assert after["render"] != before["render"] and after["scenario"] != before["scenario"]
    assert after["ego_motion"] == before["ego_motion"]
