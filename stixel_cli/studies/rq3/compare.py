"""RQ3: paired comparisons of fabricated and fitted with simulated measurements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

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
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED, Errors, Measure, Runs, names
from stixel_cli.studies.types import Table


@dataclass(frozen=True)
class Comparison:
    """One measure of one road user's runs, by one tracker where it is the tracker's.

    Attributes:
        road_user, tracker, measure: of what; `tracker` is "" for the points' own measures.
        means: of each kind of measurement over the runs that all have a value.
        apart: fabricated, and fitted, minus simulated.
        p: of either, Holm-corrected over the comparison's family; None where there is no test.
        closed: how much of the gap the fitted noise closes.
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
    """What the tests of a family of comparisons can show at all.

    Attributes:
        pairs: of runs, of the comparison that has most.
        tests: that are corrected together.
        least: smallest corrected p that any of them can have.
        needed: pairs with which one of so many tests could be significant.
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
    """What the tests of a family can show, which follows from the numbers of pairs and of tests."""
    every = [one for comparison in found for one in comparison.apart.values()]
    pairs = max((one.n for one in every), default=0)
    tests = sum(one.p is not None for one in every) or len(every)
    return Reach(pairs, tests, min(1.0, tests * least_p(pairs)), pairs_needed(tests))


def compare(
    sweeps: Mapping[str, Runs], measures: Mapping[str, Measure], by_tracker: bool
) -> list[Comparison]:
    """A family of comparisons: every measure of every road user (and tracker), corrected together.

    A pair is left out of a measure that one of its three runs has no value of.
    """
    errors = Errors()
    simulated = sweeps[SIMULATED]
    trackers = names(simulated, "tracker")
    found = []
    for user in names(simulated, "road_user"):
        for tracker in trackers if by_tracker else trackers[:1]:
            keys = [
                key
                for key in simulated
                if key.road_user == user
                and key.tracker == tracker
                and all(key in runs for runs in sweeps.values())
            ]
            for name, measure in measures.items():
                rows = [
                    [
                        measure.of(sweeps[sweep][key], errors.of(sweep, sweeps[sweep][key]))
                        for key in keys
                    ]
                    for sweep in (SIMULATED, FABRICATED, FITTED)
                ]
                found.append(
                    _compared(user, tracker if by_tracker else "", name, measure, keys, rows)
                )
    return _corrected(found)


def _compared(user, tracker, name, measure, keys, rows) -> Comparison:
    values = np.array(rows, dtype=np.float64).reshape(3, len(keys))
    known = np.isfinite(values).all(axis=0)
    values = values[:, known]
    paths = [key.path for key, there in zip(keys, known, strict=True) if there]
    gap, rest = values[1] - values[0], values[2] - values[0]
    label = f"{user} {tracker} {name}"
    return Comparison(
        user,
        tracker,
        measure,
        {
            sweep: float(row.mean()) if len(row) else None
            for sweep, row in zip((SIMULATED, FABRICATED, FITTED), values, strict=True)
        },
        {FABRICATED: paired(gap, paths), FITTED: paired(rest, paths)},
        {},
        gap_closed(gap, rest, paths, label),
    )


def _corrected(found: Sequence[Comparison]) -> list[Comparison]:
    raw = {
        f"{i} {sweep}": one.p
        for i, comparison in enumerate(found)
        for sweep, one in comparison.apart.items()
        if one.p is not None
    }
    corrected = holm(raw)
    return [
        Comparison(
            one.road_user,
            one.tracker,
            one.measure,
            one.means,
            one.apart,
            {sweep: corrected.get(f"{i} {sweep}") for sweep in one.apart},
            one.closed,
        )
        for i, one in enumerate(found)
    ]


def difference_table(name: str, found: Sequence[Comparison]) -> Table:
    """Means, paired differences with interval, corrected p and effect size, and the gap closed."""
    with_tracker = any(one.tracker for one in found)
    columns = ["road user", *(["tracker"] if with_tracker else []), "measure", "n"]
    columns += [SIMULATED, FABRICATED, FITTED]
    for sweep in (FABRICATED, FITTED):
        columns += [f"{sweep} − simulated", f"low {sweep}", f"high {sweep}"]
        columns += [f"{sweep}: p (Holm)", f"{sweep}: effect"]
    columns += ["gap closed", "low closed", "high closed"]
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
