"""Score a pack: the errors of each sequence, by the metrics of `stixel run`, as a row."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.benchmark.data import Data, SequenceData, sha256, sha256_of
from stixel_cli.benchmark.packs import Row, first_scored, read_pack
from stixel_cli.benchmark.sequences import fresh_set, named
from stixel_cli.border import write_whole, written
from stixel_cli.config.messages import validated
from stixel_cli.errors import UserError
from stixel_cli.evaluation.contour_errors import star_convex_upper_bound
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.intervals import chi_square_bounds
from stixel_cli.evaluation.scores import Scores
from stixel_cli.files import read_json
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track, contour_directions

METRIC_VERSION = 1
"""Raised by every change of a score; rows of different versions are not compared."""
METRICS = (
    *("iou_mean", "iou_box_mean", "gaussian_wasserstein_m", "centre_rmse_m", "length_error_m"),
    *("width_error_m", "orientation_rmse_deg", "seen_contour_error_m", "track_lost", "success"),
    *("precision", "time_to_loss_s", "nees_position_mean", "band_coverage"),
)
"""Of `evaluation/metric_table.py`."""
CONSISTENT, MISSING, TIME = "in_nees_band", "missing_scans", "ms_per_scan"
"""Further values of a sequence: whether its mean NEES is in the 95 % band of one scan, because the
errors of successive scans are correlated; scans without an estimate; milliseconds a scan."""
FIXED, FRESH = "fixed", "fresh"
NO_EXTENT, LEAST_ERROR = 1e-6, 1e-3
"""m: radius of the contour of a missing scan; RMSE below which a track is the truth."""


def scored_pack(file: Path, data: Data, tier: str, drawn_by: str = "") -> dict[str, Any]:
    """The row of a pack, of the tier `scored` or `rerun`; UserError if the pack is refused.

    `drawn_by` is the SHA-256 of the pack that drew the seeds of `data`: then the row is `fresh`.
    """
    sensors = {named(name).sensor for name in data.names}
    drawn = {one.name for one in fresh_set(drawn_by) if one.sensor in sensors}
    if drawn_by and drawn != {*data.names}:
        raise UserError(f"{data.folder}: its seeds are not those that this pack draws")
    manifest, tracks = read_pack(file, data)
    first = first_scored(manifest)
    scores = {name: sequence_scores(tracks[name], data.read(name), first) for name in data.names}
    for name in (name for name, one in scores.items() if one["centre_rmse_m"] < LEAST_ERROR):
        raise UserError(f"{file}: {name}: is the truth, not a track")
    own = {"tier": FRESH, "fresh_of": drawn_by} if drawn_by else {"tier": tier}
    return _row(manifest, scores) | {"pack": sha256_of(file)} | own


def _row(manifest: Mapping[str, Any], scores: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A row without its tier: scores by column, each in the order of the sequences."""
    columns = next(iter(scores.values()))
    values = {name: [one[name] for one in scores.values()] for name in columns}
    own = {"metric_version": METRIC_VERSION, "sequences": list(scores), "scores": values}
    return {**manifest, **own}


def fixed_rows(data: Data) -> Iterator[dict[str, Any]]:
    """The rows of the true box, and of the best contour that is star-convex about the centre."""
    box, star = {}, {}
    for name in data.names:
        given = data.read(name)
        box[name] = {"iou_mean": sequence_scores(true_box(given.truth), given)["iou_mean"]}
        star[name] = {"iou_mean": round(star_convex_upper_bound(given.truth), 6)}
    for name, scores in (("true box", box), ("best star-convex contour", star)):
        about = {"tracker": {"name": name, "version": ""}, "benchmark": data.id, "tier": FIXED}
        yield _row(about, scores)


def true_box(truth: Scenario) -> dict[str, np.ndarray]:
    """The arrays of a track that is the true box at the true pose."""
    return {
        "means": truth.target_poses_world,
        "covariances": np.tile(1e-6 * np.eye(3), (len(truth.times), 1, 1)),
        "contours": truth.boxes_world,
        "seconds": np.zeros(()),
    }


def sequence_scores(
    arrays: Mapping[str, np.ndarray], given: SequenceData, first: int = 0
) -> dict[str, Any]:
    """The scores of a track by name; scans before `first` do not count."""
    track, scores, missing = scored_track(arrays, given, first)
    metrics = scores.metrics
    found = {name: metrics[name] for name in METRICS}
    if "contour_std" not in arrays:
        found["band_coverage"] = None
    low, high = 0.5 * np.array(chi_square_bounds(2))
    found[CONSISTENT] = int(low <= (metrics["nees_position_mean"] or np.inf) <= high)
    found[MISSING] = int(missing[first:].sum())
    found[TIME] = 1e3 * float(arrays["seconds"].sum()) / len(track.times)
    # Six digits: rows of one pack are equal on all machines.
    return {name: None if v is None else float(f"{v:.6g}") for name, v in found.items()}


def scored_track(
    arrays: Mapping[str, np.ndarray], given: SequenceData, first: int = 0
) -> tuple[Track, Scores, np.ndarray]:
    """A track of a pack, its scores from scan `first` on, and which scans (K,) are missing.

    A missing or late scan counts as a contour of no extent at the last pose: its IoU is 0.
    """
    late = late_scans(arrays["seconds"], given.truth.times)
    means = np.where(late[:, None], np.nan, arrays["means"])
    counted = True if given.truth.scored is None else given.truth.scored
    scored = replace(given.truth, scored=(np.arange(len(given.scans)) >= first) & counted)
    track = _track({**arrays, "means": means}, given.scans)
    # A contour whose points are at its centre has no directions.
    with np.errstate(invalid="ignore"):
        return track, evaluate(track, scored, given.scans), np.isnan(means[:, 0])


def late_scans(seconds: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Whether the estimate of each scan, (K,), comes after the next scan, at `times` (K,) s.

    `seconds` are those of each scan (K,), or of all together (): then each takes as long.
    """
    taken = np.broadcast_to(seconds if seconds.ndim else seconds / len(times), times.shape)
    late, finished = np.zeros(len(times), bool), -np.inf
    for k, due in enumerate([*times[1:], 2.0 * times[-1] - times[-2]]):
        finished = max(finished, times[k]) + taken[k]
        late[k] = finished > due
    return late


def _track(arrays: Mapping[str, np.ndarray], scans: Scans) -> Track:
    """The arrays of a pack as a track; rates and NIS, which it does not have, are not scored."""
    means, poses = np.array(arrays["means"]), np.array(arrays["covariances"])
    contours = np.array(arrays["contours"], np.float64)
    std = np.array(arrays.get("contour_std", np.zeros(contours.shape[:2])), np.float64)
    count = len(means)
    _, (around,) = contour_directions(np.zeros(1), contours.shape[1])
    for k in np.flatnonzero(np.isnan(means[:, 0])):
        # Before the first estimate: where the sensor is.
        means[k] = means[k - 1] if k else scans.sensor_poses_world[0]
        poses[k] = poses[k - 1] if k else np.eye(3)
        contours[k], std[k] = means[k, :2] + NO_EXTENT * around, 0.0
    arms = contours - means[:, None, :2]
    ahead = np.roll(arms, -1, axis=1)
    clockwise = (arms[..., 0] * ahead[..., 1] - arms[..., 1] * ahead[..., 0]).sum(axis=1) < 0.0
    for values in (contours, arms, std):
        values[clockwise] = values[clockwise, ::-1]
    lengths = np.linalg.norm(arms, axis=2, keepdims=True)
    directions = np.divide(arms, lengths, out=np.zeros_like(arms), where=lengths > 0.0)
    covariances = np.tile(np.eye(6), (count, 1, 1))
    covariances[:, :3, :3] = poses
    states = np.column_stack([means, np.zeros((count, 3))]), covariances
    # Which points it used is not known, either.
    every = [np.arange(*scans.offsets[k : k + 2]) for k in range(count)]
    return Track.of_scans(
        scans.times, states, (contours, directions, std), every, np.full(count, np.nan)
    )


def write_row(row: Mapping[str, Any], folder: Path) -> Path:
    """Write a row under the hash of its content; return its file."""
    text = json.dumps(row, sort_keys=True, allow_nan=False) + "\n"
    file = folder / f"{sha256(text.encode())[:16]}.json"
    with written(folder):
        write_whole(file, text)
    return file


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """The rows of a folder with these scores; UserError in one line for an edited or wrong one."""
    files = sorted(folder.glob("*.json"))
    for file in (file for file in files if sha256_of(file)[:16] != file.stem):
        raise UserError(f"{file}: was edited: a row is named by the hash of its content")
    rows = []
    for file in files:
        row = read_json(file)
        if row.get("metric_version") == METRIC_VERSION:
            validated(Row, row, file)
            rows.append(row)
    for name in {name for row in rows for name in row["sequences"]}:
        named(name)
    return rows
