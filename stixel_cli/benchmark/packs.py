"""Packs: the tracks of one tracker on all sequences of a folder, in one zip.

`manifest.json` describes the tracker; each sequence has the arrays of `ARRAYS`, as
`NAME/ARRAY.npy`. A pack has no scores: they are computed from the tracks.
"""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, MaxLen

from stixel_cli.benchmark.data import Data, sha256
from stixel_cli.errors import UserError
from stixel_cli.files import read_arrays, read_bytes, read_json, read_text, write_whole, written
from stixel_cli.parameters import parameters

TRACKER = "tracker.json"
"""In a folder of tracks: the part of the manifest that its author writes, see `Tracker`."""
PACK_MANIFEST = "manifest.json"
ARRAYS = ("means", "covariances", "contours", "contour_std", "seconds")
OPTIONAL = "contour_std"
MOST_CORNERS = 1000
POSE = ("x", "y", "heading")
COVARIANCE = ("var_xx", "var_xy", "var_xh", "var_yy", "var_yh", "var_hh")

Text = Annotated[str, MaxLen(500)]


@parameters
class Machine:
    """Where the tracks were computed.

    Attributes:
        name: of the processor, and the operating system.
        processors: number.
        reference_ms: time of `gp_ekf` there, milliseconds a scan.
    """

    name: Text
    processors: Annotated[int, Ge(1)]
    reference_ms: Annotated[float, Ge(0)]


@parameters
class Tracker:
    """What the author of a tracker states.

    Attributes:
        name, version: of the tracker; together they name its row.
        settings: of the tracker, in any form.
        code: address of the code; "" if it is not public.
        licence: of the code.
        learnt_from: the data that anything of it was learnt or tuned on.
        causal: whether the estimate of scan k uses no later scan.
        per_class: whether its settings, beyond the prior, differ between classes.
        start: `given`, that of `start.json`, or its `own`, from scans 0 to 9.
    """

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
    """`manifest.json` of a pack; `benchmark` is the id of the sequences."""

    tracker: Tracker
    benchmark: str
    machine: Machine


def schema() -> dict[str, Any]:
    """The JSON Schema of `manifest.json`: `pipelines/bench/pack.schema.json`."""
    from pydantic import TypeAdapter

    return TypeAdapter(Manifest).json_schema()


def validated(kind: Any, content: Mapping[str, Any], file: Path) -> Any:
    """The content of `file` as a `Manifest` or `Tracker`; UserError in one line if it is not."""
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(kind).validate_json(json.dumps(content))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "content"
        raise UserError(f"{file}: {where}: {first['msg']} (pack.schema.json)") from None


def pack(folder: Path, data: Data, machine: Machine, output: Path) -> dict[str, int]:
    """Write the pack of a folder of tracks; return the sequences with missing scans.

    The folder has `tracker.json` and, for each sequence, `NAME.npz` or `NAME.csv`.

    Raises:
        UserError: in one line, if a sequence is missing or a file is not valid.
    """
    tracker = validated(Tracker, read_json(folder / TRACKER), folder / TRACKER)
    members, missing = {}, {}
    for name in data.names:
        file = folder / f"{name}.npz"
        table = file.with_suffix(".csv")
        if not file.exists() and not table.exists():
            raise UserError(f"{folder}: the sequence {name} is missing ({file.name} or .csv)")
        arrays = read_arrays(file) if file.exists() else read_csv(table)
        arrays, missing[name] = checked(arrays, len(data.given(name).scans), file)
        members |= {f"{name}/{key}.npy": values for key, values in arrays.items()}
    manifest = Manifest(tracker, data.id, machine)
    content = json.dumps(as_plain(manifest), indent=1, sort_keys=True)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        # A ZipInfo has a constant time: equal tracks give equal packs.
        archive.writestr(zipfile.ZipInfo(PACK_MANIFEST), content)
        for key, values in members.items():
            with archive.open(key, "w") as stream:
                np.lib.format.write_array(stream, values, allow_pickle=False)
    with written(output.parent):
        write_whole(output, buffer.getvalue())
    return {name: count for name, count in missing.items() if count}


def as_plain(manifest: Manifest) -> dict[str, Any]:
    """A manifest in plain types."""
    return vars(manifest) | {key: vars(getattr(manifest, key)) for key in ("tracker", "machine")}


def read_pack(file: Path, data: Data) -> tuple[Manifest, str, dict[str, dict[str, np.ndarray]]]:
    """The manifest, the SHA-256 and the arrays of each sequence of a pack of unknown origin.

    Raises:
        UserError: in one line, if it is damaged, incomplete, off the schema, or of other data.
    """
    arrays = read_arrays(file, texts := {PACK_MANIFEST: ""})
    try:
        content = json.loads(texts[PACK_MANIFEST])
    except ValueError:
        raise UserError(f"{file}: {PACK_MANIFEST} is missing or not valid JSON") from None
    manifest = validated(Manifest, content, file)
    if manifest.benchmark != data.id:
        raise UserError(
            f"{file}: its tracks are of the data {manifest.benchmark[:12]}, but {data.folder} is "
            f"{data.id[:12]}"
        )
    tracks: dict[str, dict[str, np.ndarray]] = {}
    for key, values in arrays.items():
        name, _, array = key.rpartition("/")
        tracks.setdefault(name, {})[array] = values
    for name in {*data.names} ^ {*tracks}:
        state = "is missing" if name in data.names else "is not one of the data"
        raise UserError(f"{file}: the sequence {name[:80]} {state}")
    for name in tracks:
        count = len(data.given(name).scans)
        tracks[name], _ = checked(tracks[name], count, Path(f"{file}: {name}"))
    return manifest, sha256(read_bytes(file, 2**30)), tracks


def checked(
    arrays: Mapping[str, np.ndarray], count: int, file: Path
) -> tuple[dict[str, np.ndarray], int]:
    """The arrays of a track of `count` scans, in the types of a pack; the number of missing scans.

    A scan with any number that is not finite is missing: all of its numbers become NaN.

    Raises:
        UserError: in one line that names `file` and the array.
    """
    for name in arrays:
        if name not in ARRAYS:
            raise UserError(f"{file}: {name[:40]}: a track has only {', '.join(ARRAYS)}")
    for name in ARRAYS:
        if name not in arrays and name != OPTIONAL:
            raise UserError(f"{file}: {name} is missing: a track has {', '.join(ARRAYS)}")
    corners = arrays["contours"].shape[1] if arrays["contours"].ndim == 3 else 0
    if not 3 <= corners <= MOST_CORNERS:
        raise UserError(f"{file}: contours must have 3 to {MOST_CORNERS} corners (K, M, 2)")
    shapes = {
        "means": (count, 3),
        "covariances": (count, 3, 3),
        "contours": (count, corners, 2),
        "contour_std": (count, corners),
        "seconds": (),
    }
    found = {}
    for name, values in arrays.items():
        values = values.reshape(()) if name == "seconds" and values.size == 1 else values
        if values.shape != shapes[name]:
            raise UserError(f"{file}: {name} must have shape {shapes[name]}, got {values.shape}")
        short = name in ("contours", "contour_std")
        found[name] = np.array(values, np.float32 if short else np.float64, order="C")
    if not (np.isfinite(found["seconds"]) and found["seconds"] >= 0.0):
        raise UserError(f"{file}: seconds must be a number ≥ 0, those of the whole sequence")
    scans = [found[name] for name in found if name != "seconds"]
    missing = ~np.all([np.isfinite(v).reshape(count, -1).all(axis=1) for v in scans], axis=0)
    for values in scans:
        values[missing] = np.nan
    own = found["covariances"][~missing]
    valid = np.allclose(own, own.transpose(0, 2, 1)) and (np.linalg.eigvalsh(own) > 0.0).all()
    if not valid:
        raise UserError(f"{file}: covariances must be symmetric and positive definite")
    return found, int(missing.sum())


def read_csv(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a track in a table, one row a scan.

    Columns: x, y, heading; var_xx, var_xy, var_xh, var_yy, var_yh, var_hh; the contour's px0, py0,
    px1, py1, …; optionally its std0, std1, …; seconds, of the scan. An empty cell is not a number.
    """
    import pandas

    try:
        table = pandas.read_csv(io.StringIO(read_text(file)), dtype=np.float64)
        corners = sum(name.startswith("px") for name in table)
        points = [f"p{axis}{i}" for i in range(corners) for axis in "xy"]
        band = [f"std{i}" for i in range(corners)]
        unique = table[list(COVARIANCE)].to_numpy()
        arrays = {
            "means": table[list(POSE)].to_numpy(),
            "covariances": unique[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3),
            "contours": table[points].to_numpy().reshape(-1, corners, 2),
            "seconds": np.array(table["seconds"].sum()),
        }
        return arrays | ({OPTIONAL: table[band].to_numpy()} if "std0" in table else {})
    except (KeyError, ValueError) as fault:
        reason = " ".join(str(fault).split())[:200]
        raise UserError(f"{file}: not a table of a track: {reason}") from None
