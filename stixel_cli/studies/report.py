"""The report of a study: its answer in words, the answers of its questions, its own tables."""

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from stixel_cli.answers import render
from stixel_cli.answers.page import page_links, worst_runs
from stixel_cli.answers.render import INTERVAL, Cells, overview
from stixel_cli.answers.runs import STATUS, Answer, Runs, combined
from stixel_cli.config import messages
from stixel_cli.config.folders import shipped_folder
from stixel_cli.engine.store import Store
from stixel_cli.errors import MissingData, UserError, located, printable
from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.results.folder import PAGE
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.result import GROUPS, RunResult, listed, read_scored_run
from stixel_cli.studies.file import FUNCTIONS, PLACE, StudyFile, StudyQuestion, SweepEntry
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.sweeps.folder import SweepFolder, SweepResult


@dataclass(frozen=True)
class Section:
    """The answers of a question: the label of each group of runs ("" for one), and an answer for
    each metric that the group has."""

    question: StudyQuestion
    groups: tuple[tuple[str, tuple[Answer, ...]], ...]

    @property
    def brief(self) -> str:
        """What the main metric's answers say, in a few words for each group."""
        answers = [(label, own[0]) for label, own in self.groups]
        parts = [f"{label}: {one.brief}" if label else one.brief for label, one in answers]
        text = "; ".join(parts) or "no run has a value"
        lacking = listed([*dict.fromkeys(one.lacking for _, one in answers if one.lacking)])
        return f"{text} ({lacking})" if lacking else text

    @property
    def cells(self) -> Cells:
        """One table of all groups."""
        tables = [(label, overview(own)) for label, own in self.groups]
        return joined(" ".join(self.question.by), tables)

    @cached_property
    def drawings(self) -> list[bytes]:
        """The figure of each group, an SVG, for the page and for a file of its own."""
        from stixel_cli.answers.figures import drawing

        return [drawing(own[0])[0] for _, own in self.groups]


def asked(question: StudyQuestion, frames: Mapping[str, Runs]) -> Section:
    """The answers of a question; a group without a run, and a metric without a value, has none.

    UserError in one line that names the question: for a name that is no column of the runs, and as
    of `Runs.ask`.
    """
    parts = {name: frames[name] for name in question.sweeps}
    axes = tuple(dict.fromkeys(axis for part in parts.values() for axis in part.axes))
    pieces = [part.frame.assign(sweep=name) for name, part in parts.items()]
    whole = pd.concat(pieces, ignore_index=True)
    _check_columns(question, whole)
    for column, values in question.where.items():
        whole = whole[whole[column].astype(str).isin(values)]
    axes = tuple(axis for axis in axes if axis not in question.by)
    by = list(question.by)
    groups = whole.groupby(by, sort=False, observed=True) if by else [((), whole)]
    found = []
    for key, own in groups:
        runs = Runs(own, tuple(axis for axis in axes if own[axis].notna().any()))
        label = " ".join(map(str, key))
        metrics = [name for name in question.metrics if name in runs.metrics]
        with located(f"questions: {question.name}", UserError, UserError):
            answers = tuple(runs.ask(metric=name, **_parts(question, runs)) for name in metrics)
        if answers:
            found.append((label, answers))
    return Section(question, tuple(found))


def _check_columns(question: StudyQuestion, whole: pd.DataFrame) -> None:
    """Refuse a name that is no column, where `Runs.ask` does not."""
    metrics = (name for name in question.metrics if name not in METRICS)
    named = (*question.where, *question.by, *question.compare, *metrics)
    for name in (name for name in named if name not in whole):
        raise UserError(
            f"questions: {question.name}: {messages.printable(name)}: no such column of the runs"
            f"{messages.suggestion(name, [*whole])}"
        )


def _parts(question: StudyQuestion, runs: Runs) -> dict[str, Any]:
    """The parts of a question that a group of runs can answer; it may lack the reference."""
    parts = {"compare": question.compare, "better": question.better}
    if question.reference in set(combined(runs.frame, question.compare)):
        parts["reference"] = question.reference
    given = {"within": question.within, "over": question.over}
    return parts | {name: columns for name, columns in given.items() if columns is not None}


def joined(heading: str, tables: Sequence[tuple[str, Cells]]) -> Cells:
    """One table of several, each with its label in a first column if that has a `heading`.

    A group of few units has no intervals: its values are in the same column as the others'.
    """
    shown: dict[str, str] = {}
    for name in (name for _, cells in tables for name in cells.header):
        if name.endswith(INTERVAL) or name not in shown:
            shown[name.removesuffix(INTERVAL)] = name
    first = (heading.replace("_", " "),) if heading else ()
    header, rows, best = (*first, *shown.values()), [], []
    for label, cells in tables:
        names = [name.removesuffix(INTERVAL) for name in cells.header]
        for row, marks in zip(cells.rows, cells.best, strict=True):
            texts, marked = (dict(zip(names, each, strict=True)) for each in (row, marks))
            rows.append((*(label for _ in first), *(texts.get(name, "–") for name in shown)))
            best.append((*(False for _ in first), *(marked.get(name, False) for name in shown)))
    return Cells(header, tuple(rows), tuple(best), tuple(range(1 + len(first), len(header))))


DATA = "STIXEL_DATA"
"""Environment variable that names the folder of the user's recordings."""


def data_folder(contents: str, needed: str = "") -> Path:
    """The folder that `DATA` names, or the folder `needed` in it; `contents` says what it has.

    MissingData if there is no such folder.
    """
    named = os.environ.get(DATA, "")
    folder = Path(named, needed)
    if not named or not folder.is_dir():
        raise MissingData(f"{DATA}: must name a folder that has {contents}, got {named!r}")
    return folder.absolute()


def shipped_meshes(name: str) -> list[dict[str, list]]:
    """Axes: the meshes in a folder of the shipped studies, each in the folder of its road user."""
    files = sorted((shipped_folder("pipelines") / "studies" / name).glob("*/*.obj"))
    users = [file.parent.name for file in files]
    return [{"road_user": users, "road_user.mesh": list(map(str, files))}]


@dataclass(frozen=True)
class StudyData:
    """Input of a study's report: the complete sweeps by name, in the order of the study's file.

    Their runs also have `scores`, `load` and `variant`.
    """

    sweeps: Mapping[str, SweepResult]


def with_stages(result: SweepResult, entry: SweepEntry, store: Store) -> SweepResult:
    """A complete sweep, whose runs have what a report reads of their stages.

    UserError if a run's folder cannot be read.
    """

    def with_results(run: RunResult) -> RunResult:
        def load(step: str) -> Any:
            nodes = run.graph.of_stage(step)
            values = [store.load(node.key) for node in nodes]
            return values[0] if nodes[0].stage.pattern == "once" else values

        scores = read_scored_run(SweepFolder(result.folder).run(run.index)).scores
        return replace(run, scores=scores, load=load, variant=entry.variant_of(run.setting))

    return replace(result, runs=tuple(map(with_results, result.runs)))


@dataclass(frozen=True)
class Material:
    """What a study's own module adds to the report.

    Attributes:
        tables: by heading; columns as they are shown.
        files: path in the study's folder to content of further files.

    TypeError for content of another type.
    """

    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    files: Mapping[str, str | bytes] = field(default_factory=dict)

    def __post_init__(self):
        kinds = {"tables": pd.DataFrame, "files": str | bytes}
        for name, kind in kinds.items():
            for key, content in dict(getattr(self, name)).items():
                if not isinstance(content, kind):
                    raise TypeError(f"{name}: {key}: must be of type {kind}, got {content!r}")


@dataclass(frozen=True)
class Report:
    """The report of a complete study."""

    answer: tuple[str, ...]
    """The paragraphs of the study's text; the first is the answer."""
    sections: tuple[Section, ...]
    """Of the questions."""
    material: Material
    """Of the study's own module."""


def study_report(study: StudyFile, data: StudyData) -> Report:
    """The report of a study, with what `FUNCTIONS` of its module add, if it has them.

    `columns` returns the runs of a sweep, by its name, frame and results, with further columns or
    rows; `material` the module's own tables and files. UserError for a question that the runs
    refuse, or a function that returns another type.
    """
    frames = {name: frame_of(sweep) for name, sweep in data.sweeps.items()}
    adds_columns, adds_material = (callable(getattr(study.module, n, None)) for n in FUNCTIONS)
    for name, runs in frames.items() if adds_columns else ():
        added = study.call("columns", name, runs, data.sweeps[name].runs)
        frames[name] = _typed(Runs, "columns", added)
    sections = tuple(asked(question, frames) for question in study.questions)
    own = _typed(Material, "material", study.call("material", data)) if adds_material else None
    shown = tuple(one for one in sections if one.groups)
    return Report(answer_text(study.text, sections), shown, own or Material())


def answer_text(text: str, sections: Sequence[Section]) -> tuple[str, ...]:
    """The paragraphs of a study's text, with the answer of a question in each of its places."""
    values = {section.question.name: section.brief for section in sections}
    paragraphs = [" ".join(one.split()) for one in re.split(r"\n\s*\n", text)]
    return tuple(PLACE.sub(lambda place: values[place[1]], one) for one in paragraphs if one)


def _typed(kind: type, name: str, found: Any) -> Any:
    """What a function of the module has returned."""
    if not isinstance(found, kind):
        raise UserError(f"{name}: must return {kind.__name__}, got {printable(repr(found), 60)}")
    return found


def frame_of(sweep: SweepResult) -> Runs:
    """The runs of a sweep, with the option of each of `GROUPS`, and the variant, as columns."""
    frame, axes = sweep.table.frame.copy(), list(sweep.table.axes)
    for group in GROUPS:
        if group not in frame:
            frame[group] = [getattr(run.configuration, group).kind for run in sweep.runs]
    if any(run.variant for run in sweep.runs):
        frame["variant"] = [run.variant for run in sweep.runs]
        own = frame.groupby("variant")[axes].nunique().max() == 1
        keys = [key for key in axes if own[key] and frame[key].nunique() > 1 and key not in GROUPS]
        frame, axes = frame.drop(columns=keys), [*(k for k in axes if k not in keys), "variant"]
    return Runs(frame, tuple(axes))


def with_columns(runs: Runs, **columns: Any) -> Runs:
    """The runs with further columns, which are axes where they are texts."""
    frame = runs.frame.assign(**columns)
    texts = [name for name in columns if not pd.api.types.is_numeric_dtype(frame[name])]
    return Runs(frame, (*runs.axes, *(name for name in texts if name not in runs.axes)))


def rows_of(runs: Runs, rows: Sequence[Sequence[Mapping[str, Any]]], axes: Sequence[str]) -> Runs:
    """A frame of several rows a run, such as one for each range: `rows` of each run, with `axes`
    among their keys; the other keys are metrics."""
    settings = runs.frame[[*runs.axes, STATUS]].to_dict("records")
    found = [{**setting, **row} for setting, own in zip(settings, rows, strict=True) for row in own]
    return Runs(pd.DataFrame(found), (*runs.axes, *axes))


def files_of(report: Report) -> dict[str, str | bytes]:
    """Path in the study's folder to content of the files next to the page."""
    found: dict[str, str | bytes] = {}
    data: dict[str, Any] = {"answer": list(report.answer), "questions": {}}
    for section in report.sections:
        name = section.question.name
        data["questions"][name] = {
            label or "all": render.records(answers) for label, answers in section.groups
        }
        for (label, answers), drawing in zip(section.groups, section.drawings, strict=True):
            stem = "-".join(filter(None, (name, re.sub(r"[^A-Za-z0-9_.-]+", "-", label))))
            found[f"tables/{stem}.csv"] = render.csv(answers)
            found[f"tables/{stem}.md"] = render.markdown(answers)
            found[f"tables/{stem}.tex"] = render.latex(answers, answers[0].sentence)
            found[f"figures/{stem}.svg"] = drawing
    for heading, table in report.material.tables.items():
        stem = re.sub(r"[^A-Za-z0-9]+", "-", heading).strip("-").lower()
        found[f"tables/{stem}.csv"] = table.to_csv(index=False, lineterminator="\n")
    found["report.json"] = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    return found | dict(report.material.files)


@dataclass(frozen=True)
class SweepState:
    """Progress of a sweep."""

    name: str
    runs: int | None
    """Their number; None if it depends on earlier sweeps."""
    done: int
    """Number of finished runs."""
    faults: tuple[str, ...]
    """One line for each reason why others are missing."""
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

    `origin`: that of the report, as `lineage.origin`, with the `seeds` of each sweep's runs.
    """
    shown = report or Report((), (), Material())
    progress, settings = [], []
    for state in states:
        runs = "–" if state.runs is None else str(state.runs)
        seeds = ", ".join(map(str, origin["seeds"].get(state.name, ()))) or "–"
        progress.append((state.name, runs, str(state.done), seeds, "; ".join(state.faults)))
    for one in plan.sweeps:
        texts = one.settings.items()
        settings += [(one.sweep.name, key, values.replace(",", ", ")) for key, values in texts]
    return page_template(__package__, "study.html").render(
        plan=plan,
        answer=report and report.answer,
        sections=[_section(one, i, page) for i, one in enumerate(shown.sections)],
        tables=[(name, render.cells_of(own)) for name, own in shown.material.tables.items()],
        explanation=render.explanation(),
        states=render.Cells(("sweep", "runs", "done", "seeds", "faults"), tuple(progress)),
        origin=origin,
        settings=render.Cells(("sweep", "key", "values"), tuple(settings)),
        revision=shown_revision(origin["git"]) or "–",
    )


def _section(section: Section, place: int, page: Path) -> dict[str, Any]:
    """What the template shows of a question."""
    sentences, worst, figures = [], [], []
    for i, (label, answers) in enumerate(section.groups):
        folders = [Path(str(folder)) for folder in answers[0].worst.get("folder", [])]
        links = page_links([one for one in folders if one.exists()], page, PAGE)
        worst += worst_runs(answers[0], links)
        sentences.append((label, [one.sentence for one in answers], answers[0].notes))
        figures.append((label, drawing_for_page(section.drawings[i], f"q{place}g{i}")))
    shown = {"sentences": sentences, "worst": worst, "figures": figures}
    return {"question": section.question, "cells": section.cells, **shown}
