"""What each term of the tracker `contour` gains."""

from collections.abc import Sequence
from dataclasses import replace

from stixel_cli.studies.accuracy.effects import Effects, effects_table
from stixel_cli.studies.data import StudyRun, names, run_frame
from stixel_cli.studies.types import Table

TERMS = {
    "Student weights": ("degrees_of_freedom",),
    "silhouettes": ("silhouette_factor",),
    "seen shape": ("seen_by",),
    "heading tied to the velocity": ("slip",),
    "size as a state": ("length_std", "width_std"),
    "factor on the noise": ("noise_factor",),
    "factor on the shape's error": ("shape_factor",),
    "iteration": ("iterations",),
}
"""The keys of `tracker` that switch each term off."""

WHOLE = "–"
"""The name of the variant with all terms."""

REPLACED = "class_replaced_share"

EFFECTS = Effects(
    name="ablation",
    column="term",
    heading="without",
    effect="gain",
    measures=("iou_mean", "iou_hull_mean", "iou_box_mean", "centre_rmse_m"),
    others=("nees_position_mean", "band_coverage", "track_lost", REPLACED),
)


def ablation_table(name: str, runs: Sequence[StudyRun]) -> Table:
    """One row for each road user and variant of the tracker; the first variant has all terms."""
    frame = run_frame(runs).assign(term=[_term(run, runs[0]) for run in runs])
    # A track of the prior's class has no such metric.
    frame = frame.assign(**{REPLACED: frame.get(REPLACED, 0.0)}).fillna({REPLACED: 0.0})
    references = dict.fromkeys(names(frame, "road_user"), WHOLE)
    return effects_table(replace(EFFECTS, name=name), frame, references)


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
