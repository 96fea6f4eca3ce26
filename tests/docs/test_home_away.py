"""The README's table of trackers at home and away is of the form that its script writes."""

import re

import pandas as pd
from test_settings_page import DOCS, load_script

from stixel_cli.answers.runs import Runs

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
