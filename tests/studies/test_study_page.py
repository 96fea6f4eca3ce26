"""The page of a study: one file, no name twice, its colours the page's, nothing hidden in it."""

import re

import pytest
import study_toy

from stixel_cli.cli.app import main
from stixel_cli.pictures import style
from stixel_cli.report.metrics import decimals, number, quantity
from stixel_cli.report.page import drawing_for_page, smallest_text, svg_for_page

pytestmark = pytest.mark.drawn


@pytest.fixture(scope="module")
def page(tmp_path_factory, shared_cache):
    """The toy study's page, made by the command line."""
    folder = tmp_path_factory.mktemp("study")
    file = study_toy.write(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        words = ["study", str(file), "road_user=car", "--trust-code", "--results", str(folder)]
        assert main(words) == 0
    return folder / "toy-road_user=car/report.html"


def test_the_page_is_self_contained_begins_with_the_answer_and_has_its_provenance(page):
    html = page.read_text(encoding="utf-8")
    assert len(html) < 1e6
    assert not re.search(r"<script|<link|<iframe|<object|@import", html)
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)
    assert "url(http" not in html and "xmlns" not in html
    for where in re.findall(r'(?:href|src)="([^"]*)"', html):
        assert where.startswith(("#", "data:image/png;base64,")) or (page.parent / where).exists()
    assert "default-src 'none'" in html
    names = re.findall(r'\bid="([^"]+)"', html)
    assert len(names) == len(set(names)) > 20
    for reference in re.findall(r'(?:href="|url\()#([^")]+)', html):
        assert reference in names
    # Text is escaped.
    assert "A &lt;toy&gt; &amp; its title" in html and "By &lt;hand&gt;." in html
    few = "2 seeds: too few to compare, 4 are needed"
    ordered = ['<p class="answer">&lt;b&gt; IoU. car: ', few]
    ordered += ["<p>By width: ", "<h2>One &amp; only</h2>", "<h2>Widths</h2>"]
    ordered += ["<h2>Own &amp; only</h2>", ">a_b &lt;i&gt;</th>", "Where the results come from"]
    places = [html.index(text) for text in ordered]
    assert places == sorted(places)
    # Only the first question's answers are open.
    assert html.count("<details open>") == 1 < html.count("<summary><h2>")
    # The worst run of each tracker, and of each width.
    assert len(re.findall(r'<a href="sweeps/first/runs/\d+[^"]*">0', html)) == 2
    assert len(re.findall(r'<a href="sweeps/second/runs/\d+[^"]*">0', html)) == 2
    assert not re.search(r"\bnan\b|\binf\b", html)
    assert "stixel study" in html and "<code>road_user=car</code>" in html
    cells = ['<td class="">measurement</td><td class="">fabricated</td>', "numpy", ">0, 1</td>"]
    for text in (*cells, '<td class="">first</td><td class="">4</td><td class="">4</td>'):
        assert text in html


def test_the_page_in_a_browser(page, open_page):
    for width, dark in ((1280, False), (390, True)):
        opened = open_page(page, width=width, height=900, dark=dark)
        assert opened.overflow() == 0


def test_a_figure_takes_the_colours_of_the_page():
    with style.drawing():
        figure = style.new_figure(2.0, 1.0)
        axes = figure.subplots()
        axes.plot([0, 1], color=style.RUNS[1], label="a")
        axes.plot([1, 0], color=style.TRUTH)
        axes.set_title("title")
        svg, points = svg_for_page(style.svg(figure).decode(), "f7")
    assert points == pytest.approx(144.0)
    assert not re.search("#000000|#ffffff|#1a1a1a", svg) and style.RUNS[1] not in svg
    assert "currentColor" in svg and "var(--run-1)" in svg and "var(--paper)" in svg
    assert re.match(r'<svg fill="currentColor"[^>]*viewBox', svg)
    assert "<style" not in svg and not re.search(r'id="(?!f7-)', svg)


def test_no_text_of_a_drawing_is_shown_below_10_px():
    with style.drawing():
        figure = style.new_figure(4.0, 1.0)
        figure.text(0.1, 0.5, "large", fontsize=12.0)
        figure.text(0.6, 0.5, "small", fontsize=6.0, rotation=90.0)
        drawing = style.svg(figure)
    assert smallest_text(drawing.decode()) == pytest.approx(6.0)
    shown = drawing_for_page(drawing, "f1")
    # 288 points with letters of 6 points need 480 px.
    assert shown["least"] == 480 and shown["width"] == 480


def test_numbers_in_prose():
    assert quantity(-34.654, "°") == "−34.7°" and quantity(0.0212, "px", 3) == "0.021\u202fpx"
    assert number(None) == number(float("nan")) == "–" and quantity(None, "m") == "–"
    assert number(-0.0004, 3) == "0.000" and number(0.1, 1, sign=True) == "+0.1"
    assert number(1234.5) == "1234" and number(7) == "7"
    assert [decimals(half) for half in (20.0, 3.0, 0.3, 0.0003, 0.0)] == [0, 1, 2, 3, None]
