"""The page of many runs: the answer, option by option; its scenarios; all runs."""

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.answers import figures, render
from stixel_cli.answers.runs import ERROR, FOLDER, STATUS, Answer, Runs, combined, with_key
from stixel_cli.errors import UserError, counted
from stixel_cli.evaluation.metric_table import METRICS, metric
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.report.metrics import json_in_html, number
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.results.folder import PAGE, run_labels
from stixel_cli.results.lineage import differing_settings, warnings
from stixel_cli.results.result import DONE, RunResult, check_folder, listed, read_scored_run


@dataclass(frozen=True)
class Asked:
    """What a page says of several runs: of a sweep, or of the runs in several folders."""

    title: str
    runs: Runs
    answers: Sequence[Answer]
    """Of one comparison, the main metric first."""
    remarks: Sequence[str] = ()
    """On the runs, each in one sentence."""
    origin: Mapping[str, Any] = field(default_factory=dict)
    """`command`, `created` and `revision` of the runs; {} if they differ."""
    player: Path | None = None
    """The page that plays the runs back, if there is one."""


def compared_runs(runs: Sequence[RunResult], labels: Sequence[str]) -> Runs:
    """One row a run, named by its label, with the settings in which they differ.

    Where a group is exchanged, such as the tracker, that is one column.
    """
    differing, settings = differing_settings(runs), {}
    # Of another option or kind, from which the group's other keys follow.
    exchanged = {key.removesuffix(".kind") for key in differing}
    for key, values in differing.items():
        group = key.partition(".")[0]
        if group not in exchanged:
            settings[key] = values
        elif key in (group, f"{group}.kind"):
            settings[group] = values
    names = dict.fromkeys(name for run in runs for name in run.metrics)
    metrics = {name: [run.metrics.get(name) for run in runs] for name in names}
    frame = pd.DataFrame(
        {
            **{"run": list(labels), **settings, "status": DONE},
            **{"folder": [str(run.folder) for run in runs]},
            **{name: pd.Series(values, dtype=float) for name, values in metrics.items()},
        }
    )
    default = {"compare": "run", "within": (), "over": ()}
    return Runs(frame.set_index("run", drop=False), ("run", *settings), default)


def asked_runs(
    folders: Sequence[Path], metrics: Sequence[str] = (), reference: str | None = None
) -> Asked:
    """What is asked of the runs in two folders or more.

    UserError for one folder, or one that is no result folder.
    """
    if len(folders) < 2:
        check_folder(folders[0])
        raise UserError(
            f"{folders[0]}: is one run: name two or more, or a sweep; its page is "
            f"{folders[0] / PAGE}"
        )
    labels = run_labels(folders)
    read = [read_scored_run(folder) for folder in folders]
    runs = compared_runs(read, labels)
    verdicts = zip(labels, read, strict=True)
    remarks = [f"{label}: {' '.join(verdict(run.metrics))}" for label, run in verdicts]
    answers = runs.answers(metrics, reference=reference)
    return Asked(f"Comparison of {len(read)} runs", runs, answers, [*warnings(read), *remarks])


MOST_CELLS = 4000
"""Most cells of the table of scenarios; more are in the table of runs."""


def answers_page(asked: Asked, links: Mapping[str, str], command: Sequence[str]) -> str:
    """The page of the answers of one comparison.

    Args:
        links: folder of a run, and the player, to its page, relative to this page.
        command: that writes it.
    """
    runs, answers = asked.runs, asked.answers
    first, curves = answers[0], figures.over_time(answers[0])
    is_share = any(times is figures.SHARES for times, _ in curves.values())
    times = "share of the run" if is_share else "t (s)"
    states = runs.frame[STATUS].value_counts().items()
    return page_template(__package__, "answers.html").render(
        title=asked.title,
        counts=f"{counted(len(runs), 'run')}: {listed([f'{n} {state}' for state, n in states])}",
        answers=[_shown(one, i) for i, one in enumerate(answers)],
        notes=[*first.notes, *asked.remarks],
        player=links.get(str(asked.player), ""),
        cells=render.overview(answers, paired=True),
        worst=worst_runs(first, links),
        explanation=render.explanation(answers),
        scenarios=_scenarios(first),
        axes=_axes(runs, first),
        over_time=figures.error_curves(curves, x=times),
        data=json_in_html(_table(runs, first, links)),
        linked=bool(links),
        origin=asked.origin,
        command=shlex.join(command),
    )


def _shown(answer: Answer, place: int) -> tuple[str, str, dict[str, Any] | None, str]:
    """Heading, sentence, figure and its legend."""
    svg, legend = figures.drawing(answer) if answer.units else (b"", "Nothing is compared.")
    figure = drawing_for_page(svg, f"d{place}") if svg else None
    return answer.question.row.heading, answer.sentence, figure, legend


def _axes(runs: Runs, answer: Answer) -> list[tuple[str, str, dict[str, Any]]]:
    """Name, answer and figure of each axis of numbers alone, within all others."""
    question, found = answer.question, []
    parts = {"over": question.over, "metric": question.metric, "better": question.better}
    for name in runs.axes:
        if name not in (*question.over, runs.frame.index.name) and runs.frame[name].nunique() > 2:
            one = runs.ask(compare=name, **parts)
            if (drawn := figures.over_axis(one)) is not None:
                found.append((name, one.sentence, drawing_for_page(drawn, f"a{len(found)}")))
    return found


def worst_runs(answer: Answer, links: Mapping[str, str]) -> list[tuple[str, str]]:
    """Name and link of the worst run of the option of each row; ("", "") without one."""
    keys, found = (*answer.question.within, *answer.question.over), {}
    for option, run in answer.worst.iterrows():
        named = " ".join(with_key(name, run[name]) for name in keys)
        value = number(run["value"]) if run[STATUS] == DONE else run[STATUS]
        link = links.get(str(run.get(FOLDER)), "")
        found[option] = (f"{value} ({named})" if named else value, link)
    return [found.get(option, ("", "")) for option in answer.order]


def _scenarios(answer: Answer) -> render.Cells | None:
    """Means by scenario and option, the fewer ones as columns; None for one, or too many."""
    table = answer.by_scenario()[answer.order]
    if len(table) < 2 or table.size > MOST_CELLS:
        return None
    names = [s if s in answer.scenarios else f"{s} (left out)" for s in table.index]
    table, first = table.set_axis(names), " ".join(answer.question.within)
    if table.shape[1] > len(table):
        table, first = table.T, answer.question.named
    table.insert(0, first, [*table.index], allow_duplicates=True)
    return render.cells_of(table)


def _table(runs: Runs, answer: Answer, links: Mapping[str, str]) -> dict[str, Any]:
    """What `runs.js` shows: columns, rows and links of all runs, numbers with five digits.

    The options of the answer have colours of their own.
    """
    frame = runs.frame
    names = [n for n in (*runs.axes, STATUS, *runs.metrics) if n != frame.index.name]
    columns = [
        {
            "title": name if name not in runs.metrics else metric(name).heading,
            "about": metric(name).label if name in METRICS else "",
            "bounds": metric(name).bounds,
            "shown": name in (*runs.axes, STATUS, *runs.metrics[:6]),
            "number": name in runs.metrics,
        }
        for name in names
    ]
    rows = [
        [_plain(value) for value in row] for row in frame[names].itertuples(index=False, name=None)
    ]
    folders = frame[FOLDER].astype(str) if FOLDER in frame else [""] * len(frame)
    errors = frame[ERROR].fillna("").astype(str) if ERROR in frame else [""] * len(frame)
    return {
        "first": "run",
        "columns": columns,
        "rows": rows,
        "names": [_plain(name) for name in frame.index],
        "links": [links.get(folder, "") for folder in folders],
        "errors": [*errors],
        "axes": [name for name in runs.axes if name in names],
        "options": [str(option) for option in combined(frame, answer.question.compare)],
    }


def _plain(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return None if not np.isfinite(value) else float(f"{value:.5g}")
    return value.item() if isinstance(value, np.generic) else value


def page_links(folders: Sequence[Path], page: Path, index: str) -> dict[str, str]:
    """Each run's own page, or why it failed, or else its folder, relative to that of `page`."""
    links, base = {}, page.resolve().parent
    for folder in folders:
        files = (folder / index, folder / "traceback.txt")
        target = next((file for file in files if file.exists()), folder)
        links[str(folder)] = os.path.relpath(os.path.realpath(target), base).replace(os.sep, "/")
    return links
