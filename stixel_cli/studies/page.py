"""A study's report as one self-contained page."""

import base64
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import jinja2
import yaml
from markupsafe import Markup

from stixel_cli.report import style
from stixel_cli.report.metrics import format_value
from stixel_cli.studies.tables import INTERVAL, shown_table
from stixel_cli.studies.types import (
    Block,
    Figure,
    Findings,
    Origin,
    Paragraph,
    Picture,
    Section,
    SweepState,
    Table,
)

_COLOURS = {
    "#000000": "currentColor",
    style.TRUTH: "currentColor",
    "#ffffff": "var(--paper)",
    "#e3e3e3": "var(--grid)",
    style.CONSISTENT: "var(--band)",
    **{colour: f"var(--run-{i})" for i, colour in enumerate(style.RUNS)},
}
_PIXELS_A_POINT = 1.75
"""Largest scale of a figure, px per point: its text is then as large as the page's."""
_NARROW = 700
"""Figures up to this width, px, are placed side by side if the screen is wide enough."""
_WIDEST = 125
"""A table with more characters in a row is printed in landscape format."""
_LONG = 27
"""A table with more rows is printed in a small font, unless in landscape format."""
_SHORT = 30
"""Columns of up to this many characters have no line breaks."""
_SIDE_BY_SIDE = 2
"""With more columns of intervals, the intervals are below their values."""


def study_page(
    title: str,
    question: str,
    states: Sequence[SweepState],
    findings: Findings | None,
    origin: Origin,
) -> str:
    """The page of a study; without findings, it lists the missing runs and how to resume."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = environment.from_string(
        resources.files(__package__).joinpath("templates/study.html.j2").read_text("utf-8")
    )
    numbered = _Numbered()
    summary = [] if findings is None else numbered.blocks(findings.summary, "")
    sections = [] if findings is None else numbered.sections(findings.sections, "")
    return template.render(
        title=title,
        question=question,
        answer=None if findings is None else findings.answer,
        summary=summary,
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
        run_colours=style.RUNS,
    )


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
        return {"number": number, "title": section.title, "blocks": blocks}

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
                    blocks.append({"kind": "paragraph", "text": text})
                case Figure() | Picture():
                    self.figures += 1
                    blocks.append(_figure(block, self.figures))
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
        if block["kind"] != "figure" or block["width"] > _NARROW:
            found.append(block)
        elif found and found[-1]["kind"] == "figures":
            found[-1]["figures"].append(block)
        else:
            found.append({"kind": "figures", "figures": [block]})
    return found


def _figure(block: Figure | Picture, number: int) -> dict[str, Any]:
    content = {"kind": "figure", "number": number, "name": block.name, "caption": block.caption}
    if isinstance(block, Figure):
        svg, points = svg_for_page(block.svg.decode(), number)
        return content | {"svg": Markup(svg), "width": round(points * _PIXELS_A_POINT)}
    data = base64.b64encode(block.data).decode()
    return content | {"kind": "picture", "source": f"data:{block.media_type};base64,{data}"}


def svg_for_page(text: str, number: int) -> tuple[str, float]:
    """An SVG file as an element of a page, and its width in points.

    Its ids become unique, black and the colours of runs become those of the page, and references
    to other documents are removed.
    """
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    # A style element would apply to the whole page.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.S)
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    width = re.search(r'<svg\b[^>]*?\swidth="([\d.]+)(?:pt)?"', text)
    text = re.sub(r'(<svg\b[^>]*?)\swidth="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg\b[^>]*?)\sheight="[^"]*"', r"\1", text, count=1)
    text = text.replace("<svg", '<svg fill="currentColor"', 1).replace("xlink:href=", "href=")
    # Matplotlib's ids depend on the content, so figures of a page can share them.
    text = re.sub(r'\bid="', f'id="f{number}-', text)
    text = re.sub(r'(url\(|href=")#', rf"\1#f{number}-", text)
    for colour, name in _COLOURS.items():
        text = text.replace(colour, name)
    text = re.sub(r">\s+<", "><", text)
    # A hundredth of a point is finer than any screen.
    text = re.sub(r'\sd="[^"]*"', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    return text, float(width[1]) if width else 504.0


def _sweeps(origin: Origin) -> list[dict[str, Any]]:
    sweeps = []
    for name, sweep in origin.sweeps.items():
        axes = []
        for axis in sweep["axes"]:
            key = " + ".join(axis["keys"])
            count = len(axis["keys"])
            # Overrides of a single step are shown with their keys.
            values = [
                " ".join([*(text.partition("=")[2] for text in step[:count]), *step[count:]])
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
