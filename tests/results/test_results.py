"""Folders that appear complete or not at all, and their tables."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refused

from stixel_cli import load, run
from stixel_cli.errors import FolderTaken
from stixel_cli.geometry.pose import ego_from_world, rotate_covariances
from stixel_cli.results import tables
from stixel_cli.results.folder import whole_folder, write_whole_folder
from stixel_cli.results.tables import track_arrays, track_columns
from stixel_cli.tracking.track import ObjectTrack, Track


def test_a_folder_has_its_files_at_any_depth_and_is_replaced_only_on_request(tmp_path):
    files = {"a.txt": "ä", "b/c.bin": b"\x00", "b/d.txt": "d"}
    write_whole_folder(tmp_path / "new", files)
    assert (tmp_path / "new" / "a.txt").read_bytes() == "ä".encode()
    assert (tmp_path / "new" / "b/c.bin").read_bytes() == b"\x00"
    assert (tmp_path / "new" / "b/d.txt").read_text() == "d"
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    write_whole_folder(tmp_path / "run", {"a": "1"})
    with pytest.raises(FolderTaken):
        write_whole_folder(tmp_path / "run", {"a": "2"})
    assert (tmp_path / "run" / "a").read_text() == "1"
    write_whole_folder(tmp_path / "run", {"b": "2"}, replace=True)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["b"]


def test_a_failure_leaves_nothing_and_keeps_an_older_folder(tmp_path):
    write_whole_folder(tmp_path / "old", {"a": "1"})
    for name in ("new", "old"):
        with refused("written: full"), whole_folder(tmp_path / name, True) as partial:
            (partial / "a").write_text("2")
            raise OSError("full")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old" / "a").read_text() == "1"


COUNT = 3


@pytest.fixture
def track():
    states = np.zeros((COUNT, 6)), np.tile(np.eye(6), (COUNT, 1, 1))
    contours = np.zeros((COUNT, 4, 2)), np.zeros((COUNT, 4))
    return Track.of_scans(0.1 * np.arange(COUNT), states, contours, [[]] * COUNT, np.zeros(COUNT))


@pytest.mark.parametrize("table", [track_columns, track_arrays])
def test_both_files_have_the_probability_of_each_class(track, table):
    assert not any("probability" in name for name in table(track))
    car = np.array([0.5, 0.7, 0.9])
    found = table(replace(track, class_probabilities={"car": car, "cyclist": 1.0 - car}))
    np.testing.assert_array_equal(found["car_probability"], car)
    np.testing.assert_array_equal(found["cyclist_probability"], 1.0 - car)


@pytest.mark.parametrize("replaced", [0, 1])
def test_a_track_without_probabilities_has_none_in_the_table_of_all(track, replaced):
    car = np.array([0.5, 0.7, 0.9])
    both = [track, track]
    both[replaced] = replace(track, class_probabilities={"car": car})
    found = tables.tracks_columns([ObjectTrack(0, 1, both[0]), ObjectTrack(5, 9, both[1])])
    np.testing.assert_array_equal(found["k"], [0, 1, 2, 5, 6, 7])
    np.testing.assert_array_equal(found["car_probability"][found["track"] == replaced], car)
    assert np.isnan(found["car_probability"][found["track"] != replaced]).all()
    np.testing.assert_array_equal(found["confirmed"], [0, 1, 1, 0, 0, 0])


RUN = ["measurement=fabricated", "ego=turning", "ego.yaw_rate=-20", "path.duration=0.5", "seed=1"]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    return run([*RUN, "pictures.frames=[]"], results=folder, name="moving", cache=folder / "cache")


def test_points_and_states_are_those_of_the_world_seen_from_the_car(result):
    world, ego = result.scans, result.ego_tables["scans"]
    for k, pose in enumerate(result.scenario.ego_poses_world):
        rows = world.rows(k)
        points = np.stack([ego["x"], ego["y"]], axis=-1)[rows]
        np.testing.assert_allclose(points, ego_from_world(world.points_world[rows], pose))
        turned = rotate_covariances(world.covariances_world[rows], np.pi / 2 - pose[2])
        np.testing.assert_allclose(ego["var_xx"][rows], turned[:, 0, 0])
        np.testing.assert_allclose(ego["var_xy"][rows], turned[:, 0, 1], atol=1e-15)
        np.testing.assert_allclose(ego["var_yy"][rows], turned[:, 1, 1])
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
    unknown = replace(result.track, means=means)
    ego = tables.track_in_ego_frame(unknown, result.scenario.ego_poses_world)
    known = result.ego_tables["track"]
    assert np.isnan(ego["x_rate"]).all()
    for name in ("x", "y", "heading", "std_x", "std_x_rate"):
        np.testing.assert_array_equal(ego[name], known[name])


def test_a_folder_gives_the_same(result):
    loaded = load(result.folder).ego_tables
    for name, table in result.ego_tables.items():
        assert list(table) == list(loaded[name])
        for column, values in table.items():
            np.testing.assert_array_equal(loaded[name][column], values)
    poses = result.scenario.ego_poses_world.T
    np.testing.assert_array_equal([loaded["ego"][c] for c in ("x", "y", "heading")], poses)
    rows = (result.folder / "ego.csv").read_text().splitlines()
    assert rows[0] == "k,t,x,y,heading" and len(rows) == 6
