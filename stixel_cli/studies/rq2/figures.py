"""RQ2: figures of scans and runs, and errors by range, visible sides and number of points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.report import tables
from stixel_cli.report.blocks import Figure, Table
from stixel_cli.report.charts import DASHES, WIDTH, Panel, chart, line
from stixel_cli.report.scan_frame import AXIS_LABELS, ERROR_LABELS, SCAN_ERRORS, colour


@dataclass(frozen=True)
class Condition:
    """A property that sorts scans into bins.

    Attributes:
        name: short.
        label: of an axis.
        what: in a sentence.
        column: of a frame of scans.
        edges: between bins; a value on an edge is in the bin above.
        labels: of the bins, one more than edges.
    """

    name: str
    label: str
    what: str
    column: str
    edges: tuple[float, ...]
    labels: tuple[str, ...]


CONDITIONS = (
    Condition(
        "range",
        "range (m)",
        "the distance from the sensor to the target's centre",
        "range",
        (8.0, 12.0, 16.0, 20.0, 25.0, 30.0, 40.0),
        ("< 8", "8–12", "12–16", "16–20", "20–25", "25–30", "30–40", "≥ 40"),
    ),
    Condition(
        "aspect",
        "aspect (°)",
        "the aspect angle between the heading and the line to the sensor, which determines the "
        "visible sides: at 0° only the front, at 90° only a long side, at 180° only the rear",
        "aspect",
        (15.0, 45.0, 75.0, 105.0, 135.0, 165.0),
        ("0–15", "15–45", "45–75", "75–105", "105–135", "135–165", "165–180"),
    ),
    Condition(
        "points",
        "points used",
        "the number of points that the tracker used of the scan",
        "used",
        (1.0, 3.0, 6.0, 11.0, 21.0, 41.0),
        ("0", "1–2", "3–5", "6–10", "11–20", "21–40", "> 40"),
    ),
)


def binned(condition: Condition, scans: pd.DataFrame) -> pd.DataFrame:
    """One row for each bin with scans, tracker and measurement, in the order of the bins.

    Columns: `bin`, its number; `tracker`; `measurement`; `scans` and `seeds`, their numbers; the
    statistics of each error over these seeds.
    """
    bins = np.searchsorted(condition.edges, scans[condition.column], side="right")
    rows = [
        {
            **dict(zip(("bin", "tracker", "measurement"), values, strict=True)),
            "scans": len(own),
            "seeds": own["seed"].nunique(),
            **{name: tables.mean_over(own[np.isfinite(own[name])], name) for name in SCAN_ERRORS},
        }
        for values, own in tables.groups(scans.assign(bin=bins), ["bin", "tracker", "measurement"])
    ]
    return pd.DataFrame(rows).sort_values("bin", kind="stable")


def condition_values(
    name: str, condition: Condition, scans: pd.DataFrame, measurements: Sequence[str]
) -> dict[str, Any]:
    """The figure and the table of a condition, what it is, and its number of seeds."""
    found = binned(condition, scans)
    most, least = scans["seed"].nunique(), int(found["seeds"].min())
    # A single seed has no interval.
    fewest = f"{least} (without a bar)" if least == 1 else f"{least}"
    return {
        "what": condition.what,
        "seeds": f"{most}" if least == most else f"{fewest} to {most}",
        "figure": _condition_figure(name, condition, found, scans, measurements),
        "table": _condition_table(name, condition, found),
    }


def _condition_table(name: str, condition: Condition, found: pd.DataFrame) -> Table:
    """The numbers of a condition."""
    rows = []
    for row in found.to_dict("records"):
        cells = {condition.label: condition.labels[row["bin"]]}
        cells |= {key: row[key] for key in ("tracker", "measurement", "scans", "seeds")}
        for error in ("centre", "orientation", "iou"):
            label, _, unit = AXIS_LABELS[error].partition(" (")
            full = SCAN_ERRORS[error].label.partition(",")[0]
            cells |= tables.spread(f"{full} ({unit}" if unit else full or label, row[error])
        rows.append(cells | {ERROR_LABELS[error]: row[error].mean for error in ("nees", "nis")})
    return Table.of(name, rows)


def _condition_figure(
    name: str,
    condition: Condition,
    found: pd.DataFrame,
    scans: pd.DataFrame,
    measurements: Sequence[str],
) -> Figure:
    """Errors by a condition: one column per tracker, one line per measurement."""
    trackers, there = tables.names(scans, "tracker"), tables.names(scans, "measurement")
    bins = sorted(found["bin"].unique())

    def panel(i: int, j: int) -> Panel:
        error, tracker = list(SCAN_ERRORS)[i], trackers[j]

        def draw(axes) -> None:
            for m, measurement in enumerate(there):
                own = found[(found["tracker"] == tracker) & (found["measurement"] == measurement)]
                shift = 0.5 * ((m + 0.5) / len(there) - 0.5)
                line(
                    axes,
                    [bins.index(b) + shift for b in own["bin"]],
                    own[error],
                    colour(measurement, measurements),
                    measurement,
                    bars=True,
                    linestyle=DASHES[0],
                    linewidth=0.8,
                    markersize=3.0,
                )
            axes.set_xticks(range(len(bins)), [condition.labels[b] for b in bins])
            axes.tick_params("x", labelrotation=35.0, labelsize=8.0)

        return Panel(
            draw,
            title=tracker if i == 0 else "",
            x=condition.label if i == len(SCAN_ERRORS) - 1 else "",
            y=AXIS_LABELS[error] if j == 0 else "",
            ratio=SCAN_ERRORS[error].better == "one",
            limits=(0.0, 1.0) if error == "iou" else (None, None),
        )

    panels = [panel(i, j) for i in range(len(SCAN_ERRORS)) for j in range(len(trackers))]
    return chart(name, panels, len(trackers), 1.15, sharex=True)


def boxes(name: str, runs: pd.DataFrame, measurements: Sequence[str]) -> Figure:
    """Box plots of the runs' metrics: one group per tracker, one box per measurement."""
    trackers, there = tables.names(runs, "tracker"), tables.names(runs, "measurement")

    def panel(metric) -> Panel:
        def draw(axes) -> None:
            for i, tracker in enumerate(trackers):
                for j, measurement in enumerate(there):
                    same = tables.chosen(runs, tracker=tracker, measurement=measurement)
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
        return Panel(draw, y=tables.with_unit(metric), ratio=ratio, limits=limits)

    return chart(name, list(map(panel, SCAN_ERRORS.values())), 2, 1.45, 1.45 * WIDTH)


def _box(axes, values: Sequence[float], place: float, width: float, shade: str) -> None:
    line = {"color": shade, "linewidth": 1.2}
    flier = {"marker": ".", "markersize": 3.0, "markeredgecolor": shade}
    looks = {f"{part}props": line for part in ("box", "whisker", "cap")}
    looks |= {"medianprops": line | {"linewidth": 2.2}, "flierprops": flier}
    axes.boxplot([values], positions=[place], widths=[width], manage_ticks=False, **looks)
