"""Packs, the tracks of one tracker on all sequences of a folder in one zip, and their scores.

`manifest.json` describes the tracker; each sequence has the arrays of a track, `NAME/ARRAY.npy`.
The scores are those of `stixel run`, a row of them for each pack.
"""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le, MaxLen, MinLen
from pydantic import Field

from stixel_cli.benchmark.sequences import Data, SequenceData, fresh_set, named, sha256, sha256_of
from stixel_cli.border.files import parse_json, read_arrays, read_json, read_text
from stixel_cli.border.origins import write_whole, written
from stixel_cli.config.messages import validated
from stixel_cli.errors import UserError
from stixel_cli.evaluation.contour_errors import star_convex_upper_bound
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.scores import Scores
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.pictures.uncertainty import normalised_chi_square_bounds
from stixel_cli.results.folder import json_text
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track, contour_directions

TRACKER, MANIFEST = "tracker.json", "manifest.json"
OPTIONAL = "contour_std"
ARRAYS = ("means", "covariances", "contours", OPTIONAL, "seconds")
MOST_CORNERS = 1000
OWN_START_SCANS = 10
"""With its own start, a tracker may use so many scans before the first that is scored."""
COVARIANCE = ("var_xx", "var_xy", "var_xh", "var_yy", "var_yh", "var_hh")

LARGEST = 1e9
"""Of the numbers of a pack: products of larger ones overflow."""

Text = Annotated[str, MaxLen(500)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Milliseconds = Annotated[float, Ge(0.0), Le(LARGEST)]
Score = Annotated[float, Ge(-LARGEST), Le(LARGEST)]


@parameters
class Tracker:
    """`tracker.json`: what the author of a tracker states, see docs/benchmark-1.0.md."""

    name: Annotated[str, MaxLen(80)]
    version: Annotated[str, MaxLen(80)]
    settings: dict[str, Any]
    code: Text
    licence: Text
    learnt_from: Text
    causal: bool
    per_class: bool
    start: Literal["given", "own"]


@parameters
class Manifest:
    """`manifest.json` of a pack; `reference_ms` is the time of `gp_ekf` on `machine`, a scan."""

    tracker: Tracker
    benchmark: Text
    machine: dict[str, Any]
    reference_ms: Milliseconds


@parameters
class FixedContour:
    """What `FIXED` rows have of a tracker: they are not of one."""

    name: Annotated[str, MaxLen(80)]
    version: Literal[""]


@parameters
class Row:
    """A row of the table: a manifest, and the scores of each of the sequences, by metric.

    `pack` is the SHA-256 of the pack, and `fresh_of` that of the one that drew the sequences.
    """

    tracker: Tracker | FixedContour
    benchmark: Sha256
    tier: Literal["scored", "rerun", "fresh", "fixed"]
    metric_version: int
    sequences: Annotated[list[Text], MinLen(1)]
    scores: dict[Text, list[Score | None]]
    machine: dict[str, Any] | None = None
    reference_ms: Milliseconds = 0.0
    pack: Sha256 | Literal[""] = ""
    fresh_of: Sha256 | Literal[""] = ""

    def check(self) -> None:
        """Raise ValueError for columns of other lengths, an IoU, or a tracker of another tier."""
        for name, column in self.scores.items():
            if len(column) != len(self.sequences):
                raise ValueError(f"scores.{name}: must have a value for each sequence")
        if not all(v is not None and 0.0 <= v <= 1.0 for v in self.scores.get("iou_mean", [None])):
            raise ValueError("scores.iou_mean: must be from 0 to 1")
        if len({*self.sequences}) < len(self.sequences):
            raise ValueError("sequences: one is given twice")
        if isinstance(self.tracker, FixedContour) != (self.tier == "fixed"):
            raise ValueError("tracker: must have a name alone if the tier is fixed, only then")


def pack(folder: Path, data: Data, machine: Mapping[str, Any], output: Path) -> dict[str, int]:
    """Write the pack of a folder of tracks; return the number of missing scans by sequence.

    It has `tracker.json` and, for each sequence, `NAME.npz` or `NAME.csv`; `machine` the last two
    entries of the manifest. UserError for the first file that is missing or wrong.
    """
    manifest = {"tracker": read_json(folder / TRACKER), "benchmark": data.id, **machine}
    validated(Manifest, manifest, folder / TRACKER)
    members, missing = {}, {}
    for name in data.names:
        file, table = folder / f"{name}.npz", folder / f"{name}.csv"
        if not file.exists() and not table.exists():
            raise UserError(f"{folder}: the sequence {name} is missing ({file.name} or .csv)")
        arrays = read_arrays(file) if file.exists() else read_csv(table)
        arrays = checked(arrays, len(data.read(name).scans), file)
        missing[name] = int(np.isnan(arrays["means"][:, 0]).sum())
        members |= {f"{name}/{key}": values for key, values in arrays.items()}
    np.savez_compressed(buffer := io.BytesIO(), **members)
    with zipfile.ZipFile(buffer, "a") as archive:
        # A ZipInfo has a constant time: equal tracks give equal packs.
        archive.writestr(zipfile.ZipInfo(MANIFEST), json_text(manifest))
    with written(output.parent):
        write_whole(output, buffer.getvalue())
    return {name: count for name, count in missing.items() if count}


def read_pack(file: Path, data: Data) -> tuple[dict[str, Any], dict[str, dict[str, np.ndarray]]]:
    """The manifest and the arrays of each sequence of a pack of unknown origin.

    UserError if it is damaged, incomplete, off the schema, or of other data.
    """
    arrays = read_arrays(file, texts := {MANIFEST: ""})
    manifest = parse_json(texts[MANIFEST], Path(f"{file}: {MANIFEST}"))
    validated(Manifest, manifest, file)
    if (other := manifest["benchmark"][:12]) != data.id[:12]:
        raise UserError(f"{file}: its tracks are of the data {other}, not of {data.id[:12]}")
    tracks: dict[str, dict[str, np.ndarray]] = {}
    for key, values in arrays.items():
        name, _, array = key.rpartition("/")
        tracks.setdefault(name, {})[array] = values
    for name in sorted({*data.names} ^ {*tracks}):
        raise UserError(f"{file}: the sequence {name[:80]} is missing, or not one of the data")
    for name, track in tracks.items():
        tracks[name] = checked(track, len(data.read(name).scans), Path(f"{file}: {name}"))
    return manifest, tracks


def first_scored(manifest: Mapping[str, Any]) -> int:
    """The first scan of each sequence that counts for the tracker of a pack."""
    return OWN_START_SCANS if manifest["tracker"]["start"] == "own" else 0


def checked(arrays: Mapping[str, np.ndarray], count: int, file: Path) -> dict[str, np.ndarray]:
    """The arrays of a track of `count` scans, in the types of a pack; UserError that names `file`.

    A scan with any number that is not finite is missing: all of its numbers become NaN.
    """
    for name in sorted(({*arrays} ^ {*ARRAYS}) - {OPTIONAL}):
        fault = "is missing" if name in ARRAYS else "is unknown"
        raise UserError(f"{file}: {name[:40]} {fault}: a track has {', '.join(ARRAYS)}")
    corners = arrays["contours"].shape[1] if arrays["contours"].ndim == 3 else 0
    if not 3 <= corners <= MOST_CORNERS:
        raise UserError(f"{file}: contours must have 3 to {MOST_CORNERS} corners (K, M, 2)")
    each = (count,) if arrays["seconds"].size > 1 else ()
    shapes = ((count, 3), (count, 3, 3), (count, corners, 2), (count, corners), each)
    found = {}
    for name, shape in zip(ARRAYS, shapes, strict=True):
        values = arrays.get(name)
        if values is not None:
            if values.shape != shape and (shape, values.size) != ((), 1):
                raise UserError(f"{file}: {name} must have shape {shape}, got {values.shape}")
            finite = values[np.isfinite(values)].astype(np.float64)
            if (np.abs(finite) > LARGEST).any():
                raise UserError(f"{file}: {name} must be at most {LARGEST:g}")
            kind = np.float32 if name in ("contours", OPTIONAL) else np.float64
            found[name] = np.array(values, kind, order="C").reshape(shape)
    if not np.all((found["seconds"] >= 0.0) & (found["seconds"] < np.inf)):
        raise UserError(f"{file}: seconds must be ≥ 0, of the whole sequence or of each scan")
    scans = [found[name] for name in found if name != "seconds"]
    missing = ~np.all([np.isfinite(v).reshape(count, -1).all(axis=1) for v in scans], axis=0)
    for values in scans:
        values[missing] = np.nan
    own = found["covariances"][~missing]
    if not (np.allclose(own, own.mT) and (np.linalg.eigvalsh(own) > 0.0).all()):
        raise UserError(f"{file}: covariances must be symmetric and positive definite")
    return found


def read_csv(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a track in a table, one row a scan; docs/benchmark-1.0.md has its columns.

    An empty cell is not a number. UserError in one line if the table is not valid.
    """
    import pandas

    try:
        table = pandas.read_csv(io.StringIO(read_text(file)), dtype=np.float64)
        corners = range(sum(name.startswith("px") for name in table))
        points = table[[f"p{axis}{i}" for i in corners for axis in "xy"]].to_numpy()
        unique = table[list(COVARIANCE)].to_numpy()[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]]
        band = {OPTIONAL: table[[f"std{i}" for i in corners]].to_numpy()} if "std0" in table else {}
        return band | {
            "means": table[["x", "y", "heading"]].to_numpy(),
            "covariances": unique.reshape(-1, 3, 3),
            "contours": points.reshape(len(table), -1, 2),
            "seconds": table["seconds"].fillna(0.0).to_numpy(),
        }
    except KeyError as fault:
        raise UserError(f"{file}: columns are missing: {str(fault)[:200]}") from None
    except ValueError as fault:
        raise UserError(f"{file}: not a table of a track: {str(fault)[:200]!r}") from None


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
    found = {name: scores.metrics[name] for name in METRICS}
    if "contour_std" not in arrays:
        found["band_coverage"] = None
    low, high = normalised_chi_square_bounds(np.array([2])).ravel()
    found[CONSISTENT] = int(low <= (scores.metrics["nees_position_mean"] or np.inf) <= high)
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
    for values in (contours, std):
        values[clockwise] = values[clockwise, ::-1]
    covariances = np.tile(np.eye(6), (count, 1, 1))
    covariances[:, :3, :3] = poses
    states = np.column_stack([means, np.zeros((count, 3))]), covariances
    # Which points it used is not known, either.
    every = [np.arange(*scans.offsets[k : k + 2]) for k in range(count)]
    return Track.of_scans(scans.times, states, (contours, std), every, np.full(count, np.nan))


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
