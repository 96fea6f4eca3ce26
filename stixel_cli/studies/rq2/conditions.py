"""RQ2: errors by range, by the sides that are seen, and by the number of points."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.studies.rq2.runs import Run
from stixel_cli.studies.tables import over_seeds, with_none
from stixel_cli.studies.types import Table
from stixel_cli.sweeps.statistics import Statistic


@dataclass(frozen=True)
class Condition:
    """A way to sort scans.

    Attributes:
        name: short.
        label: of an axis.
        what: in a sentence.
        value: (K,) of a run's scans.
        edges: between bins; a value on an edge is in the bin above.
        labels: of the bins, one more than edges.
    """

    name: str
    label: str
    what: str
    value: Callable[[Run], np.ndarray]
    edges: tuple[float, ...]
    labels: tuple[str, ...]


CONDITIONS = (
    Condition(
        "range",
        "range (m)",
        "the distance from the sensor to the target's centre",
        lambda run: run.ranges,
        (8.0, 12.0, 16.0, 20.0, 25.0, 30.0, 40.0),
        ("< 8", "8–12", "12–16", "16–20", "20–25", "25–30", "30–40", "≥ 40"),
    ),
    Condition(
        "aspect",
        "aspect (°)",
        "the aspect angle between the heading and the line to the sensor, which determines the "
        "visible sides: at 0° only the front, at 90° only a long side, at 180° only the rear",
        lambda run: run.aspects,
        (15.0, 45.0, 75.0, 105.0, 135.0, 165.0),
        ("0–15", "15–45", "45–75", "75–105", "105–135", "135–165", "165–180"),
    ),
    Condition(
        "points",
        "points used",
        "the number of points that the tracker used of the scan",
        lambda run: run.used.astype(float),
        (1.0, 3.0, 6.0, 11.0, 21.0, 41.0),
        ("0", "1–2", "3–5", "6–10", "11–20", "21–40", "> 40"),
    ),
)


@dataclass(frozen=True)
class Binned:
    """Scans of one tracker, measurement and bin.

    Attributes:
        scans: how many.
        seeds: how many have any of them.
        errors: statistics over these seeds, by error.
    """

    scans: int
    seeds: int
    errors: dict[str, Statistic]


def condition_statistics(
    condition: Condition, runs: Sequence[Run]
) -> dict[tuple[str, str, int], Binned]:
    """Statistics by tracker, measurement and number of the bin; bins without scans left out."""
    import pandas as pd

    scans = pd.concat(
        pd.DataFrame(
            {
                "tracker": run.tracker,
                "measurement": run.measurement,
                "seed": run.seed,
                "bin": np.searchsorted(condition.edges, condition.value(run), side="right"),
                **run.errors,
                "nees": run.nees,
                "nis": run.nis,
            }
        )
        for run in runs
    ).replace([np.inf, -np.inf], np.nan)
    found = {}
    for (tracker, measurement, b), own in scans.groupby(
        ["tracker", "measurement", "bin"], sort=False
    ):
        means = own.drop(columns=["tracker", "measurement", "bin"]).groupby("seed").mean()
        statistics = {name: over_seeds(with_none(means[name])) for name in means}
        found[tracker, measurement, int(b)] = Binned(len(own), len(means), statistics)
    return found


def condition_table(name: str, condition: Condition, runs: Sequence[Run]) -> Table:
    """The numbers of a condition, one row a bin, tracker and measurement."""
    found = condition_statistics(condition, runs)
    rows = []
    for (tracker, measurement, b), one in sorted(found.items(), key=lambda item: item[0][2]):
        cells: list[str | float | int | None] = [condition.labels[b], tracker, measurement]
        cells += [one.scans, one.seeds]
        for error in ("centre", "orientation", "iou"):
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
            "centre error (m)",
            "± centre",
            "orientation error (°)",
            "± orientation",
            "IoU",
            "± IoU",
            "NEES / 2",
            "NIS / d.o.f.",
        ),
        tuple(rows),
    )
