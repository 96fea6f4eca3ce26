"""The page of the settings is the output of its script, and so complete."""

import importlib.util
from pathlib import Path

from stixel_cli.config.keys import known_keys

DOCS = Path(__file__).parents[2] / "docs"


def load_script(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_page_is_output_of_script():
    settings = load_script("settings")
    text = settings.PAGE.read_text(encoding="utf-8")
    assert text == settings.page(), "run python docs/settings.py"
    assert [name for name in known_keys() if f"| `{name}` |" not in text] == []
