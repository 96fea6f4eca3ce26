"""Compare several runs on one self-contained page: settings, metrics, error curves, pictures."""

import os
import shlex
from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.evaluation.scan_errors import LOW_OVERLAP
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.pictures import style
from stixel_cli.report.charts import line_style
from stixel_cli.report.error_curves import Errors, error_curves
from stixel_cli.report.metrics import best, shown_difference, shown_value
from stixel_cli.report.page import page_template, picture_for_page, sentences_of
from stixel_cli.report.playback_values import SUMMARY
from stixel_cli.results.differences import by_group, differing_settings, warnings
from stixel_cli.results.folder import PAGE
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.result import RunResult

_LONGEST_NAME = 150


def run_labels(folders: Sequence[Path]) -> list[str]:
    """Name of each run: its folder's name, with the parents' names where that is not unique.

    Raises:
        UserError: if a folder is named twice.
    """
    paths = [folder.resolve() for folder in folders]
    for parts in range(1, max(len(path.parts) for path in paths) + 1):
        labels = ["/".join(path.parts[-parts:]) for path in paths]
        if len(set(labels)) == len(labels):
            return labels
    raise UserError("two arguments name the same folder; give each folder once")


def default_page(folders: Sequence[Path], what: str = "report") -> Path:
    """An unused file next to the first folder, named by `what` and the folders' names."""
    first, *others = (folder.resolve().name for folder in folders)
    stem = "-".join([what, first, *others])
    if len(stem) > _LONGEST_NAME:
        stem = f"{what}-{first}"[:_LONGEST_NAME] + f"-and-{len(others)}-more"
    parent = folders[0].parent if folders[0].name not in ("", "..") else folders[0].resolve().parent
    return unused_page(parent / f"{stem}.html")


def unused_page(page: Path) -> Path:
    """The file, or one with a number at the end of its name if it exists."""
    numbered = (page.with_name(f"{page.stem}-{number}.html") for number in count(2))
    return next(file for file in chain([page], numbered) if not file.exists())


def page_html(runs: Sequence[RunResult], command: Sequence[str], page: Path) -> str:
    """The page of two or more runs.

    Args:
        runs: with folders; the metrics of the others are compared with those of the first.
        command: command line that writes the page.
        page: file that will have it: links to the runs' own pages are relative to it.
    """
    labels = run_labels([run.folder for run in runs])
    differing, same = differing_settings(runs)
    pngs = [run.pictures.get("path.png") for run in runs]
    cautions = warnings(runs)
    shown = {"runs": runs, "labels": labels, "difference": shown_difference}
    rows = metric_rows(runs, mark_best=not cautions)
    # Metrics of another version, or of the user, may have none of these names.
    main = [row for row in rows if row["name"] in SUMMARY] or rows[: len(SUMMARY)]
    return page_template(__package__, "report.html").render(
        labels=labels,
        styles=[line_style(i) for i in range(len(runs))],
        colours=len(style.RUNS),
        links=[_link(run.folder, page) for run in runs],
        headline=[] if cautions else sentences_of(__package__, "compare", **shown),
        warnings=cautions,
        differing=by_group(differing),
        same=same,
        verdicts=[verdict(run.metrics) for run in runs],
        main_metrics=main,
        other_metrics=[row for row in rows if row not in main],
        low_overlap=LOW_OVERLAP,
        curves=error_curves(dict(zip(labels, map(_errors, runs), strict=True)), legend=False),
        pictures=[png and picture_for_page(png) for png in pngs],
        runs=runs,
        revisions=[shown_revision(run.entry("git")) for run in runs],
        entries={
            kind: list(dict.fromkeys(name for run in runs for name in run.entry(kind)))
            for kind in ("versions", "machine")
        },
        command=shlex.join(command),
    )


def _link(folder: Path, page: Path) -> str | None:
    """Path of a run's own page, relative to the folder of `page`; None if it has none."""
    if not (folder / PAGE).exists():
        return None
    link = os.path.relpath((folder / PAGE).resolve(), page.resolve().parent)
    return link.replace(os.sep, "/")


def metric_rows(runs: Sequence[RunResult], mark_best: bool = True) -> list[dict[str, Any]]:
    """One row per metric that has a value: name, label, unit, and what each run has.

    `cells`: value as text, and whether it is the best, which no value is without `mark_best`;
    `differences`: of each run but the first from the first, as text.
    """
    # In the order of a run's own metrics, also where an earlier run has no value.
    names = dict.fromkeys(name for run in runs for name in run.metrics)
    table = {name: [run.metrics.get(name) for run in runs] for name in names}
    return [
        {
            "name": name,
            "label": metric(name).label,
            "unit": metric(name).shown_unit,
            "cells": [
                (shown_value(name, value), is_best and mark_best)
                for value, is_best in zip(values, best(name, values), strict=True)
            ],
            "differences": [shown_difference(name, v, values[0]) for v in values[1:]],
        }
        for name, values in table.items()
        if any(value is not None for value in values)
    ]


def _errors(run: RunResult) -> Errors:
    scaled = {n: series.factor * getattr(run.scores, n)[None] for n, series in SERIES.items()}
    return run.scores.times, {n: own for n, own in scaled.items() if np.isfinite(own).any()}
