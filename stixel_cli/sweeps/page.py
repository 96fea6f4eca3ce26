"""What a sweep says of all its runs: summaries, its page, tables and figures to take."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.answers import figures, render
from stixel_cli.answers.answer import Answer
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.pictures import style
from stixel_cli.report.error_curves import MOST_LINES, Errors
from stixel_cli.results.folder import PAGE
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.reader import read_series
from stixel_cli.results.result import DONE
from stixel_cli.sweeps.folder import SUMMARIES, SweepFolder
from stixel_cli.sweeps.results import SweepResult, over_keys, question_over

FORMATS = ("html", "md", "tex", "csv", "svg", "pdf", "png")
SHARES = np.linspace(0.0, 1.0, 101)
"""Shares of a run at which errors over time are compared where the runs have different times."""
MOST_READ = 400
"""Most runs whose errors over time a page reads: two seconds."""


def summary_files(result: SweepResult, notes: Mapping[str, Any]) -> dict[str, str]:
    """The summaries and the page by file name; `notes` are those of the sweep's request."""
    every = result.answers(result.table.metrics)
    shown = result.answers()
    page = result.folder / PAGE
    texts = (
        render.csv(every),
        f"# {notes['command']}\n\n{render.markdown(shown)}",
        sweep_page(result, page, ["stixel", "report", str(result.folder)], notes, answers=shown),
    )
    return dict(zip(SUMMARIES, texts, strict=True))


def read_sweep(folder: Path) -> tuple[SweepResult, dict[str, Any]]:
    """The sweep in a folder and its notes; UserError if it is no sweep, or no run is done."""
    request = SweepFolder(folder).request()
    runs = tuple(SweepFolder(folder).runs(request))
    result = SweepResult(folder, runs, axes=request.axes, over=request.over)
    if not result.count(DONE):
        raise UserError(f"{folder}: no run is done; resume with: stixel sweep --resume {folder}")
    return result, request.notes


def asked_sweep(
    folder: Path, over: str | None, compare: str | None, metrics: str | None, reference: str | None
) -> tuple[SweepResult, dict[str, Any], list[Answer]]:
    """A stored sweep with its notes and the answers of a question; keys and metrics by commas."""
    result, notes = read_sweep(folder)
    if over is not None:
        result = replace(result, over=over_keys(over, result.axes))
    names = metrics.split(",") if metrics else [one.question.metric for one in result.answers()]
    parts = question_over(result) | {"reference": reference}
    if compare is not None:
        # All other axes are scenarios.
        parts["compare"] = compare.split(",")
        parts.pop("within", None)
    return result, notes, [result.table.ask(metric=name, **parts) for name in names]


def sweep_page(
    result: SweepResult,
    page: Path,
    command: Sequence[str],
    notes: Mapping[str, Any],
    answers: Sequence[Answer] = (),
) -> str:
    """The page of a sweep; `page` is its file, `command` the one that writes it.

    `answers` are those of one comparison, the main metric first; by default those of the sweep.
    """
    from stixel_cli.answers.page import answers_page, page_links

    answers = answers or result.answers()
    folders = [Path(one) for one in result.table.frame["folder"].dropna()]
    git = notes.get("git")
    origin = {
        "command": notes.get("command", ""),
        "created": notes.get("created", "–"),
        "revision": (shown_revision(git) if isinstance(git, dict) else None) or "–",
    }
    curves = over_time(answers[0])
    is_share = any(times is SHARES for times, _ in curves.values())
    return answers_page(
        result.table,
        answers,
        f"Sweep {(result.folder or page.parent).resolve().name}",
        command,
        page_links(folders, page, PAGE),
        curves,
        "share of the run" if is_share else "t (s)",
        origin,
    )


def written_format(answers: Sequence[Answer], form: str) -> str | bytes:
    """A table (md, tex, csv) of all answers, or a figure (svg, pdf, png) of the first."""
    match form:
        case "md":
            return render.markdown(answers)
        case "tex":
            return render.latex(answers, answers[0].sentence)
        case "csv":
            return render.csv(answers)
    writers = {"svg": style.svg, "pdf": figures.pdf, "png": style.png}
    return figures.differences(answers[0], writers[form])


def over_time(answer: Answer) -> dict[str, Errors]:
    """Errors over time of the best options: of each, the mean of each unit's runs.

    Over the time, if all runs have the same times; else over the share of each run.
    """
    found: dict[str, dict[Any, list[tuple[np.ndarray, dict[str, np.ndarray]]]]] = {}
    options = answer.order[:MOST_LINES]
    runs = answer.runs[answer.runs["status"] == DONE]
    if "folder" not in runs or len(runs[runs["option"].isin(options)]) > MOST_READ:
        return {}
    for option in options:
        for _, run in runs[runs["option"] == option].iterrows():
            try:
                times, series = read_series(Path(str(run["folder"])) / "scores.npz")
            except UserError:
                return {}
            found.setdefault(str(option), {}).setdefault(run["unit"], []).append((times, series))
    every = [one for units in found.values() for own in units.values() for one in own]
    if not every:
        return {}
    same = all(np.array_equal(every[0][0], times) for times, _ in every)
    names = set.intersection(*(set(series) for _, series in every))
    return {
        option: (every[0][0] if same else SHARES, _stacked(units, names, same))
        for option, units in found.items()
    }


def _stacked(units: Mapping, names: set[str], same: bool) -> dict[str, np.ndarray]:
    stacked = {}
    for name in names:
        rows = [
            np.mean([_resampled(*one, name, same) for one in own], axis=0) for own in units.values()
        ]
        values = SERIES[name].factor * np.stack(rows)
        stacked[name] = np.abs(values) if name == "orientation_error" else values
    return {name: values for name, values in stacked.items() if np.isfinite(values).any()}


def _resampled(
    times: np.ndarray, series: Mapping[str, np.ndarray], name: str, same: bool
) -> np.ndarray:
    if same or len(times) < 2:
        return series[name]
    share = (times - times[0]) / (times[-1] - times[0])
    return np.interp(SHARES, share, series[name])
