"""A page for a sweep: sortable tables, a figure for each axis, errors over time, links to runs."""

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import SERIES, over_runs
from stixel_cli.report import style
from stixel_cli.report.metrics import shown_value
from stixel_cli.report.page_svg import Drawing, drawing_for_page
from stixel_cli.report.page_template import page_template
from stixel_cli.results.folder import PAGE
from stixel_cli.results.reader import read_metrics, read_series
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.figures import DRAWN, MOST_LINES, axis_figures
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.statistics import Statistic, student_t, summarise
from stixel_cli.sweeps.tables import heading

Cell = tuple[str, str]
"""Text, and the value by which a table is sorted."""


@dataclass(frozen=True)
class ReadRun:
    """A run of a sweep, as its folder has it.

    Attributes:
        index: in the sweep.
        setting: keys that differ between the runs, without the seed, to values as typed.
        seed: as typed; "" if it is not swept.
        metrics: name to value; None if the run is missing or has failed.
        folder: of the run.
    """

    index: int
    setting: Mapping[str, str]
    seed: str
    metrics: Mapping[str, float | int | None] | None
    folder: Path


def sweep_page(folder: Path, page: Path, command: Sequence[str]) -> str:
    """The page of the sweep in `folder`.

    Args:
        folder: of a sweep; runs that it lacks are counted, and their settings have no statistics.
        page: file that will have the page: links to runs are relative to it.
        command: command line that writes it.

    Raises:
        UserError: if it is not the folder of a sweep, or none of its runs is done.
    """
    request = SweepFolder(folder).request()
    runs = read_runs(folder, request)
    done = [run for run in runs if run.metrics is not None]
    if not done:
        raise UserError(f"{folder}: no run is done; resume with: stixel sweep --resume {folder}")
    complete = _complete(runs)
    statistics = summarise([run.setting for run in complete], [run.metrics for run in complete])
    known = {name for run in done for name in run.metrics}
    shown = [name for name in DRAWN if name in known] or sorted(known)[:8]
    keys = [key for key in request.keys if key != SEED]
    incomplete = len({_key(run) for run in runs} - {_key(run) for run in complete})
    axes = axis_figures(
        [run.setting for run in complete],
        [run.metrics for run in complete],
        request.axes,
        incomplete,
        "svg",
    )
    name = folder.resolve().name
    return page_template(__package__, "sweep").render(
        title=name,
        counts=f"{len(done)} of {len(runs)} runs done; {_settings_text(runs, incomplete)}",
        run_colours=style.RUNS,
        tables=[
            _settings_table(statistics, keys, shown),
            _runs_table(runs, keys, shown, page.resolve().parent),
        ],
        axes=[
            (stem, drawing_for_page(data.decode(), f"a{i}"))
            for i, (stem, data) in enumerate(axes.items())
        ],
        over_time=over_time(complete),
        most_lines=MOST_LINES,
        settings=len({_key(run) for run in complete}),
        request=request.notes,
        command=shlex.join(command),
    )


def read_runs(folder: Path, request: SweepRequest) -> list[ReadRun]:
    """The runs of a sweep in the order of their indices."""
    runs = []
    for index, overrides in enumerate(request.runs):
        given = dict(text.strip().lstrip("+").partition("=")[::2] for text in overrides)
        values = {key: given[key] for key in request.keys}
        own = SweepFolder(folder).run(index)
        try:
            metrics = read_metrics(own)
        except UserError:
            metrics = None
        setting = {key: value for key, value in values.items() if key != SEED}
        runs.append(ReadRun(index, setting, values.get(SEED, ""), metrics, own))
    return runs


def _key(run: ReadRun) -> tuple:
    return tuple(run.setting.items())


def _complete(runs: Sequence[ReadRun]) -> list[ReadRun]:
    """The runs of the settings all of whose runs are done."""
    missing = {_key(run) for run in runs if run.metrics is None}
    return [run for run in runs if _key(run) not in missing]


def _settings_text(runs: Sequence[ReadRun], incomplete: int) -> str:
    count = len({_key(run) for run in runs})
    text = f"{count} setting{'' if count == 1 else 's'}"
    return f"{text}, {incomplete} incomplete: no statistics yet" if incomplete else text


def _settings_table(
    statistics: Sequence[Statistic], keys: Sequence[str], shown: Sequence[str]
) -> dict[str, Any]:
    """One row for each setting: its values, n, and each metric with its interval."""
    rows: dict[tuple, dict[str, Statistic]] = {}
    for one in statistics:
        rows.setdefault(tuple(one.setting.values()), {})[one.metric] = one
    names = list(dict.fromkeys(one.metric for one in statistics))
    columns = [over_runs(name) for name in shown]
    body = []
    for values, of in rows.items():
        cells = [(value, value) for value in values]
        cells.append((str(max(one.n for one in of.values())),) * 2)
        cells += [_statistic_cell(of.get(name)) for name in columns]
        body.append((cells, ""))
    header = [*keys, "n", *map(heading, columns)]
    return {
        "id": "settings",
        "title": "Settings",
        "note": "Means over the seeds with 95 % intervals (Student's t; of a share of runs "
        "Wilson's), not corrected for multiplicity. A click on a column's name sorts. "
        f"All {len(names)} metrics are in summary.csv.",
        "header": header,
        "text": len(keys),
        "rows": body,
        "open": True,
    }


def _statistic_cell(one: Statistic | None) -> Cell:
    if one is None or one.mean is None:
        return "–", ""
    text = shown_value(one.metric, one.mean)
    if one.low is not None and one.high is not None:
        ends = (shown_value(one.metric, end) for end in (one.low, one.high))
        text = f"{text}\n[{', '.join(ends)}]"
    return text, repr(float(one.mean))


def _runs_table(
    runs: Sequence[ReadRun], keys: Sequence[str], shown: Sequence[str], parent: Path
) -> dict[str, Any]:
    """One row for each run, with a link to its page, or else to its folder."""
    body = []
    for run in runs:
        metrics = run.metrics or {}
        cells = [(f"{run.index:04d}", str(run.index))]
        cells += [(run.setting[key], run.setting[key]) for key in keys]
        cells.append((run.seed or "–", run.seed))
        for name in shown:
            value = metrics.get(name)
            cells.append((shown_value(name, value), "" if value is None else repr(float(value))))
        target = run.folder / PAGE if (run.folder / PAGE).exists() else run.folder
        link = "" if run.metrics is None else os.path.relpath(target.resolve(), parent)
        body.append((cells, link.replace(os.sep, "/")))
    return {
        "id": "runs",
        "title": "Runs",
        "note": "The number links to the run's page, or to its folder.",
        "header": ["run", *keys, "seed", *map(heading, shown)],
        "text": len(keys) + 2,
        "rows": body,
        "open": False,
    }


def over_time(runs: Sequence[ReadRun]) -> list[tuple[str, Drawing]]:
    """(title, drawing) for each error over time: a line for each of the first settings.

    A line is the mean over the seeds, and its band the 95 % interval at each time. A setting whose
    runs have different times is left out, as are runs without errors over time.
    """
    lines: dict[tuple, list[ReadRun]] = {}
    for run in runs:
        lines.setdefault(_key(run), []).append(run)
    read = {key: _stacked(own) for key, own in list(lines.items())[:MOST_LINES]}
    drawn = []
    for name, series in SERIES.items():
        known = {key: found for key, found in read.items() if found and name in found[1]}
        if known:
            title = series.label + (f" ({series.unit})" if series.unit else "")
            svg = _over_time(name, title, known).decode()
            drawn.append((series.label, drawing_for_page(svg, f"t{len(drawn)}")))
    return drawn


def _stacked(runs: Sequence[ReadRun]) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Times (K,) and each error (n, K) of the runs of one setting; None if they do not match."""
    found = []
    for run in runs:
        try:
            found.append(read_series(run.folder / "scores.npz"))
        except UserError:
            return None
    times = found[0][0]
    if any(not np.array_equal(times, other) for other, _ in found):
        return None
    names = set.intersection(*(set(series) for _, series in found))
    stacked = {name: np.stack([series[name] for _, series in found]) for name in names}
    return times, {name: values for name, values in stacked.items() if np.isfinite(values).any()}


def _over_time(name: str, title: str, lines: Mapping[tuple, tuple]) -> bytes:
    series = SERIES[name]
    # Of a size that is legible on a telephone without scrolling.
    texts = ("axes.label", "xtick.label", "ytick.label", "legend.font", "legend.title_font")
    with style.drawing({f"{text}size": 10.0 for text in texts}):
        figure = style.new_figure(5.0, 2.9, layout="constrained")
        figure.patch.set_visible(False)
        axes = figure.add_subplot()
        axes.patch.set_visible(False)
        for colour, (key, (times, errors)) in zip(style.RUNS, lines.items(), strict=False):
            values = series.factor * errors[name]
            if name == "orientation_error":
                values = np.abs(values)
            label = " ".join(value for _, value in key) or "all"
            mean = values.mean(axis=0)
            if series.ratio:
                mean = np.where(mean > 0.0, mean, np.nan)
            axes.plot(times, mean, color=colour, label=label[:40])
            n = len(values)
            if n > 1 and not series.ratio:
                half = student_t(n - 1) * values.std(axis=0, ddof=1) / np.sqrt(n)
                low = np.maximum(mean - half, 0.0)
                high = np.minimum(mean + half, series.bounds[1] or np.inf)
                axes.fill_between(times, low, high, color=colour, alpha=0.2, linewidth=0.0)
        if series.ratio:
            axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")
            style.log_axis(axes)
        axes.set(xlabel="t (s)", ylabel=title)
        axes.grid(True)
        if len(lines) > 1:
            columns = max(1, min(4, 56 // max(6, *(len(h) for h in _labels(lines)))))
            title = " ".join(name for name, _ in next(iter(lines)))
            figure.legend(loc="outside lower center", ncols=columns, title=title[:60])
        return style.svg(figure)


def _labels(lines: Mapping[tuple, tuple]) -> list[str]:
    return [" ".join(value for _, value in key)[:40] for key in lines]
