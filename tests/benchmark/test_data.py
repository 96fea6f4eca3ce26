"""The sequences of `stixel bench`: rendered ones, the guests and the real data."""

import json
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.benchmark import sequences as module
from stixel_cli.benchmark.demo import demo_scans
from stixel_cli.benchmark.sequences import (
    Data,
    bench_folder,
    fresh_set,
    named,
    planned,
    sequences,
    whole_set,
)
from stixel_cli.cli.app import main
from stixel_cli.errors import MissingData, UserError
from stixel_cli.geometry.pose import rectangle
from stixel_cli.measurements.file import read_scans
from stixel_cli.results import tables
from stixel_cli.scene.scenario import Scenario


def test_version_1_0_has_450_sequences_and_fresh_seeds_nobody_can_have_tuned_on():
    of_version = whole_set()
    assert len(of_version) == len({one.name for one in of_version}) == 360 + 90
    assert [named(one.name) for one in of_version] == of_version
    assert len(whole_set(mini=True)) == 72
    hard = [one for one in of_version if one.part == "hard" and one.seed == 0]
    assert len(planned([one for one in hard if one.road_user == "car"], {})) == 6
    with pytest.raises(UserError, match="not the name of a sequence"):
        named("stixels-car-../../etc-0")
    one, other = fresh_set("ab"), fresh_set("cd")
    seeds = {sequence.seed for sequence in one}
    assert one == fresh_set("ab") and len(one) == 90 and len(seeds) == 10
    assert min(seeds) >= 10_000 and seeds.isdisjoint(sequence.seed for sequence in other)
    parts = ("guest_demo", "guest_lidarrm", "real_pandaset", "real_kitti")
    assert [len(sequences(part)) for part in parts] == [180, 38, 9, 3]
    assert all(named(one.name) == one for part in parts for one in sequences(part))
    with pytest.raises(UserError, match="is not a part"):
        sequences("demo")


def test_a_second_rendering_has_the_same_id_and_a_tracker_gets_what_was_rendered(
    rendered, tmp_path, monkeypatch, capsys, told
):
    identity = told("bench", "verify", "--data", "data").split()[-1]
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "other"))
    assert main(["bench", "render", "--mini", "--data", "again", "--workers", "1"]) == 0
    assert capsys.readouterr().out.split()[-1] == identity == Data(rendered).id
    data = Data(rendered)
    name = "fabricated-car-turn-1"
    given = data.read(name)
    truth = given.truth
    assert len(given.scans) == 12 and given.scans.field_of_view.left > 0.0
    assert given.prior.length == 4.52 and truth.known.all()
    assert np.all(np.linalg.eigvalsh(given.scans.covariances_world) > 0.0)
    assert np.hypot(*(given.initial.mean[:2] - truth.target_poses_world[0, :2])) < 3.0


def test_heights_of_points_come_back_from_a_sequence_and_from_a_run(rendered):
    name = "fabricated-car-turn-1"
    given = Data(rendered).read(name)
    heights = np.linspace(0.2, 1.4, len(given.scans.points_world))
    scans = replace(given.scans, heights=heights)
    for file, content in replace(given, scans=scans).files().items():
        (rendered / name / file).write_bytes(content)
    np.testing.assert_allclose(Data(rendered).read(name).scans.heights, heights, atol=1e-6)
    x, y, heading = scans.sensor_poses_world.T
    ego = {"t": scans.times, "x": x, "y": y, "heading": heading}
    np.savez(rendered / "ego.npz", **ego)
    np.savez(rendered / "scans.npz", **tables.scan_columns(scans))
    of_run = read_scans(str(rendered / "scans.npz"), str(rendered / "ego.npz"), 0.0, road_z=0.0)
    np.testing.assert_array_equal(of_run.heights, heights)


def test_verify_names_a_file_that_was_changed_or_is_missing(rendered, told):
    (rendered / "fabricated-car-turn-0" / "start.json").write_text("{}")
    (rendered / "fabricated-car-turn-1" / "truth.npz").unlink()
    out = told("bench", "verify", "--data", "data", code=1)
    assert "fabricated-car-turn-0/start.json: is missing or damaged" in out
    assert "fabricated-car-turn-1/truth.npz: is missing" in out


def test_verify_takes_other_scans_for_those_of_another_processor_but_no_truth(rendered, capsys):
    published = json.loads((rendered / "MANIFEST.json").read_text())
    published["files"]["fabricated-car-turn-0/scans.npz"] = "0"
    file = rendered.parent / "definitions" / "MANIFEST-mini.json"
    file.write_text(json.dumps(published))
    capsys.readouterr()
    assert main(["bench", "verify", "--data", "data"]) == 0
    said = "scans.npz of 1 sequence differ: another processor or revision"
    assert said in capsys.readouterr().err
    published["files"]["fabricated-car-turn-0/truth.npz"] = "0"
    file.write_text(json.dumps(published))
    assert main(["bench", "verify", "--data", "data"]) == 1
    assert "turn-0/truth.npz: differs from the published" in capsys.readouterr().out


@pytest.mark.parametrize("path", ["../../etc/passwd", "a/b", "x/scans.npz/../../y"])
def test_a_manifest_cannot_name_other_files(rendered, path, told):
    manifest = rendered / "MANIFEST.json"
    content = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(content | {"files": {path: "0"}}))
    assert "not a file of a sequence" in told("bench", "verify", "--data", "data", code=2)


def test_the_demo_needs_no_data_of_the_user_and_a_star_names_the_folder_of_the_seed(
    monkeypatch, tmp_path
):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    (run,) = planned([named("demo_whole-triangle-straight-3")], {})
    configuration = run.composition.configuration
    mesh = bench_folder() / "demo" / "triangle.obj"
    assert configuration.road_user.mesh == str(mesh) and mesh.is_file()
    assert configuration.path.sample_time == 1.0 and configuration.seed == 3
    with pytest.raises(MissingData, match="STIXEL_DATA"):
        planned([named("lidarrm-rectangle-sparse-2")], {})
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


def test_a_part_is_rendered_run_and_scored(tmp_path, monkeypatch, capsys, told):
    chosen = sequences("guest_demo")[:1]
    monkeypatch.setattr(module, "sequences", lambda part, seeds=(): chosen)
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "render", "--part", "guest_demo", "--data", "demo"]) == 0
    assert main(["bench", "run", "box", "--data", "demo"]) == 0, capsys.readouterr().err
    scored = ["bench", "score", "box.zip", "--data", "demo", "--rows", "rows"]
    assert main(scored) == 0 and len(list((tmp_path / "rows").iterdir())) == 1
    absent = told("bench", "verify", "--data", "absent", code=2)
    assert "MANIFEST.json: is missing: name the folder of the sequences" in absent
    assert "--rows: absent: no such folder" in told("bench", "page", "--rows", "absent", code=2)
    nothing = ["bench", "render", "--part", "guest_demo", "--sensor", "lidar", "--data", "demo"]
    assert main(nothing) == 2 and "'lidar': must be one of" in capsys.readouterr().err
