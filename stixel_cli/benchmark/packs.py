"""Packs: the tracks of one tracker on all sequences of a folder, in one zip.

`manifest.json` describes the tracker; each sequence has the arrays of a track, `NAME/ARRAY.npy`.
"""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le, MaxLen, MinLen
from pydantic import Field

from stixel_cli.benchmark.data import Data
from stixel_cli.border import write_whole, written
from stixel_cli.config.messages import validated
from stixel_cli.errors import UserError
from stixel_cli.files import parse_json, read_arrays, read_json, read_text
from stixel_cli.parameters import parameters
from stixel_cli.results.folder import json_text

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
class Baseline:
    """What `FIXED` rows have of a tracker: they are not of one."""

    name: Annotated[str, MaxLen(80)]
    version: Literal[""]


@parameters
class Row:
    """A row of the table: a manifest, and the scores of each of the sequences, by metric.

    `pack` is the SHA-256 of the pack, and `fresh_of` that of the one that drew the sequences.
    """

    tracker: Tracker | Baseline
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
        """Raise ValueError for columns of other lengths, an IoU, or a baseline that is none."""
        for name, column in self.scores.items():
            if len(column) != len(self.sequences):
                raise ValueError(f"scores.{name}: must have a value for each sequence")
        if not all(v is not None and 0.0 <= v <= 1.0 for v in self.scores.get("iou_mean", [None])):
            raise ValueError("scores.iou_mean: must be from 0 to 1")
        if len({*self.sequences}) < len(self.sequences):
            raise ValueError("sequences: one is given twice")
        if isinstance(self.tracker, Baseline) != (self.tier == "fixed"):
            raise ValueError("tracker: must be a baseline if the tier is fixed, only then")


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
    for name in sorted({*arrays} ^ {*ARRAYS} - {OPTIONAL} | {*arrays} - {*ARRAYS}):
        fault = "is missing" if name in ARRAYS else "is unknown"
        if name != OPTIONAL:
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
