import dataclasses
from dataclasses import replace

import box_scene
import numpy as np
import pytest
from box_scene import RAYCAST, RIG, objects, quad, road, scenario, speckle, target_mesh
from constants import with_constants
from hypothesis import given
from hypothesis import strategies as st
from projection import unproject

from stixel_cli.rendering import placement, raycast, tracing
from stixel_cli.rendering.frames import ROAD_ID, SKY_ID, TARGET_ID
from stixel_cli.rendering.placement import NEAR, rig_cameras, world_from_target_3d
from stixel_cli.rendering.raycast import StaticScene, Target, render_frame
from stixel_cli.rendering.shading import shade
from stixel_cli.rendering.surfaces import (
    RayTree,
    build_surfaces,
    build_textures,
    linear_from_srgb,
    srgb_from_linear,
)
from stixel_cli.rendering.tracing import Body, Shot
from stixel_cli.scene.mesh import scaled
from stixel_cli.scene.parameters import World

POSE = np.array([0.0, 0.0, box_scene.AHEAD])


@pytest.fixture(scope="module")
def target():
    return Target([target_mesh()])


@pytest.fixture
def static():
    return StaticScene(objects(), RIG, RAYCAST)


def same(one, other) -> bool:
    return all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("moving", [False, True])
def test_frame_bytes_do_not_depend_on_chunk_or_partial_rendering(target, moving, monkeypatch):
    motion = scenario(4, moving)
    chunk = StaticScene(objects(), RIG, RAYCAST)
    frames = [render_frame(chunk, target, motion, k) for k in range(4)]
    alone = [
        render_frame(StaticScene(objects(), RIG, RAYCAST), target, motion, k)
        for k in reversed(range(4))
    ][::-1]
    all_pixels = (0, RIG.height, 0, RIG.width)
    monkeypatch.setattr(raycast, "_touched_rectangles", lambda *_: (all_pixels, all_pixels))
    whole = [render_frame(chunk, target, motion, k) for k in range(4)]
    for k in range(4):
        assert same(frames[k], alone[k])
        assert same(frames[k], whole[k])


def test_render_does_not_depend_on_the_chunks(monkeypatch):
    world = [mesh for _, mesh in objects()]
    monkeypatch.setattr("stixel_cli.rendering.placement.world_objects", lambda _: world)
    monkeypatch.setattr(raycast, "road_user_meshes", lambda _: [target_mesh()])
    # A world of no other test: what is built of a world is remembered.
    rest = {"scenario": scenario(), "road_user": None, "world": World("street", 601, 1.0)}
    rest |= {"rig": RIG, "renderer": RAYCAST}
    together = raycast.render(**rest, frames=range(4))
    for first, frames in ((0, range(2)), (2, range(2, 4))):
        part = raycast.render(**rest, frames=frames)
        assert part.first == first
        for name in ("left", "right", "depth_high", "depth_low", "ids"):
            encoded = getattr(together, name).encoded[first : first + 2]
            assert getattr(part, name).encoded == encoded


def test_frame_shows_the_limbs_in_their_pose(static):
    """As a rigid target does that has the vertices of that pose."""
    still = target_mesh()
    stretched = scaled(still, np.array([0.5, 1.2, 1.5]))
    both = Target([still, stretched])
    motion = replace(scenario(2), limb_poses=np.array([0, 1]))
    for k, mesh in enumerate((still, stretched)):
        alone = render_frame(static, Target([mesh]), scenario(2), k)
        assert same(render_frame(static, both, motion, k), alone)


def test_depth_and_ids_match_the_planes_and_objects(static, target):
    left, right, depth, ids = render_frame(static, target, scenario(), 0)
    assert left.shape == right.shape == (96, 128, 3)
    assert {SKY_ID, ROAD_ID, TARGET_ID, 3, 4, 5} == set(np.unique(ids))
    assert np.all(np.isinf(depth) == (ids == SKY_ID))
    # Camera points to the world: the road at z = 0, the wall's face at y = 20.
    v, u = np.mgrid[:96, :128]
    disparity = RIG.disparity_from_depth(np.where(np.isinf(depth), 1.0, depth))
    camera = unproject(RIG, np.stack([u, v, disparity], axis=-1).reshape(-1, 3))
    transform = RIG.world_from_camera(POSE)
    world = (camera @ transform[:3, :3].T + transform[:3, 3]).reshape(96, 128, 3)
    assert np.abs(world[ids == ROAD_ID][:, 2]).max() < 1e-9
    house = world[ids == 3]
    assert np.abs(house[house[:, 2] < 5.9][:, 1] - 20.0).max() < 1e-9
    # Every point of the target lies on its box or its antenna.
    pose = world_from_target_3d(scenario().target_poses_world[0])
    points = (world[ids == TARGET_ID] - pose[:3, 3]) @ pose[:3, :3]
    low, high = np.array([-1.5, -0.7, 0.2]), np.array([1.5, 0.7, 1.6])
    assert np.all(points > low - 1e-6) and np.all(points < high + 1e-6)
    distance = np.abs(np.concatenate([points - low, points - [1.5, 0.7, 0.8]], axis=1)).min(axis=1)
    on_body = points[:, 2] < 0.8 + 1e-6
    assert np.all(distance[on_body] < 1e-6)
    assert on_body.sum() > 300


def test_every_second_row_of_an_image_with_pixels_twice_as_tall(target):
    """f_v = f_u / 2 sees in row v0 + k what square pixels see in row v0 + 2 k."""
    square = dataclasses.replace(RIG, principal_v=48.0)
    half = 2.0 * np.degrees(np.arctan(24.0 / (0.5 * square.focal)))
    tall = dataclasses.replace(square, height=48, principal_v=24.0, vertical_fov=half)
    assert tall.focal_v == pytest.approx(0.5 * square.focal)
    scenes = [StaticScene(objects(), rig, RAYCAST) for rig in (square, tall)]
    frames = [render_frame(scene, target, scenario(), 0) for scene in scenes]
    (left, _, depth, ids), (tall_left, _, tall_depth, tall_ids) = frames
    assert (tall_ids == ids[::2]).mean() > 0.999  # a ray may just touch an edge
    alike = tall_ids == ids[::2]
    np.testing.assert_allclose(tall_depth[alike], depth[::2][alike], rtol=1e-6)
    # A tall pixel covers one row and half of either neighbour.
    linear = linear_from_srgb(left)
    mean = 0.25 * linear[1:-2:2] + 0.5 * linear[2:-1:2] + 0.25 * linear[3::2]
    error = np.abs(tall_left[1:] - srgb_from_linear(mean).astype(float)).mean(axis=-1)
    assert np.median(error) < 1.0 and error.mean() < 3.0  # texture filters differ


def test_right_view_is_the_left_view_shifted_by_the_true_disparity(static, target):
    left, right, depth, ids = render_frame(static, target, scenario(), 0)
    v, u = np.mgrid[:96, :128]
    near = (ids == TARGET_ID) | (ids == ROAD_ID)
    column = u - np.where(near, RIG.disparity_from_depth(depth), 0.0)
    inside = near & (column > 1) & (column < 126)
    start = np.floor(column).astype(int)
    share = (column - start)[inside][:, None]
    row, start = v[inside], start[inside]
    expected = (1 - share) * right[row, start] + share * right[row, start + 1]
    error = np.abs(left[inside] - expected).mean(axis=1)
    # Occluded pixels and edges aside, only the interpolation differs.
    assert np.median(error) < 4.0


def test_target_shadow_darkens_only_shadowed_pixels(static, target):
    camera = rig_cameras(RIG, POSE)[0]
    lit = static.views(POSE)[0]
    picture, _, _, ids = render_frame(static, target, scenario(), 0)
    sun = placement.SUN
    pose = world_from_target_3d(scenario().target_poses_world[0])
    above = pose[:3, :3] @ np.array([0.0, 0.0, 0.5]) + pose[:3, 3]
    # The point of the road whose way to the sun leads through the middle of the body.
    ground = above - above[2] / sun[2] * sun
    ground_further = ground - 0.25 * sun * [1, 1, 0]
    u, v, _ = np.rint(camera.project(np.stack([ground, ground_further]))).astype(int).T
    empty = srgb_from_linear(lit.light).reshape(96, 128, 3)
    shadowed = [(r, c) for r, c in zip(v, u, strict=True) if ids[r, c] == ROAD_ID]
    assert shadowed
    for r, c in shadowed:
        assert picture[r, c].mean() < 0.75 * empty[r, c].mean()
    untouched = np.s_[60:, :20]
    assert np.array_equal(picture[untouched], empty[untouched])


def test_sunlit_plane_does_not_shadow_itself():
    static = StaticScene([(ROAD_ID, road(speckle(1)))], RIG, RAYCAST)
    view = static.views(POSE)[0]
    assert np.array_equal(view.centres.lit, view.ids == ROAD_ID)


def test_edges_are_blended_and_thin_parts_between_pixel_centres_are_found(target):
    static = StaticScene([(ROAD_ID, road(speckle(1)))], RIG, RAYCAST)
    plain = StaticScene([(ROAD_ID, road(speckle(1)))], RIG, with_constants(RAYCAST, samples=1))
    far = scenario()
    far.target_poses_world[:] = [0.13, 14.0, 0.0]
    smooth = render_frame(static, target, far, 0)[0]
    coarse = render_frame(plain, target, far, 0)[0]
    # At 14 m the antenna is a fifth of a pixel wide.
    camera = rig_cameras(RIG, POSE)[0]
    u, v, _ = np.rint(camera.project(np.array([[0.13 - 0.99, 14.0, 1.35]])))[0].astype(int)
    rows, columns = slice(v - 3, v + 2), slice(u - 2, u + 3)
    touched = (smooth[rows, columns] != coarse[rows, columns]).any(axis=2)
    assert touched.any(axis=1).sum() >= 2
    assert (smooth != coarse).any(axis=2).mean() < 0.1


def test_distant_chequered_road_is_grey_without_moire():
    cells = np.indices((64, 64)).sum(axis=0) % 2
    texture = np.repeat((cells * 255).astype(np.uint8)[:, :, None], 3, axis=2)
    static = StaticScene([(ROAD_ID, road(texture, 120.0))], RIG, RAYCAST)
    view = static.views(POSE)[0]
    light = view.light.reshape(96, 128, 3)[55:, :, 0]
    # One sample a pixel would make it as large as the mean.
    assert light.std() < 0.05 * light.mean()


def wall(texture):
    """18 m × 14 m, 12 m ahead, on which the texture repeats three times."""
    return (quad([(-9, 12, -6), (9, 12, -6), (9, 12, 8), (-9, 12, 8)], texture, 3.0),)


def test_texture_is_averaged_over_the_pixel_area():
    """Brute force: many unfiltered samples in each pixel have the filter's mean and its values."""
    texture = speckle(9, 64)
    static = StaticScene([(3, wall(texture))], replace(RIG, pitch=0.0), RAYCAST)
    view = static.views(POSE)[0]
    pixels = np.flatnonzero(view.ids == 3)[::37]
    v, u = np.divmod(pixels, 128)
    offsets = (np.arange(16) + 0.5) / 16 - 0.5
    du, dv = (array.ravel() for array in np.meshgrid(offsets, offsets))
    uu, vv = np.add.outer(u, du).ravel(), np.add.outer(v, dv).ravel()
    rays = tracing.camera_rays(uu, vv, view.shot.camera.pinhole)
    points = rays[:, :3] + rays[:, 3:] * (12.0 / rays[:, 4])[:, None]
    columns = np.floor((points[:, 0] + 9) / 18 * 3 * 64).astype(int) % 64
    rows = np.floor((8 - points[:, 2]) / 14 * 3 * 64).astype(int) % 64
    mean = linear_from_srgb(texture)[rows, columns].reshape(len(pixels), -1, 3).mean(axis=1)
    ambient = placement.EXPOSURE * placement.AMBIENT * 0.5 * (0.86 + 0.36)
    red = ambient + placement.EXPOSURE * placement.SUNLIGHT * max(0.0, -placement.SUN[1])
    seen = view.centres.light[pixels, 0] / red
    assert np.corrcoef(seen, mean[:, 0])[0, 1] > 0.97
    assert abs(seen.mean() / mean[:, 0].mean() - 1.0) < 0.03


def test_texture_of_the_target_is_nearer_to_the_mean_over_the_pixel(monkeypatch):
    """Against 16 × 16 samples in each pixel; the same wall once with plain mip-maps."""
    meshes = road(speckle(1)), wall(speckle(9, 256))
    bodies = tuple(Body(build_surfaces([(3, mesh)]), np.eye(4)) for mesh in meshes)
    shot = Shot(bodies, rig_cameras(RIG, POSE)[0])
    rows, columns = np.divmod(np.arange(96 * 128), 128)
    hits = tracing.nearest(shot, columns.astype(float), rows.astype(float))
    seen = np.flatnonzero(hits.body == 1)[::7]

    def light(hits, spread):
        return tracing.light_of(shot, hits, np.ones(len(hits.u), dtype=bool), spread)[:, 0]

    offsets = (np.arange(16) + 0.5) / 16 - 0.5
    right, down = (array.ravel() for array in np.meshgrid(offsets, offsets))
    u = np.add.outer(columns[seen], right).ravel()
    v = np.add.outer(rows[seen], down).ravel()
    mean = light(tracing.nearest(shot, u, v), 1.0 / 16).reshape(len(seen), -1).mean(axis=1)
    errors = []
    for finer in (1, tracing.FINER_TARGET):
        monkeypatch.setattr(tracing, "FINER_TARGET", finer)
        found = light(hits.at(seen), 1.0)
        errors.append(np.sqrt(np.mean((found - mean) ** 2)))
    assert len(seen) > 100 and errors[1] < 0.8 * errors[0]


def test_shading_accepts_an_empty_list(static):
    surfaces = static.body.surfaces
    none, ids = np.empty(0), np.empty(0, dtype=np.int32)
    one, light = np.ones(3), np.empty((0, 3), dtype=np.float32)
    textures = surfaces.textures
    hits = tracing.Hits(none, none, none, ids.astype(np.int8), ids)
    samples = hits, np.empty(0, dtype=bool), none, 0, 1
    shade(
        light, samples, (np.eye(3), np.zeros(3), 1.0, 0.0, 0.0),
        (surfaces.normals, surfaces.uv_gradients, surfaces.texture),
        (textures.texels, textures.levels, textures.first_level), (one, one, one, one),
    )  # fmt: skip
    assert len(RayTree(np.eye(3), np.array([[0, 1, 2]])).blocked(np.empty((0, 6)))) == 0


@given(st.integers(0, 10_000))
def test_hull_rectangle_contains_every_pixel_of_the_hull(seed):
    random = np.random.default_rng(seed)
    camera = rig_cameras(RIG, POSE)[0]
    centre = random.uniform([-8, -6, 0], [8, 14, 2])
    points = centre + random.uniform(-4, 4, (8, 3))
    top, bottom, left, right = camera.rectangle_of(points, 0)
    weights = random.dirichlet(np.full(8, 0.3), 500)
    u, v, depth = camera.project(weights @ points).T
    shown = (depth > NEAR) & (u > -0.5) & (u < 127.5) & (v > -0.5) & (v < 95.5)
    u, v = np.rint(u[shown]), np.rint(v[shown])
    assert np.all((u >= left) & (u < right) & (v >= top) & (v < bottom))


def test_texture_sides_are_powers_of_two_and_srgb_is_invertible():
    values = np.arange(256, dtype=np.uint8)
    assert np.array_equal(srgb_from_linear(linear_from_srgb(values)), values)
    with pytest.raises(ValueError, match="powers of two"):
        build_textures([np.zeros((64, 48, 3), dtype=np.uint8)])
