"""Compare several runs on one self-contained page: settings, metrics, error curves, pictures."""

import base64
import os
import re
import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import SERIES, metric
from stixel_cli.evaluation.scan_errors import LOW_OVERLAP
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.report import style
from stixel_cli.report.metrics import NO_VALUE, best, shown_value, with_value
from stixel_cli.results.reader import flat_settings
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
    page, number = parent / f"{stem}.html", 2
    while page.exists():
        page, number = parent / f"{stem}-{number}.html", number + 1
    return page


def page_html(runs: Sequence[RunResult], command: Sequence[str]) -> str:
    """The page of two or more runs; `command` is the command line that writes it."""
    labels = run_labels([run.folder for run in runs])
    differing, same = differing_settings(runs)
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = environment.from_string(
        resources.files(__package__).joinpath("templates/report.html.j2").read_text("utf-8")
    )
    return template.render(
        labels=labels,
        styles=[line_style(i) for i in range(len(runs))],
        colours=len(style.RUNS),
        run_colours=style.RUNS,
        differing=differing,
        same=same,
        verdicts=[verdict(run.metrics) for run in runs],
        metrics=metric_rows(runs),
        low_overlap=LOW_OVERLAP,
        curves=[(title, Markup(svg)) for title, svg in error_curves(runs)],
        pictures=[_data_uri(run.pictures.get("path.png")) for run in runs],
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


def differing_settings(
    runs: Sequence[RunResult],
) -> tuple[list[Any], list[tuple[str, str]]]:
    """Different settings as (key, value of each run), and equal ones as (key, value)."""
    flat = [flat_settings(run.settings) for run in runs]
    tables = [_choices(run, settings) | settings for run, settings in zip(runs, flat, strict=True)]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    groups = list(dict.fromkeys(key.partition(".")[0] for key in keys))
    keys.sort(key=lambda key: groups.index(key.partition(".")[0]))
    differing, same = [], []
    for key in keys:
        values = [table.get(key, NO_VALUE) for table in tables]
        if len(set(values)) > 1:
            differing.append((key, values))
        else:
            same.append((key, values[0]))
    return differing, same


def _choices(run: RunResult, settings: dict[str, str]) -> dict[str, str]:
    """The chosen option of each group whose settings have no `kind`."""
    choices = run.manifest.get("choices")
    if not isinstance(choices, dict):
        return {}
    return {
        str(group): str(option)
        for group, option in choices.items()
        if f"{group}.kind" not in settings
    }


def metric_rows(runs: Sequence[RunResult]) -> list[dict[str, Any]]:
    """One row per metric that has a value: name, label, unit; per run the value and if it is best.

    The value is text.
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
        rows.append({"name": name, "label": shown.label, "unit": shown.shown_unit, "cells": cells})
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


def _data_uri(png: bytes | None) -> str | None:
    return None if png is None else "data:image/png;base64," + base64.b64encode(png).decode()


LINE_STYLES = ("-", "--", "-.", ":")

# Placeholders for colours of the page, which is light or dark.
_INK, _GRID = "#010203", "#020304"


def run_colour(i: int) -> str:
    """Colour of the i-th run."""
    return style.RUNS[i % len(style.RUNS)]


def line_style(i: int) -> str:
    """Line style of the i-th run: style and colour are unique among the first 32 runs."""
    return LINE_STYLES[(i + i // len(style.RUNS)) % len(LINE_STYLES)]


def error_curves(runs: Sequence[RunResult]) -> list[tuple[str, str]]:
    """(title, SVG element) of each error that a run has; the i-th run has colour `var(--run-i)`.

    On the HTML page, text and axes use `currentColor`, the grid uses `var(--grid)`.
    """
    drawn = []
    with style.drawing({"text.color": _INK, "axes.edgecolor": _INK, "axes.labelcolor": _INK}):
        for name, series in SERIES.items():
            if any(np.isfinite(getattr(run.scores, name)).any() for run in runs):
                title = series.label + (" (consistent: 1)" if series.ratio else "")
                svg = _curve_svg(name, title, runs)
                drawn.append((title, _for_page(svg, len(drawn))))
    return drawn


def _curve_svg(name: str, title: str, runs: Sequence[RunResult]) -> str:
    series = SERIES[name]
    figure = style.new_figure(5.0, 2.7)
    figure.patch.set_visible(False)
    axes = figure.add_axes((0.115, 0.165, 0.87, 0.72))
    axes.patch.set_visible(False)
    axes.tick_params(colors=_INK)
    axes.grid(True, color=_GRID)
    if series.ratio:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
    line = LOW_OVERLAP if name == "iou" else series.consistent
    if line is not None:
        axes.axhline(line, color=_INK, linewidth=0.7, linestyle=(0, (4, 3)))
    for i, run in enumerate(runs):
        values = series.factor * getattr(run.scores, name)
        if series.ratio:
            values = np.where(values > 0.0, values, np.nan)
        axes.plot(
            run.scores.times, values, color=run_colour(i), linestyle=line_style(i), linewidth=1.6
        )
    if series.ratio:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.08), max(high, 12.5))
    else:
        axes.set_ylim(*series.bounds)
    axes.margins(x=0.01)
    axes.set_title(title)
    axes.set(xlabel="t (s)", ylabel=series.unit or series.short_label)
    return style.svg(figure).decode()


def _for_page(text: str, number: int) -> str:
    """An SVG file as an element of a page, with unique ids and the colours of the page."""
    text = text[text.index("<svg") :]
    text = re.sub(r'\sxmlns(:xlink)?="[^"]*"', "", text)
    text = re.sub(r'(<svg\b[^>]*?)\swidth="[^"]*"\sheight="[^"]*"', r"\1", text, count=1)
    text = text.replace("xlink:href=", "href=")
    # Matplotlib derives ids from content, so two figures of a page may share them.
    text = re.sub(r'\bid="', f'id="c{number}-', text)
    text = re.sub(r'(url\(|href=")#', rf"\1#c{number}-", text)
    colours = {_INK: "currentColor", _GRID: "var(--grid)"}
    colours |= {colour: f"var(--run-{i})" for i, colour in enumerate(style.RUNS)}
    for colour, name in colours.items():
        text = text.replace(colour, name)
    return text
