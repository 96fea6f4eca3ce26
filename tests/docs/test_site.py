"""The site of the documentation (`make docs`) has every page in its navigation, once."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_page_has_an_entry():
    spec = importlib.util.spec_from_file_location("site_conf", ROOT / "docs/site/conf.py")
    settings = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(settings)
    entries = [page for pages in settings.NAVIGATION.values() for page in pages]
    pages = [*(ROOT / "docs").glob("**/*.md"), *(ROOT / "docs").glob("**/*.rst")]
    names = {page.relative_to(ROOT).with_suffix("").as_posix() for page in pages}
    # `make setup` writes the page of the settings.
    assert sorted(entries) == sorted(names | {"CONTRIBUTING", "CHANGELOG", "docs/settings"})
