"""The frame of the scans, and statistics of runs and scans, that several studies share.

A frame of runs is that of `data.run_frame`.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.stats import chi2

from stixel_cli.evaluation.metric_table import METRICS, Metric, metric, over_runs
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.tables import over_seeds
from stixel_cli.studies.types import Table
from stixel_cli.sweeps.statistics import CONFIDENCE, Statistic

if TYPE_CHECKING:
    import pandas as pd

_PAIR = ["road_user", "path", "seed"]
"""Columns that are equal in the two runs of a pair."""
_RUN = [*_PAIR, "measurement", "measurement_kind", "tracker"]

SCAN_ERRORS = {
    "centre": METRICS["centre_rmse_m"],
    "orientation": METRICS["orientation_rmse_deg"],
    "iou": METRICS["iou_mean"],
    "nees": METRICS["nees_position_mean"],
    "nis": METRICS["nis_mean"],
}
"""Columns of errors in a frame of scans, with the metric that sums them up over a run."""


def quantity(metric: Metric) -> str:
    """The short label without the statistic: "centre" of "centre RMSE"."""
    return metric.short_label.removesuffix(" RMSE").removeprefix("mean ")


def of_runs(row: Metric) -> Metric:
    """The row of a metric's mean over runs."""
    return metric(over_runs(row.name))


CEILINGS = (
    "iou_star_convex_ceiling",
    "iou_heights_ceiling",
    "iou_hull_heights_ceiling",
    "iou_box_heights_ceiling",
)
"""The metrics that bound the overlaps."""


def ceilings_table(name: str, runs: "pd.DataFrame", keys: Sequence[str]) -> Table:
    """One row for each combination of `keys`: the greatest IoUs that a track could have."""
    rows = [
        (*values, *(metric_over_seeds(own, one).mean for one in CEILINGS))
        for values, own in runs.groupby(list(keys), sort=False)
    ]
    columns = (
        "IoU, best star-convex contour",
        *("IoU, gated heights", "hull's IoU, gated heights", "box's IoU, gated heights"),
    )
    return Table(name, "", (*(key.replace("_", " ") for key in keys), *columns), tuple(rows))


def scan_frame(runs: "pd.DataFrame") -> "pd.DataFrame":
    """One row for each scan of the runs.

    Columns: those of the run without its metrics; `k`; `t`, s; `centre`, m; `orientation`,
    absolute, degrees; `iou`; `nees`, position / 2; `nis`, divided by its degrees of freedom
    `nis_degrees`; `range`, m, from the sensor to the target's centre; `aspect`, degrees 0 … 180
    between the heading and the direction to the sensor (0: front visible, 180: rear visible);
    `points` of the scan, and the number of them `used` by the tracker.
    """
    import pandas as pd

    return pd.concat(_scan_frames(runs), ignore_index=True)


def _scan_frames(runs: "pd.DataFrame") -> "Iterator[pd.DataFrame]":
    import pandas as pd

    for row in runs.to_dict("records"):
        scenario, scans, track = (row["run"].load(name) for name in ("scenario", "scans", "track"))
        scores = row["run"].scores
        to_sensor = scans.sensor_poses_world[:, :2] - scenario.target_poses_world[:, :2]
        bearing = np.arctan2(to_sensor[:, 1], to_sensor[:, 0])
        aspect = np.abs(np.degrees(wrap_angle(bearing - scenario.target_poses_world[:, 2])))
        yield pd.DataFrame(
            {
                **{name: row[name] for name in _RUN},
                "k": np.arange(len(scores.times)),
                "t": scores.times,
                "centre": scores.centre_error,
                "orientation": np.abs(np.degrees(scores.orientation_error)),
                "iou": scores.iou,
                "nees": scores.nees_position,
                "nis": scores.nis,
                "nis_degrees": track.nis_degrees_of_freedom,
                "range": np.hypot(to_sensor[:, 0], to_sensor[:, 1]),
                "aspect": aspect,
                "points": np.diff(scans.offsets),
                "used": np.diff(track.used_offsets),
            }
        )


def metric_over_seeds(runs: "pd.DataFrame", name: str) -> Statistic:
    """A metric over seeds: each seed's mean over its runs; seeds with a missing value left out."""
    by_seed = runs.groupby("seed")[name].agg(lambda values: values.mean(skipna=False))
    return over_seeds(by_seed)


def paired_difference(one: "pd.DataFrame", other: "pd.DataFrame", name: str) -> Statistic:
    """A metric of `one` minus that of `other`: the mean of each seed over the pairs of runs.

    Runs are a pair if road user, path and seed are equal: then the motion is equal.
    """
    pairs = one[[*_PAIR, name]].merge(other[[*_PAIR, name]], on=_PAIR).dropna()
    difference = (pairs[f"{name}_x"] - pairs[f"{name}_y"]).groupby(pairs["seed"]).mean()
    return over_seeds(difference)


def within_bounds(scans: "pd.DataFrame") -> tuple[float | None, float | None]:
    """Share of scans at which the mean over seeds of NEES, and of NIS, is within chi-square bounds.

    Bar-Shalom, Li & Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*,
    section 5.4: the sum of n normalised squares is chi-square with n times their degrees of
    freedom. Of a consistent filter, 0.95 are within.
    """
    shares = []
    for name, freedom in (("nees", 2), ("nis", scans["nis_degrees"])):
        own = scans[["path", "k"]].assign(freedom=freedom, sum=scans[name] * freedom)
        own = own[np.isfinite(own["sum"]) & (own["freedom"] > 0)]
        total = own.groupby(["path", "k"]).sum()
        low, high = chi_square_bounds(total["freedom"].to_numpy())
        inside = (total["sum"] >= low) & (total["sum"] <= high)
        shares.append(float(inside.mean()) if len(inside) else None)
    return shares[0], shares[1]


def chi_square_bounds(degrees: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the central 95 % of chi-square, each with the shape of `degrees`."""
    edge = 0.5 * (1.0 - CONFIDENCE)
    return chi2.ppf(edge, degrees), chi2.ppf(1.0 - edge, degrees)


def contour_distances(scans: Scans, scenario: Scenario) -> np.ndarray:
    """Distance (P,) m of every scan's points from the true contour, negative inside it."""
    distances = np.empty(len(scans.points_world))
    for k in range(len(scans)):
        rows = scans.rows(k)
        if rows.start == rows.stop:
            continue
        truth = shapely.Polygon(scenario.contour_world(k))
        points = shapely.points(scans.points_world[rows])
        away = shapely.distance(truth.exterior, points)
        distances[rows] = np.where(shapely.contains(truth, points), -away, away)
    return distances
