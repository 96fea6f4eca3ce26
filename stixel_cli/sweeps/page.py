"""A page for a sweep: sortable tables, a figure for each axis, errors over time, links to runs."""

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.errors import UserError, counted
from stixel_cli.evaluation.metric_table import over_runs
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.report import tables
from stixel_cli.report.blocks import Table
from stixel_cli.report.error_curves import Errors, error_curves
from stixel_cli.report.page import Drawing, drawing_for_page, page_template, table_for_page
from stixel_cli.report.statistics import Unit
from stixel_cli.results.folder import PAGE
from stixel_cli.results.reader import read_series
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.figures import DRAWN, axis_figures
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.over import Axes as OverAxes
from stixel_cli.sweeps.over import over_axes, unit_of
from stixel_cli.sweeps.ranking import answer, label_of, ranked, ranking_figure
from stixel_cli.sweeps.results import SweepResult, heading


def sweep_page(folder: Path, page: Path, command: Sequence[str], over: str = "") -> str:
    """The page of the sweep in `folder`; UserError if that is no sweep, or no run of it is done.

    The runs that it lacks are counted, and their settings have no statistics. `page` is the file
    that will have the page: links are relative to it. `command` is the command line that writes it.
    `over` has the keys that means are over; "" for those of the sweep.
    """
    request = SweepFolder(folder).request()
    runs = SweepFolder(folder).runs(request)
    axes = over_axes(over or request.over, request.axes)
    result = SweepResult(folder, tuple(runs), axes=request.axes, over=axes)
    done = result.count(DONE)
    if not done:
        raise UserError(f"{folder}: no run is done; resume with: stixel sweep --resume {folder}")
    known = {name for run in runs for name in run.metrics}
    shown = [name for name in DRAWN if name in known] or sorted(known)[:8]
    incomplete = len(result.incomplete)
    settings = counted(len(result.by_setting), "setting")
    settings += f", {incomplete} incomplete: no statistics yet" if incomplete else ""
    drawn = axis_figures(result.repetitions, request.axes, incomplete, "svg", result.units)
    return page_template(__package__, "sweep.html").render(
        title=folder.resolve().name,
        counts=f"{done} of {len(runs)} runs done; {settings}; means over {result.units}",
        rankings=_rankings(result, [over_runs(name) for name in shown]),
        settings=_settings_table(result, shown),
        runs=_runs_table(result, shown, page.resolve().parent),
        units=result.units,
        axes=[
            (stem, drawing_for_page(data.decode(), f"a{i}"))
            for i, (stem, data) in enumerate(drawn.items())
        ],
        over_time=over_time(result),
        request=request.notes,
        command=shlex.join(command),
    )


def _rankings(result: SweepResult, names: Sequence[str]) -> list[tuple[str, str, Drawing]]:
    """Heading, sentence and figure of each metric with a value."""
    known = [name for name in names if ranked(result, name)]
    return [
        (
            heading(name),
            answer(result, name),
            drawing_for_page(ranking_figure(result, name).decode(), f"r{i}"),
        )
        for i, name in enumerate(known)
    ]


def _settings_table(result: SweepResult, shown: Sequence[str]) -> dict[str, Any]:
    """One row for each complete setting: its values, n, and each metric with its interval."""
    rows = []
    for setting, of in result.statistics.items():
        row = dict(setting) | {"n": max(one.n for one in of.values())}
        for name in map(over_runs, shown):
            row |= tables.ends(tables.label_of(name), of.get(name))
        rows.append(row)
    return table_for_page(Table.of("settings", rows))


def _runs_table(
    result: SweepResult, shown: Sequence[str], parent: Path
) -> tuple[dict[str, Any], list[str]]:
    """One row for each run, and the links from `parent` to their pages, or else their folders."""
    rows, links = [], []
    for run in result.runs:
        values = {tables.label_of(name): run.metrics.get(name) for name in shown}
        named = {"run": f"{run.index:04d}", **run.setting, "seed": run.manifest["seed"] or "–"}
        rows.append(named | values)
        target = run.folder / PAGE if (run.folder / PAGE).exists() else run.folder
        link = "" if run.status != DONE else os.path.relpath(target.resolve(), parent)
        links.append(link.replace(os.sep, "/"))
    return table_for_page(Table.of("runs", rows)), links


def over_time(result: SweepResult) -> list[tuple[str, Drawing]]:
    """(title, drawing) for each error over time, with a line for each complete setting.

    A line is over the units. A setting whose runs have different times is left out, as are runs
    without errors over time.
    """
    read = {label_of(s): _stacked(r, result.over) for s, r in result.complete_settings.items()}
    return error_curves({label: errors for label, errors in read.items() if errors})


def _stacked(runs: Sequence[RunResult], over: OverAxes) -> Errors | None:
    """The errors of the units of one setting; None if its runs do not match."""
    try:
        found = [read_series(run.folder / "scores.npz") for run in runs]
    except UserError:
        return None
    times = found[0][0]
    if any(not np.array_equal(times, other) for other, _ in found):
        return None
    units: dict[Unit, list[Mapping[str, np.ndarray]]] = {}
    for run, (_, series) in zip(runs, found, strict=True):
        units.setdefault(unit_of(run, over), []).append(series)
    stacked = {}
    for name in set.intersection(*(set(series) for _, series in found)):
        values = [np.mean([one[name] for one in own], axis=0) for own in units.values()]
        stacked[name] = SERIES[name].factor * np.stack(values)
    if "orientation_error" in stacked:
        stacked["orientation_error"] = np.abs(stacked["orientation_error"])
    return times, {name: values for name, values in stacked.items() if np.isfinite(values).any()}
