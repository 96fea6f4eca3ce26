"""The report of `stixel study motions`: answers of RQ2 and RQ3 on hand-made and on real motion.

The unit is a motion: a hand-made path (mean over its seeds) or a real track.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import t as student

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.results.text import listed
from stixel_cli.studies.data import BASELINE, StudyData, StudyRun, chosen, names, run_frame
from stixel_cli.studies.motions.tracks import (
    FARTHEST,
    LEAST_FRAMES,
    MOST_OCCLUDED,
    every_track,
    some_tracks,
)
from stixel_cli.studies.tables import interval_columns, over_seeds, with_unit
from stixel_cli.studies.types import Column, Material, Table
from stixel_cli.sweeps.statistics import CONFIDENCE, Statistic
from stixel_cli.validation.point_errors import PointErrors

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["every_track", "report", "some_tracks"]

ERRORS = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")
LEVELS = (*ERRORS, "iou_box_mean", "nees_position_mean", "track_lost")
POINTS = {
    "range_bias": "bias of points along the ray (m)",
    "disparity_std": "standard deviation of points (px)",
    "missed": "share of the target's columns without a point",
}
"""Measures of a run's points by their column, with their labels."""

STIXELS, FABRICATED, LIDAR = "simulated", "fabricated", "lidar"
HAND, REAL = "hand-made", "real"

HOLDS, ALIKE = "holds", "no difference in either"
UNCONFIRMED, NEW, REVERSED, TOO_FEW = "not confirmed", "new", "reversed", "too few motions"


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

    @property
    def change(self) -> tuple[float | None, float | None, float | None]:
        """Real minus hand-made, and the ends of its 95 % interval (Welch 1947); None if unknown."""
        if self.hand.std is None or self.real.std is None:
            return None, None, None
        sides = (self.hand, self.real)
        parts = [one.std**2 / one.n for one in sides]
        mean, variance = self.real.mean - self.hand.mean, sum(parts)
        if variance == 0.0:
            return mean, mean, mean
        freedom = variance**2 / sum(p**2 / (one.n - 1) for p, one in zip(parts, sides, strict=True))
        half = float(student.ppf(0.5 + 0.5 * CONFIDENCE, freedom)) * variance**0.5
        return mean, mean - half, mean + half

    @property
    def changed(self) -> bool:
        """Whether the interval of the change excludes 0."""
        _, low, high = self.change
        return low is not None and not low <= 0.0 <= high

    @property
    def verdict(self) -> str:
        """Whether the intervals exclude 0 on the same side, on either, or on one only."""
        if self.hand.low is None or self.real.low is None:
            return TOO_FEW
        sides = [
            (one.low > 0.0) - (one.high < 0.0)  # -1, 0 or 1
            for one in (self.hand, self.real)
        ]
        if sides[0] * sides[1] < 0:
            return REVERSED
        if sides[0] == sides[1]:
            return HOLDS if sides[0] else ALIKE
        return UNCONFIRMED if sides[0] else NEW


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    import pandas as pd

    sweeps = {name: _frame(sweep.runs) for name, sweep in data.sweeps.items()}
    hand = sweeps["hand_made"]
    hand = hand.assign(motion=hand["path"])
    real = pd.concat([sweeps["real"], sweeps["real_simulated"]])
    real = real.assign(motion=[_track_name(run) for run in real["run"]])
    found = findings(hand, real)
    return Material(
        {
            "answers": [_answer(q, [one for one in found if one.question == q])
                        for q in ("RQ2", "RQ3")],
            "counts": _counts(real),
            "simulated": real[real["measurement_kind"] == STIXELS]["motion"].nunique(),
            "paths": names(hand, "motion"),
            "seeds": sorted(names(hand, "seed")),
            "least": LEAST_FRAMES,
            "farthest": FARTHEST,
            "occluded": MOST_OCCLUDED,
            "tables": {
                "answers": _findings_table(found),
                "levels": _levels_table(hand, real),
                "cyclists": _case_table("cyclists", chosen(real, road_user="cyclist")),
            },
        }
    )  # fmt: skip


def _frame(runs: Sequence[StudyRun]) -> "pd.DataFrame":
    """`run_frame` with the measures `POINTS`; runs on the same scans read their errors once."""
    frame = run_frame(runs)
    known: dict[tuple, tuple[float, ...]] = {}
    rows = []
    for run in runs:
        scans = {key: value for key, value in run.setting.items() if not key.startswith("tracker")}
        key = (*scans.items(), run.seed)
        if key not in known:
            known[key] = point_values(run.load("point_errors"))
        rows.append(known[key])
    # Each track has settings of its own, by which the names would distinguish measurements.
    frame = frame.assign(measurement=frame["measurement_kind"], tracker=frame["tracker_kind"])
    columns = np.array(rows).reshape(-1, len(POINTS)).T
    return frame.assign(**dict(zip(POINTS, columns, strict=True)))


def point_values(errors: PointErrors) -> tuple[float, float, float]:
    """The measures `POINTS` of one run; NaN without a point or column of the target."""
    along, disparities, covered = errors.along, errors.disparities, errors.covered
    return (
        float(along.mean()) if len(along) else np.nan,
        float(disparities.std(ddof=1)) if len(disparities) > 1 else np.nan,
        float(1.0 - covered.mean()) if len(covered) else np.nan,
    )


def _track_name(run: StudyRun) -> str:
    path = run.configuration.path
    return f"{path.sequence}/{path.target}"


def findings(hand: "pd.DataFrame", real: "pd.DataFrame") -> list[Finding]:
    """All differences; where one kind of run is missing, they have no motions."""
    extended = [kind for kind in names(hand, "tracker_kind") if kind != BASELINE]
    found = []
    for user in names(hand, "road_user"):
        frames = [chosen(frame, road_user=user) for frame in (hand, real)]
        for tracker in extended:
            for question, one, other, measures in (
                ("RQ2", (STIXELS, tracker), (LIDAR, tracker), ERRORS),
                ("RQ2", (FABRICATED, tracker), (LIDAR, tracker), ERRORS),
                ("RQ2", (STIXELS, tracker), (STIXELS, BASELINE), ERRORS[2:]),
                ("RQ2", (LIDAR, tracker), (LIDAR, BASELINE), ERRORS[2:]),
                ("RQ3", (FABRICATED, tracker), (STIXELS, tracker), (*ERRORS, *POINTS)),
            ):
                what = " − ".join(_named(*side) for side in (one, other))
                for measure in measures:
                    sides = [_difference(frame, one, other, measure) for frame in frames]
                    found.append(Finding(question, what, user, measure, *sides))
    return found


def _named(measurement: str, tracker: str) -> str:
    return f"{'stixels' if measurement == STIXELS else measurement} ({tracker})"


def _difference(
    frame: "pd.DataFrame", one: tuple[str, str], other: tuple[str, str], measure: str
) -> Statistic:
    """A measure of `one` minus that of `other` (measurement, tracker), over the motions."""
    values = []
    for measurement, tracker in (one, other):
        side = chosen(frame, measurement_kind=measurement, tracker_kind=tracker)
        values.append(side.set_index(["motion", "seed"])[measure])
    pairs = (values[0] - values[1]).dropna()
    return over_seeds(pairs.groupby("motion").mean().tolist())


def _answer(question: str, found: Sequence[Finding]) -> dict[str, Any]:
    """The findings of a question by verdict, and those that differ between the motions."""
    by_verdict = {
        verdict: [one for one in found if one.verdict == verdict]
        for verdict in (HOLDS, ALIKE, UNCONFIRMED, NEW, REVERSED, TOO_FEW)
    }
    return {
        "question": question,
        "count": len(found),
        "changed": listed([_named_finding(one) for one in found if one.changed]),
        "changed_count": sum(one.changed for one in found),
        "numbers": {verdict: len(own) for verdict, own in by_verdict.items()},
        "listed": {
            verdict: listed([_named_finding(one) for one in own])
            for verdict, own in by_verdict.items()
        },
    }


def _named_finding(one: Finding) -> str:
    return f"{one.what}, {one.road_user}: {_label(one.measure)}"


def _label(measure: str) -> str:
    return POINTS[measure] if measure in POINTS else with_unit(METRICS[measure])


def _counts(real: "pd.DataFrame") -> dict[str, int]:
    """Number of real tracks of each class."""
    tracks = real.drop_duplicates("motion")
    return {user: int((tracks["road_user"] == user).sum()) for user in names(tracks, "road_user")}


def _findings_table(found: Sequence[Finding]) -> Table:
    columns: tuple[str | Column, ...] = ("question", "difference", "road user", "measure")
    for kind in (HAND, REAL):
        columns += (f"n, {kind}", *interval_columns(kind, kind))
    columns += interval_columns(f"{REAL} − {HAND}", "change")
    rows = [
        (
            *(one.question, one.what, one.road_user, _label(one.measure)),
            *(one.hand.n, one.hand.mean, one.hand.low, one.hand.high),
            *(one.real.n, one.real.mean, one.real.low, one.real.high),
            *one.change,
            one.verdict,
        )
        for one in found
    ]
    return Table("answers", "", (*columns, "real against hand-made"), tuple(rows))


def _levels_table(hand: "pd.DataFrame", real: "pd.DataFrame") -> Table:
    keys = ["road_user", "measurement", "tracker"]
    rows = []
    for kind, frame in ((HAND, hand), (REAL, real)):
        for values, own in frame.groupby(keys, sort=False):
            cells = []
            for name in LEVELS:
                one = over_seeds(own.groupby("motion")[name].mean().tolist())
                cells += [one.mean, one.low, one.high]
            rows.append((*values, kind, own["motion"].nunique(), *cells))
    measured = [
        column
        for name in LEVELS
        for column in interval_columns(with_unit(METRICS[name]), METRICS[name].short_label)
    ]
    columns = (*(key.replace("_", " ") for key in keys), "motion", "n", *measured)
    return Table("levels", "", columns, tuple(rows))


def _case_table(name: str, runs: "pd.DataFrame") -> Table:
    """One row for each real track, measurement and tracker."""
    ranges = {
        row["motion"]: _range_and_speed(row["run"])
        for row in runs.drop_duplicates("motion").to_dict("records")
    }
    rows = [
        (
            row["motion"],
            *ranges[row["motion"]],
            *(row["measurement"], row["tracker"]),
            *(row[metric] if np.isfinite(row[metric]) else None for metric in LEVELS),
        )
        for row in runs.sort_values(["motion", "measurement", "tracker"]).to_dict("records")
    ]
    ranges_and_speed = ("range from (m)", "range to (m)", "mean speed (m/s)")
    measured = (with_unit(METRICS[one]) for one in LEVELS)
    columns = ("clip/track", "scans", *ranges_and_speed, "measurement", "tracker", *measured)
    return Table(name, "", columns, tuple(rows))


def _range_and_speed(run: StudyRun) -> tuple[int, float, float, float]:
    scenario = run.load("scenario")
    away = scenario.target_poses_world[:, :2] - scenario.ego_poses_world[:, :2]
    ranges = np.hypot(*away.T)
    speeds = np.hypot(*scenario.target_rates_world[:, :2].T)
    return len(ranges), float(ranges.min()), float(ranges.max()), float(speeds.mean())
