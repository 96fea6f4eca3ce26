"""Write the answers of studies into the page: python docs/studies.py FOLDER..."""

import html
import re
import sys
from pathlib import Path

import yaml

PAGE = Path(__file__).parent / "studies.md"
BEGIN, END = "<!-- answers of the studies -->", "<!-- end of the answers -->"


def main(folders: list[Path]) -> None:
    """Replace what is between the two comments of the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    answers = "\n".join(answer(folder) for folder in folders)
    PAGE.write_text(f"{before}{BEGIN}\n\n{answers}\n{END}{after}", encoding="utf-8")


def answer(folder: Path) -> str:
    """A study's title, command and revision, and the sentences at the top of its report."""
    study = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    report = (folder / "report.html").read_text(encoding="utf-8")
    block = re.search(r'<div class="answer">(.*?)</div>', report, re.S)[1]
    sentences = [html.unescape(p) for p in re.findall(r"<p>(.*?)</p>", block, re.S)]
    revision = study["git"]["revision"][:7]
    lines = [f"### {study['title']}", "", f"`{study['command']}`, revision {revision}:", ""]
    return "\n".join([*lines, *(f"- {sentence}" for sentence in sentences), ""])


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
