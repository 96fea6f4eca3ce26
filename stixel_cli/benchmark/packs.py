"""Packs: the tracks of one tracker on all sequences of a folder, in one zip.

`manifest.json` describes the tracker; each sequence has the arrays of a track, as `NAME/ARRAY.npy`.
A pack has no scores: they are computed from the tracks.
"""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import MaxLen

from stixel_cli.benchmark.data import Data, sha256_of
from stixel_cli.errors import UserError
from stixel_cli.files import read_arrays, read_json, read_text, write_whole, written
from stixel_cli.parameters import parameters

TRACKER, MANIFEST = "tracker.json", "manifest.json"
"""Files: of a folder of tracks, what their author states; of a pack."""
OPTIONAL = "contour_std"
ARRAYS = ("means", "covariances", "contours", OPTIONAL, "seconds")
MOST_CORNERS = 1000
COVARIANCE = ("var_xx", "var_xy", "var_xh", "var_yy", "var_yh", "var_hh")

Text = Annotated[str, MaxLen(500)]


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
    reference_ms: float


def validated(content: Mapping[str, Any], file: Path) -> dict[str, Any]:
    """The content of a pack's manifest; UserError in one line if it is off the schema."""
    from pydantic import TypeAdapter, ValidationError

    try:
        TypeAdapter(Manifest).validate_json(json.dumps(content))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "content"
        raise UserError(f"{file}: {where}: {first['msg']} (pack.schema.json)") from None
    return dict(content)


def pack(folder: Path, data: Data, machine: Mapping[str, Any], output: Path) -> dict[str, int]:
    """Write the pack of a folder of tracks; return the number of missing scans by sequence.

    The folder has `tracker.json` and, for each sequence, `NAME.npz` or `NAME.csv`; `machine` has
    the last two entries of the manifest. UserError for the first file that is missing or wrong.
    """
    tracker = read_json(folder / TRACKER)
    manifest = validated({"tracker": tracker, "benchmark": data.id, **machine}, folder / TRACKER)
    members, missing = {}, {}
    for name in data.names:
        file, table = folder / f"{name}.npz", folder / f"{name}.csv"
        if not file.exists() and not table.exists():
            raise UserError(f"{folder}: the sequence {name} is missing ({file.name} or .csv)")
        arrays = read_arrays(file) if file.exists() else read_csv(table)
        arrays = checked(arrays, len(data.read(name).scans), file)
        missing[name] = int(np.isnan(arrays["means"][:, 0]).sum())
        members |= {f"{name}/{key}.npy": values for key, values in arrays.items()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        # A ZipInfo has a constant time: equal tracks give equal packs.
        archive.writestr(zipfile.ZipInfo(MANIFEST), json.dumps(manifest, indent=1, sort_keys=True))
        for key, values in members.items():
            with archive.open(key, "w") as stream:
                np.lib.format.write_array(stream, values, allow_pickle=False)
    with written(output.parent):
        write_whole(output, buffer.getvalue())
    return missing


def read_pack(
    file: Path, data: Data
) -> tuple[dict[str, Any], str, dict[str, dict[str, np.ndarray]]]:
    """The manifest, the SHA-256 and the arrays of each sequence of a pack of unknown origin.

    UserError if it is damaged, incomplete, off the schema, or of other data.
    """
    arrays = read_arrays(file, texts := {MANIFEST: ""})
    try:
        manifest = validated(json.loads(texts[MANIFEST]), file)
    except ValueError:
        raise UserError(f"{file}: {MANIFEST} is missing or not valid JSON") from None
    if (other := manifest["benchmark"][:12]) != data.id[:12]:
        raise UserError(f"{file}: its tracks are of the data {other}, not of {data.id[:12]}")
    tracks: dict[str, dict[str, np.ndarray]] = {}
    for key, values in arrays.items():
        name, _, array = key.rpartition("/")
        tracks.setdefault(name, {})[array] = values
    for name in sorted({*data.names} ^ {*tracks}):
        state = "is missing" if name in data.names else "is not one of the data"
        raise UserError(f"{file}: the sequence {name[:80]} {state}")
    for name, track in tracks.items():
        tracks[name] = checked(track, len(data.read(name).scans), Path(f"{file}: {name}"))
    return manifest, sha256_of(file), tracks


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
    shapes = ((count, 3), (count, 3, 3), (count, corners, 2), (count, corners), ())
    found = {}
    for name, shape in zip(ARRAYS, shapes, strict=True):
        values = arrays.get(name)
        if values is not None:
            if values.shape != shape and not (shape == () and values.size == 1):
                raise UserError(f"{file}: {name} must have shape {shape}, got {values.shape}")
            kind = np.float32 if name in ("contours", OPTIONAL) else np.float64
            found[name] = np.array(values, kind, order="C").reshape(shape)
    if not (np.isfinite(found["seconds"]) and found["seconds"] >= 0.0):
        raise UserError(f"{file}: seconds must be a number ≥ 0, those of the whole sequence")
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
        corners = sum(name.startswith("px") for name in table)
        points = [f"p{axis}{i}" for i in range(corners) for axis in "xy"]
        unique = table[list(COVARIANCE)].to_numpy()
        arrays = {
            "means": table[["x", "y", "heading"]].to_numpy(),
            "covariances": unique[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3),
            "contours": table[points].to_numpy().reshape(-1, corners, 2),
            "seconds": np.array(table["seconds"].sum()),
        }
        if "std0" in table:
            arrays[OPTIONAL] = table[[f"std{i}" for i in range(corners)]].to_numpy()
        return arrays
    except (KeyError, ValueError) as fault:
        reason = " ".join(str(fault).split())[:200]
        raise UserError(f"{file}: not a table of a track: {reason}") from None
