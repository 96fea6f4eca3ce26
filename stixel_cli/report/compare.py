"""Compare several runs on one self-contained page: settings, metrics, error curves, pictures."""

import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.evaluation.scan_errors import LOW_OVERLAP
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.pictures import style
from stixel_cli.report.charts import DASHES, Panel, chart
from stixel_cli.report.metrics import NO_VALUE, best, shown_difference, shown_value, with_value
from stixel_cli.report.page import Drawing, drawing_for_page, page_template, picture_for_page
from stixel_cli.results.differences import by_group, differing_settings, warnings
from stixel_cli.results.folder import PAGE
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
    names = [folder.resolve().name for folder in folders]
    stem = f"{what}-" + "-".join(names)
    if len(stem) > _LONGEST_NAME:
        stem = f"{what}-{names[0]}"[:_LONGEST_NAME] + f"-and-{len(names) - 1}-more"
    parent = folders[0].parent if folders[0].name not in ("", "..") else folders[0].resolve().parent
    return unused_page(parent / f"{stem}.html")


def unused_page(page: Path) -> Path:
    """The file, or one with a number at the end of its name if it exists."""
    found, number = page, 2
    while found.exists():
        found, number = page.with_name(f"{page.stem}-{number}.html"), number + 1
    return found


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
    return page_template(__package__, "report").render(
        labels=labels,
        styles=[line_style(i) for i in range(len(runs))],
        colours=len(style.RUNS),
        links=[_link(run.folder, page) for run in runs],
        warnings=warnings(runs),
        differing=by_group(differing),
        same=same,
        verdicts=[verdict(run.metrics) for run in runs],
        metrics=metric_rows(runs),
        low_overlap=LOW_OVERLAP,
        curves=error_curves(runs),
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
    own = folder / PAGE
    if not own.exists():
        return None
    return os.path.relpath(own.resolve(), page.resolve().parent).replace(os.sep, "/")


def metric_rows(runs: Sequence[RunResult]) -> list[dict[str, Any]]:
    """One row per metric that has a value: name, label, unit, and what each run has.

    `cells`: value as text, and whether it is the best; `differences`: of each run but the first
    from the first, as text.
    """
    rows = []
    known = [with_value(run.metrics) for run in runs]
    # In the order of a run's own metrics, also where an earlier run has no value.
    for name in dict.fromkeys(name for run in runs for name in run.metrics):
        values = [metrics.get(name) for metrics in known]
        if all(value is None for value in values):
            continue
        shown = metric(name)
        texts = [shown_value(name, value) for value in values]
        cells = list(zip(texts, best(name, values), strict=True))
        rows.append(
            {
                "name": name,
                "label": shown.label,
                "unit": shown.shown_unit,
                "cells": cells,
                "differences": [shown_difference(name, v, values[0]) for v in values[1:]],
            }
        )
    return rows


def _provenance(runs: Sequence[RunResult]) -> list[tuple[str, list[str]]]:
    """(name, value of each run): command, revision, versions and machine."""
    manifests = [run.manifest for run in runs]
    rows = [("folder", [str(run.folder) for run in runs])]
    for name in ("command", "seed", "created"):
        rows.append((name, [_text(manifest.get(name)) for manifest in manifests]))
    rows.append(("run time (s)", [_text(manifest.get("seconds")) for manifest in manifests]))
    rows.append(("git revision", [_revision(manifest.get("git")) for manifest in manifests]))
    for group, title in (("versions", ""), ("machine", "machine, ")):
        tables = [m.get(group) if isinstance(m.get(group), dict) else {} for m in manifests]
        for name in dict.fromkeys(name for table in tables for name in table):
            rows.append((f"{title}{name}", [_text(table.get(name)) for table in tables]))
    return rows


def _revision(git: Any) -> str:
    if not isinstance(git, dict) or git.get("revision") is None:
        return NO_VALUE
    return f"{str(git['revision'])[:12]}{' with uncommitted changes' if git.get('dirty') else ''}"


def _text(value: Any) -> str:
    return NO_VALUE if value is None else str(value)


_SETTINGS = {"axes.labelsize": 10.0, "xtick.labelsize": 10.0, "ytick.labelsize": 10.0}


def run_colour(i: int) -> str:
    """Colour of the i-th run."""
    return style.RUNS[i % len(style.RUNS)]


def line_style(i: int) -> str:
    """Line style of the i-th run: style and colour are unique among the first 32 runs."""
    return DASHES[(i + i // len(style.RUNS)) % len(DASHES)]


def error_curves(runs: Sequence[RunResult]) -> list[tuple[str, Drawing]]:
    """(title, drawing) of each error that a run has; the i-th run has colour `var(--run-i)`."""
    drawn = []
    for name, series in SERIES.items():
        if any(np.isfinite(getattr(run.scores, name)).any() for run in runs):
            title = series.label + (" (consistent: 1)" if series.ratio else "")
            drawn.append((title, drawing_for_page(_curve_svg(name, title, runs), f"c{len(drawn)}")))
    return drawn


def _curve_svg(name: str, title: str, runs: Sequence[RunResult]) -> str:
    series = SERIES[name]
    mark = LOW_OVERLAP if name == "iou" else None if series.ratio else series.consistent

    def draw(axes: Axes) -> None:
        if mark is not None:
            axes.axhline(mark, color=style.TRUTH, linewidth=0.7, linestyle=(0, (4, 3)))
        for i, run in enumerate(runs):
            values = series.factor * getattr(run.scores, name)
            if series.ratio:
                values = np.where(values > 0.0, values, np.nan)
            look = {"color": run_colour(i), "linestyle": line_style(i), "linewidth": 1.6}
            axes.plot(run.scores.times, values, **look)
        axes.margins(x=0.01)

    limits = (None, None) if series.ratio else series.bounds
    y = series.unit or series.short_label
    panel = Panel(draw, title, "t (s)", y, series.ratio, limits)
    return chart("", [panel], row=2.25, width=5.0, settings=_SETTINGS).svg.decode()
