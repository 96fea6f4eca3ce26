"""The report of `stixel study motions`: answers of RQ2 and RQ3 on hand-made and on real motion.

The unit is a motion: a hand-made path (mean over its seeds) or a real track.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.evaluation.scan_errors import finite_mean
from stixel_cli.report.blocks import Cell, Figure, Material, Table
from stixel_cli.report.example_scans import first_runs, scenes
from stixel_cli.report.forest import difference_row, forest
from stixel_cli.report.intervals import combined_interval
from stixel_cli.report.run_frame import BASELINE, LIDAR, STIXELS, run_frame
from stixel_cli.report.statistics import Statistic, excludes_zero
from stixel_cli.report.tables import chosen, difference, ends, names, rows_by, with_unit
from stixel_cli.results.reader import listed
from stixel_cli.results.result import RunResult
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.motions.tracks import (
    FARTHEST,
    LEAST_FRAMES,
    MOST_OCCLUDED,
    every_track,
    some_tracks,
)
from stixel_cli.validation.point_statistics import std

__all__ = ["every_track", "report", "some_tracks"]

ERRORS = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")
LEAD = "centre_rmse_m"
"""The metric of the answer's plot."""
POINTS = {
    "range_bias": "bias of points along the ray (m)",
    "disparity_std": "standard deviation of points (px)",
    "missed": "share of the target's columns without a point",
}
"""Measures of a run's points by their column, with their labels."""

SPEED = "mean speed (m/s)"
STANDING = 0.3
"""A slower track stands, m/s."""

FABRICATED = "fabricated"
HAND, REAL = "hand-made", "real"

SAME, ALIKE = "same sign", "no difference in either"
UNCONFIRMED, NEW, REVERSED, TOO_FEW = "not confirmed", "new", "reversed", "too few motions"


LEVELS = {
    name: with_unit(METRICS[name])
    for name in (*ERRORS, "iou_box_mean", "nees_position_mean", "track_lost")
}


@dataclass(frozen=True)
class Finding:
    """One measure's difference between two kinds of run, on hand-made and on real motion.

    Attributes:
        question: RQ2 or RQ3.
        what: which runs, `one − other`.
        road_user, measure: of the difference.
        hand, real: the difference over the motions of each kind.
    """

    question: str
    what: str
    road_user: str
    measure: str
    hand: Statistic
    real: Statistic

    def __str__(self) -> str:
        return f"{self.what}, {self.road_user}: {label_of(self.measure)}"

    @property
    def change(self) -> Statistic:
        """Real minus hand-made, with its 95 % interval (Welch 1947)."""
        if self.hand.std is None or self.real.std is None:
            return Statistic()
        mean = self.real.mean - self.hand.mean
        parts = [(one.std**2 / one.n, one.n - 1) for one in (self.hand, self.real)]
        return Statistic(mean, *combined_interval(mean, parts))

    @property
    def verdict(self) -> str:
        """Whether the intervals exclude 0 on the same side, on either, or on one only."""
        if self.hand.low is None or self.real.low is None:
            return TOO_FEW
        # -1, 0 or 1.
        sides = [(one.low > 0.0) - (one.high < 0.0) for one in (self.hand, self.real)]
        if sides[0] * sides[1] < 0:
            return REVERSED
        if sides[0] == sides[1]:
            return SAME if sides[0] else ALIKE
        return UNCONFIRMED if sides[0] else NEW


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    sweeps = {name: _frame(sweep.runs) for name, sweep in data.sweeps.items()}
    hand = sweeps["hand_made"].assign(motion=sweeps["hand_made"]["path"])
    real = pd.concat([sweeps["real"], sweeps["real_simulated"]])
    paths = [run.configuration.path for run in real["run"]]
    clips = [path.sequence or Path(path.folder).name[:8] for path in paths]
    motions = [f"{clip}/{str(path.target)[:8]}" for clip, path in zip(clips, paths, strict=True)]
    real = real.assign(motion=motions)
    tracks = real.drop_duplicates("motion")
    standing = [_range_and_speed(run)[SPEED] < STANDING for run in tracks["run"]]
    found = findings(hand, real)
    kinds = {HAND: hand, REAL: real}
    levels = pd.concat([frame.assign(**{"motions": kind}) for kind, frame in kinds.items()])
    keys = ("road_user", "measurement", "tracker", "motions")
    return Material(
        {
            "answers": [
                _answer(question, [one for one in found if one.question == question])
                for question in ("RQ2", "RQ3")
            ],
            "forest": findings_forest(found),
            "scenes": scenes(first_runs(hand)),
            "counts": tracks["road_user"].value_counts(sort=False).to_dict(),
            "standing": tracks.loc[standing, "road_user"].value_counts(sort=False).to_dict(),
            "still": STANDING,
            "logs": sum(run.configuration.path.sequence is None for run in tracks["run"]),
            "simulated": chosen(real, measurement_kind=STIXELS)["motion"].nunique(),
            "paths": names(hand, "motion"),
            "seeds": sorted(names(hand, "seed")),
            "least": LEAST_FRAMES,
            "farthest": FARTHEST,
            "occluded": MOST_OCCLUDED,
            "tables": {
                "answers": findings_table(found),
                "levels": Table.of("levels", rows_by(levels, keys, LEVELS, unit="motion")),
                "cyclists": Table.of("cyclists", _case_rows(chosen(real, road_user="cyclist"))),
            },
        }
    )


def _frame(runs: Sequence[RunResult]) -> pd.DataFrame:
    """`run_frame` with the measures `POINTS`; runs on the same scans read their errors once."""
    known: dict[tuple, tuple[float | None, ...]] = {}
    keys = []
    for run in runs:
        scans = (pair for pair in run.setting.items() if not pair[0].startswith("tracker"))
        keys.append((*scans, run.seed))
        if keys[-1] not in known:
            errors = run.load("point_errors")
            covered = finite_mean(errors.covered)
            missed = None if covered is None else 1.0 - covered
            known[keys[-1]] = (finite_mean(errors.along), std(errors.disparities), missed)
    frame = run_frame(runs)
    # Each track has settings of its own, by which the names would distinguish measurements.
    frame = frame.assign(measurement=frame["measurement_kind"], tracker=frame["tracker_kind"])
    points = pd.DataFrame([known[key] for key in keys], frame.index, [*POINTS], dtype=float)
    return frame.join(points)


def _answer(question: str, found: Sequence[Finding]) -> dict[str, Any]:
    """The findings of a question by verdict, and those that differ between the motions."""
    by_verdict = {
        verdict: [str(one) for one in found if one.verdict == verdict]
        for verdict in (SAME, ALIKE, UNCONFIRMED, NEW, REVERSED, TOO_FEW)
    }
    changed = [str(one) for one in found if excludes_zero(one.change)]
    return {
        "question": question,
        "count": len(found),
        "changed": listed(changed),
        "changed_count": len(changed),
        "numbers": {verdict: len(own) for verdict, own in by_verdict.items()},
        "listed": {verdict: listed(own) for verdict, own in by_verdict.items()},
    }


def _case_rows(runs: pd.DataFrame) -> Iterator[dict[str, Cell]]:
    """One row for each real track, measurement and tracker."""
    ranges = {
        row["motion"]: _range_and_speed(row["run"])
        for row in runs.drop_duplicates("motion").to_dict("records")
    }
    for row in runs.sort_values(["motion", "measurement", "tracker"]).to_dict("records"):
        yield {
            "clip/track": row["motion"],
            **ranges[row["motion"]],
            **{key: row[key] for key in ("measurement", "tracker")},
            **{label: row[k] if np.isfinite(row[k]) else None for k, label in LEVELS.items()},
        }


def _range_and_speed(run: RunResult) -> dict[str, Cell]:
    scenario = run.load("scenario")
    away = scenario.target_poses_world[:, :2] - scenario.ego_poses_world[:, :2]
    ranges = np.hypot(*away.T)
    speeds = np.hypot(*scenario.target_rates_world[:, :2].T)
    return {
        "scans": len(ranges),
        "range from (m)": float(ranges.min()),
        "range to (m)": float(ranges.max()),
        SPEED: float(speeds.mean()),
    }


def findings(hand: pd.DataFrame, real: pd.DataFrame) -> list[Finding]:
    """All differences; where one kind of run is missing, they have no motions."""
    found = []
    extended = [kind for kind in names(hand, "tracker_kind") if kind != BASELINE]
    for user, tracker in product(names(hand, "road_user"), extended):
        for question, one, other, measures in (
            ("RQ2", (STIXELS, tracker), (LIDAR, tracker), ERRORS),
            ("RQ2", (FABRICATED, tracker), (LIDAR, tracker), ERRORS),
            ("RQ2", (STIXELS, tracker), (STIXELS, BASELINE), ERRORS[2:]),
            ("RQ2", (LIDAR, tracker), (LIDAR, BASELINE), ERRORS[2:]),
            ("RQ3", (FABRICATED, tracker), (STIXELS, tracker), (*ERRORS, *POINTS)),
        ):
            what = " − ".join(f"{kind} ({by})" for kind, by in (one, other))
            pairs = [
                [
                    chosen(frame, road_user=user, measurement_kind=kind, tracker_kind=by)
                    for kind, by in (one, other)
                ]
                for frame in (hand, real)
            ]
            for measure in measures:
                over = [difference(*p, measure, ("motion", "seed"), "motion") for p in pairs]
                found.append(Finding(question, what, user, measure, *over))
    return found


def label_of(measure: str) -> str:
    """The label of a metric or of one of `POINTS`, with its unit."""
    return POINTS[measure] if measure in POINTS else with_unit(METRICS[measure])


def findings_forest(found: Sequence[Finding]) -> Figure | None:
    """The differences in `LEAD`, on hand-made and on real motion."""
    rows = [
        difference_row(METRICS[LEAD], one.what, one.road_user, kind, apart)
        for one in found
        if one.measure == LEAD
        for kind, apart in ((HAND, one.hand), (REAL, one.real))
    ]
    return forest("answer_forest", rows, "first better", "first worse")


def findings_table(found: Sequence[Finding]) -> Table:
    """One row for each finding."""
    rows = []
    for one in found:
        row: dict[str, Cell] = {
            "question": one.question,
            "difference": one.what,
            "road user": one.road_user,
            "measure": label_of(one.measure),
        }
        for kind, own in ((HAND, one.hand), (REAL, one.real)):
            row |= {f"n, {kind}": own.n, **ends(kind, own)}
        row |= ends(f"{REAL} − {HAND}", one.change)
        rows.append({**row, "real against hand-made": one.verdict})
    return Table.of("answers", rows)
