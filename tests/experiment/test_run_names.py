"""Names of runs: what differs from the default, and valid as a folder's name."""

import pytest

from stixel_cli.experiment.run_names import LONGEST_NAME, differences, joined_name
from stixel_cli.results.folder import check_plain_name

DEFAULT = {"road_user": "car", "path": "turn", "rig": "default", "tracker": "gp_ekf"}


def run_name(*given):
    return joined_name(differences(*given))


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ([], "car-turn"),
        (["rig=kitti", "stereo=bm"], "car-turn-rig=kitti-stereo=bm"),
        (["measurement=fabricated", "tracker=point"], "car-turn-fabricated-point"),
        (["measurement=stixels", "tracker=gp_ekf", "rig=default"], "car-turn"),
        (["tracker.sigma_f=0.5", "seed=3"], "car-turn-sigma_f=0.5-seed=3"),
        (["tracker.basis_points=50", "rig.baseline=0.3"], "car-turn"),
        (["prior=car"], "car-turn-prior=car"),
        (["executor.workers=1", "cache.folder=x", "pictures.frames=[1]"], "car-turn"),
        (["measurement/noise=constant"], "car-turn-noise=constant"),
        (["road_user.mesh=/home/me/my van.obj"], "car-turn-mesh=myvan.obj"),
        (["tracker=my_module:track"], "car-turn-my_module_track"),
    ],
)
def test_what_differs_is_in_the_name(overrides, name):
    assert run_name(DEFAULT, overrides) == name
    check_plain_name(name)


def test_road_user_and_path_are_always_in_it():
    choices = DEFAULT | {"road_user": "cyclist", "path": "crossing"}
    assert run_name(choices, ["road_user=cyclist", "path=crossing"]) == "cyclist-crossing"


def test_scans_of_a_file_have_no_path_in_their_name():
    choices = DEFAULT | {"measurement": "file"}
    overrides = ["measurement=file", "measurement.path=a/scans.csv"]
    assert run_name(choices, overrides) == "car-file-path=scans.csv"


def test_a_long_list_is_cut():
    overrides = ["path=waypoints", f"path.points={[[0, k] for k in range(99)]}"]
    name = run_name(DEFAULT | {"path": "waypoints"}, overrides)
    assert name.startswith("car-waypoints-points=0,0,0,1,") and name.endswith("..")
    many = [f"tracker.some_long_key_{k}={k}" for k in range(20)]
    name = run_name(DEFAULT, many)
    assert len(name) < LONGEST_NAME + 5 and name.endswith("+16")
    check_plain_name(name)


def test_a_foreign_manifest_gives_printable_words():
    found = differences({"road_user": "a\nb\x1b"}, ["=", "x\n=\t\u202e1", "stereo=" + "y" * 99])
    assert all(part.isprintable() for part in found)
    check_plain_name("x" + joined_name(["ä\x00/.."]))
