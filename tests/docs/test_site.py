"""The site of the documentation (`make docs`) has every page in its navigation, once."""

from test_settings_page import DOCS, load_script


def test_every_page_has_an_entry():
    settings = load_script("site/conf")
    entries = [page for pages in settings.NAVIGATION.values() for page in pages]
    pages = [*DOCS.glob("**/*.md"), *DOCS.glob("**/*.rst")]
    names = {page.relative_to(DOCS.parent).with_suffix("").as_posix() for page in pages}
    # `make setup` writes the page of the settings.
    assert sorted(entries) == sorted(names | {"CONTRIBUTING", "CHANGELOG", "docs/settings"})
