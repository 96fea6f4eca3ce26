"""RQ3: paired comparisons of fabricated and fitted with simulated measurements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.studies.data import names
from stixel_cli.studies.inference import (
    SIGNIFICANT,
    Closed,
    Paired,
    gap_closed,
    holm,
    least_p,
    paired,
    pairs_needed,
)
from stixel_cli.studies.rq3.runs import (
    FABRICATED,
    FITTED,
    PAIR,
    SIMULATED,
    TRACKER_MEASURES,
    Measure,
)
from stixel_cli.studies.tables import interval_columns
from stixel_cli.studies.types import Column, Table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Comparison:
    """One measure of the runs of one road user, and of one tracker if it is a tracker's measure.

    Attributes:
        road_user, tracker, measure: `tracker` is "" for measures of the points.
        means: kind of measurement to the mean over the pairs.
        apart: kind (fabricated, fitted) to its difference from simulated.
        p: kind to Holm's corrected p over the comparison's family; None without a test.
        closed: fraction of the gap that the fitted noise closes.
    """

    road_user: str
    tracker: str
    measure: Measure
    means: Mapping[str, float | None]
    apart: Mapping[str, Paired]
    p: Mapping[str, float | None]
    closed: Closed

    def differs(self, sweep: str) -> bool:
        """Whether the corrected test distinguishes a sweep from the simulated one."""
        return self.p[sweep] is not None and self.p[sweep] < SIGNIFICANT


@dataclass(frozen=True)
class Reach:
    """Limits of the tests of a family of comparisons.

    Attributes:
        pairs: largest number of pairs of runs of a comparison.
        tests: number of tests that are corrected together.
        least: smallest corrected p that a test can have.
        needed: number of pairs with which one of these tests could be significant.
    """

    pairs: int
    tests: int
    least: float
    needed: int

    @property
    def enough(self) -> bool:
        """Whether a test can be significant."""
        return self.least < SIGNIFICANT


def reach_of(found: Sequence[Comparison]) -> Reach:
    """Limits of a family's tests, from the numbers of pairs and of tests."""
    every = [one for comparison in found for one in comparison.apart.values()]
    pairs = max((one.n for one in every), default=0)
    tests = sum(one.p is not None for one in every) or len(every)
    return Reach(pairs, tests, min(1.0, tests * least_p(pairs)), pairs_needed(tests))


def compare(
    sweeps: "Mapping[str, pd.DataFrame]", measures: Mapping[str, Measure], by_tracker: bool
) -> list[Comparison]:
    """A family of comparisons: every measure of every road user (and tracker), corrected together.

    `sweeps` are frames of `runs_of`. A pair without a value in one of its three runs is left out.
    """
    import pandas as pd

    simulated = sweeps[SIMULATED]
    trackers = names(simulated, "tracker")
    kinds = (SIMULATED, FABRICATED, FITTED)
    values = pd.concat(
        {kind: _values(sweeps[kind], measures) for kind in kinds}, axis=1, join="inner"
    ).reset_index(names=PAIR)
    found = []
    for user in names(simulated, "road_user"):
        for tracker in trackers if by_tracker else trackers[:1]:
            own = values[(values["road_user"] == user) & (values["tracker"] == tracker)]
            for name, measure in measures.items():
                rows = np.array([own[kind, name] for kind in kinds])
                known = np.isfinite(rows).all(axis=0)
                paths = own["path"][known].tolist()
                label = tracker if by_tracker else ""
                found.append(_compared(user, label, name, measure, rows[:, known], paths))
    return _corrected(found)


def _values(runs: "pd.DataFrame", measures: Mapping[str, Measure]) -> "pd.DataFrame":
    """The measures of the runs, with `PAIR` as index."""
    found = runs.set_index(PAIR)
    pairs = list(zip(found["run"], found["errors"], strict=True))
    return found[[]].assign(
        **{name: np.array([m.of(*p) for p in pairs], float) for name, m in measures.items()}
    )


def _compared(
    user: str, tracker: str, name: str, measure: Measure, values: np.ndarray, paths: Sequence[str]
) -> Comparison:
    """The comparison of values (3, n) of n pairs: simulated, fabricated, fitted."""
    gap, rest = values[1] - values[0], values[2] - values[0]
    return Comparison(
        user,
        tracker,
        measure,
        {
            kind: float(row.mean()) if len(row) else None
            for kind, row in zip((SIMULATED, FABRICATED, FITTED), values, strict=True)
        },
        {FABRICATED: paired(gap, paths), FITTED: paired(rest, paths)},
        {},
        gap_closed(gap, rest, paths, f"{user} {tracker} {name}"),
    )


def _corrected(found: Sequence[Comparison]) -> list[Comparison]:
    """The comparisons with Holm's correction over all of them."""
    raw = {
        f"{i} {kind}": one.p
        for i, comparison in enumerate(found)
        for kind, one in comparison.apart.items()
        if one.p is not None
    }
    p = holm(raw)
    return [
        replace(one, p={kind: p.get(f"{i} {kind}") for kind in one.apart})
        for i, one in enumerate(found)
    ]


def difference_table(name: str, found: Sequence[Comparison]) -> Table:
    """Means, paired differences with interval, corrected p and effect size, and the gap closed."""
    with_tracker = any(one.tracker for one in found)
    columns: list[str | Column] = [
        "road user",
        *(["tracker"] if with_tracker else []),
        "measure",
        "n",
    ]
    columns += [SIMULATED, FABRICATED, FITTED]
    for sweep in (FABRICATED, FITTED):
        columns += interval_columns(f"{sweep} − simulated", sweep)
        columns += [f"{sweep}: p (Holm)", f"{sweep}: effect"]
    columns += interval_columns("gap closed", "closed")
    rows = []
    for one in found:
        unit = f" ({one.measure.unit})" if one.measure.unit else ""
        cells: list[str | int | float | None] = [one.road_user]
        cells += [one.tracker] if with_tracker else []
        cells += [one.measure.label + unit, one.apart[FABRICATED].n, *one.means.values()]
        for sweep in (FABRICATED, FITTED):
            apart = one.apart[sweep]
            cells += [apart.mean, apart.low, apart.high, one.p[sweep], apart.effect]
        cells += [one.closed.share, one.closed.low, one.closed.high]
        rows.append(tuple(cells))
    return Table(name, "", tuple(columns), tuple(rows))


def noise_table(simulated: "pd.DataFrame", levels: "Mapping[str, pd.DataFrame]") -> Table:
    """The tracker's measures on fabricated scans by noise, and their differences from simulated.

    `levels` are frames of `runs_of` by the values of the noise. One row for each road user, tracker
    and level; differences are paired, with 95 % intervals as in the other tables.
    """
    metrics = {name: TRACKER_MEASURES[name] for name in ("centre", "orientation", "iou")}
    reference = _values(simulated, metrics).add_suffix(f"_{SIMULATED}")
    rows = []
    for level, runs in levels.items():
        pairs = _values(runs, metrics).join(reference, how="inner")
        for (user, tracker), own in pairs.groupby(level=["road_user", "tracker"], sort=False):
            paths = own.index.get_level_values("path").tolist()
            cells: list[float | None] = []
            for name in metrics:
                known = np.isfinite(own[name]) & np.isfinite(own[f"{name}_{SIMULATED}"])
                values, others = own[name][known], own[f"{name}_{SIMULATED}"][known]
                kept = [path for path, one in zip(paths, known, strict=True) if one]
                apart = paired((values - others).to_numpy(), kept)
                mean = float(values.mean()) if len(values) else None
                cells += [mean, apart.mean, apart.low, apart.high]
            rows.append((user, tracker, level, len(own), *cells))
    columns: list[str | Column] = []
    for measure in metrics.values():
        label = f"{measure.label} ({measure.unit})" if measure.unit else measure.label
        columns += [label, *interval_columns(f"{measure.label} − {SIMULATED}", measure.label)]
    return Table("noise_levels", "", ("road user", "tracker", "noise", "n", *columns), tuple(rows))
