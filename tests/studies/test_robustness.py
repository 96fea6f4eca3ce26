"""Axes of the studies of the trackers away from home: the user's tables, and shipped meshes."""

from pathlib import Path

import pytest

from stixel_cli.errors import MissingData
from stixel_cli.studies import robustness


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    """A folder of data with tables of two targets of a lidar, and of one run of a scenario."""
    for name in ("pandaset/car-a", "pandaset/pedestrian-b", "lidarrm/default-00"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "scans.csv").touch()
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    return tmp_path


def test_recordings_are_those_of_the_users_data(recordings):
    (axes,) = robustness.pandaset()
    assert axes["road_user"] == ["car", "pedestrian"]
    folder = recordings / "pandaset"
    assert axes["measurement.truth"] == [
        str(folder / name / "truth.csv") for name in ("car-a", "pedestrian-b")
    ]
    assert {*axes} == {"road_user", *(f"measurement.{name}" for name in ("path", "ego", "truth"))}
    (axes,) = robustness.lidarrm()
    assert axes["measurement.path"] == [str(recordings / "lidarrm/default-00/scans.csv")]
    (axes,) = robustness.clip()
    assert axes["source.target"] == [31, 0, 1] and len(axes["source.folder"]) == 3


def test_shapes_are_shipped_meshes_of_their_class():
    (axes,) = robustness.shapes()
    names = [(user, Path(mesh).stem) for user, mesh in zip(*axes.values(), strict=True)]
    assert ("car", "trapezium") in names and ("cyclist", "cargo_bike") in names
    assert len(robustness.held_out()[0]["road_user"]) >= 3
    assert {Path(mesh).stem for mesh in robustness.odd()[0]["road_user.mesh"]} >= {
        "truck",
        "stroller",
    }


def test_without_data_one_line_names_the_variable(studies, recordings, monkeypatch):
    (recordings / "lidarrm/default-00/scans.csv").unlink()
    with pytest.raises(MissingData, match="lidarrm has no folder"):
        robustness.lidarrm()
    monkeypatch.delenv("STIXEL_DATA")
    assert "STIXEL_DATA: must name a folder that has pandaset" in studies.refused("robustness_real")
