"""Score a pack: the errors of each sequence, by the metrics of `stixel run`, as a row."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.benchmark.data import Data, sha256
from stixel_cli.benchmark.packs import as_plain, read_pack
from stixel_cli.benchmark.run import OWN_START_SCANS, true_box
from stixel_cli.benchmark.sequences import fresh_set
from stixel_cli.errors import UserError
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.upper_bounds import find_upper_bounds
from stixel_cli.files import read_json, write_whole, written
from stixel_cli.measurements.scans import Scans
from stixel_cli.report.intervals import chi_square_bounds
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track, contour_directions, used_rows

METRIC_VERSION = 1
"""Raised by every change of a score; rows of different versions are not compared."""

METRICS = (
    *("iou_mean", "iou_box_mean", "gaussian_wasserstein_m", "centre_rmse_m"),
    *("orientation_rmse_deg", "length_error_m", "width_error_m", "seen_contour_error_m"),
    *("track_lost", "time_to_loss_s", "success", "precision", "nees_position_mean"),
    "band_coverage",
)
"""Of `evaluation/metric_table.py`."""
CONSISTENT, MISSING, TIME = "in_nees_band", "missing_scans", "ms_per_scan"
"""Further values of a sequence: whether its mean NEES is in the 95 % band of one scan, as the
errors of its scans are alike; scans without an estimate; milliseconds a scan."""
OF_BAND = ("band_coverage",)
OF_IOU = ("iou_mean", "iou_box_mean")
TIERS = ("scored", "rerun")
FIXED, FRESH = "fixed", "fresh"

NO_EXTENT = 1e-6
"""Radius of the contour of a missing scan, m."""

LEAST_ERROR = 1e-3
"""m. A track that is never farther from the truth is the truth."""


def scored_pack(file: Path, data: Data, tier: str, pack: str = "") -> dict[str, Any]:
    """The row of a pack.

    Args:
        file: the pack.
        data: the sequences of its tracks.
        tier: `scored` or `rerun`.
        pack: SHA-256 of the pack that drew the seeds of `data`: the row is `fresh`.

    Raises:
        UserError: in one line, if the pack is refused.
    """
    if pack and {one.name for one in fresh_set(pack)} != {*data.names}:
        raise UserError(f"{data.folder}: its seeds are not those that this pack draws")
    manifest, digest, tracks = read_pack(file, data)
    first = OWN_START_SCANS if manifest.tracker.start == "own" else 0
    scores = {}
    for name in data.names:
        scores[name] = sequence_scores(
            tracks[name], data.truth(name), data.given(name).scans, first
        )
        if scores[name]["centre_rmse_m"] < LEAST_ERROR:
            raise UserError(f"{file}: {name}: is the truth, not a track")
    own = {"tier": FRESH, "fresh_of": pack} if pack else {"tier": tier}
    return row_of(data, as_plain(manifest), scores) | {"pack": digest} | own


def row_of(
    data: Data, manifest: Mapping[str, Any], scores: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """A row without its tier: scores by column, each in the order of the sequences."""
    columns = dict.fromkeys(name for one in scores.values() for name in one)
    return {
        "metric_version": METRIC_VERSION,
        "benchmark": data.id,
        **{key: manifest[key] for key in ("tracker", "machine") if key in manifest},
        "sequences": list(scores),
        "scores": {name: [one.get(name) for one in scores.values()] for name in columns},
    }


def fixed_rows(data: Data) -> list[dict[str, Any]]:
    """The rows of the true box, and of the best contour that is star-convex about the centre."""
    box, star = {}, {}
    for name in data.names:
        truth = data.truth(name)
        found = sequence_scores(true_box(truth), truth, data.given(name).scans)
        box[name] = {key: found[key] for key in OF_IOU}
        bound = find_upper_bounds(truth, None, None).star_convex_upper_bound
        star[name] = {"iou_mean": _short(bound)}
    names = {"true box": box, "best star-convex contour": star}
    return [
        row_of(data, {"tracker": {"name": name, "version": ""}}, scores) | {"tier": FIXED}
        for name, scores in names.items()
    ]


def sequence_scores(
    arrays: Mapping[str, np.ndarray], truth: Scenario, scans: Scans, first: int = 0
) -> dict[str, Any]:
    """The scores of a track by name; scans before `first` do not count.

    A missing scan counts as a contour of no extent at the last pose: its IoU is 0.
    """
    k = np.arange(len(truth.times))
    scored = Scenario(**{**vars(truth), "scored": k >= first})
    metrics = evaluate(_track(arrays, scans), scored, scans).metrics
    found = {name: _short(metrics[name]) for name in METRICS}
    if "contour_std" not in arrays:
        found |= dict.fromkeys(OF_BAND)
    low, high = chi_square_bounds(2)
    nees = metrics["nees_position_mean"]
    found[CONSISTENT] = int(nees is not None and low / 2 <= nees <= high / 2)
    found[MISSING] = int(np.isnan(arrays["means"][first:, 0]).sum())
    found[TIME] = _short(1e3 * float(arrays["seconds"]) / len(k))
    return found


def _short(value: float | int | None) -> float | int | None:
    """Six digits: rows of one pack are equal on all machines."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _track(arrays: Mapping[str, np.ndarray], scans: Scans) -> Track:
    """The arrays of a pack as a track; rates and NIS, which it does not have, are not scored."""
    means, covariances = np.array(arrays["means"]), np.array(arrays["covariances"])
    contours = np.array(arrays["contours"], np.float64)
    std = np.array(arrays.get("contour_std", np.zeros(contours.shape[:2])), np.float64)
    count = len(means)
    _, (around,) = contour_directions(np.zeros(1), contours.shape[1])
    for k in np.flatnonzero(np.isnan(means[:, 0])):
        # Before the first estimate: where the sensor is.
        means[k] = means[k - 1] if k else scans.sensor_poses_world[0]
        covariances[k] = covariances[k - 1] if k else np.eye(3)
        contours[k], std[k] = means[k, :2] + NO_EXTENT * around, 0.0
    turns = np.roll(contours, -1, axis=1)
    clockwise = (contours[..., 0] * turns[..., 1] - contours[..., 1] * turns[..., 0]).sum(1) < 0.0
    contours[clockwise], std[clockwise] = contours[clockwise, ::-1], std[clockwise, ::-1]
    arms = contours - means[:, None, :2]
    lengths = np.linalg.norm(arms, axis=2, keepdims=True)
    states = np.zeros((count, 6, 6))
    states[:, :3, :3], states[:, 3:, 3:] = covariances, np.eye(3)
    offsets, used = used_rows([np.zeros(0, np.int64)] * count)
    return Track(
        times=scans.times,
        means=np.column_stack([means, np.zeros((count, 3))]),
        covariances=states,
        contours_world=contours,
        contour_directions=np.divide(arms, lengths, out=np.zeros_like(arms), where=lengths > 0.0),
        contour_std=std,
        used_offsets=offsets,
        used_points=used,
        nis=np.full(count, np.nan),
        nis_degrees_of_freedom=np.zeros(count, np.int64),
    )


def row_text(row: Mapping[str, Any]) -> str:
    """The content of the file of a row."""
    return json.dumps(row, indent=1, sort_keys=True, allow_nan=False) + "\n"


def write_row(row: Mapping[str, Any], folder: Path) -> Path:
    """Write a row under the hash of its content; return its file. None is ever replaced."""
    text = row_text(row)
    file = folder / f"{sha256(text.encode())[:16]}.json"
    with written(folder):
        if not file.exists():
            write_whole(file, text)
    return file


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """All rows of a folder; UserError in one line for one that was edited."""
    rows = []
    for file in sorted(folder.glob("*.json")):
        row = read_json(file)
        if sha256(row_text(row).encode())[:16] != file.stem:
            raise UserError(f"{file}: was edited: a row is named by the hash of its content")
        rows.append(row | {"file": file.name})
    return rows
