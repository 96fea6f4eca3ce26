"""The page of a study: one file, no name twice, its colours the page's, nothing hidden in it."""

import re

import pytest
import study_toy

from stixel_cli.cli.app import main
from stixel_cli.errors import UserError, counted
from stixel_cli.pictures import style
from stixel_cli.report.blocks import Findings, Section, Table
from stixel_cli.report.metrics import decimals, number, percent, quantity
from stixel_cli.report.page import drawing_for_page, smallest_text, svg_for_page, table_for_page
from stixel_cli.report.statistics import statistic
from stixel_cli.report.tables import (
    shown_table,
    table_csv,
    table_latex,
)
from stixel_cli.report.template import inline_html
from stixel_cli.results.reader import listed
from stixel_cli.studies.folder import files_of
from stixel_cli.studies.page import brief


@pytest.fixture(scope="module")
def page(tmp_path_factory, shared_cache):
    """The toy study's page, made by the command line."""
    folder = tmp_path_factory.mktemp("study")
    file = study_toy.write(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        assert (
            main(["study", str(file), "road_user=car", "--trust-code", "--results", str(folder)])
            == 0
        )
    return folder / "toy-road_user=car/report.html"


def test_the_page_is_self_contained(page):
    html = page.read_text(encoding="utf-8")
    assert len(html) < 8e6
    assert not re.search(r"<script|<link|<iframe|<object|@import", html)
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)
    assert "url(http" not in html and "xmlns" not in html
    for where in re.findall(r'(?:href|src)="([^"]*)"', html):
        assert where.startswith(("#", "data:image/png;base64,")), where
    assert "default-src 'none'" in html


def test_text_is_escaped(page):
    html = page.read_text(encoding="utf-8")
    assert "A &lt;toy&gt; &amp; its title" in html
    assert "A &lt;script&gt; is text." in html


def test_paragraphs_are_markdown_without_html():
    assert (
        inline_html("Rig `long_range` & <b>, *now* 2 * 3, a_b_c [0.1, 0.2]")
        == "Rig <code>long_range</code> &amp; &lt;b&gt;, <em>now</em> 2 * 3, a_b_c [0.1, 0.2]"
    )
    assert inline_html("[docs](docs/x.md)") == '<a href="docs/x.md">docs</a>'


@pytest.mark.parametrize(
    ("caption", "clause"),
    [
        ("NIS / d.o.f. over time. Means.", "NIS / d.o.f. over time"),
        ("NIS / d.o.f. Means over time.", "NIS / d.o.f"),
        ("Means; the rest.", "Means"),
        ("One clause", "One clause"),
    ],
)
def test_a_folded_figure_is_named_by_the_first_clause_of_its_caption(caption, clause):
    assert brief(caption) == clause


def test_ids_are_unique_and_references_resolve(page):
    html = page.read_text(encoding="utf-8")
    names = re.findall(r'\bid="([^"]+)"', html)
    assert len(names) == len(set(names)) > 20
    for reference in re.findall(r'(?:href="|url\()#([^")]+)', html):
        assert reference in names


def test_the_answer_is_followed_by_its_table(page):
    html = page.read_text("utf-8")
    assert html.index(">Answer<") < html.index("Table 1. In short.") < html.index("One &amp; only")
    assert "Table 2. 50 % of a_b." in html


def test_the_page_has_styles_for_dark_screens_phones_and_paper(page):
    html = page.read_text(encoding="utf-8")
    assert "@media screen and (prefers-color-scheme: dark)" in html
    assert "@media print" in html and "break-inside: avoid" in html
    assert 'name="viewport"' in html
    assert len(re.findall(r'<div class="scroll[^>]*><table', html)) == html.count("<table")


def test_the_page_has_its_provenance(page):
    html = page.read_text(encoding="utf-8")
    assert "stixel study" in html and "road_user=car" in html
    for stage in ("scenario", "scans", "track", "scores"):
        assert f"<td>{stage}</td>" in html
    for what in ("git revision", "numpy", "machine, processors", "measurement=fabricated"):
        assert what in html
    assert "<td>first</td><td>seeds</td><td>0, 1</td>" in html
    assert 'href="#s1.1"' in html and 'id="s1.1"' in html


def test_the_page_in_a_browser(page, open_page):
    for width, dark in ((1280, False), (390, True)):
        opened = open_page(page, width=width, height=900, dark=dark)
        assert opened.problems == []
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
        text = style.svg(figure).decode()
    assert smallest_text(text) == pytest.approx(6.0)
    shown = drawing_for_page(text, "f1")
    # 288 points with letters of 6 points need 480 px.
    assert shown.least == 480 and shown.width == 480


def test_a_standard_deviation_is_in_the_cell_of_its_value():
    table = Table(
        "t",
        "",
        ("who", "m", "± m", "n"),
        (("a", 0.123456, 0.04, 3), ("b", None, None, 2), ("c", -139.13, 0.0, 2)),
    )
    header, rows, numeric = shown_table(table)
    assert header == ["who", "m ± sd", "n"]
    assert rows == [
        ["a", "0.123 ± 0.040", "3"],
        ["b", "–", "2"],
        ["c", "\u2212139.1 ± 0.0", "2"],
    ]
    assert numeric == [False, True, True]


def test_an_interval_determines_the_digits():
    columns = ("who", "m", "low m", "high m", "p")
    rows = (("a", -5.77012, -26.196, 14.656, 1e-6), ("b", 0.1, 0.071, 0.129, 0.04))
    table = Table("t", "", columns, (*rows, ("c", 0.1, None, None, None)))
    header, shown, numeric = shown_table(table)
    assert header == ["who", "m [95 %]", "p"] and numeric == [False, True, True]
    assert shown[0] == ["a", "−6 [−26, 15]", "< 0.0001"]
    assert shown[1] == ["b", "0.100 [0.071, 0.129]", "0.0400"]
    assert shown[2] == ["c", "0.100", "–"]
    assert "$-$6 [$-$26, 15] & $<$ 0.0001" in table_latex(table)
    assert "-26.196" in table_csv(table)


def test_a_table_in_latex_needs_no_package():
    """pdflatex stops at a σ, a minus or a narrow space of Unicode; it knows letters and quotes."""
    table = Table("t", "σ² of 3 × 2\u202fpx", ("σ", "stixels \u2212 lidar"), (("±1 °", -0.5),))
    latex = table_latex(table)
    assert r"\caption{$\sigma$$^2$ of 3 $\times$ 2\,px}" in latex
    assert r"$\sigma$ & stixels $-$ lidar \\" in latex
    assert latex.isascii()


def test_numbers_in_prose():
    assert quantity(-34.654, "°") == "−34.7°" and quantity(0.0212, "px", 3) == "0.021\u202fpx"
    assert number(None) == number(float("nan")) == "–" and quantity(None, "m") == "–"
    assert number(-0.0004, 3) == "0.000" and number(0.1, 1, sign=True) == "+0.1"
    assert number(1234.5) == "1234" and number(7) == "7"
    assert percent(0.1234) == "12\u202f%" and percent(None) == "–"
    assert listed(["a"]) == "a" and listed("abc") == "a, b and c" and listed([]) == ""
    assert counted(1, "path") == "1 path" and counted(3, "path") == "3 paths"
    assert [decimals(half) for half in (20.0, 3.0, 0.3, 0.0003, 0.0)] == [0, 1, 2, 3, None]


def test_duplicate_and_outside_file_names_are_refused():
    table = Table("t", "", ("a",), ((1,),))
    with pytest.raises(UserError, match=r"two files have the name tables/t\.csv"):
        files_of(Findings((), (Section("s", (table, table)),), {}))
    for name in ("../x", "/x", "report.html"):
        with pytest.raises(UserError, match="is not a valid file name"):
            files_of(Findings((), (), {name: ""}), ("report.html",))


def test_rows_of_a_table_may_lack_columns_of_others():
    table = Table.of("t", [{"a": 1, "b": None}, {"a": 2, "c": "x"}])
    assert table.columns == ("a", "b", "c") and table.rows == ((1, None, None), (2, None, "x"))


def test_statistics_over_seeds():
    one = statistic("", [1.0, None, 3.0, 1.0, 3.0])
    assert (one.n, one.mean) == (4, 2.0)
    # Student's t with three degrees of freedom: 3.1824 sigma / 2, sigma² = 4 / 3.
    assert one.high - one.mean == pytest.approx(3.1824 / 3**0.5, abs=1e-4)
    assert statistic("", [None]).mean is None


def test_large_tables_are_printed_in_landscape_or_small():
    def printed(columns: int, rows: int) -> tuple[bool, bool]:
        table = Table(
            "t", "c", tuple(f"a {i}" for i in range(columns)), ((1.234,) * columns,) * rows
        )
        shown = table_for_page(table)
        return shown["wide"], shown["long"]

    assert printed(9, 20) == (False, False)
    assert printed(9, 64) == (False, True)
    assert printed(26, 64) == (True, False)
    assert printed(3, 0) == (False, False)


def test_intervals_of_many_columns_are_below_their_values():
    def cells(columns: int) -> list[str]:
        names = tuple(f"{end}a{i}" for i in range(columns) for end in ("", "low ", "high "))
        (row,) = table_for_page(Table("t", "c", names, ((1.2, 1.1, 1.4) * columns,)))["rows"]
        assert row[1] == [1.2] * columns
        return row[0]

    assert cells(2) == ["1.20 [1.10, 1.40]"] * 2
    assert cells(3) == ["1.20\n[1.10, 1.40]"] * 3
