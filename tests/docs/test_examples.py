"""The README shows a picture of each of its runs, and of the default experiment."""

import re

from test_settings_page import DOCS, load_script

from stixel_cli import compose
from stixel_cli.experiment.stages import pictured_frames

examples = load_script("examples")
README = (DOCS.parent / "README.md").read_text(encoding="utf-8")


def test_all_are_shown():
    shown = re.findall(r"\(docs/figures/example_(\w+)\.webp\)", README)
    assert sorted(shown) == sorted(examples.PICTURES)
    assert {file.stem for file in (DOCS / "figures").glob("example_*")} == {
        f"example_{name}" for name in shown
    }


def test_the_runs_draw_these_frames():
    for name, overrides in examples.examples().items():
        frame = re.match(r"k(\d+)/", examples.PICTURES[name])
        assert frame is None or int(frame[1]) in pictured_frames(compose(overrides))
