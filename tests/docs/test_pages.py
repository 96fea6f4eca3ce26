"""Every page names what exists, is reached, and its links, figures and citation are right."""

import importlib
import importlib.util
import json
import re
import runpy
import tomllib
from pathlib import Path

import pytest
import yaml

import stixel_cli
from stixel_cli.config.keys import known_keys
from stixel_cli.scene import parameters, road_user

DOCS = Path(__file__).parents[2] / "docs"


def load_script(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_page_has_every_key():
    text = load_script("settings").page()
    assert [name for name in known_keys() if f"| `{name}` |" not in text] == []


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


_SCORE = re.compile(
    r"\b(?:IoUs?|NEES|NIS|RMSE?|overlaps?|coverage|errors?|intervals?|lost|loss)\b", re.I
)
# As a study writes its numbers, in two decimals or more or as 1.2 %, or a change, 3 → 4. The limits
# of a definition have fewer.
_FIGURE = re.compile(r"(?<![\w.=])\d*\.\d\d+(?!\w|\.\d)|\d+\.\d %|\d(?: %| m| px)? → \.?\d")
_COMMAND = re.compile(r"`[^`]*\b(?:stixel|python|pytest)\s[^`]*`")
_GENERATED = re.compile(r"<!-- from .*?<!-- end -->", re.S)
_CODE = re.compile(r"^```(\w*)(.*?)^```$", re.M | re.S)


def typed_figures(text: str) -> list[str]:
    """Numbers of scores that no script has written and whose paragraph names no command.

    A list item or a row of a table is a paragraph; the one before it that ends with a colon, or a
    block of code, counts with it. What a `console` block of the page prints, a test compares.
    """
    printed = "".join(block[2] for block in _CODE.finditer(text) if block[1] == "console")
    text = _CODE.sub(lambda block: "`stixel :`:" * (block[1] == "sh"), text)
    found, lead, previous = [], "", ""
    for paragraph in _GENERATED.sub("", text).split("\n\n"):
        listed = re.match(r"[-*|]|\d+\. ", paragraph)
        lead = previous if previous.endswith(":") else lead if listed else ""
        for part in re.split(r"\n(?=[-*|]|\d+\. )", paragraph):
            words = re.sub(r"`[^`]*`|\$[^$]*\$|\]\([^)]*\)", "", part)
            if _SCORE.search(words) and not _COMMAND.search(lead + part):
                found += [n for n in _FIGURE.findall(words) if n not in _FIGURE.findall(printed)]
        previous = paragraph.rstrip()
    return found


# `make bench` and docs/gallery.py write the two others as a whole.
BY_HAND = [page for page in PAGES if page.name not in ("benchmark.md", "gallery.md")]


@pytest.mark.parametrize("page", BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_number_of_a_study_is_written_by_a_script_or_names_its_command(page):
    assert typed_figures(page.read_text(encoding="utf-8")) == []


def test_a_typed_number_of_a_study_is_found():
    block = "<!-- from the studies -->\n\nIoU 0.93\n\n<!-- end -->"
    console = "```console\n$ stixel run\nIoU 0.81\n```"
    for allowed in (
        block,
        f"{console}\n\nThe IoU of 0.81 is fair.",
        "Lost below an IoU of 0.2.",
        "The error is 0.12 m (`stixel study rq1`).",
        "By `python bench/a.py`:\n\n| error | 0.12 |\n| error | 0.13 |",
        "`tracker.sigma_f=0.15` changes the error.",
    ):
        assert typed_figures(allowed) == []
    typed = {
        f"{block}\n\nThe IoU is 0.93 there.": ["0.93"],
        f"{console}\n\nThe IoU is 0.82.": ["0.82"],
        "- By `stixel study rq1`.\n- The error is .12 m.": [".12"],
        "By `python bench/a.py`:\n\n| error | 0.12 |\n\nOther errors are 0.13 m.": ["0.13"],
        "Lost tracks: 23 % → 0.": ["3 % → 0"],
        "4.5 % are lost.": ["4.5 %"],
    }
    assert {text: typed_figures(text) for text in typed} == typed


CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REFERENCE_TYPES = {"thesis", "article", "conference-paper"}


def is_named(author):
    return bool(author.get("name")) != bool(author.get("family-names"))


def test_the_citation_is_complete_and_agrees_with_the_package():
    assert CITATION["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= CITATION.keys()
    assert CITATION["authors"]
    assert all(is_named(author) for author in CITATION["authors"])
    assert CITATION["version"] == stixel_cli.__version__
    assert CITATION["license"] == PROJECT["license"]
    assert [a["name"] for a in CITATION["authors"]] == [a["name"] for a in PROJECT["authors"]]
    for reference in CITATION["references"]:
        assert {"type", "title", "authors"} <= reference.keys()
        assert reference["type"] in REFERENCE_TYPES
        assert all(is_named(author) for author in reference["authors"])
    families = {a["family-names"] for r in CITATION["references"] for a in r["authors"]}
    assert {"Olsson", "Wahlström", "Badino", "Hirschmüller", "Konolige", "Huber"} <= families
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{stixel_cli.__version__}]" in text


def test_what_contributing_and_results_name_exists():
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
    text = (ROOT / "results" / "README.md").read_text(encoding="utf-8")
    (link,) = re.findall(r"\]\(([^)]+)\)", text)
    assert "manifest.json" in (ROOT / "results" / link).read_text(encoding="utf-8")


THEORY = [
    (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in ("theory", "several_targets")
]
NAMES_OF_FUNCTIONS = sorted(set(re.findall(r"`(\w+(?:\.\w+)+:\w+(?:\.\w+)?)`", "".join(THEORY))))
FOLDERS = ("geometry", "stereo", "stixels", "measurements", "tracking", "evaluation", "validation")


def test_every_folder_is_named():
    assert {name.split(".")[0] for name in NAMES_OF_FUNCTIONS} >= set(FOLDERS)


@pytest.mark.parametrize("page", THEORY)
def test_functions_are_named_in_one_form_and_maths_is_closed(page):
    """Otherwise the test below would not check them."""
    odd = re.findall(rf"`((?:{'|'.join(FOLDERS)})[./][^`\n]*)`", page)
    assert [name for name in odd if name not in NAMES_OF_FUNCTIONS] == []
    without_code = re.sub(r"`[^`\n]*`", "", page)
    blocks = without_code.split("$$")
    assert len(blocks) % 2 == 1
    for between in blocks[::2]:
        assert between.count("$") % 2 == 0
    for inside in blocks[1::2]:
        assert inside.count("{") == inside.count("}")
        assert inside.count(r"\begin") == inside.count(r"\end")


@pytest.mark.parametrize("name", NAMES_OF_FUNCTIONS)
def test_function_exists(name):
    module, _, path = name.partition(":")
    found = importlib.import_module(f"stixel_cli.{module}")
    for part in path.split("."):
        found = getattr(found, part)
    assert found.__doc__


def test_constants_of_the_theory_are_in_the_code():
    table = THEORY[0].partition("### Constants of this tracker")[2].partition("\n## ")[0]
    named = re.findall(r"`([A-Z_]{3,})`", "".join(re.findall(r"^\| (.*?) \|", table, re.M)))
    folders = (ROOT / "stixel_cli" / name for name in ("tracking", "measurements"))
    files = (file for folder in folders for file in folder.rglob("*.py"))
    code = "".join(file.read_text(encoding="utf-8") for file in files)
    missing = [one for one in named if not re.search(rf"^(\w+, )*{one}\b.*=", code, re.M)]
    assert named and missing == []


def test_pages_have_the_answers_and_the_tables(tmp_path):
    folder = tmp_path / "accuracy"
    (folder / "tables").mkdir(parents=True)
    (folder / "report.json").write_text(json.dumps({"answer": ["Car: 0.12 <m>.", "Details."]}))
    (folder / "tables/held_out-car.md").write_text("| contour | 0.93 |\n\n- Words.\n")
    (folder / "tables/peers-car.md").write_text("| contour | 0.99 |\n")
    study = {"title": "How", "command": "stixel study accuracy", "git": {"revision": "0123456789"}}
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    script = runpy.run_path(str(DOCS / "studies.py"))
    places = script["main"].__globals__
    for name in ("PAGE", "ACCURACY"):
        page = tmp_path / f"{name}.md"
        old = "### How\n\nold\n\n### Other\n\nstays"
        page.write_text(f"before\n{script['BEGIN']}\n{old}\n{script['END']}\nafter\n")
        places[name] = page
    script["main"]([folder])
    assert places["PAGE"].read_text() == (
        f"before\n{script['BEGIN']}\n\n### How\n\n`stixel study accuracy`, revision 0123456:\n\n"
        f"- Car: 0.12 <m>.\n- Details.\n\n### Other\n\nstays\n\n{script['END']}\nafter\n"
    )
    text = places["ACCURACY"].read_text()
    assert "Meshes of another origin, car:\n\n| contour | 0.93 |\n" in text
    assert "0.99" not in text and "Words" not in text


def test_a_block_of_real_data_has_what_its_command_prints(tmp_path, monkeypatch):
    script = load_script("real_data")
    (tmp_path / "prints.py").write_text(
        "import sys\nprint('| a |\\n|---|\\nin all', sys.argv[1])\n"
    )
    monkeypatch.setenv("STIXEL_DATA", "here")
    block = f"<!-- from {tmp_path / 'prints.py'} $STIXEL_DATA -->\n{{}}\n<!-- end -->"
    page = f"Before.\n\n{block}\n\nAfter.\n"
    new = page.format("\n| a |\n|---|\n\n- in all here\n")
    assert script.BLOCK.sub(script.written, page.format("old")) == new
    page = (DOCS / "real-data.md").read_text(encoding="utf-8")
    assert all((ROOT / block[2].split()[0]).is_file() for block in script.BLOCK.finditer(page))
    assert len(script.BLOCK.findall(page)) == page.count("<!-- end -->") == 4


def test_every_page_has_an_entry():
    settings = load_script("site/conf")
    entries = [page for pages in settings.NAVIGATION.values() for page in pages]
    pages = [*DOCS.glob("**/*.md"), *DOCS.glob("**/*.rst")]
    names = {page.relative_to(DOCS.parent).with_suffix("").as_posix() for page in pages}
    # `make setup` writes the page of the settings.
    assert sorted(entries) == sorted(names | {"CONTRIBUTING", "CHANGELOG", "docs/settings"})
