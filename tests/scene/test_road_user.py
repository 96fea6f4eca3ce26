"""Road users: their meshes, and bodies drawn within the class by `road_user.shape_seed`."""

import zlib
from collections import Counter
from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np
import pytest
import scene_presets
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.scene.contours import outline
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
def test_meshes_meet_the_requirements_of_the_renderers_and_face_outwards(kind):
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
    # The signed volume of every closed piece is positive; windows and cabin close together.
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


def test_mesh_files_their_keys_and_a_shape_seed_are_checked_before_the_run(tmp_path):
    road_user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, "nowhere/mesh.ply", 1.0, "x")
    with pytest.raises(ValueError, match=r"road_user\.mesh: file not found"):
        road_user.check()
    for scale, forward in ((0.001, "x"), (1.0, "-y")):
        road_user = RoadUser("car", 4.5, 1.8, 1.5, 0.6, None, None, scale, forward)
        with pytest.raises(ValueError, match=r"give road_user\.mesh=FILE"):
            road_user.check()
    file = tmp_path / "own.obj"
    file.write_text("")
    road_user = replace(scene_presets.road_user("car"), mesh=str(file), shape_seed=1)
    with pytest.raises(ValueError, match=r"road_user\.shape_seed.*road_user\.mesh"):
        road_user.check()
    replace(road_user, shape_seed=None).check()


SIZES = {
    # least and greatest length, width, height, m
    "car": ((3.6, 1.55, 1.36), (5.1, 2.05, 2.0)),
    "cyclist": ((1.6, 0.4, 1.5), (2.0, 0.8, 2.05)),
    "pedestrian": ((0.4, 0.3, 1.5), (1.05, 0.75, 1.96)),
}


def drawn(kind, seed):
    return road_user_meshes(replace(scene_presets.road_user(kind), shape_seed=seed))


@pytest.mark.parametrize("kind", SIZES)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**63 - 1))
def test_drawn_shapes_are_closed_and_have_plausible_sizes(kind, seed):
    meshes = drawn(kind, seed)
    low, high = bounding_box(*meshes)
    least, greatest = SIZES[kind]
    assert (high - low >= least).all() and (high - low <= greatest).all()
    np.testing.assert_allclose(low + high, [0.0, 0.0, high[2]], atol=1e-9)
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    for mesh in (meshes[0], meshes[len(meshes) // 3]):
        for part in mesh:
            assert np.isfinite(part.vertices).all()
            # The cabin and its windows close together with the body.
            if part.name not in ("cabin", "windows"):
                assert _is_closed(part.triangles), part.name


def _is_closed(triangles):
    """Every edge is used once in each direction."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ahead = Counter(map(tuple, edges.tolist()))
    return max(ahead.values()) == 1 and all(edge[::-1] in ahead for edge in ahead)


@pytest.mark.parametrize("kind", SIZES)
def test_same_seed_same_bytes_and_other_seeds_other_contours(kind):
    from stixel_cli.scene.road_user import _built_in

    first = corners(drawn(kind, 1000)[0]).tobytes()
    _built_in.cache_clear()
    assert corners(drawn(kind, 1000)[0]).tobytes() == first
    one, other = (shapely.Polygon(outline(corners(drawn(kind, seed)[0]))) for seed in (1000, 1001))
    assert one.intersection(other).area / one.union(other).area < 0.97


def test_null_keeps_the_car_of_earlier_versions():
    """Checksum of the corners in micrometres, from the revision before `shape_seed` existed."""
    (mesh,) = road_user_meshes(scene_presets.road_user("car"))
    steps = np.rint(1e6 * corners(mesh)).astype("<i8")
    assert zlib.crc32(steps.tobytes()) == 93015083


def test_cars_have_round_wheels_and_lengths_over_the_whole_range():
    lengths = []
    for seed in range(1000, 1024):
        (mesh,) = drawn("car", seed)
        lengths.append(np.ptp(bounding_box(mesh)[:, 0]))
        tyres = next(part.vertices for part in mesh if part.name == "tyres")
        front_left = tyres[: len(tyres) // 4]
        assert np.ptp(front_left[:, 0]) == pytest.approx(0.64, abs=1e-9)
    assert min(lengths) < 4.1 and max(lengths) > 4.8
