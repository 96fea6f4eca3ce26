"""Write the answers and tables of studies into docs/studies.md and docs/accuracy.md.

Run it as: python docs/studies.py FOLDER...
"""

import json
import sys
from pathlib import Path
from typing import Any

import yaml

DOCS = Path(__file__).parent
PAGE, ACCURACY = DOCS / "studies.md", DOCS / "accuracy.md"
BEGIN, END = "<!-- from the studies -->", "<!-- end -->"
TABLES = ("ablation", "ablation_lidar", "wrong_class", "wrong_class_lidar", "simulated", "held_out")
"""Questions of `stixel study accuracy` whose tables are in docs/accuracy.md."""


def main(folders: list[Path]) -> None:
    """Replace what is between the two comments of each page."""
    write(PAGE, "\n".join(answer(folder) for folder in folders))
    for folder in folders:
        if folder.name == "accuracy":
            write(ACCURACY, tables(folder))


def write(page: Path, content: str) -> None:
    """Put the content between the comments of a page."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    page.write_text(f"{before}{BEGIN}\n\n{content}\n{END}{after}", encoding="utf-8")


def request(folder: Path) -> dict[str, Any]:
    """The request of a study, with its revision."""
    return yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))


def answer(folder: Path) -> str:
    """A study's title, command and revision, and the paragraphs of its answer."""
    study = request(folder)
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    revision = study["git"]["revision"][:7]
    lines = [f"### {study['title']}", "", f"`{study['command']}`, revision {revision}:", ""]
    return "\n".join([*lines, *(f"- {text}" for text in report["answer"]), ""])


def tables(folder: Path) -> str:
    """The tables of `TABLES`, each with its name."""
    study = request(folder)
    parts = [f"`{study['command']}`, revision {study['git']['revision'][:7]}.\n"]
    for name in TABLES:
        for file in sorted((folder / "tables").glob(f"{name}*.md")):
            parts += [f"{file.stem.replace('-', ', ', 1).replace('_', ' ')}:\n", file.read_text()]
    return "\n".join(parts)


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
