"""Write the answers of studies into docs/studies.md, and RQ2's trackers on stixels into the README.

Run it as: python docs/studies.py FOLDER...
"""

import json
import sys
from pathlib import Path
from typing import Any

import yaml

from stixel_cli.report.tables import markdown_table

README = Path(__file__).parent.parent / "README.md"
PAGE = Path(__file__).parent / "studies.md"
BEGIN, END = "<!-- from the studies -->", "<!-- end -->"


def main(folders: list[Path]) -> None:
    """Replace what is between the two comments of each page."""
    write(PAGE, "\n".join(answer(folder) for folder in folders))
    for folder in folders:
        if folder.name == "rq2":
            write(README, trackers(report(folder)["tables"]["trackers"]["rows"]))


def write(page: Path, content: str) -> None:
    """Put the content between the comments of a page."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    page.write_text(f"{before}{BEGIN}\n\n{content}\n{END}{after}", encoding="utf-8")


def report(folder: Path) -> dict[str, Any]:
    """The report of a study as data."""
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


def answer(folder: Path) -> str:
    """A study's title, command and revision, and the sentences at the top of its report."""
    study = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    revision = study["git"]["revision"][:7]
    lines = [f"### {study['title']}", "", f"`{study['command']}`, revision {revision}:", ""]
    return "\n".join([*lines, *(f"- {sentence}" for sentence in report(folder)["leads"]), ""])


def trackers(rows: list[dict[str, Any]]) -> str:
    """A table of RQ2's trackers on stixels: the means over paths and seeds."""
    header = [column for column in rows[0] if column != "n"]
    cells = [
        [row[column] if i < 2 else f"{row[column]:.2f}" for i, column in enumerate(header)]
        for row in rows
    ]
    return "\n".join([*markdown_table(header, cells, [i > 1 for i in range(len(header))]), ""])


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
