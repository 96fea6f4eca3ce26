"""A study's report as one self-contained page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from stixel_cli.config.texts import split_override
from stixel_cli.report.blocks import Findings
from stixel_cli.report.metrics import format_value
from stixel_cli.report.numbered import FILTERS, Numbered
from stixel_cli.report.page import page_template
from stixel_cli.results.provenance import provenance
from stixel_cli.studies.plan import StudyPlan


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
    opening = [] if findings is None else numbered.blocks(findings.opening, "")
    figures = [i for i, block in enumerate(opening, 1) if block["kind"] in ("figure", "figures")]
    split = figures[0] if figures else len(opening)
    sections = [] if findings is None else numbered.sections(findings.sections, "")
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
    git = content.get("git") or {}
    revision = str(git.get("revision"))[:12] if git.get("revision") else "–"
    rows = [("git revision", revision + (" with changes" if git.get("dirty") else ""))]
    rows += [(f"machine, {name}", str(v)) for name, v in (content.get("machine") or {}).items()]
    return rows + [(name, str(v)) for name, v in (content.get("versions") or {}).items()]
