"""The report of a study: its answer in words, the answers of its questions, its own tables."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from stixel_cli.answers import render
from stixel_cli.answers.question import STATUS
from stixel_cli.answers.runs import Runs
from stixel_cli.errors import UserError, printable
from stixel_cli.results.result import GROUPS, RunResult
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.questions import PLACE, Section, StudyQuestion, asked
from stixel_cli.sweeps.results import SweepResult


@dataclass(frozen=True)
class Material:
    """What a study's own module adds to the report.

    Attributes:
        tables: by heading; columns as they are shown.
        files: path in the study's folder to content of further files.

    Raises:
        TypeError: for content of another type.
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
    """The report of a complete study.

    Attributes:
        answer: the paragraphs of the study's text; the first is the answer.
        sections: of the questions.
        material: of the study's own module.
    """

    answer: tuple[str, ...]
    sections: tuple[Section, ...]
    material: Material


def study_report(
    text: str,
    questions: Sequence[StudyQuestion],
    data: StudyData,
    columns: Callable[[str, Runs, Sequence[RunResult]], Runs] | None = None,
    material: Callable[[StudyData], Material] | None = None,
) -> Report:
    """The report.

    Args:
        text: paragraphs, in which `{NAME}` is the answer of a question.
        columns: of the module: the runs of a sweep, by its name, frame and results, with further
            columns, or further rows.
        material: of the module: its own tables and files.

    Raises:
        UserError: for a question that the runs refuse, or a function that returns another type.
    """
    frames = {name: frame_of(sweep) for name, sweep in data.sweeps.items()}
    if columns is not None:
        for name, runs in frames.items():
            frames[name] = _typed(Runs, "columns", columns(name, runs, data.sweeps[name].runs))
    sections = tuple(asked(question, frames) for question in questions)
    own = Material() if material is None else _typed(Material, "material", material(data))
    return Report(answer_text(text, sections), tuple(one for one in sections if one.groups), own)


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
    runs = sweep.table
    frame, axes = runs.frame.copy(), list(runs.axes)
    for group in GROUPS:
        if group not in frame:
            frame[group] = [getattr(run.configuration, group).kind for run in sweep.runs]
    if any(run.variant for run in sweep.runs):
        keys = [key for key in axes if key not in GROUPS and not key.endswith("seed")]
        frame = frame.drop(columns=keys).assign(variant=[run.variant for run in sweep.runs])
        axes = [*(axis for axis in axes if axis not in keys), "variant"]
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
