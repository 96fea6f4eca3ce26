import numpy as np
import pytest

from stixel_cli.scene.contour import ground_contour
from stixel_cli.scene.mesh import bounding_box
from stixel_cli.scene.mesh_file import load_mesh
from stixel_cli.scene.road_user import road_user_mesh
from stixel_cli.scene.road_user_parameters import RoadUser

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


def test_the_users_mesh_is_put_on_the_ground_and_keeps_its_size(tmp_path):
    path = tmp_path / "wedge.obj"
    path.write_text(wedge())
    mesh = road_user_mesh(RoadUser("car", 4.5, 1.8, 1.5, 0.6, str(path)))
    np.testing.assert_allclose(bounding_box(mesh), [[-1, -0.5, 0], [1, 0.5, 1]], atol=1e-9)
    contour = ground_contour(mesh)
    assert {tuple(point) for point in np.round(contour, 3)} == {(-1, -0.5), (1, -0.5), (-1, 0.5)}


def test_a_texture_is_kept_the_right_way_up(tmp_path):
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


def test_vertex_colours_are_kept(tmp_path):
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


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent.obj", None, "there is no file"),
        ("text.ply", "this is no mesh\n", "no triangles"),
        ("strange.xyz", "1 2 3\n", "no triangles"),
        ("empty.obj", "", "no triangles"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "no triangles"),
        ("large.obj", wedge().replace("v 3 1 3", "v 3000 1 3"), "0.1 to 30 m"),
        ("small.obj", "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\n", "0.1 to 30 m"),
    ],
)
def test_what_cannot_be_a_road_user_is_refused_in_one_line(tmp_path, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        load_mesh(str(path), 0.5)
    assert str(caught.value).startswith("road_user.mesh: ")
    assert "\n" not in str(caught.value)
