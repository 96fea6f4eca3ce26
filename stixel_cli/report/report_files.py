"""The files of a report next to its page: tables, figures, and its answer and tables as data."""

import json
from collections.abc import Collection
from itertools import takewhile
from pathlib import PurePosixPath
from typing import Any

from stixel_cli.errors import UserError
from stixel_cli.report.blocks import Figure, Findings, Paragraph, Table
from stixel_cli.report.tables import plain_rows, table_csv, table_latex, table_markdown

DATA = "report.json"


def files_of(findings: Findings, taken: Collection[str] = ()) -> dict[str, str | bytes]:
    """Path in the folder to content of the files next to the page; `taken` are other names.

    Raises:
        UserError: if two files have one name, or a name is not a path inside the folder.
    """
    named: list[tuple[str, str | bytes]] = []
    for table in findings.blocks(Table):
        for suffix, text in (("csv", table_csv), ("md", table_markdown), ("tex", table_latex)):
            named.append((f"tables/{table.name}.{suffix}", text(table)))
    named += [(f"figures/{figure.name}.svg", figure.svg) for figure in findings.blocks(Figure)]
    named.append((DATA, json.dumps(report_data(findings), indent=1, ensure_ascii=False) + "\n"))
    named += findings.files.items()
    files = dict(named)
    if len(files) < len(named):
        names = [name for name, _ in named]
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"report: two files have the name {twice}")
    for name in files:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or name in taken:
            raise UserError(f"report: {name!r} is not a valid file name in a study's folder")
    return files


def report_data(findings: Findings) -> dict[str, Any]:
    """The report as plain types.

    `answer`: its paragraphs; `leads`: those before its first figure. `tables`: caption and rows by
    name; a row maps the columns of `tables/NAME.csv` to cells.
    """
    leads = takewhile(lambda block: not isinstance(block, Figure), findings.opening)
    return {
        "leads": [block.text for block in leads if isinstance(block, Paragraph)],
        "answer": list(findings.answer),
        "tables": {
            table.name: {
                "caption": table.caption,
                "rows": [dict(zip(table.columns, row, strict=True)) for row in plain_rows(table)],
            }
            for table in findings.blocks(Table)
        },
    }
