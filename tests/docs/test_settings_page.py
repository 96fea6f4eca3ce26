"""The page of the settings, which `make setup` writes, is complete."""

import importlib.util
from pathlib import Path

from stixel_cli.config.keys import known_keys

DOCS = Path(__file__).parents[2] / "docs"


def load_script(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_page_has_every_key():
    text = load_script("settings").page()
    assert [name for name in known_keys() if f"| `{name}` |" not in text] == []
