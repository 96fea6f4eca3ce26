"""Write tables of `stixel study accuracy` into the page: python docs/accuracy.py FOLDER."""

import csv
import sys
from pathlib import Path

import yaml

from stixel_cli.studies.tables import markdown_row, number, with_interval

PAGE = Path(__file__).parent / "accuracy.md"
BEGIN, END = "<!-- tables of the study -->", "<!-- end of the tables -->"
TABLES = {
    "ablation": "Each term left out (the first row of a road user has all terms)",
    "ablation_lidar": "The same on the 64-layer lidar",
    "wrong_class": "The prior of another class, and of no class, next to that of the right one",
    "wrong_class_lidar": "The same on the 64-layer lidar",
    "goals": "The tracker with all terms, next to the project's goals",
    "simulated": "The trackers on simulated measurements",
    "peers": "The trackers of PyRecEst on the same measurements",
}


def main(folder: Path) -> None:
    """Replace what is between the two comments of the page."""
    study = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    parts = [f"`{study['command']}`, revision {study['git']['revision'][:7]}.\n"]
    for name, caption in TABLES.items():
        table = folder / "tables" / f"{name}.csv"
        if not table.exists():
            # A study that was made smaller has no runs of it.
            continue
        with table.open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        parts.append(f"{caption}:\n\n{markdown(header, rows)}\n")
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    tables = "\n".join(parts)
    PAGE.write_text(f"{before}{BEGIN}\n\n{tables}\n{END}{after}", encoding="utf-8")


def markdown(header: list[str], rows: list[list[str]]) -> str:
    """The table; a value and the ends of its interval are in one cell."""
    first = [i for i, name in enumerate(header) if not name.startswith(("low ", "high "))]
    lines = [markdown_row([header[i] for i in first]), "|" + " --- |" * len(first)]
    for row in rows:
        cells = []
        for i in first:
            value, low, high = (_number(cell) for cell in (*row[i : i + 3], "", "")[:3])
            interval = i + 1 < len(header) and header[i + 1].startswith("low ")
            if isinstance(value, str):
                cells.append(value)
            else:
                cells.append(with_interval(value, low, high) if interval else number(value))
        lines.append(markdown_row(cells))
    return "\n".join(lines) + "\n"


def _number(cell: str) -> float | int | str | None:
    if cell.isdecimal():
        return int(cell)
    try:
        return float(cell) if cell else None
    except ValueError:
        return cell


if __name__ == "__main__":
    main(Path(sys.argv[1]))
