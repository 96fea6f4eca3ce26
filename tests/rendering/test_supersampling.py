from dataclasses import replace

import numpy as np
import pytest
from box_scene import AHEAD, RAYCAST, RIG, objects, quad, scenario, speckle, target_mesh
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.rendering import supersampling, tracing
from stixel_cli.rendering.placement import (
    Camera,
    numbered_objects,
    rig_cameras,
    world_from_target_3d,
)
from stixel_cli.rendering.raycast import StaticScene, Target
from stixel_cli.rendering.supersampling import Centres, rasterised, sample_offsets, supersampled
from stixel_cli.rendering.surfaces import build_surfaces
from stixel_cli.rendering.tracing import Body, Shot
from stixel_cli.scene.mesh import Part
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes

POSE = np.array([0.0, 0.0, AHEAD])


def street() -> tuple[list[Body], Camera]:
    """The shipped street and a car in it, from the left camera."""
    static = build_surfaces(numbered_objects(World("street", 1, 1.0)))
    car = RoadUser("car", 4.5, 1.8, 1.5, 1.0, None, None, 1.0, "x")
    pose = world_from_target_3d(np.array([-1.0, 9.0, 0.4]))
    bodies = (Body(static, np.eye(4)), Body(build_surfaces([(2, road_user_meshes(car)[0])]), pose))
    return Shot(bodies, rig_cameras(RIG, POSE)[0])


def agreement(shot, rows, columns, samples) -> tuple[float, float]:
    """Shares of the samples in which rasteriser and ray caster meet the same triangle, and with
    the same depth."""
    right, down = sample_offsets(samples)
    inverse, found = rasterised(shot, rows, columns, (right, down))
    u, v = np.add.outer(columns, right).ravel(), np.add.outer(rows, down).ravel()
    hits = tracing.nearest(shot, u, v)
    number = hits.triangle + np.where(hits.body == 1, len(shot.bodies[0].surfaces.corners), 0)
    assert np.array_equal(found.ravel() >= 0, inverse.ravel() > 0)
    near = np.abs(inverse.ravel() - 1.0 / hits.depth) <= 1e-5 * inverse.ravel()
    return (found.ravel() == number).mean(), near.mean()


def test_the_rasteriser_meets_the_triangles_that_the_ray_caster_meets():
    shot = street()
    camera = shot.camera
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    same, near = agreement(shot, rows, columns, 2)
    assert same >= 0.9999 and near >= 0.9999
    # Of some pixels only, in any number of samples.
    some = np.random.default_rng(0).random(len(rows)) < 0.1
    same, near = agreement(shot, rows[some], columns[some], 8)
    assert same >= 0.9999 and near >= 0.9999


@given(st.integers(0, 10_000))
def test_triangles_around_the_camera_are_rasterised_as_they_are_cast(seed):
    """Some are in front of it, some behind, and some reach from the one side to the other."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-6.0, 6.0, (40, 1, 3))
    points = (centres + random.normal(0.0, random.choice([0.3, 5.0]), (40, 3, 3))) + [0, 0, 1.2]
    one, uvs = np.array([[0, 1, 2]], dtype=np.int32), np.zeros((1, 3, 2))
    parts = [Part(corners, one, uvs, speckle(1), "triangle") for corners in points]
    body = Body(build_surfaces([(3, tuple(parts))]), np.eye(4))
    camera = rig_cameras(RIG, POSE)[0]
    shot = Shot((body,), camera)
    rows, columns = np.divmod(np.arange(0, camera.height * camera.width, 7), camera.width)
    same, near = agreement(shot, rows, columns, 2)
    # One sample of the thousands may be on an edge, where single precision decides for the other.
    assert same >= 0.9995 and near >= 0.9995


def test_two_triangles_with_a_common_edge_leave_no_sample_between_them():
    corners = [(-5, 6, -4), (5.3, 7, -4), (5.1, 7, 4.7), (-5.2, 6, 4.7)]
    body = Body(build_surfaces([(3, (quad(corners, speckle(1)),))]), np.eye(4))
    shot = Shot((body,), rig_cameras(replace(RIG, pitch=0.0), POSE)[0])
    rows, columns = (grid.ravel() for grid in np.mgrid[10:80, 20:100])
    _, found = rasterised(shot, rows, columns, sample_offsets(8))
    assert set(np.unique(found)) == {0, 1}


@pytest.fixture(scope="module")
def edges():
    """The box scene, and the values of all its pixels."""
    static, target = StaticScene(objects(), RIG, RAYCAST), Target([target_mesh()])
    camera = rig_cameras(RIG, POSE)[0]
    pose = world_from_target_3d(scenario().target_poses_world[0])
    shot = Shot((static.body, Body(target.surfaces(0), pose)), camera)
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    return shot, Centres(rows, columns, *seen(shot, columns, rows, 1.0))


def seen(shot, u, v, spread):
    """What is hit at pixels, whether the sun shines there, and the light."""
    hits = tracing.nearest(shot, u.astype(float), v.astype(float))
    lit = tracing.sunlit(shot, hits, (0, 1))
    return hits, lit, tracing.light_of(shot, hits, lit, spread)


def brute_force(shot, centres, samples) -> np.ndarray:
    """Every sample with a colour of its own, from rays."""
    right, down = sample_offsets(samples)
    u = np.add.outer(centres.columns, right).ravel()
    v = np.add.outer(centres.rows, down).ravel()
    _, _, light = seen(shot, u, v, 1.0 / samples)
    return light.reshape(len(centres.rows), -1, 3).mean(axis=1)


def test_more_samples_come_nearer_to_the_mean_over_the_pixel(edges):
    shot, centres = edges
    _, found = rasterised(shot, centres.rows, centres.columns, sample_offsets(4))
    mixed = np.flatnonzero((found != found[:, :1]).any(axis=1))
    assert len(mixed) > 300
    centres, at_shadow = centres.at(mixed), np.zeros(len(mixed), dtype=bool)
    exact = brute_force(shot, centres, 12)
    means = [supersampled(shot, centres, at_shadow, samples) for samples in (1, 2, 4, 8)]
    errors = [np.sqrt(((mean - exact) ** 2).mean()) for mean in means]
    assert errors[1] < 0.6 * errors[0] and errors[2] < 0.6 * errors[1] and errors[3] < errors[2]
    # It is nearer than few samples that are all shaded.
    alone = brute_force(shot, centres, 2)
    assert errors[3] < 0.65 * np.sqrt(((alone - exact) ** 2).mean())


def test_a_shadows_edge_inside_a_triangle_is_blended(edges):
    shot, centres = edges
    exact = brute_force(shot, centres, 4)
    _, found = rasterised(shot, centres.rows, centres.columns, sample_offsets(4))
    one = (found == found[:, :1]).all(axis=1) & (found[:, 0] >= 0)
    unlike = np.flatnonzero(one & (np.abs(exact - centres.light).max(axis=1) > 0.1))
    assert len(unlike) > 15
    some = centres.at(unlike)
    at_shadow = np.ones(len(unlike), dtype=bool)
    blended = supersampled(shot, some, at_shadow, 8)
    before, after = (np.abs(light - exact[unlike]).mean() for light in (some.light, blended))
    assert after < 0.5 * before


def test_neither_the_size_of_a_block_nor_no_pixels_matter(edges, monkeypatch):
    shot, centres = edges
    some = centres.at(np.s_[4000:4500])
    at_shadow = np.arange(500) % 3 == 0
    whole = supersampled(shot, some, at_shadow, 4)
    monkeypatch.setattr(supersampling, "BLOCK", 16 * 7)
    assert supersampled(shot, some, at_shadow, 4).tobytes() == whole.tobytes()
    none = centres.at(np.s_[:0])
    result = supersampled(shot, none, np.zeros(0, dtype=bool), 8)
    assert result.shape == (0, 3)


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 8])
def test_samples_are_spread_over_the_pixel(samples):
    right, down = sample_offsets(samples)
    expected = (np.arange(samples**2) + 0.5) / samples**2 - 0.5
    assert np.allclose(np.sort(right), expected) and np.allclose(np.sort(down), expected)
