"""RQ2: the figures of its own. Their captions are in the template."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import WIDTH, Panel, chart
from stixel_cli.report.tables import chosen, names, with_unit
from stixel_cli.studies.data import StudyRun
from stixel_cli.studies.runs import SCAN_ERRORS, colour

if TYPE_CHECKING:
    import pandas as pd


def example_scans(name: str, runs: "pd.DataFrame") -> Figure:
    """The middle scan of the first seed: one row per measurement, one column per path."""
    rows, columns = names(runs, "measurement"), names(runs, "path")

    def panel(measurement: str, path: str) -> Panel:
        found = chosen(runs, measurement=measurement, path=path).sort_values("seed")

        def draw(axes) -> None:
            axes.grid(False)
            if len(found):
                _scan(axes, found["run"].iloc[0])

        return Panel(draw, title=f"{measurement},\n{path}")

    panels = [panel(measurement, path) for measurement in rows for path in columns]
    return chart(name, panels, len(columns), 2.0, settings={"axes.titlesize": 8.0})


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


def boxes(name: str, runs: "pd.DataFrame", measurements: Sequence[str]) -> Figure:
    """Box plots of the runs' metrics: one group per tracker, one box per measurement."""
    trackers, there = names(runs, "tracker"), names(runs, "measurement")

    def panel(metric) -> Panel:
        def draw(axes) -> None:
            for i, tracker in enumerate(trackers):
                for j, measurement in enumerate(there):
                    same = chosen(runs, tracker=tracker, measurement=measurement)
                    values = same[metric.name].dropna()
                    if metric.better == "one":
                        # The axis is logarithmic.
                        values = values[values > 0.0]
                    shade = colour(measurement, measurements)
                    place = i + 0.8 * ((j + 0.5) / len(there) - 0.5)
                    if len(values):
                        _box(axes, values.to_numpy(), place, 0.6 / len(there), shade)
                    # Only for the legend.
                    axes.plot([], [], color=shade, linewidth=4.0, label=measurement)
            axes.set_xticks(range(len(trackers)), trackers)
            axes.grid(False, axis="x")

        ratio = metric.better == "one"
        limits = (None, None) if ratio else metric.bounds
        return Panel(draw, y=with_unit(metric), ratio=ratio, limits=limits)

    return chart(name, list(map(panel, SCAN_ERRORS.values())), 2, 1.45, 1.45 * WIDTH, legend=4)


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
