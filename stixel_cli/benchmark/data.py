"""The files of a sequence and the manifest of a folder of sequences: write, read and verify.

A sequence has four files: `scans.npz`, `start.json`, `prior.json` and `truth.npz`. Their bytes
depend on nothing but the sequence: numbers are rounded, so that the last bits of another processor
or library do not count, and arrays are not compressed, as versions of zlib give other bytes.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.benchmark.sequences import bench_folder, definitions
from stixel_cli.errors import UserError
from stixel_cli.evaluation.contour_errors import even_points, in_frames, seen_points
from stixel_cli.files import read_arrays, read_bytes, read_json, write_whole, written
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState
from stixel_cli.version import __version__

MANIFEST = "MANIFEST.json"
RENDERED = "RENDERED.json"
"""Commit, package versions and machine of a rendering: not in the manifest, which has the id."""
FILES = ("scans.npz", "start.json", "prior.json", "truth.npz")
DECIMALS = 4
"""Of points and contours, m: 0.1 mm; of poses, times, starts and priors two more."""


@dataclass(frozen=True)
class Given:
    """What a tracker gets of a sequence."""

    scans: Scans
    initial: InitialState
    prior: PriorShape


def sequence_files(
    scans: Scans, initial: InitialState, prior: PriorShape, scenario: Scenario
) -> dict[str, bytes]:
    """The content of the four files, by name."""
    if not isinstance(scans.field_of_view, FieldOfView):
        raise UserError("bench: a sequence needs the sensor's field of view")
    view = asdict(scans.field_of_view)
    variances = scans.covariances_world[:, [0, 0, 1], [0, 1, 1]].astype(np.float32)
    contours = scenario.contours_target
    sensors = in_frames(scans.sensor_poses_world[:, None, :2], scenario.target_poses_world)[:, 0]
    seen = seen_points(even_points(contours), contours, scenario.limb_poses, sensors)
    return {
        "scans.npz": npz(
            times=_rounded(scans.times),
            sensor_poses=_rounded(scans.sensor_poses_world),
            offsets=scans.offsets.astype(np.int32),
            points=np.round(scans.points_world, DECIMALS).astype(np.float32),
            variances=variances,
            field_of_view=_rounded(np.array([view["right"], view["left"], view["baseline"]])),
        ),
        "start.json": _json({"mean": initial.mean, "covariance": initial.covariance}),
        "prior.json": _json(vars(prior)),
        "truth.npz": npz(
            poses=_rounded(scenario.target_poses_world),
            rates=_rounded(scenario.target_rates_world),
            contours=np.round(contours, DECIMALS).astype(np.float32),
            limb_poses=scenario.limb_poses.astype(np.int32),
            box=np.round(scenario.box_target, DECIMALS),
            seen=np.packbits(seen, axis=1),
        ),
    }


def _rounded(values: np.ndarray) -> np.ndarray:
    # The sum turns -0.0, which has other bytes, into 0.0.
    return np.round(np.asarray(values, np.float64), DECIMALS + 2) + 0.0


def _json(values: Mapping[str, Any]) -> bytes:
    plain = {k: _rounded(v).tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
    return (json.dumps(plain, indent=1) + "\n").encode()


def npz(**arrays: np.ndarray) -> bytes:
    """An uncompressed NPZ file; equal arrays give equal bytes."""
    buffer = io.BytesIO()
    np.savez(buffer, **{name: np.ascontiguousarray(values) for name, values in arrays.items()})
    return buffer.getvalue()


def sha256(content: bytes) -> str:
    """In hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def write_sequence(folder: Path, content: Mapping[str, bytes]) -> dict[str, str]:
    """Write the files of a sequence; return their SHA-256 by name."""
    with written(folder):
        for name, data in content.items():
            write_whole(folder / name, data)
    return {name: sha256(data) for name, data in content.items()}


def manifest_text(files: Mapping[str, str]) -> str:
    """The manifest of sequences, whose `files` have a SHA-256 by path.

    Its own SHA-256 is the benchmark's id, so it has nothing that differs between two renderings:
    their commits are in `RENDERED`.
    """
    content = {
        "benchmark": definitions()["version"],
        "generator": f"stixel {__version__}",
        "files": dict(sorted(files.items())),
    }
    return json.dumps(content, indent=1) + "\n"


class Data:
    """A folder of sequences; its files are read with limits, and none is unpickled."""

    def __init__(self, folder: Path):
        """UserError unless the folder has a manifest of this version of the benchmark."""
        self.folder = folder
        content = read_json(folder / MANIFEST)
        files = content.get("files")
        if content.get("benchmark") != definitions()["version"] or not isinstance(files, dict):
            raise UserError(
                f"{folder / MANIFEST}: not of benchmark {definitions()['version']}: run stixel "
                "bench render"
            )
        self.files: dict[str, str] = files
        self.id = sha256(read_bytes(folder / MANIFEST))

    @cached_property
    def names(self) -> list[str]:
        """The names of its sequences."""
        return list(dict.fromkeys(path.partition("/")[0] for path in self.files))

    def faults(self) -> list[str]:
        """One line for each file that is missing or has another SHA-256."""
        found = []
        for path, expected in self.files.items():
            try:
                if sha256(read_bytes(self._path(path))) != expected:
                    found.append(f"{path}: its SHA-256 is not that of {MANIFEST}")
            except UserError as fault:
                found.append(str(fault))
        return found

    def _path(self, path: str) -> Path:
        sequence, _, file = path.partition("/")
        if file not in FILES or not sequence.replace("-", "").replace("_", "").isalnum():
            raise UserError(f"{self.folder / MANIFEST}: {path[:80]!r}: not a file of a sequence")
        return self.folder / sequence / file

    def _content(self, name: str, file: str) -> dict[str, Any]:
        path = self._path(f"{name}/{file}")
        return read_json(path) if file.endswith(".json") else read_arrays(path)

    def given(self, name: str) -> Given:
        """What a tracker gets of the sequence; UserError if a file is not valid."""
        scans = self._content(name, "scans.npz")
        start = self._content(name, "start.json")
        try:
            xx, xy, yy = scans["variances"].astype(np.float64).T
            return Given(
                Scans(
                    times=scans["times"],
                    sensor_poses_world=scans["sensor_poses"],
                    offsets=scans["offsets"].astype(np.int64),
                    points_world=scans["points"].astype(np.float64),
                    covariances_world=np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2),
                    field_of_view=FieldOfView(*scans["field_of_view"].tolist()),
                ),
                InitialState(np.array(start["mean"]), np.array(start["covariance"])),
                PriorShape(**self._content(name, "prior.json")),
            )
        except (KeyError, TypeError, ValueError) as fault:
            raise UserError(f"{self.folder / name}: not a sequence: {fault}") from None

    def truth(self, name: str) -> Scenario:
        """The truth of the sequence; UserError if the file is not valid."""
        truth, scans = self._content(name, "truth.npz"), self._content(name, "scans.npz")
        try:
            return Scenario(
                times=scans["times"],
                ego_poses_world=scans["sensor_poses"],
                target_poses_world=truth["poses"],
                target_rates_world=truth["rates"],
                contours_target=truth["contours"].astype(np.float64),
                limb_poses=truth["limb_poses"].astype(np.int64),
            )
        except (KeyError, TypeError, ValueError) as fault:
            raise UserError(f"{self.folder / name}: not a sequence: {fault}") from None


def published() -> dict[str, str]:
    """SHA-256 by path of the published mini set's files, `pipelines/bench/MANIFEST-mini.json`."""
    file = bench_folder() / "MANIFEST-mini.json"
    return read_json(file)["files"] if file.exists() else {}
