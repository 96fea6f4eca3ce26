"""`road_user.shape_seed` draws bodies within the class."""

import zlib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import scene_presets
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.scene.contours import outline
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.road_user import road_user_meshes

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


def test_shape_seed_with_a_mesh_is_refused(tmp_path):
    file = tmp_path / "own.obj"
    file.write_text("")
    road_user = replace(scene_presets.road_user("car"), mesh=str(file), shape_seed=1)
    with pytest.raises(ValueError, match=r"road_user\.shape_seed.*road_user\.mesh"):
        road_user.check()
    replace(road_user, shape_seed=None).check()
