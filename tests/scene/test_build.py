import numpy as np
import pytest
import scene_presets
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import binary_fill_holes

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rectangle
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.scene.contours import outline
from stixel_cli.scene.ego import Parked, Straight, Turning, ego_motion, ego_poses
from stixel_cli.scene.mesh import Part, corners
from stixel_cli.scene.path import build_scenario, path_poses
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario
from stixel_cli.scene.shapes import box, part


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_scenario_contains_the_ground_truth(kind):
    path = scene_presets.path("s_curve", kind)
    motion = ego_motion(scene_presets.ego("turning"), path.duration, path.sample_time)
    scenario = build_scenario(motion, scene_presets.road_user(kind), path)
    count = len(motion.times)
    assert scenario.target_poses_world.shape == scenario.target_rates_world.shape == (count, 3)
    np.testing.assert_array_equal(scenario.ego_poses_world, motion.poses_world)
    np.testing.assert_array_equal(scenario.times, motion.times)
    np.testing.assert_allclose(scenario.target_poses_world[0, :2], path.start)
    assert scenario.contours_target.ndim == 3 and scenario.contours_target.shape[2] == 2
    assert scenario.star_convex == all(map(is_star_convex, scenario.contours_target))


def is_star_convex(contour):
    return Scenario(np.zeros(1), *np.zeros((3, 1, 3)), contour[None]).star_convex


GREY = np.full((1, 1, 3), 128, np.uint8)


@pytest.fixture(scope="module")
def meshes():
    users = scene_presets.ROAD_USERS
    return {kind: road_user_meshes(scene_presets.road_user(kind))[0] for kind in users}


def boxes(*corner_pairs):
    return (part("boxes", [box(low, high) for low, high in corner_pairs], GREY, 1.0),)


def rasterised(mesh, step):
    """Brute force: which points of a grid lie in any projected triangle, holes filled."""
    flat = corners(mesh)[:, :, :2]
    low, high = flat.min(axis=(0, 1)) - 2 * step, flat.max(axis=(0, 1)) + 2 * step
    xs, ys = (np.arange(low[i], high[i], step) for i in (0, 1))
    inside = np.zeros((len(xs), len(ys)), dtype=bool)
    for triangle in flat:
        ends = triangle.min(axis=0), triangle.max(axis=0)
        at = tuple(slice(*np.searchsorted(a, [e[i] for e in ends])) for i, a in enumerate((xs, ys)))
        x, y = xs[at[0], None], ys[None, at[1]]
        edges = zip(triangle, np.roll(triangle, -1, axis=0), strict=True)
        sides = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in edges]
        signs = np.array(sides)
        inside[at] |= (signs >= 0).all(axis=0) | (signs <= 0).all(axis=0)
    return xs, ys, binary_fill_holes(inside)


@pytest.mark.parametrize(
    ("kind", "step", "least_area", "most_area"),
    [("car", 0.008, 6.9, 7.69), ("cyclist", 0.0025, 0.3, 0.6), ("pedestrian", 0.0015, 0.08, 0.16)],
)
def test_contour_equals_the_silhouette_from_above(meshes, kind, step, least_area, most_area):
    contour = outline(corners(meshes[kind]))
    xs, ys, truth = rasterised(meshes[kind], step)
    found = shapely.contains_xy(shapely.Polygon(contour), *np.meshgrid(xs, ys, indexing="ij"))
    assert (truth & found).sum() > 0.99 * (truth | found).sum()
    assert least_area < shapely.Polygon(contour).area < most_area


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_contour_is_one_simple_polygon_and_star_convex_where_all_of_it_is_seen(meshes, kind):
    contour = outline(corners(meshes[kind]))
    polygon = shapely.Polygon(contour)
    assert polygon.is_valid and polygon.exterior.is_ccw
    assert 20 < len(contour) < 400
    assert not np.array_equal(contour[0], contour[-1])
    ends = np.abs([contour.min(axis=0), contour.max(axis=0)])
    greatest = np.abs(corners(meshes[kind])[:, :, :2]).max(axis=(0, 1))
    np.testing.assert_allclose(ends, np.tile(greatest, (2, 1)), atol=1.1e-3)
    shape = shapely.Polygon(contour).buffer(1e-9)
    middles = 0.5 * (contour + np.roll(contour, -1, axis=0))
    seen = all(shape.covers(shapely.LineString([(0, 0), point])) for point in [*contour, *middles])
    assert is_star_convex(contour) == seen


def test_contour_includes_the_mirrors(meshes):
    """The car is widest at its mirrors alone: half a metre behind them it is narrower."""
    polygon = shapely.Polygon(outline(corners(meshes["car"])))
    left = polygon.bounds[3]
    outermost = shapely.box(-9, left - 0.03, 9, 9).intersection(polygon)
    assert outermost.bounds[2] - outermost.bounds[0] < 0.2


def test_contour_fills_holes_joins_parts_and_needs_an_area():
    frame = [((-1, -1, 0), (1, -0.8, 1)), ((-1, 0.8, 0), (1, 1, 1)),
             ((-1, -1, 0), (-0.8, 1, 1)), ((0.8, -1, 0), (1, 1, 1))]  # fmt: skip
    assert shapely.Polygon(outline(corners(boxes(*frame)))).area == pytest.approx(4.0)
    apart = boxes(((-1, -0.5, 0), (-0.01, 0.5, 1)), ((0.01, -0.5, 0), (1, 0.5, 1)))
    polygon = shapely.Polygon(outline(corners(apart)))
    assert polygon.is_valid
    assert polygon.area == pytest.approx(2.0, abs=0.03)
    upright = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1]])
    wall = Part(upright, np.array([[0, 1, 2]], np.int32), np.zeros((1, 3, 2)), GREY, "wall")
    with pytest.raises(ValueError, match="no area"):
        outline(corners((wall,)))


def test_star_convexity_of_known_shapes():
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    assert is_star_convex(square)
    assert not is_star_convex(square + 5.0)
    dented = np.array([[-1.0, -1], [1, -1], [1, 1], [0, 0.2], [-1, 1]])
    assert is_star_convex(dented)
    hooked = np.array([[-1.0, -1], [1, -1], [1, 1], [0.6, 1], [0.9, 0.5], [-1, 0.5]])
    assert not is_star_convex(hooked)


@pytest.mark.parametrize("name", scene_presets.EGOS)
def test_world_frame_equals_the_first_ego_frame(name):
    motion = ego_motion(scene_presets.ego(name), 10.0, 0.1)
    assert motion.times.shape == (100,) and motion.poses_world.shape == (100, 3)
    np.testing.assert_array_equal(motion.poses_world[0], [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(motion.times, 0.1 * np.arange(100))


def test_parked_ego_stays_and_straight_ego_moves_forward():
    assert (ego_motion(Parked("parked"), 2.0, 0.5).poses_world == [0.0, 0.0, np.pi / 2]).all()
    poses = ego_motion(Straight("straight", 3.0), 2.0, 0.5).poses_world
    np.testing.assert_allclose(poses, [[0, 1.5 * k, np.pi / 2] for k in range(4)], atol=1e-12)


@given(st.floats(0, 30), st.floats(-90, 90), st.floats(0.1, 20))
def test_ego_moves_along_its_heading(speed, yaw_rate, time):
    ego, step = Turning("turning", speed, yaw_rate), 1e-5
    before, here, after = ego_poses(ego, np.array([time - step, time, time + step]))
    rates = (after - before) / (2 * step)
    expected = [speed * np.cos(here[2]), speed * np.sin(here[2]), np.radians(yaw_rate)]
    np.testing.assert_allclose(rates, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("duration", "sample_time", "count"),
    [(10.0, 0.1, 100), (0.3, 0.1, 3), (0.04, 0.1, 1), (1.0, 10.0, 1), (1.26, 0.1, 13)],
)
def test_number_of_scans_is_duration_over_sample_time(duration, sample_time, count):
    motion = ego_motion(Parked("parked"), duration, sample_time)
    assert len(motion.times) == len(motion.poses_world) == count


@pytest.mark.parametrize("name", scene_presets.EGOS)
@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("path", ["turn", "crossing", "approach"])
def test_no_scan_of_the_studies_is_empty(name, kind, path):
    """The presets of the ego car keep the target in view: fabricated without noise."""
    words = ("measurement=fabricated", "measurement.noise.disparity_std=0")
    chosen = compose([f"ego={name}", f"road_user={kind}", f"path={path}", *words]).configuration
    motion = ego_motion(chosen.ego, chosen.path.duration, chosen.path.sample_time)
    poses, rates = path_poses(chosen.path, motion.times)
    box = rectangle(chosen.prior.length, chosen.prior.width)
    scenario = Scenario(motion.times, motion.poses_world, poses, rates, box[None])
    scans = fabricate_scans(scenario, chosen.rig, chosen.measurement, seed=0)
    assert np.diff(scans.offsets).min() > 0
