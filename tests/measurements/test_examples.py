"""The examples that write a user's own scans: they are read, and a track can start from them."""

import gzip
import json
import os
import pickle
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import read_truth
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.start_scans import start_from_scans

EXAMPLE = Path(__file__).parents[2] / "examples" / "radar_scans.py"


def test_the_example_is_a_run_s_input(tmp_path):
    runpy.run_path(str(EXAMPLE))["main"](tmp_path)
    scans = read_scans(str(tmp_path / "scans.csv"), str(tmp_path / "ego.csv"), 0.2)
    truth = read_truth(scans, str(tmp_path / "truth.csv"))
    assert len(scans) == 60
    assert np.all(np.diff(scans.offsets)[9::10] == 0)
    configuration = compose(["start=scans"]).configuration
    state = start_from_scans(scans, configuration.start, configuration.prior)
    first = transition(scans.times[1]) @ state.mean
    assert np.hypot(*(first[:2] - truth.target_poses_world[0, :2])) < 1.0
    assert np.hypot(*(first[3:5] - truth.target_rates_world[0, :2])) < 2.0


PANDASET = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "pandaset_scans.py"))
LEFT = {"w": np.sqrt(0.5), "x": 0.0, "y": 0.0, "z": np.sqrt(0.5)}


def write(file, value):
    file.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(value, pd.DataFrame):  # Texts as in the version of pandas that wrote PandaSet.
        value.columns = value.columns.astype(object)
    file.write_bytes(gzip.compress(pickle.dumps(value, protocol=4)))


@pytest.fixture
def sequence(tmp_path):
    """Three frames: a car drives along x, a sensor at the origin looks along -x, a wall is near."""
    random = np.random.default_rng(0)
    for k in range(3):
        x = 20.0 + 2.0 * k
        car = np.column_stack(
            [x + random.uniform(-2, 2, 50), np.full(50, -0.9), np.linspace(0, 1.5, 50)]
        )
        sky, far = [[x, 0.0, 5.0]], [[x + 8.0, 0.0, 1.0]]
        points = np.concatenate([car, sky, far])
        frame = pd.DataFrame(points, columns=["x", "y", "z"]).assign(i=1.0, t=0.0, d=0)
        write(tmp_path / f"lidar/{k:02d}.pkl.gz", pd.concat([frame, frame.assign(d=1, y=-0.8)]))
        values = {"uuid": "a", "label": "Car", "yaw": -0.5 * np.pi, "position.x": x}
        values |= {"position.y": 0.0, "dimensions.x": 1.8, "dimensions.y": 4.4}
        label = pd.DataFrame([values, values]).astype({"uuid": object, "label": object})
        write(tmp_path / f"annotations/cuboids/{k:02d}.pkl.gz", label)
    pose = {"position": {"x": 0.0, "y": 0.0, "z": 1.8}, "heading": LEFT}
    (tmp_path / "lidar/poses.json").write_text(json.dumps([pose] * 3))
    (tmp_path / "lidar/timestamps.json").write_text(json.dumps([1e9, 1e9 + 0.1, 1e9 + 0.2]))
    return tmp_path


def test_its_tables_are_a_run_s_input(sequence, tmp_path):
    assert PANDASET["moving"](PANDASET["cuboids"](sequence)).loc["a", "frames"] == 3
    PANDASET["main"](sequence, "a", tmp_path / "out")
    scans = read_scans(str(tmp_path / "out/scans.csv"), str(tmp_path / "out/ego.csv"), 0.1)
    truth = read_truth(scans, str(tmp_path / "out/truth.csv"))
    np.testing.assert_allclose(scans.times, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(np.cos(scans.sensor_poses_world[:, 2]), -1.0)
    np.testing.assert_allclose(truth.target_poses_world[:, 0], [20.0, 22.0, 24.0])
    np.testing.assert_allclose(truth.target_poses_world[:, 2], 0.0, atol=1e-12)
    # Only the rotating lidar, the car's heights, and one point of each bearing.
    np.testing.assert_array_equal(scans.points_world[:, 1], -0.9)
    bearings = np.arctan2(*scans.points_world[scans.rows(0)].T[::-1])
    assert 0 < len(bearings) == len(np.unique(np.round(bearings / PANDASET["BEARING"])))


def test_a_pickle_of_anything_else_is_refused(tmp_path, capsys):
    class Evil:
        def __reduce__(self):
            return os.system, ("false",)

    file = tmp_path / "evil.pkl.gz"
    for value, words in ((Evil(), "is no part of a data frame"), ([1], "is no data frame")):
        write(file, value)
        with pytest.raises(SystemExit, match=words):
            PANDASET["read_frame"](file)
    file.write_bytes(b"text")
    with pytest.raises(SystemExit, match=r"evil\.pkl\.gz"):
        PANDASET["read_frame"](file)
