"""RQ3: paired comparisons of fabricated and fitted with simulated measurements."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.statistics import (
    LEAST_DRAWN,
    SIGNIFICANT,
    Paired,
    holm,
    interval,
    least_p,
    mean_interval,
    paired,
    pairs_needed,
    weights,
)
from stixel_cli.report.tables import ends, groups, names
from stixel_cli.studies.rq3.runs import (
    FABRICATED,
    FITTED,
    PAIR,
    SIMULATED,
    TRACKER_MEASURES,
    Measure,
)

if TYPE_CHECKING:
    import pandas as pd

KINDS = (SIMULATED, FABRICATED, FITTED)


@dataclass(frozen=True)
class Closed:
    """Fraction of a gap that is closed, and its 95 % interval; see `gap_closed`."""

    mean: float | None
    low: float | None
    high: float | None


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

    def without_zero(self, sweep: str) -> bool:
        """Whether the interval of a sweep's difference from the simulated one excludes 0."""
        gap = self.apart[sweep]
        return gap.low is not None and not gap.low <= 0.0 <= gap.high


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

    values = pd.concat(
        {kind: _values(sweeps[kind], measures) for kind in KINDS}, axis=1, join="inner"
    )
    values.index.names = PAIR
    users, trackers = (names(sweeps[SIMULATED], key) for key in ("road_user", "tracker"))
    found = []
    for user in users:
        for tracker in trackers if by_tracker else trackers[:1]:
            own = values.query("road_user == @user and tracker == @tracker")
            for name, measure in measures.items():
                rows = own.xs(name, axis=1, level=1)[list(KINDS)]
                rows = rows[np.isfinite(rows).all(axis=1)]
                paths = rows.index.get_level_values("path").tolist()
                gap, rest = (
                    (rows[kind] - rows[SIMULATED]).to_numpy() for kind in (FABRICATED, FITTED)
                )
                label = tracker if by_tracker else ""
                found.append(
                    Comparison(
                        user,
                        label,
                        measure,
                        {kind: float(rows[kind].mean()) if len(rows) else None for kind in KINDS},
                        {FABRICATED: paired(gap, paths), FITTED: paired(rest, paths)},
                        {},
                        gap_closed(gap, rest, paths, f"{user} {label} {name}"),
                    )
                )
    return _corrected(found)


def _values(runs: "pd.DataFrame", measures: Mapping[str, Measure]) -> "pd.DataFrame":
    """The measures of the runs, with `PAIR` as index."""
    found = runs.set_index(PAIR)
    pairs = list(zip(found["run"], found["errors"], strict=True))
    return found[[]].assign(
        **{name: np.array([m.of(*p) for p in pairs], float) for name, m in measures.items()}
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


def gap_closed(gap: np.ndarray, rest: np.ndarray, strata: Sequence[str], name: str) -> Closed:
    """Fraction of the gap (n,) that the correction closes; `rest` (n,) is the remaining gap.

    1 - sum over the strata of |sum of the rest| / the same of the gap. The sum is over
    strata (paths), because errors of opposite sign on two paths would cancel in the overall mean.
    1: closed; 0: unchanged; below 0: wider. None if the mean gap has no 95 % interval or the
    interval contains 0. The fraction's own interval is a bootstrap's, and None if a stratum has
    fewer than `LEAST_DRAWN` pairs; `name` is the label of the random numbers.
    """
    bounds = mean_interval(gap, strata)
    if bounds is None or bounds[0] <= 0.0 <= bounds[1]:
        return Closed(None, None, None)
    columns = np.array(strata)
    of_stratum = (columns[:, None] == np.unique(columns)).astype(np.float64)

    def size(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.abs((rows * values) @ of_stratum).sum(axis=-1)

    whole = np.full((1, len(gap)), 1.0 / len(gap))
    share = 1.0 - size(whole, rest) / size(whole, gap)
    if min(map(list(strata).count, strata)) < LEAST_DRAWN:
        return Closed(float(share[0]), None, None)
    drawn = weights(strata, name)
    shares = 1.0 - size(drawn, rest) / np.maximum(size(drawn, gap), 1e-12)
    return Closed(float(share[0]), *interval(shares))


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


def noise_table(simulated: "pd.DataFrame", levels: "Mapping[str, pd.DataFrame]") -> Table:
    """The tracker's measures on fabricated scans by noise, and their differences from simulated.

    `levels` are frames of `runs_of` by the values of the noise. One row for each road user, tracker
    and level; differences are paired, with 95 % intervals as in the other tables.
    """
    return Table.of("noise_levels", _noise_rows(simulated, levels))


def _noise_rows(
    simulated: "pd.DataFrame", levels: "Mapping[str, pd.DataFrame]"
) -> Iterator[dict[str, Cell]]:
    metrics = {name: TRACKER_MEASURES[name] for name in ("centre", "orientation", "iou")}
    reference = _values(simulated, metrics).add_suffix("_")
    for level, runs in levels.items():
        pairs = _values(runs, metrics).join(reference, how="inner").reset_index()
        for (user, tracker), own in groups(pairs, ["road_user", "tracker"]):
            row: dict[str, Cell] = {"road user": user, "tracker": tracker}
            row |= {"noise": level, "n": len(own)}
            for name, measure in metrics.items():
                known = own[np.isfinite(own[name]) & np.isfinite(own[f"{name}_"])]
                apart = (known[name] - known[f"{name}_"]).to_numpy()
                row[str(measure)] = float(known[name].mean()) if len(known) else None
                label = f"{measure.label} − {SIMULATED}"
                row |= ends(label, paired(apart, known["path"].tolist()))
            yield row
