"""Presets of the user's own, `--config-dir`."""

import json
import os

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.choice import compose_options
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import group_options, use_presets


@pytest.fixture
def presets(tmp_path):
    folder = tmp_path / "my presets"
    (folder / "tracker").mkdir(parents=True)
    (folder / "tracker" / "coarse.yaml").write_text(
        "defaults:\n  - gp_ekf\n  - _self_\n\nbasis_points: 12\n"
    )
    (folder / "rig").mkdir()
    (folder / "rig" / "mine.yaml").write_text("defaults:\n  - default\n  - _self_\n\nwidth: 320\n")
    (folder / "experiment").mkdir()
    (folder / "experiment" / "quick.yaml").write_text(
        "# @package _global_\ndefaults:\n  - override /path: crossing\npath: {duration: 0.5}\n"
    )
    yield folder
    use_presets(None)


def dry_run(capsys, *arguments):
    code = main(["run", "--json", "--dry-run", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_they_are_options_like_those_of_conf(presets, capsys):
    words = ["tracker=coarse", "rig=mine", "experiment=quick", "measurement=fabricated"]
    code, out, err = dry_run(capsys, "--config-dir", str(presets), *words)
    assert code == 0, err
    config = json.loads(out)["config"]
    assert (config["tracker"]["basis_points"], config["rig"]["width"]) == (12, 320)
    assert (config["path"]["kind"], config["path"]["duration"]) == ("crossing", 0.5)
    assert "coarse" in group_options()["tracker"]


def test_they_are_forgotten_by_the_next_command(presets, capsys):
    assert dry_run(capsys, "--config-dir", str(presets), "tracker=coarse")[0] == 0
    code, _, err = dry_run(capsys, "tracker=coarse")
    assert code == 2
    assert "tracker: unknown option 'coarse'" in err
    assert "coarse" not in group_options()["tracker"]


def test_an_edit_of_a_preset_takes_effect(presets):
    use_presets(presets)
    assert compose(["rig=mine"]).configuration.rig.width == 320
    file = presets / "rig" / "mine.yaml"
    file.write_text(file.read_text().replace("320", "480"))
    compose_options.cache_clear()
    assert compose(["rig=mine"]).configuration.rig.width == 480


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("tracker/gp_ekf.yaml", "tracker=gp_ekf exists; rename it"),
        ("trackers/mine.yaml", "must be in a folder of a group's name"),
        ("mine.yaml", "must be in a folder of a group's name"),
    ],
)
def test_files_that_are_no_presets_are_refused_in_one_line(name, fault, presets, capsys):
    file = presets / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("a: 1\n")
    code, _, err = dry_run(capsys, "--config-dir", str(presets))
    assert (code, len(err.splitlines())) == (2, 1), err
    assert fault in err


@pytest.mark.parametrize(
    "make",
    [
        lambda file: file.symlink_to(file.parent),
        lambda file: file.symlink_to(file.name),
        lambda file: file.symlink_to("/dev/zero"),
        lambda file: file.symlink_to("absent"),
        lambda file: file.mkdir(),
        os.mkfifo,
        lambda file: file.write_bytes(b"\xff\xfe"),
        lambda file: file.write_text("a: &a [*a]\n"),
    ],
)
def test_what_is_no_yaml_file_is_refused_in_one_line(make, presets, capsys):
    make(presets / "rig" / "other.yaml")
    code, _, err = dry_run(capsys, "--config-dir", str(presets))
    assert (code, len(err.splitlines())) == (2, 1), err
    assert "other.yaml" in err
    assert "internal error" not in err


@pytest.mark.parametrize(
    "text",
    [
        *("# @pack\nwidth: 320\n", "defaults: 3\n", "defaults: [{a: 3}]\n", "- 1\n"),
        *("sources: 3\n", "defaults: [mine]\n", "width: 1\nwidth: 2\n"),
    ],
)
def test_a_preset_that_hydra_cannot_read_is_refused_in_one_line(text, presets, capsys):
    (presets / "rig" / "mine.yaml").write_text(text)
    code, _, err = dry_run(capsys, "--config-dir", str(presets), "rig=mine")
    assert (code, len(err.splitlines())) == (2, 1), err
    assert "--config-dir: " in err
    assert "internal error" not in err


def test_a_missing_folder_and_a_wrong_preset(presets, capsys):
    assert dry_run(capsys, "--config-dir", "absent")[0] == 2
    (presets / "rig" / "mine.yaml").write_text("width: 320\n")
    code, _, err = dry_run(capsys, "--config-dir", str(presets), "rig=mine")
    assert (code, len(err.splitlines())) == (2, 1), err
    assert "is missing" in err
