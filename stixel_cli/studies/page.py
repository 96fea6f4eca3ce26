"""A study's report as one self-contained page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.answers import render
from stixel_cli.answers.page import page_links, worst_runs
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.results.folder import PAGE
from stixel_cli.results.lineage import provenance, shown_revision
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.studies.questions import Section
from stixel_cli.studies.report import Report


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
    report: Report | None,
    origin: Mapping[str, Any],
    page: Path,
) -> str:
    """The page of a study, the file `page`; without a report, it lists the missing runs.

    `origin`: `command` line that makes the report; when it was `created`, UTC; the `seeds` of each
    sweep's runs.
    """
    made = provenance()
    return page_template(__package__, "study.html").render(
        plan=plan,
        answer=report and report.answer,
        sections=[_section(one, i, page) for i, one in enumerate(report.sections)]
        if report
        else [],
        tables=[
            (heading, render.cells_of(table))
            for heading, table in (report.material.tables.items() if report else ())
        ],
        explanation=render.explanation(),
        states=render.Cells(
            ("sweep", "runs", "done", "seeds", "faults"),
            tuple(
                (
                    state.name,
                    "–" if state.runs is None else str(state.runs),
                    str(state.done),
                    ", ".join(map(str, origin["seeds"].get(state.name, ()))) or "–",
                    "; ".join(state.faults),
                )
                for state in states
            ),
        ),
        origin=origin,
        settings=render.Cells(
            ("sweep", "key", "values"),
            tuple(
                (one.sweep.name, key, values.replace(",", ", "))
                for one in plan.sweeps
                for key, values in one.settings.items()
            ),
        ),
        revision=shown_revision(made["git"]) or "–",
        made=made,
    )


def _section(section: Section, place: int, page: Path) -> dict[str, Any]:
    """What the template shows of a question."""
    worst = []
    for _, answers in section.groups:
        folders = [Path(str(folder)) for folder in answers[0].worst.get("folder", [])]
        links = page_links([one for one in folders if one.exists()], page, PAGE)
        worst += worst_runs(answers[0], links)
    return {
        "question": section.question,
        "sentences": [
            (label, [one.sentence for one in answers], answers[0].notes)
            for label, answers in section.groups
        ],
        "cells": section.cells,
        "worst": worst,
        "figures": [
            (label, drawing_for_page(drawing, f"q{place}g{i}"))
            for i, ((label, _), drawing) in enumerate(
                zip(section.groups, section.drawings, strict=True)
            )
        ],
    }
