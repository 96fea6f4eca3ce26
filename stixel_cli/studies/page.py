"""A study's report as one self-contained page."""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from markupsafe import Markup

from stixel_cli.config.texts import split_override
from stixel_cli.report.blocks import Block, Figure, Findings, Paragraph, Picture, Section, Table
from stixel_cli.report.metrics import format_value
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.report.tables import INTERVAL, shown_table
from stixel_cli.report.template import inline_html
from stixel_cli.results.lineage import provenance, shown_revision
from stixel_cli.studies.plan import StudyPlan

_NARROW = 700
"""Figures up to this width, px, are placed side by side if the screen is wide enough."""
_WIDEST = 125
"""A table with more characters in a row is printed in landscape format."""
_LONG = 27
"""A table with more rows is printed in a small font, unless in landscape format."""
_SHORT = 30
"""Columns of up to this many characters have no line breaks."""
_LEAST_PICTURE = 600
"""px: the least width of a picture, whose text has this size then (`report.scan_frame`)."""
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
    widths = [[max(map(len, row[i].split("\n"))) for row in rows] for i in range(len(header))]
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
    content = {"kind": "figure", "number": number}
    content |= {key: getattr(block, key) for key in ("name", "caption", "folded")}
    if isinstance(block, Figure):
        return content | vars(drawing_for_page(block.svg.decode(), f"f{number}"))
    data = base64.b64encode(block.data).decode()
    source = f"data:{block.media_type};base64,{data}"
    return content | {"kind": "picture", "source": source, "least": _LEAST_PICTURE}


def brief(caption: str) -> str:
    """The first clause of a caption, without its full stop."""
    return re.split(r"\.(?= [A-Z]|$)|; ", caption)[0]


FILTERS = {"inline": lambda text: Markup(inline_html(text)), "brief": brief}
"""What a template of the blocks uses: Markdown as HTML, and the caption of what is folded."""


@dataclass(frozen=True)
class SweepState:
    """Progress of a sweep.

    Attributes:
        runs: their number; None if it depends on earlier sweeps.
        done: number of finished runs.
        faults: one line for each reason why others are missing.
    """

    name: str
    runs: int | None
    done: int
    faults: tuple[str, ...]
    folder: Path

    @property
    def complete(self) -> bool:
        """Whether every run is finished."""
        return self.done == self.runs


def study_page(
    plan: StudyPlan,
    states: Sequence[SweepState],
    findings: Findings | None,
    origin: Mapping[str, Any],
) -> str:
    """The page of a study; without findings, it lists the missing runs and how to resume.

    `origin`: `command` line that makes the report; when it was `created`, UTC; s `elapsed` since
    the start of the command; the `seeds` of each sweep's runs; the resolved `configuration` of the
    first run; `stage_cpu_seconds`, those of each stage's results, NaN if one is unknown.
    """
    numbered = Numbered()
    opening, sections = [], []
    if findings is not None:
        opening = numbered.blocks(findings.opening, "")
        sections = numbered.sections(findings.sections, "")
    figures = (i for i, block in enumerate(opening, 1) if block["kind"] in ("figure", "figures"))
    split = next(figures, len(opening))
    seconds = origin["stage_cpu_seconds"]
    return page_template(__package__, "study", FILTERS).render(
        title=plan.study.title,
        question=plan.study.question,
        answer=None if findings is None else opening[:split],
        detail=opening[split:],
        sections=sections,
        states=states,
        origin=origin,
        plan=plan,
        sweeps=[
            _sweep(name, request, origin["seeds"].get(name, ()))
            for name, request in plan.request()["sweeps"].items()
        ],
        stages=[(name, format_value(s)) for name, s in seconds.items()],
        all_seconds=format_value(sum(seconds.values())),
        provenance=_provenance(provenance()),
        configuration=yaml.safe_dump(
            dict(origin["configuration"]), sort_keys=False, allow_unicode=True
        ),
    )


def _sweep(name: str, request: Mapping[str, Any], seeds: Sequence[int]) -> dict[str, Any]:
    """The texts of a sweep's request."""
    axes = []
    for axis in request["axes"]:
        count = len(axis["keys"])
        # Overrides of a single step are shown with their keys.
        values = [
            " ".join([*(split_override(text)[1] for text in step[:count]), *step[count:]])
            for step in axis["steps"]
        ]
        axes.append((" + ".join(axis["keys"]), ", ".join(values)))
    return {
        "name": name,
        "fixed": " ".join(request["fixed"]),
        "axes": axes,
        "left_out": [
            " ".join(f"{key}={value}" for key, value in entry.items())
            for entry in request["leave_out"]
        ],
        "derive": request["derive"],
        "seeds": ", ".join(map(str, seeds)),
    }


def _provenance(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [("git revision", shown_revision(content.get("git") or {}) or "–")]
    rows += [(f"machine, {name}", str(v)) for name, v in (content.get("machine") or {}).items()]
    return rows + [(name, str(v)) for name, v in (content.get("versions") or {}).items()]
