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
from stixel_cli.report.blocks import (
    Block,
    Figure,
    Findings,
    Paragraph,
    Picture,
    Section,
    Table,
)
from stixel_cli.report.metrics import format_value
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.report.tables import INTERVAL, shown_table
from stixel_cli.studies.template import inline_html

_NARROW = 700
"""Figures up to this width, px, are placed side by side if the screen is wide enough."""
_WIDEST = 125
"""A table with more characters in a row is printed in landscape format."""
_LONG = 27
"""A table with more rows is printed in a small font, unless in landscape format."""
_SHORT = 30
"""Columns of up to this many characters have no line breaks."""
_LEAST_PICTURE = 600
"""px: the least width of a picture, whose text has this size then (`rq1.report.contact_sheet`)."""
_SIDE_BY_SIDE = 2
"""With more columns of intervals, the intervals are below their values."""


@dataclass(frozen=True)
class SweepState:
    """Progress of a sweep.

    Attributes:
        name: of the sweep.
        runs: their number; None if it depends on earlier sweeps.
        done: number of finished runs.
        faults: one line for each reason why others are missing.
        folder: of the sweep.
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


@dataclass(frozen=True)
class Origin:
    """Provenance of a report.

    Attributes:
        command: command line that makes the report.
        overrides: of the command.
        notes: which overrides are left out of which sweeps.
        seeds: of the runs of each sweep.
        provenance: revision, versions and machine, as in a manifest.
        created: UTC.
        stage_cpu_seconds: CPU seconds that the results of each stage took; NaN if one is unknown.
        elapsed: s from the start of the command.
        sweeps: request of each sweep.
        configuration: of the first run, resolved.
    """

    command: str
    overrides: Sequence[str]
    notes: Sequence[str]
    seeds: Mapping[str, Sequence[int]]
    provenance: Mapping[str, Any]
    created: str
    stage_cpu_seconds: Mapping[str, float]
    elapsed: float
    sweeps: Mapping[str, Mapping[str, Any]]
    configuration: Mapping[str, Any]


def study_page(
    title: str,
    question: str,
    states: Sequence[SweepState],
    findings: Findings | None,
    origin: Origin,
) -> str:
    """The page of a study; without findings, it lists the missing runs and how to resume."""
    numbered = _Numbered()
    opening = [] if findings is None else numbered.blocks(findings.opening, "")
    figures = [i for i, block in enumerate(opening, 1) if block["kind"] in ("figure", "figures")]
    split = figures[0] if figures else len(opening)
    sections = [] if findings is None else numbered.sections(findings.sections, "")
    return page_template(__package__, "study", {"inline": _inline, "brief": _brief}).render(
        title=title,
        question=question,
        answer=None if findings is None else opening[:split],
        detail=opening[split:],
        sections=sections,
        states=states,
        origin=origin,
        sweeps=_sweeps(origin),
        stages=[(name, format_value(s)) for name, s in origin.stage_cpu_seconds.items()],
        all_seconds=format_value(sum(origin.stage_cpu_seconds.values())),
        provenance=_provenance(origin.provenance),
        configuration=yaml.safe_dump(
            dict(origin.configuration), sort_keys=False, allow_unicode=True
        ),
    )


def _inline(text: str) -> Markup:
    """A paragraph of Markdown as HTML."""
    return Markup(inline_html(text))


def _brief(caption: str) -> str:
    """The first clause of a caption, without its full stop."""
    return re.split(r"\.(?= [A-Z]|$)|; ", caption)[0]


class _Numbered:
    """Numbers sections, figures and tables."""

    def __init__(self):
        self.figures = self.tables = 0

    def sections(self, sections: Sequence[Section], before: str) -> list[dict[str, Any]]:
        return [
            self._section(section, f"{before}{i}") for i, section in enumerate(sections, start=1)
        ]

    def _section(self, section: Section, number: str) -> dict[str, Any]:
        blocks = self.blocks(section.blocks, number)
        return {
            "number": number,
            "title": section.title,
            "blocks": blocks,
            "folded": section.folded,
        }

    def blocks(self, content: Sequence[Block], number: str) -> list[dict[str, Any]]:
        """The blocks of a section with this number, or of the answer."""
        blocks, inner = [], 0
        for block in content:
            match block:
                case Section():
                    inner += 1
                    own = self._section(block, f"{number}.{inner}")
                    blocks.append({"kind": "section", **own})
                case Paragraph(text):
                    blocks.append({"kind": "paragraph", "text": text, "folded": False})
                case Figure() | Picture():
                    self.figures += 1
                    blocks.append(_figure(block, self.figures) | {"folded": block.folded})
                case Table():
                    self.tables += 1
                    header, rows, numeric = shown_table(block)
                    intervals = sum(name.endswith(INTERVAL) for name in header)
                    if intervals > _SIDE_BY_SIDE:
                        header, *rows = [list(map(_stacked, row)) for row in (header, *rows)]
                    wide = _characters(header, rows) > _WIDEST
                    blocks.append(
                        {
                            "kind": "table",
                            "number": self.tables,
                            "name": block.name,
                            "caption": block.caption,
                            "header": header,
                            "rows": rows,
                            "numeric": numeric,
                            "wide": wide,
                            "long": len(rows) > _LONG and not wide,
                            "classes": _classes(rows, numeric),
                            "folded": block.folded,
                        }
                    )
        return _side_by_side(blocks)


def _characters(header: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Characters in a row: for each column its longest cell or header word, plus one."""
    columns = zip(header, *rows, strict=True)
    return sum(
        1 + max(*map(len, name.split()), *(min(_width(cell), _SHORT) for cell in cells), 0)
        for name, *cells in columns
    )


def _classes(rows: Sequence[Sequence[str]], numeric: Sequence[bool]) -> list[str]:
    """CSS class of each column: numbers are aligned right, short texts have no line breaks."""
    columns = zip(*rows, strict=True)
    short = [max(map(_width, column)) <= _SHORT for column in columns] or [True] * len(numeric)
    return [
        "number" if right else "short" if fits else ""
        for right, fits in zip(numeric, short, strict=True)
    ]


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
    if isinstance(block, Figure):
        return content | vars(drawing_for_page(block.svg.decode(), f"f{number}"))
    data = base64.b64encode(block.data).decode()
    source = f"data:{block.media_type};base64,{data}"
    return content | {"kind": "picture", "source": source, "least": _LEAST_PICTURE}


def _sweeps(origin: Origin) -> list[dict[str, Any]]:
    sweeps = []
    for name, sweep in origin.sweeps.items():
        axes = []
        for axis in sweep["axes"]:
            key = " + ".join(axis["keys"])
            count = len(axis["keys"])
            # Overrides of a single step are shown with their keys.
            values = [
                " ".join([*(split_override(text)[1] for text in step[:count]), *step[count:]])
                for step in axis["steps"]
            ]
            axes.append((key, ", ".join(values)))
        sweeps.append(
            {
                "name": name,
                "fixed": " ".join(sweep["fixed"]),
                "axes": axes,
                "left_out": [
                    " ".join(f"{key}={value}" for key, value in entry.items())
                    for entry in sweep["leave_out"]
                ],
                "derive": sweep["derive"],
                "seeds": ", ".join(map(str, origin.seeds.get(name, ()))),
            }
        )
    return sweeps


def _provenance(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    git = content.get("git") or {}
    revision = str(git.get("revision"))[:12] if git.get("revision") else "–"
    rows = [("git revision", revision + (" with changes" if git.get("dirty") else ""))]
    rows += [(f"machine, {name}", str(v)) for name, v in (content.get("machine") or {}).items()]
    return rows + [(name, str(v)) for name, v in (content.get("versions") or {}).items()]
