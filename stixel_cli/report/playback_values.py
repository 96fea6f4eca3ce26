"""Values of the playback page: facts in words, rounded numbers, the tracker's noise R.

Lengths are whole millimetres and the like; None stands for what is not finite.
"""

import base64
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.evaluation.metric_table import SMOOTHED, Metric, metric
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.pictures.uncertainty import ellipse_axes, tracker_noise
from stixel_cli.report.metrics import shown_value, smoothed_label
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.result import RunResult

SUMMARY = (
    "centre_rmse_m",
    "orientation_rmse_deg",
    "iou_mean",
    "iou_box_mean",
    "low_overlap_share",
    "nees_position_mean",
    "nis_mean",
)
"""The metrics that the page shows of a whole run."""

FACTS = ("road_user", "path", "ego", "measurement", "tracker")
"""The groups whose choices the page names."""


def facts_of(run: RunResult) -> list[tuple[str, str]]:
    """(name, value) pairs that describe the run."""
    measurement, seed = run.settings["measurement"], ("seed", str(run.settings["seed"]))
    if measurement.get("kind") == "file":
        facts = [(group, run.choice(group)) for group in ("prior", "start", "tracker")]
        return [("scans", Path(measurement["path"]).name), *facts, seed]
    mesh = run.settings["road_user"].get("mesh")
    own = [] if mesh is None else [("mesh", Path(mesh).name)]
    return [*((group, run.choice(group)) for group in FACTS), *own, seed]


def origin_of(run: RunResult) -> dict[str, Any] | None:
    """What a page mailed to a colleague states of a run; None if it has no command.

    A run without a folder is about to be written into that of its page, so links begin there.
    """
    manifest, drawn = run.manifest, run.pictures.get("rig_error.png", b"")
    if "command" not in manifest:
        return None
    versions = manifest.get("versions") or {}
    made = [
        f"stixel {versions.get('stixel', 'unknown')}",
        f"revision {shown_revision(manifest.get('git') or {}) or 'unknown'}",
        str(manifest.get("created", "")),
    ]
    if "row_difference_px" in manifest:
        made.append(f"rows of the images {manifest['row_difference_px']} px apart")
    links = [["figures", "figures/"], ["metrics", "metrics.json"], ["configuration", "config.yaml"]]
    return {
        "command": str(manifest["command"]),
        "made": [one for one in made if one],
        "links": links if run.folder is None else [],
        "correction": manifest.get("correction", ""),
        "rigError": base64.b64encode(drawn).decode("ascii"),
    }


def summary_of(metrics: dict[str, float | int | None]) -> list[list[str]]:
    """[name, value with its unit, smoothed value] of the `SUMMARY`'s metrics that have a value."""
    rows, smoothed = [], smoothed_label(metrics)
    for row in (metric(name) for name in SUMMARY if metrics.get(name) is not None):
        value = _with_unit(row, metrics[row.name])
        if SMOOTHED + row.name in metrics:
            value += f" ({smoothed}: {shown_value(row.name, metrics[SMOOTHED + row.name])})"
        rows.append([row.short_label, value])
    return rows


def headline_of(run: RunResult) -> list[list[str]]:
    """[name, value, reference] of the main numbers of a run.

    The reference is that of the same scans: the IoU of the baseline, the mean of the used points
    for the centre, its direction of motion for the orientation; 1 for NEES.
    """
    metrics = run.metrics
    iou = "iou_mean" if metrics.get("iou_mean") is not None else "iou_box_mean"
    centre, orientation = _of_points(run)
    references = {
        iou: (metrics.get("iou_baseline"), "baseline"),
        "centre_rmse_m": (centre, "mean of its points"),
        "orientation_rmse_deg": (orientation, "motion of its points"),
        "nees_position_mean": (1.0, "consistent"),
    }
    rows: list[list[str]] = []
    for name, (reference, words) in references.items():
        row, value = metric(name), metrics.get(name)
        if value is None:
            continue
        beside = "" if reference is None else f"{words}: {_with_unit(row, reference)}"
        rows.append([row.short_label, _with_unit(row, value), beside])
    return rows


def _of_points(run: RunResult) -> tuple[float | None, float | None]:
    """RMSE of the mean of the used points, m, and of its direction over a second, °."""
    scans, track, truth = run.scans, run.track, run.scenario.target_poses_world
    used = [track.used_points[slice(*ends)] for ends in pairwise(track.used_offsets)]
    nothing = np.full(2, np.nan)
    means = np.array([scans.points_world[u].mean(0) if len(u) else nothing for u in used])
    half = max(1, int(np.searchsorted(track.times - track.times[0], 0.5)))
    ways = means[2 * half :] - means[: -2 * half]
    turns = wrap_angle(np.arctan2(ways[:, 1], ways[:, 0]) - truth[half:-half, 2])
    errors = (np.linalg.norm(means - truth[:, :2], axis=1), np.degrees(turns))
    squares = (error[np.isfinite(error)] ** 2 for error in errors)
    return tuple(float(np.sqrt(square.mean())) if len(square) else None for square in squares)


def _with_unit(row: Metric, value: float | int) -> str:
    return f"{shown_value(row.name, value)} {row.shown_unit}".strip().replace(" °", "°")


FARTHEST = 1e7  # m; the page omits farther points


def ellipses(covariances: np.ndarray) -> list[int | None]:
    """Semi-axes (mm) and angle (1e-3 rad) of each 1σ ellipse, in one list."""
    semi_axes, angles = ellipse_axes(covariances)
    values = 1000.0 * np.stack([*semi_axes, angles], axis=1).ravel()
    known = np.abs(values) < 1e3 * FARTHEST
    whole = np.rint(np.where(known, values, 0.0)).astype(np.int64).tolist()
    return whole if known.all() else [w if k else None for w, k in zip(whole, known, strict=True)]


def rounded_poses(poses: np.ndarray) -> list[list[int] | None]:
    """x, y (mm) and heading (1e-4 rad) of poses (K, 3 or more)."""
    return [_integers(pose[:3] * (1e3, 1e3, 1e4)) for pose in poses]


def millimetres(values: np.ndarray) -> list[int] | None:
    """Lengths in m as whole millimetres; None if one is not finite or too large."""
    return _integers(1000.0 * values)


def _integers(values: np.ndarray) -> list[int] | None:
    """The values rounded to integers; None if one is not finite or too large."""
    if not (np.abs(values) < 1e3 * FARTHEST).all():
        return None
    return np.rint(values).astype(np.int64).tolist()


def numbers(values: np.ndarray, digits: int) -> list[float | None]:
    """The values, rounded to `digits`; None for one that is not finite."""
    return [round(v, digits) if np.isfinite(v) else None for v in np.asarray(values).tolist()]


MOST_ELLIPSES = 20_000
"""With more used points than this, the page shows the scan's covariances: it must stay small."""


def noise_of(run: RunResult) -> dict[str, Any]:
    """R of the used points of a computed run, for the playback page.

    Returns `text`, a description; `std`, mm, if R is the same for all points, else None; and
    `ellipses`, for each scan the 1σ ellipses of its used points in their order, None if they are
    those of the scan.
    """
    text, covariances, std = tracker_noise(run.composition.configuration.tracker, run.scans)
    if std is not None:
        return {"text": text, "std": round(1000.0 * std), "ellipses": None}
    if run.track is None:
        return {"text": text, "std": None, "ellipses": None}
    rows, shown = run.track.used_points, None
    is_own = covariances is not run.scans.covariances_world
    if is_own and len(rows) > MOST_ELLIPSES:
        text += "; too many points to show it"
    elif is_own:
        scans = pairwise(run.track.used_offsets)
        shown = [ellipses(covariances[rows[start:stop]]) for start, stop in scans]
    return {"text": text, "std": None, "ellipses": shown}
