"""Write tables of `stixel study accuracy` into the page: python docs/accuracy.py FOLDER."""

import json
import sys
from pathlib import Path

import yaml

from stixel_cli.report.blocks import Table
from stixel_cli.report.tables import markdown_table, shown_table

PAGE = Path(__file__).parent / "accuracy.md"
BEGIN, END = "<!-- tables of the study -->", "<!-- end of the tables -->"
TABLES = {
    "ablation": "Each term left out (the first row of a road user has all terms)",
    "ablation_lidar": "The same on the 64-layer lidar",
    "wrong_class": "The prior of another class, and of no class, next to that of the right one",
    "wrong_class_lidar": "The same on the 64-layer lidar",
    "simulated": "The trackers on simulated measurements",
    "held_out": "Meshes that the generator of the learned shapes does not draw",
    "peers": "The trackers of PyRecEst on the same measurements",
}


def main(folder: Path) -> None:
    """Replace what is between the two comments of the page."""
    study = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    parts = [f"`{study['command']}`, revision {study['git']['revision'][:7]}.\n"]
    for name, caption in TABLES.items():
        table = Table.of(name, report["tables"][name]["rows"])
        parts += [f"{caption}:\n", *markdown_table(*shown_table(table)), ""]
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    tables = "\n".join(parts)
    PAGE.write_text(f"{before}{BEGIN}\n\n{tables}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
