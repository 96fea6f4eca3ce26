import shutil

import pytest
import yaml

from stixel_cli.config import folders
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


def test_installed_copy_is_taken_where_there_is_no_checkout(tmp_path, monkeypatch):
    package = tmp_path / "site-packages" / "stixel_cli"
    shutil.copytree(shipped_folder("conf"), package / "conf")
    # Somebody else's folder of the same name.
    (package.parent / "conf").mkdir()
    monkeypatch.setattr(folders, "_PACKAGE", package)
    assert shipped_folder("conf") == package / "conf"
    (package.parent / "pyproject.toml").touch()
    assert shipped_folder("conf") == package.parent / "conf"


def test_a_missing_folder_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path / "stixel_cli")
    with pytest.raises(ConfigurationError, match="conf: the folder is missing"):
        shipped_folder("conf")


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
