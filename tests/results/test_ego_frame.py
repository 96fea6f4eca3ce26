"""Tables in the ego car's frame, of a result and of its folder."""

import dataclasses

import numpy as np
import pytest

from stixel_cli import load, run
from stixel_cli.geometry.pose import ego_from_world, rotate_covariances
from stixel_cli.results.tables import track_in_ego_frame

RUN = ["measurement=fabricated", "ego=turning", "ego.yaw_rate=-20", "path.duration=0.5", "seed=1"]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    return run([*RUN, "pictures.frames=[]"], results=folder, name="moving", cache=folder / "cache")


def test_points_are_those_of_the_world_seen_from_the_car(result):
    world, ego = result.scans, result.ego_tables["scans"]
    for k, pose in enumerate(result.scenario.ego_poses_world):
        rows = world.rows(k)
        points = np.stack([ego["x"], ego["y"]], axis=-1)[rows]
        np.testing.assert_allclose(points, ego_from_world(world.points_world[rows], pose))
        turned = rotate_covariances(world.covariances_world[rows], np.pi / 2 - pose[2])
        np.testing.assert_allclose(ego["var_xx"][rows], turned[:, 0, 0])
        np.testing.assert_allclose(ego["var_xy"][rows], turned[:, 0, 1], atol=1e-15)
        np.testing.assert_allclose(ego["var_yy"][rows], turned[:, 1, 1])


def test_a_state_is_turned_with_its_covariance(result):
    track, ego = result.track, result.ego_tables["track"]
    for k, pose in enumerate(result.scenario.ego_poses_world):
        centre = ego_from_world(track.means[k, None, :2], pose)[0]
        np.testing.assert_allclose([ego["x"][k], ego["y"][k]], centre)
        ahead = track.means[k, :2] + track.means[k, 3:5]
        rate = ego_from_world(ahead[None], pose)[0] - centre
        np.testing.assert_allclose([ego["x_rate"][k], ego["y_rate"][k]], rate)
        heading = track.means[k, 2] - pose[2] + np.pi / 2
        assert np.cos(ego["heading"][k] - heading) == pytest.approx(1.0)
        position = rotate_covariances(track.covariances[k, None, :2, :2], np.pi / 2 - pose[2])[0]
        std = [ego["std_x"][k], ego["std_y"][k]]
        np.testing.assert_allclose(std, np.sqrt(np.diag(position)))
    np.testing.assert_array_equal(ego["heading_rate"], track.means[:, 5])


def test_an_unknown_rate_leaves_the_place_known(result):
    means = result.track.means.copy()
    means[:, 3] = np.nan
    ego = track_in_ego_frame(
        dataclasses.replace(result.track, means=means), result.scenario.ego_poses_world
    )
    known = result.ego_tables["track"]
    assert np.isnan(ego["x_rate"]).all()
    for name in ("x", "y", "heading", "std_x", "std_x_rate"):
        np.testing.assert_array_equal(ego[name], known[name])


def test_a_folder_gives_the_same(result):
    tables = load(result.folder).ego_tables
    for name, table in result.ego_tables.items():
        assert list(table) == list(tables[name])
        for column, values in table.items():
            np.testing.assert_array_equal(tables[name][column], values)
    poses = result.scenario.ego_poses_world.T
    np.testing.assert_array_equal([tables["ego"][c] for c in ("x", "y", "heading")], poses)
    rows = (result.folder / "ego.csv").read_text().splitlines()
    assert rows[0] == "k,t,x,y,heading" and len(rows) == 6
