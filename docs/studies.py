"""Write the answers and tables of studies into docs/studies.md and docs/accuracy.md.

Run it as: python docs/studies.py FOLDER...
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import yaml

DOCS = Path(__file__).parent
PAGE, ACCURACY = DOCS / "studies.md", DOCS / "accuracy.md"
SECTION = re.compile(r"^(?=### )", re.MULTILINE)
BEGIN, END = "<!-- from the studies -->", "<!-- end -->"
TABLES = {
    "accuracy": [
        "ablation",
        "wrong_class",
        "wrong_class_lidar",
        "simulated",
        "held_out",
    ],
    "consistency": ["by_measurement"],
    "robustness_real": ["terms"],
    "rq1": ["near"],
}
"""Study to the questions whose tables are written, too: those of `accuracy` to docs/accuracy.md."""


def main(folders: list[Path]) -> None:
    """Replace what is between the two comments of each page; other studies' answers stay."""
    known = {one.partition("\n")[0]: one for one in SECTION.split(content(PAGE)) if one}
    known |= {one.partition("\n")[0]: one for one in map(answer, folders)}
    write(PAGE, "\n".join(one.strip("\n") + "\n" for one in known.values()))
    for folder in folders:
        if folder.name == "accuracy":
            of_study = request(folder)
            origin = f"`{of_study['command']}`, revision {of_study['git']['revision'][:7]}.\n"
            write(ACCURACY, "\n".join([origin, *tables(folder)]))


def content(page: Path) -> str:
    """What is between the comments of a page."""
    return page.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0].strip("\n")


def write(page: Path, written: str) -> None:
    """Put what is `written` between the comments of a page."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    page.write_text(f"{before}{BEGIN}\n\n{written}\n{END}{after}", encoding="utf-8")


def request(folder: Path) -> dict[str, Any]:
    """The request of a study, with its revision."""
    return yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))


def answer(folder: Path) -> str:
    """A study's title, command and revision, and the paragraphs of its answer."""
    study = request(folder)
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    revision = study["git"]["revision"][:7]
    lines = [f"### {study['title']}", "", f"`{study['command']}`, revision {revision}:", ""]
    lines += [*(f"- {text}" for text in report["answer"]), ""]
    return "\n".join(lines if folder.name == "accuracy" else [*lines, *tables(folder)])


def tables(folder: Path) -> list[str]:
    """The tables of a study's `TABLES`, each with its heading, without the sentences below them."""
    parts, of_study = [], folder / "tables"
    shipped = DOCS.parent / "pipelines" / "studies" / f"{folder.name}.yaml"
    questions = yaml.safe_load(shipped.read_text(encoding="utf-8"))["questions"]
    for name in TABLES.get(folder.name, ()):
        for file in (*of_study.glob(f"{name}.md"), *sorted(of_study.glob(f"{name}-*.md"))):
            rows = [row for row in file.read_text(encoding="utf-8").splitlines() if row[:1] == "|"]
            group = file.stem.removeprefix(name).replace("-", ", ", 1)
            parts += [f"{questions[name]['heading']}{group}:\n", *rows, ""]
    return parts


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
