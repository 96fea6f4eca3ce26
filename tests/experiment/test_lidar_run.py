"""A lidar's runs through the real command line: what is shared, a mesh of one's own, a sweep."""

import csv

from boxes import write_box

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import experiment_graph


def keys(*words: str) -> tuple[str, str]:
    """The keys of the returns and of the scans."""
    graph = experiment_graph(compose(["measurement=lidar", *words]))
    return graph.of_stage("cast_lidar")[0].key, graph.of_stage("scans")[0].key


def test_the_returns_are_those_of_what_the_beams_meet():
    """Seeds, noise, gates and stereo share them."""
    returns, scans = keys()
    for word in ("seed=1", "measurement.range_std=0.03", "measurement.height_min=0.5"):
        assert keys(word)[0] == returns and keys(word)[1] != scans, word
    assert keys("rig.baseline=1.0") == (returns, scans)
    for word in ("rig.horizontal_fov=40.0", "measurement.scanner.layers=5", "world.seed=2"):
        assert keys(word)[0] != returns, word
    assert keys("ego=straight")[0] != returns


def test_two_sensors_and_two_trackers_of_a_mesh_of_ones_own_from_a_car_that_turns(capsys, tmp_path):
    mesh = write_box(tmp_path / "barrow.obj", 3.0, 1.4, 1.4)
    words = ["measurement=fabricated,lidar", "tracker=gp_ekf,point", "path.duration=0.3"]
    words += [f"road_user.mesh={mesh}", "ego=turning", "path.start=[-1.0,9.0]"]
    code = main(["sweep", "--results", str(tmp_path), "--name", "both", *words])
    assert code == 0, capsys.readouterr().err
    with (tmp_path / "both" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert len({row["centre_rmse_m"] for row in rows}) == 4
    assert all(float(row["points_used_mean"]) > 10 for row in rows)
    assert all(float(row["low_overlap_share"]) == 0.0 for row in rows)
