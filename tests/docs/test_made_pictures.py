"""Pictures and tables are the output of their scripts, small, and of valid commands."""

import io
import re
import shlex
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from test_pages import DOCS, load_script

from stixel_cli import compose
from stixel_cli.answers.runs import Runs
from stixel_cli.border.origins import TYPED
from stixel_cli.config.overrides import check_overrides, read_overrides

MOST_BYTES = 1_800_000


def pictured_frames(composition):
    return composition.configuration.pictures.frames_of(composition.scan_count)


gallery = load_script("gallery")
ENTRIES = [entry for group in gallery.sections().values() for entry in group]


def test_the_gallery_is_the_output_of_its_script_and_small():
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page(), (
        "run python docs/gallery.py"
    )
    files = sorted((DOCS / gallery.FOLDER).iterdir())
    assert [file.name for file in files] == sorted(f"{entry.name}.webp" for entry in ENTRIES)
    assert all(file.read_bytes()[8:12] == b"WEBP" for file in files)
    assert sum(file.stat().st_size for file in files) < MOST_BYTES


@pytest.mark.parametrize("heading", gallery.sections())
def test_every_command_is_on_the_page_and_valid(heading):
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    section = text.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    entries = gallery.sections()[heading]
    for entry in entries:
        check_overrides(read_overrides(entry.overrides, TYPED))
        assert all(shlex.quote(override) in section for override in entry.overrides)


@pytest.mark.parametrize("group", gallery.sections().values(), ids=gallery.sections())
def test_commands_draw_their_pictures(group, monkeypatch):
    """One entry per section: the entries of a section differ only in the option."""
    monkeypatch.chdir(DOCS.parent)
    entry = group[-1]
    composition = compose(entry.overrides)
    frames = pictured_frames(composition)
    assert all(frame < composition.scan_count for frame in frames)
    folder, _, name = entry.source.rpartition("/")
    assert (f"k{frames[0]:04d}" if folder else "") == folder
    if name not in {"path.png", "errors.png", "birds_eye.png"}:
        assert composition.configuration.measurement.kind == "stixels"


@pytest.mark.drawn
def test_one_picture_can_be_drawn_without_the_others(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "DOCS", tmp_path)
    gallery.main(["path_stop_and_go"])
    (file,) = (tmp_path / gallery.FOLDER).iterdir()
    assert file.name == "path_stop_and_go.webp"
    assert (tmp_path / "gallery.md").read_text(encoding="utf-8") == gallery.page()
    with pytest.raises(SystemExit, match="path_stop: unknown picture"):
        gallery.main(["path_stop"])


def test_pictures_keep_their_size():
    """Scaled down, their letters would be smaller than 10 px."""
    buffer = io.BytesIO()
    Image.new("RGB", (1200, 50), "red").save(buffer, format="png")
    assert Image.open(io.BytesIO(gallery.small_file(buffer.getvalue()))).size == (1200, 50)


examples = load_script("examples")
README = (DOCS.parent / "README.md").read_text(encoding="utf-8")


def test_all_examples_are_shown_and_drawn():
    shown = re.findall(r"\(docs/figures/example_(\w+)\.webp\)", README)
    assert sorted(shown) == sorted(examples.PICTURES)
    assert {file.stem for file in (DOCS / "figures").glob("example_*")} == {
        f"example_{name}" for name in shown
    }
    for name, overrides in examples.examples().items():
        frame = re.match(r"k(\d+)/", examples.PICTURES[name])
        assert frame is None or int(frame[1]) in pictured_frames(compose(overrides))


moving_picture = load_script("moving_picture")
MOST_BYTES_MOVING = 1_500_000


def test_readme_begins_with_it_and_it_is_small():
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"!\[[^\]]+\]\(([^)]+)\)", readme)
    assert DOCS.parent / shown[1] == moving_picture.FILE
    assert moving_picture.FILE.stat().st_size < MOST_BYTES_MOVING
    with Image.open(moving_picture.FILE) as picture:
        assert picture.n_frames == 100


@pytest.mark.drawn
def test_each_frame_of_the_run_is_shown(tmp_path):
    file = tmp_path / "picture.gif"
    small = ["path.duration=0.2", "rig.width=160", "rig.height=120", "pictures.frames=[]"]
    moving_picture.main(small, file)
    with Image.open(file) as picture:
        assert picture.n_frames == 2
        first = np.asarray(picture.convert("RGB"))
    assert first.shape[0] == moving_picture.HEIGHT
    assert np.ptp(first[:, : moving_picture.WIDTH]) > 100  # the camera's image
    colours = {tuple(pixel) for pixel in first[:, moving_picture.WIDTH :].reshape(-1, 3)}
    assert len(colours) > 5  # axes, points and contours


terminal = load_script("terminal")
MOST_BYTES_OF_A_TERMINAL = 60_000


@pytest.mark.parametrize("name", terminal.PICTURES)
def test_picture(name):
    file = DOCS / "figures" / f"{name}.svg"
    text = file.read_text(encoding="utf-8")
    assert len(text) < MOST_BYTES_OF_A_TERMINAL
    words = "".join(ElementTree.fromstring(text).itertext()).replace("\xa0", " ")
    for command in terminal.PICTURES[name]:
        assert f"$ {command}" in words, f"run python docs/terminal.py {name}"
    assert set(re.findall(r"https?://[^\s\"]+", text)) == {"http://www.w3.org/2000/svg"}


def test_output_has_its_colours_and_errors(tmp_path):
    command = "python -c 'import sys; print(sys.stdout.isatty()); sys.exit(\"wrong\")'"
    assert terminal.output_on_a_terminal(command, tmp_path) == "True\nwrong\n"
    svg = terminal.picture(["printf '\\033[31mred'"])
    assert ">red<" in svg and "fonts" not in svg


script = load_script("home_away")


def test_a_cell_has_overlap_consistency_and_losses():
    rows = [
        {"tracker": name, "seed": seed, "status": "done", "track_lost": int(name == "box")}
        | {"iou_box_mean": 0.8 + 0.02 * seed, "nees_position_mean": 1.0 + seed}
        for name in script.TRACKERS
        for seed in range(4)
    ]
    runs = Runs(pd.DataFrame(rows), ("tracker", "seed"))
    lines = script.table({"made": (runs, "seed")}).splitlines()
    cells = dict(
        re.findall(r"\| `(\w+)` \| 0\.83 \[0\.\d\d, 0\.\d\d\], (2\.5, \d+ %) \|", str(lines))
    )
    assert cells == {name: f"2.5, {100 * (name == 'box')} %" for name in script.TRACKERS}


def test_the_readme_has_its_table_or_says_that_it_is_gone():
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    place = text.partition(script.BEGIN)[2].partition(script.END)[0]
    rows = [
        re.match(r"\| `(\w+)` (\| [\d.]+ \[[^]]+\], [\d.]+, \d+ % ){4}\|", row)
        for row in place.split("\n")
    ]
    assert tuple(row[1] for row in rows if row) == script.TRACKERS or "are gone" in place
