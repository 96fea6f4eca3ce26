"""A page for a sweep: sortable tables, a figure for each axis, errors over time, links to runs."""

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.errors import UserError, counted
from stixel_cli.evaluation.metric_table import over_runs
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.pictures import style
from stixel_cli.report import charts
from stixel_cli.report.charts import series_values
from stixel_cli.report.metrics import shown_value
from stixel_cli.report.page import Drawing, drawing_for_page, page_template
from stixel_cli.results.folder import PAGE
from stixel_cli.results.reader import read_series
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.figures import DRAWN, MOST_LINES, axis_figures
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.over import over_axes
from stixel_cli.sweeps.results import SweepResult, heading


def sweep_page(folder: Path, page: Path, command: Sequence[str], over: str = "") -> str:
    """The page of the sweep in `folder`; UserError if that is no sweep, or no run of it is done.

    The runs that it lacks are counted, and their settings have no statistics. `page` is the file
    that will have the page: links are relative to it. `command` is the command line that writes it.
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
    axes = axis_figures(result.repetitions, request.axes, incomplete, "svg")
    return page_template(__package__, "sweep").render(
        title=folder.resolve().name,
        counts=f"{done} of {len(runs)} runs done; {settings}",
        tables=[_settings_table(result, shown), _runs_table(result, shown, page.resolve().parent)],
        axes=[
            (stem, drawing_for_page(data.decode(), f"a{i}"))
            for i, (stem, data) in enumerate(axes.items())
        ],
        over_time=over_time(result),
        most_lines=MOST_LINES,
        settings=len(result.by_setting) - incomplete,
        request=request.notes,
        command=shlex.join(command),
    )


def _settings_table(result: SweepResult, shown: Sequence[str]) -> dict[str, Any]:
    """One row for each complete setting: its values, n, and each metric with its interval."""
    columns, rows = list(map(over_runs, shown)), []
    keys = list(dict(next(iter(result.by_setting))))
    for setting, of in result.statistics.items():
        cells = [(value, value) for _, value in setting]
        cells.append((str(max(one.n for one in of.values())),) * 2)
        for name in columns:
            one = of.get(name)
            mean = None if one is None else one.mean
            text = shown_value(name, mean)
            if mean is not None and one.low is not None:
                text += f"\n[{shown_value(name, one.low)}, {shown_value(name, one.high)}]"
            cells.append((text, _sorted_by(mean)))
        rows.append((cells, ""))
    count = len(next(iter(result.statistics.values()), {}))
    return {
        "id": "settings",
        "title": "Settings",
        "note": "Means over the seeds with 95 % intervals (Student's t; of a share of runs "
        "Wilson's), not corrected for multiplicity. A click on a column's name sorts. "
        f"All {count} metrics are in summary.csv.",
        "header": [*keys, "n", *map(heading, columns)],
        "text": len(keys),
        "rows": rows,
        "open": True,
    }


def _sorted_by(value: float | int | None) -> str:
    return "" if value is None else repr(float(value))


def _runs_table(result: SweepResult, shown: Sequence[str], parent: Path) -> dict[str, Any]:
    """One row for each run, with a link to its page, or else to its folder."""
    keys, rows = list(result.runs[0].setting), []
    for run in result.runs:
        seed = run.manifest["seed"]
        cells = [(f"{run.index:04d}", str(run.index))]
        cells += [(value, value) for value in run.setting.values()]
        cells.append((seed or "–", seed))
        values = [(name, run.metrics.get(name)) for name in shown]
        cells += [(shown_value(name, value), _sorted_by(value)) for name, value in values]
        target = run.folder / PAGE if (run.folder / PAGE).exists() else run.folder
        link = "" if run.status != DONE else os.path.relpath(target.resolve(), parent)
        rows.append((cells, link.replace(os.sep, "/")))
    return {
        "id": "runs",
        "title": "Runs",
        "note": "The number links to the run's page, or to its folder.",
        "header": ["run", *keys, "seed", *map(heading, shown)],
        "text": len(keys) + 2,
        "rows": rows,
        "open": False,
    }


def over_time(result: SweepResult) -> list[tuple[str, Drawing]]:
    """(title, drawing) for each error over time: a line for each of the first complete settings.

    A line is the mean over the seeds, and its band the 95 % interval at each time. A setting whose
    runs have different times is left out, as are runs without errors over time.
    """
    settings = list(result.statistics)[:MOST_LINES]
    read = {setting: _stacked(result.by_setting[setting]) for setting in settings}
    drawn = []
    for name, series in SERIES.items():
        known = {key: found for key, found in read.items() if found and name in found[1]}
        if known:
            svg = _over_time(name, known).decode()
            drawn.append((series.label, drawing_for_page(svg, f"t{len(drawn)}")))
    return drawn


def _stacked(runs: Sequence[RunResult]) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Times (K,) and each error (n, K) of the runs of one setting; None if they do not match."""
    try:
        found = [read_series(run.folder / "scores.npz") for run in runs]
    except UserError:
        return None
    times = found[0][0]
    if any(not np.array_equal(times, other) for other, _ in found):
        return None
    names = set.intersection(*(set(series) for _, series in found))
    stacked = {name: np.stack([series[name] for _, series in found]) for name in names}
    return times, {name: values for name, values in stacked.items() if np.isfinite(values).any()}


def _over_time(name: str, lines: Mapping[tuple, tuple]) -> bytes:
    series = SERIES[name]
    labels = [" ".join(value for _, value in key)[:40] or "all" for key in lines]

    def draw(axes: Axes) -> None:
        drawn = zip(style.RUNS, labels, lines.values(), strict=False)
        for colour, label, (times, errors) in drawn:
            values = series_values(name, series, errors[name])
            look = {"color": colour, "label": label if len(lines) > 1 else ""}
            bounds = (0.0, series.bounds[1])
            charts.over_time(axes, times, values, series.ratio, bounds, **look)

    # Of a size that is legible on a telephone without scrolling.
    texts = ("axes.label", "xtick.label", "ytick.label", "legend.font", "axes.title")
    settings = {f"{text}size": 10.0 for text in texts}
    keys = " ".join(key for key, _ in next(iter(lines)))[:60] if len(lines) > 1 else ""
    title = series.label + (f" ({series.unit})" if series.unit else "")
    panel = charts.Panel(draw, keys, "t (s)", title, series.ratio)
    columns = max(1, min(4, 56 // max(6, *map(len, labels))))
    return charts.chart("", [panel], row=2.45, width=5.0, legend=columns, settings=settings).svg
