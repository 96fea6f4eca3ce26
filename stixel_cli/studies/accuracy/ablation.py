"""What each term of the tracker `contour` gains."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.studies.data import StudyRun, chosen, names, run_frame
from stixel_cli.studies.runs import metric_over_seeds, paired_difference
from stixel_cli.studies.tables import interval_columns, with_unit
from stixel_cli.studies.types import Table

if TYPE_CHECKING:
    import pandas as pd

TERMS = {
    "Student weights": ("degrees_of_freedom",),
    "silhouettes": ("silhouette_factor",),
    "seen shape": ("seen_by",),
    "heading tied to the velocity": ("slip",),
    "size as a state": ("length_std", "width_std"),
    "factor on the noise": ("noise_factor",),
    "iteration": ("iterations",),
}
"""The keys of `tracker` that switch each term off."""

WHOLE = "–"
"""The name of the variant with all terms."""

MEASURES = ("iou_mean", "iou_hull_mean", "iou_box_mean", "centre_rmse_m")
"""Metrics with a gain."""

STATED = ("nees_position_mean", "band_coverage", "track_lost")
"""Metrics without one."""


def ablation_table(runs: Sequence[StudyRun]) -> Table:
    """One row for each road user and variant of the tracker; the first variant has all terms."""
    frame = run_frame(runs).assign(term=[_term(run, runs[0]) for run in runs])
    rows = []
    for user in names(frame, "road_user"):
        own = chosen(frame, road_user=user)
        whole = chosen(own, term=WHOLE)
        rows += [_row(user, term, whole, chosen(own, term=term)) for term in names(own, "term")]
    columns: list = ["road user", "without", "n"]
    for name in MEASURES:
        label = with_unit(metric(over_runs(name)))
        columns += interval_columns(label, label)
        columns += interval_columns(f"gain, {label}", f"gain, {label}")
    for name in STATED:
        label = with_unit(metric(over_runs(name)))
        columns += interval_columns(label, label)
    return Table("ablation", "", tuple(columns), tuple(rows))


def _term(run: StudyRun, first: StudyRun) -> str:
    """The term that a run leaves out, by the keys in which it differs from the first run."""
    changed = {
        key.removeprefix("tracker.")
        for key, value in run.setting.items()
        if key.startswith("tracker.") and value != first.setting[key]
    }
    if not changed:
        return WHOLE
    known = {frozenset(keys): term for term, keys in TERMS.items()}
    return known.get(frozenset(changed), ", ".join(sorted(changed)))


def _row(user: str, term: str, whole: "pd.DataFrame", own: "pd.DataFrame") -> tuple:
    cells: list = [user, term, own["seed"].nunique()]
    for name in MEASURES:
        found = metric_over_seeds(own, name)
        cells += [found.mean, found.low, found.high]
        if term == WHOLE:
            cells += [None] * 3
        else:
            gain = paired_difference(whole, own, name)
            cells += [gain.mean, gain.low, gain.high]
    for name in STATED:
        found = metric_over_seeds(own, name)
        cells += [found.mean, found.low, found.high]
    return tuple(cells)
