"""The guests and the real data of `stixel bench`."""

import numpy as np
import pytest

from stixel_cli.benchmark.demo import demo_scans
from stixel_cli.benchmark.sequences import bench_folder, named, planned, sequences
from stixel_cli.cli.app import main
from stixel_cli.errors import MissingData, UserError
from stixel_cli.geometry.pose import rectangle
from stixel_cli.scene.scenario import Scenario


def test_the_names_of_all_parts_give_their_sequences_back():
    parts = ("guest_demo", "guest_lidarrm", "real_pandaset", "real_kitti")
    assert [len(sequences(part)) for part in parts] == [180, 38, 9, 3]
    assert all(named(one.name) == one for part in parts for one in sequences(part))
    with pytest.raises(UserError, match="is not a part"):
        sequences("demo")


def test_the_demo_has_its_own_shapes_and_needs_no_data_of_the_user(monkeypatch):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    (run,) = planned([named("demo_whole-triangle-straight-3")], {})
    configuration = run.composition.configuration
    mesh = bench_folder() / "demo" / "triangle.obj"
    assert configuration.road_user.mesh == str(mesh) and mesh.is_file()
    assert configuration.path.sample_time == 1.0 and configuration.seed == 3
    with pytest.raises(MissingData, match="STIXEL_DATA"):
        planned([named("lidarrm-rectangle-sparse-2")], {})


def test_a_star_names_the_folder_of_the_seed(tmp_path, monkeypatch):
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    for name in ("car-aa", "car-bb"):
        (tmp_path / "pandaset" / name).mkdir(parents=True)
        for table in ("scans", "ego", "truth"):
            (tmp_path / "pandaset" / name / f"{table}.csv").write_text("k,t,x,y\n0,0,1,2\n")
    wanted = str(tmp_path / "pandaset" / "car-bb" / "scans.csv")
    assert f"measurement.path={wanted}" in named("pandaset-car-002-1").overrides
    with pytest.raises(MissingData, match="has 2 files"):
        planned([named("pandaset-car-002-2")], {})


def test_scans_of_the_demo_are_on_the_outline_or_on_the_side_that_the_sensor_sees():
    count = 5
    poses = np.tile([0.0, 10.0, 0.0], (count, 1))
    sensor, rates = np.tile([0.0, 0.0, 0.5 * np.pi], (count, 1)), np.zeros((count, 3))
    square = rectangle(3.0, 3.0)[None]
    truth = Scenario(np.arange(5.0), sensor, poses, rates, square)
    for whole in (True, False):
        points = demo_scans(truth, 0, 20, 1e-6, whole).points_world - poses[0, :2]
        assert len(points) == 100
        np.testing.assert_allclose(np.abs(points).max(axis=1), 1.5, atol=1e-4)
        assert (points[:, 1] > -1.4).any() == whole


def test_a_part_is_rendered_run_and_scored(tmp_path, monkeypatch, capsys):
    from stixel_cli.benchmark import sequences as module

    chosen = sequences("guest_demo")[:1]
    monkeypatch.setattr(module, "sequences", lambda part, seeds=(): chosen)
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "render", "--part", "guest_demo", "--data", "demo"]) == 0
    assert main(["bench", "run", "box", "--data", "demo"]) == 0, capsys.readouterr().err
    scored = ["bench", "score", "box.zip", "--data", "demo", "--rows", "rows"]
    assert main(scored) == 0 and len(list((tmp_path / "rows").iterdir())) == 1
    assert main(["bench", "verify", "--data", "absent"]) == 2
    assert "MANIFEST.json: is missing: name the folder of the sequences" in capsys.readouterr().err
    assert main(["bench", "page", "--rows", "absent"]) == 2
    assert "--rows: absent: no such folder" in capsys.readouterr().err
    nothing = ["bench", "render", "--part", "guest_demo", "--sensor", "lidar", "--data", "demo"]
    assert main(nothing) == 2 and "'lidar': must be one of" in capsys.readouterr().err
