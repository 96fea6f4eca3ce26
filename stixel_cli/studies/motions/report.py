"""The report of `stixel study motions`: answers of RQ2 and RQ3 on hand-made and on real motion.

The unit is a motion: a hand-made path (mean over its seeds) or a real track.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report.blocks import Cell, Material, Table
from stixel_cli.report.tables import chosen, names, rows_by, with_unit
from stixel_cli.results.reader import listed
from stixel_cli.studies.data import STIXELS, StudyData, StudyRun, run_frame
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
)
from stixel_cli.studies.motions.tracks import (
    FARTHEST,
    LEAST_FRAMES,
    MOST_OCCLUDED,
    every_track,
    some_tracks,
)
from stixel_cli.validation.point_errors import PointErrors

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["every_track", "report", "some_tracks"]

LEVELS = {
    name: with_unit(METRICS[name])
    for name in (*ERRORS, "iou_box_mean", "nees_position_mean", "track_lost")
}


def report(data: StudyData) -> Material:
    """Values and tables of the template."""
    import pandas as pd

    sweeps = {name: _frame(sweep.runs) for name, sweep in data.sweeps.items()}
    hand = sweeps["hand_made"].assign(motion=sweeps["hand_made"]["path"])
    real = pd.concat([sweeps["real"], sweeps["real_simulated"]])
    paths = [run.configuration.path for run in real["run"]]
    real = real.assign(motion=[f"{path.sequence}/{path.target}" for path in paths])
    tracks = real.drop_duplicates("motion")
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
            "counts": tracks["road_user"].value_counts(sort=False).to_dict(),
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


def _frame(runs: Sequence[StudyRun]) -> "pd.DataFrame":
    """`run_frame` with the measures `POINTS`; runs on the same scans read their errors once."""
    known: dict[tuple, tuple[float, ...]] = {}
    rows = []
    for run in runs:
        scans = {key: value for key, value in run.setting.items() if not key.startswith("tracker")}
        key = (*scans.items(), run.seed)
        if key not in known:
            known[key] = point_values(run.load("point_errors"))
        rows.append(known[key])
    frame = run_frame(runs)
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


def _answer(question: str, found: Sequence[Finding]) -> dict[str, Any]:
    """The findings of a question by verdict, and those that differ between the motions."""
    by_verdict = {
        verdict: [str(one) for one in found if one.verdict == verdict]
        for verdict in (SAME, ALIKE, UNCONFIRMED, NEW, REVERSED, TOO_FEW)
    }
    return {
        "question": question,
        "count": len(found),
        "changed": listed([str(one) for one in found if one.changed]),
        "changed_count": sum(one.changed for one in found),
        "numbers": {verdict: len(own) for verdict, own in by_verdict.items()},
        "listed": {verdict: listed(own) for verdict, own in by_verdict.items()},
    }


def _case_rows(runs: "pd.DataFrame") -> Iterator[dict[str, Cell]]:
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
            **{
                label: row[name] if np.isfinite(row[name]) else None
                for name, label in LEVELS.items()
            },
        }


def _range_and_speed(run: StudyRun) -> dict[str, Cell]:
    scenario = run.load("scenario")
    away = scenario.target_poses_world[:, :2] - scenario.ego_poses_world[:, :2]
    ranges = np.hypot(*away.T)
    speeds = np.hypot(*scenario.target_rates_world[:, :2].T)
    return {
        "scans": len(ranges),
        "range from (m)": float(ranges.min()),
        "range to (m)": float(ranges.max()),
        "mean speed (m/s)": float(speeds.mean()),
    }
