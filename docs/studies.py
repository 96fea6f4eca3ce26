"""Write the answers of studies into docs/studies.md, and RQ2's trackers on stixels into the README.

Run it as: python docs/studies.py FOLDER...
"""

import html
import re
import sys
from pathlib import Path

import pandas as pd
import yaml

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.studies.tables import markdown_row, with_unit

README = Path(__file__).parent.parent / "README.md"
PAGE = Path(__file__).parent / "studies.md"
BEGIN, END = "<!-- from the studies -->", "<!-- end -->"
COLUMNS = (
    *("iou_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg"),
    *("nees_position_mean", "track_lost"),
)


def main(folders: list[Path]) -> None:
    """Replace what is between the two comments of each page."""
    write(PAGE, "\n".join(answer(folder) for folder in folders))
    for folder in folders:
        if folder.name == "rq2":
            write(README, trackers(folder))


def write(page: Path, content: str) -> None:
    """Put the content between the comments of a page."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    page.write_text(f"{before}{BEGIN}\n\n{content}\n{END}{after}", encoding="utf-8")


def answer(folder: Path) -> str:
    """A study's title, command and revision, and the sentences at the top of its report."""
    study = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    report = (folder / "report.html").read_text(encoding="utf-8")
    block = re.search(r'<div class="answer">(.*?)</div>', report, re.S)[1]
    sentences = [html.unescape(p) for p in re.findall(r"<p>(.*?)</p>", block, re.S)]
    revision = study["git"]["revision"][:7]
    lines = [f"### {study['title']}", "", f"`{study['command']}`, revision {revision}:", ""]
    return "\n".join([*lines, *(f"- {sentence}" for sentence in sentences), ""])


def trackers(folder: Path) -> str:
    """A table of RQ2's trackers on stixels: the means over paths and seeds."""
    runs = pd.read_csv(folder / "sweeps" / "tracking" / "runs.csv")
    means = runs[runs["measurement"] == "simulated"].groupby(["road_user", "tracker"], sort=False)
    header = ["road user", "tracker", *(with_unit(metric(over_runs(name))) for name in COLUMNS)]
    lines = [markdown_row(header), "| --- | --- |" + " ---: |" * len(COLUMNS)]
    for (user, tracker), row in means[list(COLUMNS)].mean().iterrows():
        cells = [f"{row[name]:.2f}" for name in COLUMNS]
        lines.append(markdown_row([user, f"`{tracker}`", *cells]))
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
