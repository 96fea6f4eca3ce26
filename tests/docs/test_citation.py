"""CITATION.cff has the fields that format 1.2.0 requires, and agrees with the package."""

import tomllib
from pathlib import Path

import yaml

import stixel_cli

ROOT = Path(__file__).parents[2]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REFERENCE_TYPES = {"thesis", "article", "conference-paper"}


def is_named(author):
    return bool(author.get("name")) != bool(author.get("family-names"))


def test_required_fields():
    assert CITATION["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= CITATION.keys()
    assert CITATION["authors"]
    assert all(is_named(author) for author in CITATION["authors"])


def test_it_agrees_with_the_package():
    assert CITATION["version"] == stixel_cli.__version__
    assert CITATION["license"] == PROJECT["license"]
    assert [a["name"] for a in CITATION["authors"]] == [a["name"] for a in PROJECT["authors"]]


def test_references_are_complete():
    for reference in CITATION["references"]:
        assert {"type", "title", "authors"} <= reference.keys()
        assert reference["type"] in REFERENCE_TYPES
        assert all(is_named(author) for author in reference["authors"])
    families = {a["family-names"] for r in CITATION["references"] for a in r["authors"]}
    assert {"Olsson", "Wahlström", "Badino", "Hirschmüller", "Konolige", "Huber"} <= families


def test_the_changelog_has_the_version():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{stixel_cli.__version__}]" in text
