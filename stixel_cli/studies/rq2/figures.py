"""RQ2: the figures."""

import math
from collections.abc import Sequence

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.report import style
from stixel_cli.report.compare import LINE_STYLES
from stixel_cli.studies.prose import capital
from stixel_cli.studies.rq2.conditions import Condition, condition_statistics
from stixel_cli.studies.rq2.runs import Run, chi_square_bounds, chosen, names
from stixel_cli.studies.types import Figure
from stixel_cli.sweeps.statistics import Statistic, student_t

WIDTH = 4.9
"""in: about that of a phone's page, on which the text is then as large as it was drawn."""

ERRORS = {"centre": "centre (m)", "orientation": "orientation (°)", "iou": "IoU"}
CONSISTENCY = {"nees": "NEES / 2", "nis": "NIS / d.o.f."}
BOXED = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "nees_position_mean", "nis_mean")


def colour(measurement: str, measurements: Sequence[str]) -> str:
    """Colour of a measurement, the same in every figure."""
    return style.RUNS[measurements.index(measurement) % len(style.RUNS)]


def example_scans(name: str, runs: Sequence[Run]) -> Figure:
    """The middle scan of the first seed, a row a measurement and a column a path."""
    rows, columns = names(runs, "measurement"), names(runs, "path")
    with style.drawing():
        figure = _figure(WIDTH, 0.35 + 2.0 * len(rows))
        for i, measurement in enumerate(rows):
            for j, path in enumerate(columns):
                axes = figure.add_subplot(len(rows), len(columns), i * len(columns) + j + 1)
                found = chosen(runs, measurement=measurement, path=path)
                axes.set_title(f"{measurement},\n{path}", fontsize=8.0)
                if found:
                    _scan(axes, min(found, key=lambda run: run.seed))
        return Figure(
            name,
            "The scan in the middle of each run of the first seed: the true contour, the scan's "
            "points, and, dashed, the line to the sensor. World's ground plane, m.",
            style.svg(figure),
        )


def _scan(axes, run: Run) -> None:
    scenario, scans = run.point.load("scenario"), run.point.load("scans")
    k = len(scans) // 2
    pose = scenario.target_poses_world[k]
    contour = world_from_target(scenario.contour_target, pose)
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
    axes.tick_params(labelsize=7.0)


def over_time(name: str, runs: Sequence[Run], measurements: Sequence[str]) -> Figure:
    """Errors and consistency over time on one path: a column a tracker, a line a measurement."""
    trackers = names(runs, "tracker")
    rows = {**ERRORS, **CONSISTENCY}
    with style.drawing():
        figure = _figure(WIDTH, 0.6 + 1.1 * len(rows))
        grid = figure.subplots(len(rows), len(trackers), sharex=True, squeeze=False)
        for j, tracker in enumerate(trackers):
            for measurement in names(runs, "measurement"):
                same = chosen(runs, tracker=tracker, measurement=measurement)
                if not same:
                    continue
                shade = colour(measurement, measurements)
                for i, row in enumerate(rows):
                    _band(grid[i, j], row, same, shade, measurement)
            grid[0, j].set_title(tracker)
            grid[-1, j].set_xlabel("t (s)")
        count = len(names(runs, "seed"))
        low, high = (float(bound) / (2 * count) for bound in chi_square_bounds(2 * count))
        _finish(figure, grid, list(rows.values()), "both")
        for axes in grid[-2]:
            axes.axhspan(low, high, color=style.CONSISTENT, zorder=0)
        return Figure(
            name,
            f"{capital(runs[0].road_user)}, path {runs[0].path}: errors and consistency over time, "
            f"n = {count} seeds.",
            style.svg(figure),
        )


def _band(axes, row: str, runs: Sequence[Run], shade: str, label: str) -> None:
    times = runs[0].times
    values = np.stack(
        [
            run.nees if row == "nees" else run.nis if row == "nis" else run.errors[row]
            for run in runs
        ]
    )
    known = np.isfinite(values)
    n = known.sum(axis=0)
    mean = np.divide(np.where(known, values, 0.0).sum(axis=0), n, where=n > 0, out=_nans(len(n)))
    if row in ("nees", "nis"):
        mean = np.where(mean > 0.0, mean, np.nan)
    axes.plot(times, mean, color=shade, linewidth=1.2, label=label)
    if row in ERRORS and len(runs) > 1 and (n == len(runs)).all():
        half = student_t(len(runs) - 1) * values.std(axis=0, ddof=1) / math.sqrt(len(runs))
        low = np.maximum(mean - half, 0.0)
        axes.fill_between(times, low, mean + half, color=shade, alpha=0.2, linewidth=0.0)


def boxes(name: str, runs: Sequence[Run], measurements: Sequence[str]) -> Figure:
    """Box plots of the runs' summaries, a group a tracker and a box a measurement."""
    trackers, there = names(runs, "tracker"), names(runs, "measurement")
    groups = len(trackers) * len(there)
    with style.drawing():
        figure = _figure(WIDTH, 0.5 + 1.3 * len(BOXED))
        grid = figure.subplots(len(BOXED), 1, sharex=True, squeeze=False)
        for axes, metric in zip(grid[:, 0], map(METRICS.get, BOXED), strict=True):
            is_ratio = metric.better == "one"
            for i, tracker in enumerate(trackers):
                for j, measurement in enumerate(there):
                    same = chosen(runs, tracker=tracker, measurement=measurement)
                    values = [run.point.metrics.get(metric.name) for run in same]
                    values = [value for value in values if value is not None]
                    if is_ratio:
                        # On a logarithmic axis, as a run of no scan that counts has none.
                        values = [value for value in values if value > 0.0]
                    shade = colour(measurement, measurements)
                    place = i + 0.8 * ((j + 0.5) / len(there) - 0.5)
                    if values:
                        _box(axes, values, place, 0.6 / len(there), shade)
                    # For the legend alone.
                    axes.plot([], [], color=shade, linewidth=4.0, label=measurement)
            unit = f" ({metric.unit})" if metric.unit else ""
            axes.set_ylabel(f"{metric.short_label}{unit}", fontsize=8.0)
            axes.grid(True, axis="y")
            axes.set_xticks(range(len(trackers)), trackers)
            if is_ratio:
                _ratio_axis(axes)
            else:
                axes.set_ylim(*metric.bounds)
        _legend(figure, grid)
        return Figure(
            name,
            f"{capital(runs[0].road_user)}: every run's summary, all paths and seeds together, "
            f"{len(runs) // groups} runs a box: median, quartiles, whiskers to the last value "
            "within 1.5 times the box's height, and dots for what is beyond. A box shows how runs "
            "spread, paths among them; "
            "it is no interval of a mean. NEES and NIS are means over a run's scans; 1, dashed, is "
            "consistent.",
            style.svg(figure),
        )


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
    name: str, condition: Condition, runs: Sequence[Run], measurements: Sequence[str]
) -> Figure:
    """Errors and consistency by a condition: a column a tracker, a line a measurement."""
    trackers, there = names(runs, "tracker"), names(runs, "measurement")
    rows = {**ERRORS, **CONSISTENCY}
    found = condition_statistics(condition, runs)
    bins = [b for b in range(len(condition.labels)) if any(key[2] == b for key in found)]
    with style.drawing():
        figure = _figure(WIDTH, 0.7 + 1.1 * len(rows))
        grid = figure.subplots(len(rows), len(trackers), sharex=True, squeeze=False)
        for j, tracker in enumerate(trackers):
            for m, measurement in enumerate(there):
                shift = 0.5 * ((m + 0.5) / len(there) - 0.5)
                here = [found.get((tracker, measurement, b)) for b in bins]
                for i, row in enumerate(rows):
                    statistics = [None if one is None else one.errors[row] for one in here]
                    shade = colour(measurement, measurements)
                    _means(grid[i, j], statistics, shift, shade, measurement)
            grid[0, j].set_title(tracker)
            grid[-1, j].set_xlabel(condition.label)
            grid[-1, j].set_xticks(range(len(bins)), [condition.labels[b] for b in bins])
            grid[-1, j].tick_params("x", labelrotation=35.0, labelsize=7.0)
        _finish(figure, grid, list(rows.values()), "y")
        most, least = len(names(runs, "seed")), min(one.seeds for one in found.values())
        # A single seed has no interval.
        fewest = f"{least} (without a bar)" if least == 1 else f"{least}"
        counted = f"{most}" if least == most else f"{fewest} to {most}"
        return Figure(
            name,
            f"{capital(runs[0].road_user)}: errors and consistency by {condition.what}; "
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
    # Below nothing there is no error; a logarithm has no room for it at all.
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
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")


def _figure(width: float, height: float):
    figure = style.new_figure(width, height, layout="constrained")
    figure.patch.set_visible(False)
    return figure


def _legend(figure, grid) -> None:
    found = {
        label: handle
        for axes in grid.flat
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    for axes in grid.flat:
        axes.patch.set_visible(False)
    if found:
        figure.legend(found.values(), found, loc="outside lower center", ncols=min(4, len(found)))


def _nans(n: int) -> np.ndarray:
    return np.full(n, np.nan)
