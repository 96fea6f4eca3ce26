"""RQ2: the figures."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.report import style
from stixel_cli.report.compare import LINE_STYLES
from stixel_cli.studies.data import StudyRun, chosen, names
from stixel_cli.studies.rq2.conditions import Condition, condition_statistics
from stixel_cli.studies.runs import SCAN_ERRORS, chi_square_bounds, quantity
from stixel_cli.studies.tables import capital, with_unit
from stixel_cli.studies.types import Figure
from stixel_cli.sweeps.statistics import Statistic, student_t

if TYPE_CHECKING:
    import pandas as pd

WIDTH = 4.9
"""in: about that of a phone's page, on which the text is then as large as it was drawn."""

_LABELS = {
    name: f"{quantity(metric)} ({metric.unit})" if metric.unit else quantity(metric)
    for name, metric in SCAN_ERRORS.items()
}


def colour(measurement: str, measurements: Sequence[str]) -> str:
    """Colour of a measurement, the same in every figure."""
    return style.RUNS[measurements.index(measurement) % len(style.RUNS)]


def example_scans(name: str, runs: "pd.DataFrame") -> Figure:
    """The middle scan of the first seed: one row per measurement, one column per path."""
    rows, columns = names(runs, "measurement"), names(runs, "path")
    with style.drawing():
        figure = _figure(WIDTH, 0.35 + 2.0 * len(rows))
        for i, measurement in enumerate(rows):
            for j, path in enumerate(columns):
                axes = figure.add_subplot(len(rows), len(columns), i * len(columns) + j + 1)
                found = chosen(runs, measurement=measurement, path=path)
                axes.set_title(f"{measurement},\n{path}", fontsize=8.0)
                if len(found):
                    _scan(axes, found.sort_values("seed")["run"].iloc[0])
        return Figure(name, "", style.svg(figure))


def _scan(axes, run: StudyRun) -> None:
    scenario, scans = run.load("scenario"), run.load("scans")
    k = len(scans) // 2
    pose = scenario.target_poses_world[k]
    contour = scenario.contour_world(k)
    points = scans.points_world[scans.rows(k)]
    axes.plot(*np.vstack([contour, contour[:1]]).T, color=style.TRUTH, linewidth=1.0)
    sensor = scans.sensor_poses_world[k, :2] - pose[:2]
    reach = 0.75 * np.ptp(contour, axis=0).max() + 0.5
    towards = pose[:2] + reach * sensor / np.hypot(*sensor)
    axes.plot(*np.stack([pose[:2], towards]).T, color=style.UNUSED, linewidth=0.8, linestyle="--")
    axes.plot(*points.T, ".", color=style.USED, markersize=3.5)
    axes.set_aspect("equal")
    axes.set_xlim(pose[0] - reach, pose[0] + reach)
    axes.set_ylim(pose[1] - reach, pose[1] + reach)
    axes.tick_params(labelsize=8.0)


def over_time(name: str, scans: "pd.DataFrame", measurements: Sequence[str]) -> dict[str, Figure]:
    """Errors over time on one path: one plot for each error, one colour for each measurement.

    The first tracker has solid lines and bands, each further one its own dashes and no band.
    """
    return {error: _over_time(name, error, scans, measurements) for error in SCAN_ERRORS}


def _over_time(name: str, error: str, scans: "pd.DataFrame", measurements: Sequence[str]) -> Figure:
    trackers = names(scans, "tracker")
    with style.drawing({"xtick.labelsize": 9.0, "ytick.labelsize": 9.0, "legend.fontsize": 9.0}):
        figure = _figure(WIDTH, 3.1)
        axes = figure.add_subplot()
        for measurement in names(scans, "measurement"):
            for dash, tracker in zip(LINE_STYLES, trackers, strict=False):
                same = chosen(scans, tracker=tracker, measurement=measurement)
                if not same.empty:
                    shade = colour(measurement, measurements)
                    label = measurement if tracker == trackers[0] else ""
                    _band(axes, error, same, shade, label, dash)
        if len(trackers) > 1:
            for dash, tracker in zip(LINE_STYLES, trackers, strict=False):
                axes.plot([], [], dash, color=style.UNUSED, label=tracker)
        if SCAN_ERRORS[error].better == "one":
            _ratio_axis(axes)
        if error == "nees":
            count = 2 * len(names(scans, "seed"))
            low, high = (float(bound) / count for bound in chi_square_bounds(count))
            axes.axhspan(low, high, color=style.CONSISTENT, zorder=0)
        if error == "iou":
            axes.set_ylim(0.0, 1.0)
        axes.set(xlabel="t (s)", ylabel=_LABELS[error])
        axes.grid(True)
        _legend(figure, np.array([axes]), 3)
        return Figure(f"{name}_{error}", "", style.svg(figure))


def _band(axes, error: str, scans: "pd.DataFrame", shade: str, label: str, dash: str = "-") -> None:
    """The mean over seeds at each time, and the interval of errors that every seed has.

    A line with a label has the interval as a band.
    """
    times = scans["t"].unique()
    values = scans.pivot(index="seed", columns="k", values=error).to_numpy()
    seeds, is_ratio = len(values), SCAN_ERRORS[error].better == "one"
    known = np.isfinite(values)
    n = known.sum(axis=0)
    mean = np.divide(np.where(known, values, 0.0).sum(axis=0), n, where=n > 0, out=_nans(len(n)))
    if is_ratio:
        mean = np.where(mean > 0.0, mean, np.nan)
    axes.plot(times, mean, dash, color=shade, linewidth=1.4 if label else 1.0, label=label)
    if label and not is_ratio and seeds > 1 and (n == seeds).all():
        half = student_t(seeds - 1) * values.std(axis=0, ddof=1) / math.sqrt(seeds)
        low = np.maximum(mean - half, 0.0)
        axes.fill_between(times, low, mean + half, color=shade, alpha=0.2, linewidth=0.0)


def boxes(name: str, runs: "pd.DataFrame", measurements: Sequence[str]) -> Figure:
    """Box plots of the runs' metrics: one group per tracker, one box per measurement."""
    trackers, there = names(runs, "tracker"), names(runs, "measurement")
    with style.drawing():
        figure = _figure(1.5 * WIDTH, 0.4 + 1.45 * -(-len(SCAN_ERRORS) // 2))
        grid = figure.subplots(-(-len(SCAN_ERRORS) // 2), 2)
        for axes in grid.flat[len(SCAN_ERRORS) :]:
            axes.set_axis_off()
        for axes, metric in zip(grid.flat, SCAN_ERRORS.values(), strict=False):
            is_ratio = metric.better == "one"
            for i, tracker in enumerate(trackers):
                for j, measurement in enumerate(there):
                    same = chosen(runs, tracker=tracker, measurement=measurement)
                    values = same[metric.name].dropna()
                    if is_ratio:
                        # The axis is logarithmic.
                        values = values[values > 0.0]
                    shade = colour(measurement, measurements)
                    place = i + 0.8 * ((j + 0.5) / len(there) - 0.5)
                    if len(values):
                        _box(axes, values.to_numpy(), place, 0.6 / len(there), shade)
                    # Only for the legend.
                    axes.plot([], [], color=shade, linewidth=4.0, label=measurement)
            axes.set_ylabel(with_unit(metric), fontsize=8.0)
            axes.grid(True, axis="y")
            axes.set_xticks(range(len(trackers)), trackers)
            if is_ratio:
                _ratio_axis(axes)
            else:
                axes.set_ylim(*metric.bounds)
        _legend(figure, grid)
        return Figure(name, "", style.svg(figure))


def _box(axes, values: Sequence[float], place: float, width: float, shade: str) -> None:
    line = {"color": shade, "linewidth": 1.2}
    axes.boxplot(
        [values],
        positions=[place],
        widths=[width],
        manage_ticks=False,
        boxprops=line,
        whiskerprops=line,
        capprops=line,
        medianprops=line | {"linewidth": 2.2},
        flierprops={"marker": ".", "markersize": 3.0, "markeredgecolor": shade},
    )


def by_condition(
    name: str, condition: Condition, scans: "pd.DataFrame", measurements: Sequence[str]
) -> Figure:
    """Errors by a condition: one column per tracker, one line per measurement."""
    trackers, there = names(scans, "tracker"), names(scans, "measurement")
    found = condition_statistics(condition, scans)
    bins = [b for b in range(len(condition.labels)) if any(key[2] == b for key in found)]
    with style.drawing():
        figure = _figure(WIDTH, 0.7 + 1.1 * len(SCAN_ERRORS))
        grid = figure.subplots(len(SCAN_ERRORS), len(trackers), sharex=True, squeeze=False)
        for j, tracker in enumerate(trackers):
            for m, measurement in enumerate(there):
                shift = 0.5 * ((m + 0.5) / len(there) - 0.5)
                here = [found.get((tracker, measurement, b)) for b in bins]
                for i, error in enumerate(SCAN_ERRORS):
                    statistics = [None if one is None else one.errors[error] for one in here]
                    shade = colour(measurement, measurements)
                    _means(grid[i, j], statistics, shift, shade, measurement)
            grid[0, j].set_title(tracker)
            grid[-1, j].set_xlabel(condition.label)
            grid[-1, j].set_xticks(range(len(bins)), [condition.labels[b] for b in bins])
            grid[-1, j].tick_params("x", labelrotation=35.0, labelsize=8.0)
        _finish(figure, grid, list(_LABELS.values()), "y")
        most, least = len(names(scans, "seed")), min(one.seeds for one in found.values())
        # A single seed has no interval.
        fewest = f"{least} (without a bar)" if least == 1 else f"{least}"
        counted = f"{most}" if least == most else f"{fewest} to {most}"
        return Figure(
            name,
            f"{capital(names(scans, 'road_user')[0])}: errors and consistency by {condition.what}; "
            f"n = {counted} seeds.",
            style.svg(figure),
        )


def _means(
    axes, statistics: Sequence[Statistic | None], shift: float, shade: str, label: str
) -> None:
    """Means and their intervals at the places 0, 1, … moved by `shift`, where there is a mean."""
    known = [(i, s) for i, s in enumerate(statistics) if s is not None and s.mean is not None]
    if not known:
        return
    means = [s.mean for _, s in known]
    halves = [0.0 if s.low is None else s.mean - s.low for _, s in known]
    # Errors are not negative, and a logarithmic axis has no 0.
    below = np.minimum(halves, 0.9 * np.array(means))
    axes.errorbar(
        [i + shift for i, _ in known],
        means,
        yerr=[below, halves],
        color=shade,
        linestyle=LINE_STYLES[0],
        linewidth=0.8,
        elinewidth=1.0,
        marker="o",
        markersize=3.0,
        label=label,
    )


def _finish(figure, grid, labels: Sequence[str], lines: str) -> None:
    """Labels, grid lines of the axis `lines`, the axes of IoU, NEES and NIS, and the legend."""
    for axes, label in zip(grid[:, 0], labels, strict=True):
        axes.set_ylabel(label, fontsize=8.0)
    for axes in grid.flat:
        axes.grid(True, axis=lines)
    for axes in grid[2]:
        axes.set_ylim(0.0, 1.0)
    for axes in grid[-2:].flat:
        _ratio_axis(axes)
    _legend(figure, grid)


def _ratio_axis(axes) -> None:
    axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")
    style.log_axis(axes)


def _figure(width: float, height: float):
    figure = style.new_figure(width, height, layout="constrained")
    figure.patch.set_visible(False)
    return figure


def _legend(figure, grid, columns: int = 4) -> None:
    found = {
        label: handle
        for axes in grid.flat
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    for axes in grid.flat:
        axes.patch.set_visible(False)
    if found:
        figure.legend(
            found.values(), found, loc="outside lower center", ncols=min(columns, len(found))
        )


def _nans(n: int) -> np.ndarray:
    return np.full(n, np.nan)
