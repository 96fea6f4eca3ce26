"""Folders of presets: the shipped ones, and the user's own, `--config-dir`."""

import json
import os
import shutil

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.config import folders
from stixel_cli.config.choice import compose_options
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import (
    EXPERIMENT,
    default_option,
    group_options,
    inner_options,
    innermost_group,
    option_values,
    options_of_kind,
    outer_options,
    shipped_folder,
    use_presets,
)
from stixel_cli.errors import ConfigurationError


def flatten(plain, prefix=""):
    for key, value in plain.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


@pytest.mark.parametrize("group", [group for group in group_options() if group != EXPERIMENT])
def test_values_are_those_of_the_yaml(group):
    for option in group_options()[group]:
        text = (shipped_folder("conf") / group / f"{option}.yaml").read_text(encoding="utf-8")
        content = yaml.safe_load(text)
        content.pop("defaults", None)
        assert option_values(group, option) == dict(flatten(content))


def test_default_options():
    text = (shipped_folder("conf") / "config.yaml").read_text(encoding="utf-8")
    chosen = [item for item in yaml.safe_load(text)["defaults"] if isinstance(item, dict)]
    for group, option in (pair for item in chosen for pair in item.items()):
        expected = "car" if option == "${road_user}" else option
        assert default_option(group) == expected


def test_an_installed_copy_is_taken_where_there_is_no_checkout_and_a_missing_folder_is_said(
    tmp_path, monkeypatch
):
    package = tmp_path / "site-packages" / "stixel_cli"
    shutil.copytree(shipped_folder("conf"), package / "conf")
    # Somebody else's folder of the same name.
    (package.parent / "conf").mkdir()
    find = shipped_folder.__wrapped__
    monkeypatch.setattr(folders, "_PACKAGE", package)
    assert find("conf") == package / "conf"
    (package.parent / "pyproject.toml").touch()
    assert find("conf") == package.parent / "conf"
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path / "stixel_cli")
    with pytest.raises(ConfigurationError, match="conf: the folder is missing"):
        find("conf")


def test_a_group_within_another():
    assert inner_options("measurement", "fabricated") == {"measurement/noise": "stereo"}
    assert inner_options("measurement", "stixels") == {}
    assert outer_options("measurement/noise") == ("fabricated",)
    assert outer_options("measurement") == ()
    assert default_option("measurement/noise") == "stereo"
    assert innermost_group("measurement.noise.range_std") == "measurement/noise"
    assert innermost_group("measurement.noise") == "measurement/noise"
    assert innermost_group("measurement.rays") == "measurement"
    assert innermost_group("nothing.rays") == ""
    assert options_of_kind("measurement/noise", "constant") == ["constant"]
    fitted = options_of_kind("measurement/noise", "fitted")
    assert {"fitted_car", "fitted_cyclist", "fitted_pedestrian"} <= set(fitted)


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


def test_presets_are_options_like_those_of_conf_until_the_next_command(presets, capsys):
    words = ["tracker=coarse", "rig=mine", "experiment=quick", "measurement=fabricated"]
    code, out, err = dry_run(capsys, "--config-dir", str(presets), *words)
    assert code == 0, err
    config = json.loads(out)["config"]
    assert (config["tracker"]["basis_points"], config["rig"]["width"]) == (12, 320)
    assert (config["path"]["kind"], config["path"]["duration"]) == ("crossing", 0.5)
    assert "coarse" in group_options()["tracker"]
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


def write(content):
    """Make a file of a text or bytes."""
    return lambda file: file.write_bytes(
        content if isinstance(content, bytes) else content.encode()
    )


@pytest.mark.parametrize(
    ("name", "make", "fault"),
    [
        ("tracker/gp_ekf.yaml", write("a: 1\n"), "tracker=gp_ekf exists; rename it"),
        ("trackers/mine.yaml", write("a: 1\n"), "must be in a folder of a group's name"),
        ("mine.yaml", write("a: 1\n"), "must be in a folder of a group's name"),
        ("rig/other.yaml", lambda file: file.symlink_to("/dev/zero"), "other.yaml"),
        ("rig/other.yaml", os.mkfifo, "other.yaml"),
        ("rig/other.yaml", write(b"\xff\xfe"), "other.yaml"),
        ("rig/mine.yaml", write("width: 320\n"), "is missing"),
        ("rig/mine.yaml", write("# @pack\nwidth: 320\n"), "--config-dir: "),
        ("rig/mine.yaml", write("defaults: 3\n"), "--config-dir: "),
        ("rig/mine.yaml", write("defaults: [{a: 3}]\n"), "--config-dir: "),
        ("rig/mine.yaml", write("- 1\n"), "--config-dir: "),
        ("rig/mine.yaml", write("sources: 3\n"), "--config-dir: "),
        ("rig/mine.yaml", write("defaults: [mine]\n"), "--config-dir: "),
        ("rig/mine.yaml", write("width: 1\nwidth: 2\n"), "--config-dir: "),
    ],
)
def test_what_is_no_preset_is_refused_in_one_line(name, make, fault, presets, capsys):
    (presets / name).parent.mkdir(exist_ok=True)
    make(presets / name)
    chosen = ["rig=mine"] if name == "rig/mine.yaml" else []
    code, _, err = dry_run(capsys, "--config-dir", str(presets), *chosen)
    assert (code, len(err.splitlines())) == (2, 1), err
    assert fault in err
    assert "internal error" not in err


def test_a_missing_folder(capsys):
    assert dry_run(capsys, "--config-dir", "absent")[0] == 2
