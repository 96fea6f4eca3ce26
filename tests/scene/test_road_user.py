from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np
import pytest
import scene_presets

from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.road_user import road_user_meshes


def parameters(kind="car", **changes):
    return replace(scene_presets.road_user(kind), **changes)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("size", [None, (3.3, 1.1, 2.0)])
def test_bounding_box_has_the_given_size(kind, size):
    road_user = parameters(kind)
    if size is not None:
        road_user = replace(road_user, length=size[0], width=size[1], height=size[2])
    low, high = bounding_box(*road_user_meshes(road_user))
    half = 0.5 * np.array([road_user.length, road_user.width])
    np.testing.assert_allclose(low, [*-half, 0.0], atol=1e-12)
    np.testing.assert_allclose(high, [*half, road_user.height], atol=1e-12)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_road_user_parts_meet_the_requirements_of_the_renderers(kind):
    mesh = road_user_meshes(parameters(kind))[0]
    assert len({part.name for part in mesh}) == len(mesh) >= 5
    assert len(corners(mesh)) < 8000
    for part in mesh:
        assert part.vertices.dtype == np.float64 and part.vertices.shape[1:] == (3,)
        assert part.triangles.dtype == np.int32 and part.triangles.shape[1:] == (3,)
        assert part.triangles.min() >= 0 and part.triangles.max() < len(part.vertices)
        assert part.uvs.shape == (len(part.triangles), 3, 2) and np.isfinite(part.uvs).all()
        assert part.texture.dtype == np.uint8 and part.texture.shape[2] == 3
        assert all(side & (side - 1) == 0 for side in part.texture.shape[:2])


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_triangles_face_outwards(kind):
    """The signed volume of every closed piece is positive; windows and cabin close together."""
    parts = {part.name: part for part in road_user_meshes(parameters(kind))[0]}
    groups = [[name] for name in parts if name not in ("cabin", "windows")]
    for names in groups:
        for triangles in _pieces(parts[names[0]].triangles):
            points = parts[names[0]].vertices[triangles]
            points = points - points.mean(axis=(0, 1))
            volume = np.einsum("ti,ti->", points[:, 0], np.cross(points[:, 1], points[:, 2]))
            assert volume > 0.0, names


def _pieces(triangles):
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    size = triangles.max() + 1
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(size, size))
    label = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return [triangles[label == number] for number in np.unique(label)]


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_contrast_changes_paint_and_cloth(kind):
    def std(contrast):
        part = road_user_meshes(parameters(kind, contrast=contrast))[0][0]
        return part.texture.astype(float).std(axis=(0, 1)).max()

    plain, middling, strong = map(std, (0.0, 0.5, 1.0))
    assert plain == 0.0
    assert 5.0 < middling < strong


def test_paint_has_detail_at_short_and_long_range():
    """Averaged over squares of 2 mm … 14 cm the paint still varies: stereo matches on it."""
    texture = road_user_meshes(parameters("car"))[0][0].texture.mean(axis=2)
    for square in (1, 4, 16, 64):
        side = len(texture) // square
        averaged = texture.reshape(side, square, side, square).mean(axis=(1, 3))
        assert averaged.std() > 3.0


def test_every_class_has_a_mesh_of_its_own():
    kinds = get_args(get_type_hints(RoadUser)["kind"])
    users = [RoadUser(kind, 2.0, 1.0, 1.5, 0.6, None, None, 1.0, "x") for kind in kinds]
    meshes = [road_user_meshes(user)[0] for user in users]
    assert len({corners(mesh).tobytes() for mesh in meshes}) == len(kinds)


def test_missing_mesh_file_is_rejected_before_the_run():
    road_user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, "nowhere/mesh.ply", 1.0, "x")
    with pytest.raises(ValueError, match=r"road_user\.mesh: file not found"):
        road_user.check()


def test_a_built_in_shape_is_not_scaled_or_turned_by_keys_of_a_mesh():
    for scale, forward in ((0.001, "x"), (1.0, "-y")):
        road_user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, None, scale, forward)
        with pytest.raises(ValueError, match=r"give road_user\.mesh=FILE"):
            road_user.check()
