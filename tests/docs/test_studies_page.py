"""docs/studies.py takes the answers and the tables from the data of reports."""

import json
import runpy
from pathlib import Path

import yaml

SCRIPT = Path(__file__).parents[2] / "docs" / "studies.py"


def test_pages_have_the_answers_and_the_tables(tmp_path):
    folder = tmp_path / "accuracy"
    (folder / "tables").mkdir(parents=True)
    (folder / "report.json").write_text(json.dumps({"answer": ["Car: 0.12 <m>.", "Details."]}))
    (folder / "tables/held_out-car.md").write_text("| contour | 0.93 |\n\n- Words.\n")
    (folder / "tables/peers-car.md").write_text("| contour | 0.99 |\n")
    study = {"title": "How", "command": "stixel study accuracy", "git": {"revision": "0123456789"}}
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    script = runpy.run_path(str(SCRIPT))
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
    assert "held out, car:\n\n| contour | 0.93 |\n" in text
    assert "0.99" not in text and "Words" not in text
