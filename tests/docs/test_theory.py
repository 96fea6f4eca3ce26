"""Every function that the pages of the theory name exists."""

import importlib
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in ("theory", "several_targets")
]
NAMES = sorted(set(re.findall(r"`(\w+(?:\.\w+)+:\w+(?:\.\w+)?)`", "".join(PAGES))))
FOLDERS = ("geometry", "stereo", "stixels", "measurements", "tracking", "evaluation", "validation")


def test_every_folder_is_named():
    assert {name.split(".")[0] for name in NAMES} >= set(FOLDERS)


@pytest.mark.parametrize("page", PAGES)
def test_functions_are_named_in_one_form(page):
    """Otherwise the test below would not check them."""
    odd = re.findall(rf"`((?:{'|'.join(FOLDERS)})[./][^`\n]*)`", page)
    assert [name for name in odd if name not in NAMES] == []


@pytest.mark.parametrize("name", NAMES)
def test_function_exists(name):
    module, _, path = name.partition(":")
    found = importlib.import_module(f"stixel_cli.{module}")
    for part in path.split("."):
        found = getattr(found, part)
    assert found.__doc__


@pytest.mark.parametrize("page", PAGES)
def test_maths_is_closed(page):
    without_code = re.sub(r"`[^`\n]*`", "", page)
    blocks = without_code.split("$$")
    assert len(blocks) % 2 == 1
    for between in blocks[::2]:
        assert between.count("$") % 2 == 0
    for inside in blocks[1::2]:
        assert inside.count("{") == inside.count("}")
        assert inside.count(r"\begin") == inside.count(r"\end")
