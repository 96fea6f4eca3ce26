"""The gallery's page and pictures are those that its script makes; its commands are accepted."""

import importlib.util
import shlex
from pathlib import Path

from stixel_cli import compose
from stixel_cli.experiment.stages import pictured_frames, scan_count

DOCS = Path(__file__).parents[2] / "docs"
MOST_BYTES = 1_500_000


def load_script():
    spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


gallery = load_script()
ENTRIES = [entry for group in gallery.sections().values() for entry in group]


def test_the_page_is_the_scripts():
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page(), (
        "run python docs/gallery.py"
    )


def test_the_pictures_are_the_scripts_and_small():
    files = sorted((DOCS / gallery.FOLDER).iterdir())
    assert [file.name for file in files] == sorted(f"{entry.name}.webp" for entry in ENTRIES)
    assert all(file.read_bytes()[8:12] == b"WEBP" for file in files)
    assert sum(file.stat().st_size for file in files) < MOST_BYTES


def test_every_command_gives_its_picture():
    for entry in ENTRIES:
        configuration = compose(entry.overrides).configuration
        frames = pictured_frames(configuration)
        assert all(frame < scan_count(configuration) for frame in frames), entry.name
        folder, _, name = entry.source.rpartition("/")
        assert (f"k{frames[0]:04d}" if folder else "") == folder, entry.name
        if name not in {"path.png", "errors.png", "birds_eye.png"}:
            assert configuration.measurement.kind == "simulated", entry.name
        command = shlex.join(["stixel", "run", *entry.overrides])
        assert command in (DOCS / "gallery.md").read_text(encoding="utf-8")


def test_a_picture_is_scaled_down_and_never_up():
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.new("RGB", (100, 50), "red").save(buffer, format="png")
    for width, size in ((40, (40, 20)), (400, (100, 50))):
        small = Image.open(io.BytesIO(gallery.small_picture(buffer.getvalue(), width)))
        assert small.size == size
