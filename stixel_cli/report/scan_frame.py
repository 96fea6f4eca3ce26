"""The frame of the scans, statistics and pictures of runs and scans, that several studies share.

A frame of runs is that of `run_frame.run_frame`.
"""

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.pictures import style
from stixel_cli.report import tables
from stixel_cli.report.blocks import Cell, Figure, Picture, Table
from stixel_cli.report.charts import DASHES, Panel, chart
from stixel_cli.report.charts import over_time as draw_over_time
from stixel_cli.report.intervals import chi_square_bounds
from stixel_cli.report.statistics import statistic
from stixel_cli.results.result import RunResult
from stixel_cli.validation.point_statistics import contour_distances

NEAR = 2.0
"""Points within this distance of the true contour, m, are taken for the target's."""

SCAN_ERRORS = {
    "centre": METRICS["centre_rmse_m"],
    "orientation": METRICS["orientation_rmse_deg"],
    "iou": METRICS["iou_mean"],
    "nees": METRICS["nees_position_mean"],
    "nis": METRICS["nis_mean"],
}
"""Columns of errors in a frame of scans, with the metric that sums them up over a run."""
ERROR_LABELS = {name: tables.plain_label(metric) for name, metric in SCAN_ERRORS.items()}
AXIS_LABELS = {name: tables.axis_label(metric) for name, metric in SCAN_ERRORS.items()}
UPPER_BOUNDS = {
    "iou_star_convex_upper_bound": "IoU, best star-convex contour",
    "iou_heights_upper_bound": "IoU, gated heights",
    "iou_hull_heights_upper_bound": "hull's IoU, gated heights",
    "iou_box_heights_upper_bound": "box's IoU, gated heights",
}
"""The metrics that bound the overlaps, with their labels."""


def upper_bounds_table(name: str, runs: pd.DataFrame, keys: Sequence[str]) -> Table:
    """One row for each combination of `keys`: the greatest IoUs that a track could have."""
    return Table.of(name, tables.rows_by(runs, keys, UPPER_BOUNDS, tables.mean_cell))


def scan_frame(runs: pd.DataFrame) -> pd.DataFrame:
    """One row for each scan of the runs.

    Columns: those of the run without its metrics; `k`; `t`, s; `centre`, m; `orientation`,
    absolute, degrees; `iou`; `nees`, position / 2; `nis`, divided by its degrees of freedom
    `nis_degrees`; `range`, m, from the sensor to the target's centre; `aspect`, degrees 0 … 180
    between the heading and the direction to the sensor (0: front visible, 180: rear visible);
    `points` of the scan, and the number of them `used` by the tracker.
    """
    return pd.concat(map(_scans_of_run, runs.to_dict("records")), ignore_index=True)


def _scans_of_run(row: Mapping[str, Any]) -> pd.DataFrame:
    scenario, scans, track = (row["run"].load(name) for name in ("scenario", "scans", "track"))
    scores = row["run"].scores
    to_sensor = scans.sensor_poses_world[:, :2] - scenario.target_poses_world[:, :2]
    bearing = np.arctan2(to_sensor[:, 1], to_sensor[:, 0])
    keys = ("road_user", "path", "seed", "measurement", "measurement_kind", "tracker")
    return pd.DataFrame(
        {
            **{name: row[name] for name in keys},
            "k": np.arange(len(scores.times)),
            "t": scores.times,
            "centre": scores.centre_error,
            "orientation": np.abs(np.degrees(scores.orientation_error)),
            "iou": scores.iou,
            "nees": scores.nees_position,
            "nis": scores.nis,
            "nis_degrees": track.nis_degrees_of_freedom,
            "range": np.hypot(to_sensor[:, 0], to_sensor[:, 1]),
            "aspect": np.abs(np.degrees(wrap_angle(bearing - scenario.target_poses_world[:, 2]))),
            "points": np.diff(scans.offsets),
            "used": np.diff(track.used_offsets),
        }
    )


def within_bounds(scans: pd.DataFrame) -> tuple[float | None, float | None]:
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


def near_points(run: RunResult) -> tuple[np.ndarray, np.ndarray]:
    """Number of points of each scan (K,) near the true contour, and their distances, m."""
    scans = run.load("scans")
    distances = contour_distances(scans, run.load("scenario"))
    near = distances < NEAR
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return np.bincount(k[near], minlength=len(scans)), distances[near]


def gate_shares(runs: Iterable[RunResult]) -> tuple[float | None, float | None]:
    """Share of the target's points that a tracker did not use, and of others in those it used."""
    near = used = both = 0
    for run in runs:
        is_near = contour_distances(run.load("scans"), run.load("scenario")) < NEAR
        used_points = run.load("track").used_points
        near += np.count_nonzero(is_near)
        used += len(used_points)
        both += np.count_nonzero(is_near[used_points])
    return ((near - both) / near if near else None), ((used - both) / used if used else None)


def scan_rows(runs: pd.DataFrame, keys: Sequence[str]) -> Iterator[dict[str, Cell]]:
    """Points of the scans and their distances from the true contour, by `keys`."""
    for values, own in tables.groups(runs, keys):
        near = [near_points(run) for run in own["run"]]
        counts, away = [n for n, _ in near], [d for _, d in near if len(d)]
        empty = statistic("", [(n == 0).mean() for n in counts])
        mean = statistic("", [d.mean() for d in away])
        rms = statistic("", [np.sqrt(np.mean(np.square(d))) for d in away])
        yield {
            **dict(zip(keys, values, strict=True)),
            **tables.spread("points on the target", statistic("", [n.mean() for n in counts])),
            "share of scans without points on the target": empty.mean,
            **tables.spread("mean distance from the contour (m)", mean),
            **tables.spread("RMS distance (m)", rms),
        }


def colour(measurement: str, measurements: Sequence[str]) -> str:
    """Colour of a measurement, the same in every figure."""
    return style.RUNS[measurements.index(measurement) % len(style.RUNS)]


def over_time(name: str, scans: pd.DataFrame, measurements: Sequence[str]) -> dict[str, Figure]:
    """Errors over time on one path: one plot for each error, one colour for each measurement.

    The first tracker has solid lines and bands, each further one its own dashes and no band.
    """
    trackers = tables.names(scans, "tracker")

    def plot(error: str) -> Figure:
        ratio = SCAN_ERRORS[error].better == "one"
        limits = (0.0, 1.0) if error == "iou" else (None, None)

        def draw(axes) -> None:
            for (measurement, tracker), own in tables.groups(scans, ["measurement", "tracker"]):
                first = tracker == trackers[0]
                draw_over_time(
                    axes,
                    own["t"].unique(),
                    own.pivot(index="seed", columns="k", values=error).to_numpy(),
                    ratio,
                    limits if error == "iou" else (0.0, None),
                    band=first,
                    color=colour(measurement, measurements),
                    label=measurement if first else "",
                    linestyle=DASHES[trackers.index(tracker) % len(DASHES)],
                    linewidth=1.4 if first else 1.0,
                )
            for dash, tracker in zip(DASHES, trackers if trackers[1:] else (), strict=False):
                axes.plot([], [], dash, color=style.UNUSED, label=tracker)
            if error == "nees":
                count = 2 * len(tables.names(scans, "seed"))
                low, high = (float(bound) / count for bound in chi_square_bounds(count))
                axes.axhspan(low, high, color=style.CONSISTENT, zorder=0)

        panel = Panel(draw, x="t (s)", y=AXIS_LABELS[error], ratio=ratio, limits=limits)
        return chart(f"{name}_{error}", [panel], row=2.7)

    return {error: plot(error) for error in SCAN_ERRORS}


def stage_pictures(name: str, run: RunResult) -> list[tuple[int, Picture]]:
    """Frame and picture of all panels, of every frame that the stage `camera_pictures` drew."""
    drawn = {path: png for one in run.load("camera_pictures") for path, png in one.files.items()}
    found = []
    for path, png in drawn.items():
        folder, _, file = path.partition("/")
        if file == "camera.png":
            frame, buffer = int(folder[1:]), io.BytesIO()
            Image.open(io.BytesIO(png)).save(buffer, "WEBP", quality=72, method=4)
            picture = Picture(f"{name}_{frame:04d}", "", buffer.getvalue(), "image/webp")
            found.append((frame, picture))
    return sorted(found, key=lambda pair: pair[0])
