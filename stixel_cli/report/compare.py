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
from stixel_cli.report.metrics import NO_VALUE, best, shown_difference, shown_value
from stixel_cli.report.page import page_template, picture_for_page
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
    rows = metric_rows(runs, mark_best=not cautions)
    # Metrics of another version, or of the user, may have none of these names.
    main = [row for row in rows if row["name"] in SUMMARY] or rows[: len(SUMMARY)]
    return page_template(__package__, "report.html").render(
        labels=labels,
        styles=[line_style(i) for i in range(len(runs))],
        colours=len(style.RUNS),
        links=[_link(run.folder, page) for run in runs],
        headline=[] if cautions else headline(runs, labels),
        warnings=cautions,
        differing=by_group(differing),
        same=same,
        verdicts=[verdict(run.metrics) for run in runs],
        main_metrics=main,
        other_metrics=[row for row in rows if row not in main],
        low_overlap=LOW_OVERLAP,
        curves=error_curves(dict(zip(labels, map(_errors, runs), strict=True)), legend=False),
        pictures=[png and picture_for_page(png) for png in pngs],
        provenance=_provenance(runs),
        command=shlex.join(command),
    )


def write_page(page: Path, html: str) -> None:
    """Write a page to a new file.

    Raises:
        UserError: if the file exists or cannot be written.
    """
    try:
        with page.open("x", encoding="utf-8") as file:
            file.write(html)
            file.flush()
            os.fsync(file.fileno())
    except FileExistsError:
        raise UserError(f"{page}: already exists; choose another file") from None
    except OSError as error:
        raise UserError(f"{page}: cannot be written: {error.strerror}") from error


def _link(folder: Path, page: Path) -> str | None:
    """Path of a run's own page, relative to the folder of `page`; None if it has none."""
    if not (folder / PAGE).exists():
        return None
    link = os.path.relpath((folder / PAGE).resolve(), page.resolve().parent)
    return link.replace(os.sep, "/")


FRACTIONS = ("half", "a third", "a quarter", "a fifth", "a sixth", "a seventh", "an eighth")
"""A half and smaller parts, in words."""


def headline(runs: Sequence[RunResult], labels: Sequence[str]) -> list[str]:
    """A sentence on each run but the first: how its IoU and its centre error differ."""
    lines, first = [], runs[0].metrics
    for run, label in zip(runs[1:], labels[1:], strict=True):
        parts = []
        for name, text in (("iou_mean", "IoU"), ("iou_box_mean", "IoU of the box")):
            one, other = first.get(name), run.metrics.get(name)
            if one is not None and other is not None:
                parts.append(f"{text} {shown_difference(name, other, one)}")
                break
        one, other = first.get("centre_rmse_m"), run.metrics.get("centre_rmse_m")
        if one and other is not None:
            parts.append(f"centre error {_share(other / one)}")
        lines += [f"{label}, compared with {labels[0]}: {', '.join(parts)}."] if parts else []
    return lines


def _share(ratio: float) -> str:
    """`a fifth` for 0.2, `2.5 times` for 2.5; near 1 the change in per cent."""
    if 0.6 <= ratio <= 1.7:
        return f"{100.0 * (ratio - 1.0):+.0f} %".replace("-", "\u2212")
    part = round(1.0 / ratio) if ratio > 0.0 else 0
    return FRACTIONS[part - 2] if 2 <= part < len(FRACTIONS) + 2 else f"{ratio:.2g} times"


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


def _provenance(runs: Sequence[RunResult]) -> list[tuple[str, list[str]]]:
    """(name, value of each run): command, revision, versions and machine."""
    tables: list[dict[str, Any]] = []
    for run in runs:
        tables.append(
            {
                "folder": run.folder,
                **{name: run.manifest.get(name) for name in ("command", "seed", "created")},
                "run time (s)": run.manifest.get("seconds"),
                "git revision": shown_revision(run.entry("git")),
                **run.entry("versions"),
                **{f"machine, {name}": value for name, value in run.entry("machine").items()},
            }
        )
    names = dict.fromkeys(name for table in tables for name in table)
    in_order = sorted(names, key=lambda name: name.startswith("machine"))
    values = {name: [table.get(name) for table in tables] for name in in_order}
    return [(n, [NO_VALUE if v is None else str(v) for v in row]) for n, row in values.items()]


def _errors(run: RunResult) -> Errors:
    scaled = {n: series.factor * getattr(run.scores, n)[None] for n, series in SERIES.items()}
    return run.scores.times, {n: own for n, own in scaled.items() if np.isfinite(own).any()}
