"""CONTRIBUTING and the README of the results name what exists."""

import re
from pathlib import Path

from stixel_cli.scene import parameters, road_user

ROOT = Path(__file__).parents[2]


def test_the_places_of_a_class_of_road_user_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| a class of road user \|.*$", text, flags=re.MULTILINE)
    for module, names in (
        (parameters, ("RoadUserClass", "CLASS_ROWS")),
        (road_user, ("_CLASSES",)),
    ):
        for name in names:
            assert f"`{name}`" in row and hasattr(module, name)
    named = re.findall(r"`([\w/]+\.(?:py|yaml))`", row)
    assert len(named) >= 8
    for one in (name for name in named if "NAME" not in name):
        assert any((ROOT / folder / one).exists() for folder in ("", "stixel_cli")), one
    for folder in ("conf/road_user", "conf/pace", "conf/prior"):
        users = {file.stem for file in (ROOT / folder).glob("*.yaml")} - {"unknown"}
        assert users == set(parameters.CLASS_ROWS)
    noises = {file.stem for file in (ROOT / "conf/measurement/noise").glob("fitted_*.yaml")}
    assert noises == {f"fitted_{name}" for name in parameters.CLASS_ROWS}


def test_the_list_of_files_that_results_refers_to_exists():
    text = (ROOT / "results" / "README.md").read_text(encoding="utf-8")
    (link,) = re.findall(r"\]\(([^)]+)\)", text)
    assert "manifest.json" in (ROOT / "results" / link).read_text(encoding="utf-8")
