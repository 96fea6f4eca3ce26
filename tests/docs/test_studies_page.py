"""docs/studies.py takes the answers and the trackers' table from the data of reports."""

import importlib.util
import json
from pathlib import Path

import yaml
from stixel_cli.report.blocks import Figure, Findings, Paragraph, Table

from stixel_cli.studies.folder import files_of


def load_script():
    script = Path(__file__).parents[2] / "docs" / "studies.py"
    spec = importlib.util.spec_from_file_location("studies_script", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_pages_have_the_leads_and_the_trackers(tmp_path):
    rows = [{"road user": "car", "tracker": "contour", "n": 5, "mean IoU": 0.9251}]
    opening = (
        Paragraph("Car: 0.12 <m>."),
        Figure("forest", "", b"<svg/>"),
        Paragraph("Details."),
        Table.of("trackers", rows),
    )
    folder = tmp_path / "rq2"
    folder.mkdir()
    data = json.loads(files_of(Findings(opening, (), {}))["report.json"])
    assert data["answer"] == ["Car: 0.12 <m>.", "Details."]
    (folder / "report.json").write_text(json.dumps(data))
    study = {"title": "RQ2", "command": "stixel study rq2", "git": {"revision": "0123456789"}}
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    script = load_script()
    for name in ("PAGE", "README"):
        page = tmp_path / f"{name}.md"
        page.write_text(f"before\n{script.BEGIN}\nold\n{script.END}\nafter\n")
        setattr(script, name, page)
    script.main([folder])
    assert script.PAGE.read_text() == (
        f"before\n{script.BEGIN}\n\n### RQ2\n\n`stixel study rq2`, revision 0123456:\n\n"
        f"- Car: 0.12 <m>.\n\n{script.END}\nafter\n"
    )
    assert "| car | contour | 0.93 |\n" in script.README.read_text()
