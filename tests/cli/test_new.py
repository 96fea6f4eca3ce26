"""`stixel new`: a tracker whose test passes, and the class of meshes."""

import sys
from runpy import run_path

import pytest
from boxes import write_box

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.user_shape import read_class


def test_a_new_tracker_passes_its_test(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "tracker", "ours"]) == 0
    assert "stixel run tracker=ours:track" in capsys.readouterr().out
    assert {file.name for file in tmp_path.iterdir()} == {"ours.py", "test_ours.py"}
    assert len((tmp_path / "ours.py").read_text().splitlines()) <= 30
    # As pytest would: another process takes seconds to import all.
    monkeypatch.syspath_prepend(tmp_path)
    (test,) = [one for name, one in run_path("test_ours.py").items() if name.startswith("test_")]
    test()
    sys.modules.pop("ours")


def test_it_overwrites_nothing_and_needs_a_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "test_ours.py").write_text("ours")
    for words, fault in (
        (["tracker", "ours"], "test_ours.py: exists"),
        (["tracker", "my-tracker"], "must be the name of a new module"),
        (["tracker", "numpy"], "must be the name of a new module"),
        (["tracker", "class"], "must be the name of a new module"),
        (["sensor", "ours"], "no such command 'sensor'"),
    ):
        assert main(["new", *words]) == 2
        assert fault in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["test_ours.py"]


def test_the_overrides_that_it_prints_use_the_class_of_the_meshes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sizes = {"a.obj": (4.0, 1.6), "b.obj": (5.0, 2.0)}
    meshes = [str(write_box(tmp_path / name, *size)) for name, size in sizes.items()]
    given = ["--sensor", "outline", "--output", "vans.json"]
    assert main(["new", "class", *meshes, *given]) == 0
    assert {file.name for file in tmp_path.glob("*")} == {"a.obj", "b.obj", "vans.json"}
    overrides = capsys.readouterr().out.split()
    p = compose(["measurement=fabricated", "tracker=contour", *overrides]).configuration.prior
    assert (p.length, p.width, p.length_std, p.width_std) == (4.5, 1.8, 0.11, 0.11)
    assert {*read_class(tmp_path / "vans.json")} & {"lidar", "outline", "stixels"} == {"outline"}
    for tracker in ("contour", "gp_ekf"):
        with pytest.raises(ConfigurationError, match=r"tracker\.seen_by=lidar: learn it"):
            compose(["measurement=lidar", f"tracker={tracker}", *overrides])
    # Others see no visible shape.
    assert compose(["measurement=lidar", "tracker=rectangle", *overrides])
    # A rectangle's corner is far beyond that of a drawn car, whose front is round.
    corner = class_shape(p.class_file).outline[22]
    assert corner[0] > 2.15 and corner[1] > 0.85


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["no.obj", "--output", "x.json"], "road_user.mesh: file not found"),
        (["a.obj", "--output", "x.csv"], "--output: x.csv must have the suffix .json"),
        (["a.obj", "--output", "old.json"], "--output: old.json exists"),
        (["a.obj", "--output", "x.json", "--sensor", "sonar"], "--sensor: 'sonar' is not known"),
        (["a.obj", "--output", "x.json", "--road-user", "tram"], "road_user: unknown option"),
        (["a.obj", "--output", "x.json", "--forward", "w"], "'--forward': 'w' is not one of"),
        (["--output", "x.json"], "MESH"),
        (["old.json", "--output", "x.json"], "road_user.mesh: "),
        (["a.obj", "--output", "x.json", "--scale", "9"], "each side must be 0.1 to 30 m"),
    ],
)
def test_wrong_input_is_one_line_and_no_file(tmp_path, monkeypatch, capsys, arguments, fault):
    monkeypatch.chdir(tmp_path)
    write_box(tmp_path / "a.obj", 4.0, 1.6)
    (tmp_path / "old.json").write_text("{}", encoding="utf-8")
    assert main(["new", "class", *arguments]) == 2
    error = capsys.readouterr().err
    assert fault in error and error.count("\n") == 1
    assert not (tmp_path / "x.json").exists()
