"""Relative links and pictures of every page have a target, headings included."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/**/*.md", "results/README.md", "stixel_cli/**/*.md")
    for page in ROOT.glob(pattern)
    if page.name != "settings.md"  # `make setup` writes it; a clone has none to link to
)
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def prose(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", prose(page), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> list[str]:
    broken = []
    for target in _LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(target)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links(page):
    assert broken_links(page) == []


def test_every_page_is_reached_from_the_readme():
    reached, ahead = set(), [ROOT / "README.md"]
    while ahead:
        page = ahead.pop().resolve()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        for target in _LINK.findall(prose(page)):
            file = page.parent / target.partition("#")[0]
            if not re.match(r"[a-z]+:", target) and file.exists():
                ahead.append(file)
    docs = {page.resolve() for page in PAGES if page.is_relative_to(ROOT / "docs")}
    assert docs <= reached


def test_a_broken_link_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One two\n[a](page.md#one-two) [b](#three) ![c](no.png) [d](https://e.org)\n")
    assert broken_links(page) == ["#three", "no.png"]


def test_the_readme_says_on_which_paths_its_figures_are_and_where_tracks_are_lost():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    before, _, _ = text.partition("<!-- from docs/home_away.py -->")
    assert "(turn, crossing, approach;" in before[-1200:]
    assert "docs/studies.md#where-gp_ekf-loses-the-target" in before[-1200:]
