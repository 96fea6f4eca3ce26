"""RQ3: the measures of a track, and paired comparisons with simulated measurements."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pandas as pd

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report import statistics
from stixel_cli.report.blocks import Cell, Figure, Table
from stixel_cli.report.forest import Row, forest
from stixel_cli.report.intervals import bootstrap_interval, bootstrap_weights
from stixel_cli.report.metrics import MINUS
from stixel_cli.report.tables import ends, groups

SIMULATED, FABRICATED, FITTED = "simulated", "fabricated", "fitted"

SCAN = ["road_user", "path", "seed"]
"""Columns that determine the scans of a sweep."""
PAIR = [*SCAN, "tracker"]
"""Columns that are equal in runs that are compared."""


@dataclass(frozen=True)
class Measure:
    """A number of a run: its name, and its unit, "" if it has none."""

    label: str
    unit: str

    def __str__(self) -> str:
        return f"{self.label} ({self.unit})" if self.unit else self.label


_METRICS = {
    "centre": "centre_rmse_m",
    "orientation": "orientation_rmse_deg",
    "iou": "iou_mean",
    "iou_hull": "iou_hull_mean",
    "iou_box": "iou_box_mean",
    "nees": "nees_position_mean",
    "nis": "nis_mean",
}
DECADES = "log10 of "
"""Begin of the labels of metrics that are compared as log10."""
TRACKER_MEASURES = {
    name: Measure(
        (DECADES if METRICS[metric].better == "one" else "") + METRICS[metric].short_label,
        METRICS[metric].unit,
    )
    for name, metric in _METRICS.items()
}

KINDS = (SIMULATED, FABRICATED, FITTED)
_MORE_IS_BETTER = {row.short_label for row in METRICS.values() if row.better == "more"}


@dataclass(frozen=True)
class Comparison:
    """One measure of the runs of one road user, and of one tracker if it is a tracker's measure.

    Attributes:
        road_user, tracker, measure: `tracker` is "" for measures of the points.
        means: kind of measurement to the mean over the pairs.
        apart: kind (fabricated, fitted) to its difference from simulated.
        p: kind to Holm's corrected p over the comparison's family; None without a test.
        closed: fraction of the gap that the fitted noise closes, see `gap_closed`.
    """

    road_user: str
    tracker: str
    measure: Measure
    means: Mapping[str, float | None]
    apart: Mapping[str, statistics.Paired]
    p: Mapping[str, float | None]
    closed: statistics.Statistic

    def differs(self, sweep: str) -> bool:
        """Whether the corrected test distinguishes a sweep from the simulated one."""
        return self.p[sweep] is not None and self.p[sweep] < statistics.SIGNIFICANT


@dataclass(frozen=True)
class Reach:
    """Limits of the tests of a family of comparisons.

    The largest number of pairs of runs of a comparison, the number of tests that are corrected
    together, the smallest corrected p that a test can have, and the number of pairs that one of
    these tests would need to be significant.
    """

    pairs: int
    tests: int
    least: float
    needed: int

    @property
    def enough(self) -> bool:
        """Whether a test can be significant."""
        return self.least < statistics.SIGNIFICANT


def reach_of(found: Sequence[Comparison]) -> Reach:
    """Limits of a family's tests, from the numbers of pairs and of tests."""
    every = [one for comparison in found for one in comparison.apart.values()]
    pairs = max((one.n for one in every), default=0)
    tests = sum(one.p is not None for one in every) or len(every)
    return Reach(
        pairs, tests, min(1.0, tests * statistics.least_p(pairs)), statistics.pairs_needed(tests)
    )


def tracker_values(runs: pd.DataFrame) -> pd.DataFrame:
    """`TRACKER_MEASURES` of the runs, with `PAIR` as index."""
    columns = [*_METRICS.values()]
    values = runs.set_index(PAIR).reindex(columns=columns).set_axis([*_METRICS], axis=1)
    values = values.replace([np.inf, -np.inf], np.nan)
    for name, measure in TRACKER_MEASURES.items():
        if measure.label.startswith(DECADES):
            values[name] = np.log10(values[name].where(values[name] > 0.0))
    return values


def compare(
    sweeps: Mapping[str, pd.DataFrame], measures: Mapping[str, Measure]
) -> list[Comparison]:
    """A family of comparisons: every measure of every road user and tracker, corrected together.

    `sweeps` have the columns `measures`, and `PAIR` as index. A pair without a value in one of its
    three runs is left out.
    """
    pairs = pd.concat({kind: sweeps[kind] for kind in KINDS}, axis=1, join="inner")
    pairs.index.names = PAIR
    users, trackers = (sweeps[SIMULATED].index.unique(key) for key in ("road_user", "tracker"))
    found = []
    for user, tracker in product(users, trackers):
        own = pairs.query("road_user == @user and tracker == @tracker")
        for name, measure in measures.items():
            rows = own.xs(name, axis=1, level=1)[list(KINDS)].dropna()
            paths = rows.index.get_level_values("path").tolist()
            gap, rest = ((rows[kind] - rows[SIMULATED]).to_numpy() for kind in (FABRICATED, FITTED))
            means = {kind: float(rows[kind].mean()) if len(rows) else None for kind in KINDS}
            apart = {
                FABRICATED: statistics.paired(gap, paths),
                FITTED: statistics.paired(rest, paths),
            }
            closed = gap_closed(gap, rest, paths, f"{user} {tracker} {name}")
            found.append(Comparison(user, tracker, measure, means, apart, {}, closed))
    return _corrected(found)


def _corrected(found: Sequence[Comparison]) -> list[Comparison]:
    """The comparisons with Holm's correction over all of them."""
    every = enumerate(found)
    p = statistics.holm({(i, kind): d.p for i, one in every for kind, d in one.apart.items()})
    return [
        replace(one, p={kind: p.get((i, kind)) for kind in one.apart})
        for i, one in enumerate(found)
    ]


def gap_closed(
    gap: np.ndarray, rest: np.ndarray, strata: Sequence[str], name: str
) -> statistics.Statistic:
    """Fraction of the gap (n,) that the correction closes; `rest` (n,) is the remaining gap.

    1 - sum over the strata of |sum of the rest| / the same of the gap. The sum is over
    strata (paths), because errors of opposite sign on two paths would cancel in the overall mean.
    1: closed; 0: unchanged; below 0: wider. None if the mean gap has no 95 % interval or the
    interval contains 0. The fraction's own interval is a bootstrap's, and None if a stratum has
    fewer than `LEAST_DRAWN` pairs; `name` is the label of the random numbers.
    """
    if not statistics.excludes_zero(statistics.paired(gap, strata)):
        return statistics.Statistic()
    columns = np.array(strata)
    of_stratum = (columns[:, None] == np.unique(columns)).astype(np.float64)

    def size(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.abs((rows * values) @ of_stratum).sum(axis=-1)

    whole = np.full((1, len(gap)), 1.0 / len(gap))
    share = 1.0 - size(whole, rest) / size(whole, gap)
    if min(map(list(strata).count, strata)) < statistics.LEAST_DRAWN:
        return statistics.Statistic(float(share[0]))
    drawn = bootstrap_weights(strata, name)
    shares = 1.0 - size(drawn, rest) / np.maximum(size(drawn, gap), 1e-12)
    return statistics.Statistic(float(share[0]), *bootstrap_interval(shares))


def difference_table(name: str, found: Sequence[Comparison]) -> Table:
    """Means, paired differences with interval, corrected p and effect size, and the gap closed."""
    rows = []
    for one in found:
        row: dict[str, Cell] = {"road user": one.road_user}
        row |= {"tracker": one.tracker} if one.tracker else {}
        row |= {"measure": str(one.measure), "n": one.apart[FABRICATED].n, **one.means}
        for sweep, apart in one.apart.items():
            row |= ends(f"{sweep} − simulated", apart)
            row |= {f"{sweep}: p (Holm)": one.p[sweep], f"{sweep}: effect": apart.effect}
        rows.append(row | ends("gap closed", one.closed))
    return Table.of(name, rows)


def comparisons_forest(
    name: str, tracks: Sequence[Comparison], sweeps: Sequence[str]
) -> Figure | None:
    """Differences of the trackers' metrics from simulated, a panel for each metric."""
    several = len(sweeps) > 1
    sides = f"{MINUS} {SIMULATED}" if several else f"{sweeps[0]} {MINUS} {SIMULATED}"
    labels = [one.measure.label for one in tracks]
    rows = [
        Row(
            f"{one.road_user}, {one.tracker}" if several else one.road_user,
            sweep if several else one.tracker,
            f"{one.measure.label}, {sides}",
            one.measure.unit,
            one.apart[sweep],
            one.p[sweep] is not None,
            one.differs(sweep),
            one.measure.label in _MORE_IS_BETTER,
        )
        for one in sorted(tracks, key=lambda one: labels.index(one.measure.label))
        for sweep in sweeps
    ]
    better, worse = ("", "") if several else (f"{FABRICATED} better", f"{FABRICATED} worse")
    return forest(name, rows, better, worse)


def noise_rows(
    simulated: pd.DataFrame, levels: Mapping[str, pd.DataFrame]
) -> Iterator[dict[str, Cell]]:
    """The tracker's measures on fabricated scans by noise, and their differences from simulated.

    `levels` are frames of `tracker_values` by the values of the noise. One row for each road user,
    tracker and level; differences are paired, with 95 % intervals as in the other tables.
    """
    for level, runs in levels.items():
        pairs = runs.join(simulated.add_suffix("_"), how="inner").reset_index()
        for (user, tracker), own in groups(pairs, ["road_user", "tracker"]):
            row: dict[str, Cell] = {"road user": user, "tracker": tracker}
            row |= {"noise": level, "n": len(own)}
            for name in ("centre", "orientation", "iou"):
                measure, known = TRACKER_MEASURES[name], own.dropna(subset=[name, f"{name}_"])
                apart = (known[name] - known[f"{name}_"]).to_numpy()
                row[str(measure)] = float(known[name].mean()) if len(known) else None
                label = f"{measure.label} − {SIMULATED}"
                row |= ends(label, statistics.paired(apart, known["path"].tolist()))
            yield row
