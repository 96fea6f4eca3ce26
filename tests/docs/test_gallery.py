"""The gallery is the output of its script, and its commands are valid."""

import io
import shlex

import pytest
from test_settings_page import DOCS, load_script

from stixel_cli import compose
from stixel_cli.border import TYPED
from stixel_cli.config.overrides import check_overrides, read_overrides
from stixel_cli.experiment.stages import pictured_frames, scan_count

MOST_BYTES = 1_800_000


gallery = load_script("gallery")
ENTRIES = [entry for group in gallery.sections().values() for entry in group]


def test_page_is_output_of_script():
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page(), (
        "run python docs/gallery.py"
    )


def test_pictures_are_output_of_script_and_small():
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
    assert all(frame < scan_count(composition) for frame in frames)
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
    from PIL import Image

    buffer = io.BytesIO()
    Image.new("RGB", (1200, 50), "red").save(buffer, format="png")
    assert Image.open(io.BytesIO(gallery.small_file(buffer.getvalue()))).size == (1200, 50)
