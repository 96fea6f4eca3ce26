"""Pictures of a whole run: its errors and consistency over time, the error of its rig."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.evaluation.scores import LOW_OVERLAP, SERIES, Scores
from stixel_cli.geometry.rig_calibration import RigCalibration
from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures import style
from stixel_cli.pictures.uncertainty import normalised_chi_square_bounds
from stixel_cli.results.pictures import Pictures
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def error_pictures(scans: Scans, track: Track, scenario: Scenario, scores: Scores) -> Pictures:
    """`errors`, over time, as `.png` and `.svg`; without truth the panels that need none."""
    with style.drawing():
        figure = errors_figure(scans, track, scores, bool(scenario.known.any()))
        return Pictures({"errors.png": style.png(figure), "errors.svg": style.svg(figure)})


def errors_figure(scans: Scans, track: Track, scores: Scores, with_truth: bool = True) -> Figure:
    """Centre error, orientation error and IoU; NEES and NIS with χ² bounds; points of each scan.

    Without truth: NIS and points only.
    """
    figure = style.new_figure(10.4, 6.0 if with_truth else 4.2)
    used = np.diff(track.used_offsets)
    rows, columns, bottom = (3, 2, 0.08) if with_truth else (2, 1, 0.12)
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    figure.subplots_adjust(0.07, bottom, 0.985, 0.95, hspace=0.32, wspace=0.18)
    if with_truth:
        _draw_errors(grid[:, 0], scores)
        _draw_consistency(grid[0, 1], scores, "nees_position", np.full(len(used), 2))
    _draw_consistency(grid[-2, -1], scores, "nis", track.nis_degrees_of_freedom)
    _draw_counts(grid[-1, -1], scores.times, np.diff(scans.offsets), used)
    for axes in grid.flat:
        axes.grid(True)
        axes.margins(x=0.01)
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    figure.align_ylabels()
    return figure


def _draw_errors(column, scores: Scores) -> None:
    overlap = "iou" if np.isfinite(scores.iou).any() else "iou_box"
    rows = (
        ("centre_error", "RMSE", "centre_rmse_m"),
        ("orientation_error", "RMSE", "orientation_rmse_deg"),
        (overlap, "mean", f"{overlap}_mean"),
    )
    for axes, (name, average, total) in zip(column, rows, strict=True):
        series, value = SERIES[name], scores.metrics.get(total)
        title = series.label
        if value is not None:
            title += f", {average} {value:.2f} {metric(total).unit}".rstrip().replace(" °", "°")
        if name == "iou":
            axes.axhline(LOW_OVERLAP, color=style.UNUSED, linewidth=0.9, linestyle="--")
            title += f"  (dashed: < {LOW_OVERLAP}; dotted: box)"
            axes.plot(scores.times, scores.iou_box, ":", color=style.ESTIMATE, linewidth=1.2)
        if series.consistent is not None:
            axes.axhline(series.consistent, color=style.TRUTH, linewidth=0.7)
        axes.plot(scores.times, series.factor * getattr(scores, name), color=style.ESTIMATE)
        label = series.unit or series.short_label
        axes.set(ylim=series.bounds, title=title, ylabel=label)


def _draw_consistency(axes: Axes, scores: Scores, name: str, degrees_of_freedom) -> None:
    """A statistic divided by its degrees of freedom, on a logarithmic axis."""
    series, ratio = SERIES[name], getattr(scores, name)
    low, high = normalised_chi_square_bounds(np.asarray(degrees_of_freedom))
    ratio = np.where(ratio > 0.0, ratio, np.nan)
    axes.set_yscale("log")
    # A decade to each side at least, so that a small scatter does not look like a great one.
    finite = np.concatenate([[0.1, 10.0], ratio[np.isfinite(ratio)]])
    axes.set_ylim(0.8 * finite.min(), 1.25 * finite.max())
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.fill_between(scores.times, low, high, color=style.CONSISTENT, linewidth=0)
    axes.axhline(series.consistent, color=style.TRUTH, linewidth=0.7)
    axes.plot(scores.times, ratio, color=style.ESTIMATE)
    axes.set(title=f"{series.label}  (consistent: 1; grey: 95 % interval)", ylabel="ratio")


def _draw_counts(axes: Axes, times, candidates, used) -> None:
    steps = {"drawstyle": "steps-mid"}
    # Wide, so that it shows where all points of a scan are used.
    axes.plot(times, candidates, color=style.UNUSED, linewidth=3.5, label="in scan", **steps)
    axes.plot(times, used, color=style.USED, label="used", **steps)
    top = 1.25 * max(1, int(candidates.max(initial=0)))
    axes.set(ylim=(0.0, top), title="Points per scan", ylabel="points")
    axes.legend(loc="upper right", ncols=2)


DEPTHS = (10.0, 20.0, 40.0)
"""m, at which the error of a depth is drawn."""


def rig_pictures(calibration: RigCalibration) -> Pictures:
    """`rig_error` as `.png` and `.svg`: the error over the columns, and the depth errors it causes.

    Without points there is no picture.
    """
    if not len(calibration.columns):
        return Pictures({})
    rig = calibration.rig
    columns = np.linspace(0, rig.width - 1, 200)
    basis = rig.disparity_error_basis(columns)
    error = basis @ rig.disparity_error
    band = np.linalg.norm(basis @ rig.disparity_error_factor, axis=1)
    with style.drawing():
        figure = style.new_figure(10.4, 3.6, layout="constrained")
        left, right = figure.subplots(1, 2)
        left.plot(calibration.columns, calibration.errors, ",", color=style.UNUSED)
        left.fill_between(columns, error - 2 * band, error + 2 * band, color=style.CONSISTENT)
        left.plot(columns, error, color=style.ESTIMATE)
        left.set(ylim=(min(error.min(), 0.0) - 1.5, max(error.max(), 0.0) + 1.5), ylabel="px")
        left.set_title("Disparity error, ± 2 standard deviations; points: static points")
        for depth, colour in zip(DEPTHS, style.RUNS, strict=False):
            per_pixel = depth / rig.disparity_from_depth(depth)
            right.plot(columns, -per_pixel * error, color=colour, label=f"{depth:g} m")
            reach = 2 * per_pixel * band
            right.fill_between(columns, -reach, reach, color=colour, alpha=0.2)
        right.set(title="Error of a depth: lines before, bands (± 2 std) after", ylabel="m")
        right.legend(loc="upper center", ncols=3)
        for axes in (left, right):
            axes.set_xlabel("column (px)")
            axes.grid(True)
        return Pictures({"rig_error.png": style.png(figure), "rig_error.svg": style.svg(figure)})
