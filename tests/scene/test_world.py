import numpy as np
import pytest
import scene_presets
import shapely

from stixel_cli.geometry.pose import world_from_target
from stixel_cli.scene.background import KERB, MARK, PAVEMENTS
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.parameters import World
from stixel_cli.scene.path import path_poses
from stixel_cli.scene.world import world_objects


@pytest.fixture(scope="module")
def objects():
    return world_objects(scene_presets.world())


@pytest.fixture(scope="module")
def obstacles(objects):
    """Hulls of the ground projections of all that stands, and the raised pavements."""
    hulls = [
        shapely.convex_hull(shapely.MultiPoint(corners(mesh).reshape(-1, 3)[:, :2]))
        for mesh in objects[1:]
    ]
    return shapely.union_all([*hulls, *(shapely.box(*rectangle) for rectangle in PAVEMENTS)])


def test_world_has_one_road_first_and_a_limited_size(objects):
    assert [mesh[0].name for mesh in objects].index("asphalt") == 0
    assert 30 < len(objects) < 200
    assert sum(len(corners(mesh)) for mesh in objects) < 40_000


def test_ground_is_large_flat_and_textured(objects):
    low, high = bounding_box(objects[0])
    assert (low[:2] <= -150).all() and (high[:2] >= 150).all()
    assert low[2] == 0.0 and high[2] == KERB
    asphalt, _, marks = objects[0][:3]
    assert asphalt.texture.astype(float).std() > 15.0
    assert (marks.vertices[:, 2] == MARK).all()
    for part in objects[0][:3]:
        points = part.vertices[part.triangles]
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        assert (normals[:, 2] > 0.0).all() and (normals[:, :2] == 0.0).all()


def test_background_surrounds_the_ego_car_on_the_ground(objects):
    boxes = [bounding_box(mesh) for mesh in objects[1:]]
    assert all(abs(low[2]) < 0.2 for low, _ in boxes)
    tall = shapely.union_all(
        [shapely.box(*low[:2], *high[:2]) for low, high in boxes if high[2] > 4]
    )
    for angle in np.radians(np.arange(0, 360, 5)):
        ray = shapely.LineString([(0, 0), (220 * np.cos(angle), 220 * np.sin(angle))])
        assert ray.intersects(tall)


def test_objects_above_four_metres_are_behind_the_target(objects):
    """In the default rig's view, past the default path, nearer than 50 m."""
    tall = [
        mesh[0].name
        for mesh in objects[1:]
        for low, high in [bounding_box(mesh)]
        if high[2] > 4.0 and 28.0 < low[1] < 50.0 and abs(0.5 * (low[0] + high[0])) < 0.57 * low[1]
    ]
    assert {"walls", "trunk", "pole"} <= set(tall)
    assert len(tall) >= 8


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("name", scene_presets.PATHS)
def test_preset_paths_are_free_of_objects(obstacles, kind, name):
    path, road_user = scene_presets.path(name, kind), scene_presets.road_user(kind)
    motion = ego_motion(scene_presets.ego("parked"), path.duration, path.sample_time)
    half = 0.5 * np.array([road_user.length, road_user.width])
    outline = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    for pose in path_poses(path, motion.times)[0]:
        footprint = shapely.Polygon(world_from_target(outline, pose))
        assert footprint.distance(obstacles) > 0.2


@pytest.mark.parametrize("name", scene_presets.EGOS)
def test_ego_paths_are_free_of_objects(obstacles, name):
    for pose in ego_motion(scene_presets.ego(name), 10.0, 0.5).poses_world:
        assert shapely.Point(pose[:2]).distance(obstacles) > 1.5


def test_world_parts_meet_the_requirements_of_the_renderers(objects):
    for mesh in objects:
        for part in mesh:
            assert part.triangles.dtype == np.int32 and np.isfinite(part.vertices).all()
            assert part.uvs.shape == (len(part.triangles), 3, 2)
            assert part.texture.dtype == np.uint8
            assert all(side & (side - 1) == 0 for side in part.texture.shape[:2])


def test_world_is_repeatable_and_depends_on_its_seed(objects):
    def bytes_of(items):
        parts = [part for mesh in items for part in mesh]
        return [(part.vertices.tobytes(), part.texture.tobytes()) for part in parts]

    assert bytes_of(world_objects(scene_presets.world())) == bytes_of(objects)
    assert bytes_of(world_objects(World("street", 2, 1.0))) != bytes_of(objects)


def test_asphalt_without_contrast_has_one_colour():
    ground = world_objects(World("street", 1, 0.0))[0]
    assert ground[0].texture.std(axis=(0, 1)).max() == 0.0
