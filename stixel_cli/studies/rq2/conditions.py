"""RQ2: errors by range, by visible sides, and by number of points."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.evaluation.metric_table import Metric
from stixel_cli.studies.runs import SCAN_ERRORS, quantity
from stixel_cli.studies.tables import over_seeds, std_columns
from stixel_cli.studies.types import Table
from stixel_cli.sweeps.statistics import Statistic

if TYPE_CHECKING:
    import pandas as pd

SHOWN = {name: SCAN_ERRORS[name] for name in ("centre", "orientation", "iou")}
"""Errors whose standard deviation is shown."""


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


@dataclass(frozen=True)
class Binned:
    """Scans of one tracker, measurement and bin.

    Attributes:
        scans: number of scans.
        seeds: number of seeds with such scans.
        errors: statistics over these seeds, by column of errors.
    """

    scans: int
    seeds: int
    errors: dict[str, Statistic]


def condition_statistics(
    condition: Condition, scans: "pd.DataFrame"
) -> dict[tuple[str, str, int], Binned]:
    """Statistics by tracker, measurement and number of the bin; bins without scans left out."""
    errors = list(SCAN_ERRORS)
    scans = scans[["tracker", "measurement", "seed", *errors]].assign(
        bin=np.searchsorted(condition.edges, scans[condition.column], side="right"),
        **scans[errors].replace([np.inf, -np.inf], np.nan),
    )
    found = {}
    for (tracker, measurement, b), own in scans.groupby(
        ["tracker", "measurement", "bin"], sort=False
    ):
        means = own.groupby("seed")[errors].mean()
        statistics = {name: over_seeds(means[name]) for name in means}
        found[tracker, measurement, int(b)] = Binned(len(own), len(means), statistics)
    return found


def condition_table(name: str, condition: Condition, scans: "pd.DataFrame") -> Table:
    """The numbers of a condition, one row for each bin, tracker and measurement."""
    found = condition_statistics(condition, scans)
    rows = []
    for (tracker, measurement, b), one in sorted(found.items(), key=lambda item: item[0][2]):
        cells: list[str | float | int | None] = [condition.labels[b], tracker, measurement]
        cells += [one.scans, one.seeds]
        for error in SHOWN:
            cells += [one.errors[error].mean, one.errors[error].std]
        rows.append((*cells, one.errors["nees"].mean, one.errors["nis"].mean))
    return Table(
        name,
        "",
        (
            condition.label,
            "tracker",
            "measurement",
            "scans",
            "seeds",
            *(
                column
                for metric in SHOWN.values()
                for column in std_columns(_called(metric), quantity(metric))
            ),
            quantity(SCAN_ERRORS["nees"]),
            quantity(SCAN_ERRORS["nis"]),
        ),
        tuple(rows),
    )


def _called(metric: Metric) -> str:
    """The label without the statistic, with its unit: "centre error (m)"."""
    label = metric.label.partition(",")[0]
    return f"{label} ({metric.unit})" if metric.unit else label
