"""The blocks of a report, numbered, as a page shows them."""

import base64
import re
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from stixel_cli.report.blocks import Block, Figure, Paragraph, Picture, Section, Table
from stixel_cli.report.page import drawing_for_page
from stixel_cli.report.tables import INTERVAL, shown_table
from stixel_cli.report.template import inline_html

_NARROW = 700
"""Figures up to this width, px, are placed side by side if the screen is wide enough."""
_WIDEST = 125
"""A table with more characters in a row is printed in landscape format."""
_LONG = 27
"""A table with more rows is printed in a small font, unless in landscape format."""
_SHORT = 30
"""Columns of up to this many characters have no line breaks."""
_LEAST_PICTURE = 600
"""px: the least width of a picture, whose text has this size then (`pictures.stage_sheet`)."""
_SIDE_BY_SIDE = 2
"""With more columns of intervals, the intervals are below their values."""


class Numbered:
    """Numbers sections, figures and tables, and gives what the template of a page shows."""

    def __init__(self):
        self.figures = self.tables = 0

    def sections(self, sections: Sequence[Section], before: str) -> list[dict[str, Any]]:
        """The sections, with `before` in front of their numbers."""
        return [self._section(section, f"{before}{i}") for i, section in enumerate(sections, 1)]

    def _section(self, section: Section, number: str) -> dict[str, Any]:
        content = {"number": number, "title": section.title, "folded": section.folded}
        return content | {"kind": "section", "blocks": self.blocks(section.blocks, number)}

    def blocks(self, content: Sequence[Block], number: str) -> list[dict[str, Any]]:
        """The blocks of a section with this number, or of the answer."""
        blocks, inner = [], 0
        for block in content:
            match block:
                case Section():
                    inner += 1
                    blocks.append(self._section(block, f"{number}.{inner}"))
                case Paragraph(text):
                    blocks.append({"kind": "paragraph", "text": text, "folded": False})
                case Figure() | Picture():
                    self.figures += 1
                    blocks.append(_figure(block, self.figures))
                case Table():
                    self.tables += 1
                    blocks.append(_table(block, self.tables))
        return _side_by_side(blocks)


def _table(block: Table, number: int) -> dict[str, Any]:
    header, rows, numeric = shown_table(block)
    if sum(name.endswith(INTERVAL) for name in header) > _SIDE_BY_SIDE:
        header, *rows = [list(map(_stacked, row)) for row in (header, *rows)]
    # For each column its longest cell or header word, plus one.
    widths = [[_width(row[i]) for row in rows] for i in range(len(header))]
    least = [
        max(*map(len, name.split()), *(min(width, _SHORT) for width in column), 0)
        for name, column in zip(header, widths, strict=True)
    ]
    wide = sum(least) + len(least) > _WIDEST
    # Numbers are aligned right, short texts have no line breaks.
    classes = [
        "number" if right else "short" if max(column, default=0) <= _SHORT else ""
        for right, column in zip(numeric, widths, strict=True)
    ]
    return {
        "kind": "table",
        "number": number,
        "name": block.name,
        "caption": block.caption,
        "header": header,
        "rows": rows,
        "numeric": numeric,
        "wide": wide,
        "long": len(rows) > _LONG and not wide,
        "classes": classes,
        "folded": block.folded,
    }


def _stacked(cell: str) -> str:
    """The cell with its interval on a second line."""
    return cell.replace(" [", "\n[") if cell.endswith("]") else cell


def _width(cell: str) -> int:
    return max(map(len, cell.split("\n")))


def _side_by_side(blocks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The blocks, with successive narrow figures in one block."""
    found: list[dict[str, Any]] = []
    for block in blocks:
        if block["kind"] != "figure" or block["width"] > _NARROW or block["folded"]:
            found.append(block)
        elif found and found[-1]["kind"] == "figures":
            found[-1]["figures"].append(block)
        else:
            found.append({"kind": "figures", "figures": [block], "folded": False})
    return found


def _figure(block: Figure | Picture, number: int) -> dict[str, Any]:
    content = {"kind": "figure", "number": number, "name": block.name, "caption": block.caption}
    content["folded"] = block.folded
    if isinstance(block, Figure):
        return content | vars(drawing_for_page(block.svg.decode(), f"f{number}"))
    data = base64.b64encode(block.data).decode()
    source = f"data:{block.media_type};base64,{data}"
    return content | {"kind": "picture", "source": source, "least": _LEAST_PICTURE}


def inline(text: str) -> Markup:
    """A paragraph of Markdown as HTML."""
    return Markup(inline_html(text))


def brief(caption: str) -> str:
    """The first clause of a caption, without its full stop."""
    return re.split(r"\.(?= [A-Z]|$)|; ", caption)[0]


FILTERS = {"inline": inline, "brief": brief}
"""What a template of the blocks uses."""
