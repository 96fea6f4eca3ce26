"""A lidar's runs through the real command line: what is shared, a mesh of one's own, a sweep."""

import csv

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import experiment_graph

WEDGE = """v -1.5 -0.7 0
v -1.5 0.7 0
v 1.5 0.7 0
v 1.5 -0.7 0
v -1.5 -0.7 1.4
v -1.5 0.7 1.4
f 1 3 2
f 1 4 3
f 1 5 4
f 2 3 6
f 5 6 4
f 4 6 3
f 1 2 5
f 2 6 5
"""


@pytest.fixture
def results(tmp_path):
    return tmp_path / "results"


def keys(*words: str) -> tuple[str, str]:
    """The keys of the returns and of the scans."""
    graph = experiment_graph(compose(["measurement=lidar", *words]))
    return graph.of_stage("cast_lidar")[0].key, graph.of_stage("scans")[0].key


@pytest.mark.parametrize(
    "word",
    ["seed=1", "measurement.range_std=0.03", "measurement.height_min=0.5", "rig.baseline=1.0"],
)
def test_seeds_noise_gates_and_stereo_share_the_returns(word):
    returns, scans = keys()
    assert keys(word)[0] == returns
    assert (keys(word)[1] == scans) == word.startswith("rig")


@pytest.mark.parametrize(
    "word",
    ["rig.horizontal_fov=40.0", "measurement.scanner.layers=5", "world.seed=2", "ego=straight"],
)
def test_what_the_beams_meet_changes_the_returns(word):
    assert keys(word)[0] != keys()[0]


def test_two_sensors_and_two_trackers_of_a_mesh_of_ones_own_from_a_car_that_turns(
    results, capsys, tmp_path
):
    mesh = tmp_path / "wedge.obj"
    mesh.write_text(WEDGE)
    words = ["measurement=fabricated,lidar", "tracker=gp_ekf,point", "path.duration=0.3"]
    words += [f"road_user.mesh={mesh}", "ego=turning", "path.start=[-1.0,9.0]"]
    code = main(["sweep", "--results", str(results), "--name", "both", *words])
    assert code == 0, capsys.readouterr().err
    with (results / "both" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert len({row["centre_rmse_m"] for row in rows}) == 4
    assert all(float(row["points_used_mean"]) > 10 for row in rows)
    assert all(float(row["low_overlap_share"]) == 0.0 for row in rows)
