"""What the tests of the configuration share."""

import shutil

import pytest

from stixel_cli.config import folders
from stixel_cli.config.folders import group_options, shipped_folder


@pytest.fixture
def own_conf(tmp_path, monkeypatch):
    """The folder `conf` of a checkout of the user's own."""
    shutil.copytree(shipped_folder("conf"), tmp_path / "conf")
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path / "stixel_cli")
    for known in (group_options, shipped_folder):
        known.cache_clear()
    yield tmp_path / "conf"
    for known in (group_options, shipped_folder):
        known.cache_clear()
