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
from stixel_cli.report.blocks import Block, Figure, Findings, Picture, Section, Table
from stixel_cli.report.metrics import format_value
from stixel_cli.report.page import drawing_for_page, page_template, table_for_page
from stixel_cli.report.template import inline_html
from stixel_cli.results.lineage import provenance, shown_revision
from stixel_cli.studies.plan import StudyPlan

_NARROW = 700
"""Figures up to this width, px, are placed side by side if the screen is wide enough."""
_LEAST_PICTURE = 1050
"""px: the least width of a picture: then the text of that of all stages has 10 px."""


class Numbered:
    """Numbers sections, figures and tables, and gives what the template of a page shows."""

    def __init__(self):
        self.figures = self.tables = 0

    def blocks(self, content: Sequence[Block], number: str = "") -> list[dict[str, Any]]:
        """The blocks of a section with this number, of the answer, or of the whole report."""
        blocks, inner = [], 0
        for block in content:
            shown = {"kind": type(block).__name__.lower(), "folded": False, **vars(block)}
            match block:
                case Section():
                    inner += 1
                    own = f"{number}.{inner}" if number else f"{inner}"
                    shown |= {"number": own, "blocks": self.blocks(block.blocks, own)}
                case Figure() | Picture():
                    self.figures += 1
                    shown |= {"number": self.figures} | _drawn(block, f"f{self.figures}")
                case Table():
                    self.tables += 1
                    shown |= {"number": self.tables} | table_for_page(block)
            blocks.append(shown)
        return _side_by_side(blocks)


def _drawn(block: Figure | Picture, name: str) -> dict[str, Any]:
    if isinstance(block, Figure):
        return vars(drawing_for_page(block.svg.decode(), name))
    data = base64.b64encode(block.data).decode()
    return {"source": f"data:{block.media_type};base64,{data}", "least": _LEAST_PICTURE}


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


def brief(caption: str) -> str:
    """The first clause of a caption, without its full stop."""
    return re.split(r"\.(?= [A-Z]|$)|; ", caption)[0]


FILTERS = {
    "inline": lambda text: Markup(inline_html(text)),
    "brief": brief,
    "value": lambda text: split_override(text)[1],
    "number": format_value,
}
"""What the template uses: Markdown as HTML, the caption of what is folded, values of overrides."""


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
    opening = numbered.blocks(findings.opening if findings else ())
    figures = (i for i, block in enumerate(opening, 1) if block["kind"] in ("figure", "figures"))
    split = next(figures, len(opening))
    seconds = origin["stage_cpu_seconds"]
    made = provenance()
    return page_template(__package__, "study.html", FILTERS).render(
        plan=plan,
        answer=opening[:split] if findings else None,
        detail=opening[split:],
        sections=numbered.blocks(findings.sections if findings else ()),
        states=states,
        origin=origin,
        sweeps=plan.request()["sweeps"],
        seconds=seconds | {"all": sum(seconds.values())},
        revision=shown_revision(made["git"]) or "–",
        made=made,
        configuration=yaml.safe_dump(
            dict(origin["configuration"]), sort_keys=False, allow_unicode=True
        ),
    )
