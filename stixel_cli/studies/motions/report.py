"""The report of `stixel study motions`: answers of RQ2 and RQ3 on hand-made and on real motion.

The unit is a motion: a hand-made path (mean over its seeds) or a real track.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.results.text import listed
from stixel_cli.studies.data import STIXELS, StudyData, StudyRun, chosen, names, run_frame
from stixel_cli.studies.motions.findings import (
    ALIKE,
    ERRORS,
    HAND,
    NEW,
    POINTS,
    REAL,
    REVERSED,
    SAME,
    TOO_FEW,
    UNCONFIRMED,
    Finding,
    findings,
    findings_forest,
    findings_table,
    label_of,
)
from stixel_cli.studies.motions.tracks import (
    FARTHEST,
    LEAST_FRAMES,
    MOST_OCCLUDED,
    every_track,
    some_tracks,
)
from stixel_cli.studies.tables import interval_columns, over_seeds, with_unit
from stixel_cli.studies.types import Material, Table
from stixel_cli.validation.point_errors import PointErrors

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["every_track", "report", "some_tracks"]

LEVELS = (*ERRORS, "iou_box_mean", "nees_position_mean", "track_lost")


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
            "forest": findings_forest(found),
            "counts": _counts(real),
            "simulated": real[real["measurement_kind"] == STIXELS]["motion"].nunique(),
            "paths": names(hand, "motion"),
            "seeds": sorted(names(hand, "seed")),
            "least": LEAST_FRAMES,
            "farthest": FARTHEST,
            "occluded": MOST_OCCLUDED,
            "tables": {
                "answers": findings_table(found),
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


def _answer(question: str, found: Sequence[Finding]) -> dict[str, Any]:
    """The findings of a question by verdict, and those that differ between the motions."""
    by_verdict = {
        verdict: [one for one in found if one.verdict == verdict]
        for verdict in (SAME, ALIKE, UNCONFIRMED, NEW, REVERSED, TOO_FEW)
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
    return f"{one.what}, {one.road_user}: {label_of(one.measure)}"


def _counts(real: "pd.DataFrame") -> dict[str, int]:
    """Number of real tracks of each class."""
    tracks = real.drop_duplicates("motion")
    return {user: int((tracks["road_user"] == user).sum()) for user in names(tracks, "road_user")}


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
