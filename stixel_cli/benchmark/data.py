"""The files of a sequence and the manifest of a folder of sequences: make, read and verify.

The bytes depend on the sequence alone: numbers are rounded, so that the last bits of another
processor do not count, and arrays are not compressed, as versions of zlib give other bytes.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.benchmark.sequences import definitions
from stixel_cli.errors import UserError
from stixel_cli.evaluation.contour_errors import even_points, in_frames, seen_points
from stixel_cli.files import GREATEST_ARRAYS, read_arrays, read_bytes, read_json
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.results.folder import arrays_content
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState

MANIFEST = "MANIFEST.json"
RENDERED = "RENDERED.json"
"""Commit, package versions and machine of a rendering: not in the manifest, which has the id."""
FILES = ("scans.npz", "start.json", "prior.json", "truth.npz")
DECIMALS = 4
"""Of points and contours, m: 0.1 mm; of poses, times and starts two more."""


@dataclass(frozen=True)
class SequenceData:
    """What the files of a sequence have; a tracker gets all except the truth."""

    scans: Scans
    initial: InitialState
    prior: PriorShape
    truth: Scenario

    def files(self) -> dict[str, bytes]:
        """The content of the four files, by name."""
        scans, truth, view = self.scans, self.truth, self.scans.field_of_view
        contours = truth.contours_target
        sensors = in_frames(scans.sensor_poses_world[:, None, :2], truth.target_poses_world)[:, 0]
        seen = seen_points(even_points(contours), contours, truth.limb_poses, sensors)
        return {
            "scans.npz": npz(
                times=_rounded(scans.times),
                sensor_poses=_rounded(scans.sensor_poses_world),
                offsets=scans.offsets.astype(np.int32),
                points=np.round(scans.points_world, DECIMALS).astype(np.float32),
                variances=scans.covariances_world[:, [0, 0, 1], [0, 1, 1]].astype(np.float32),
                field_of_view=_rounded([view.right, view.left, view.baseline] if view else []),
            ),
            "start.json": _json(**{k: _rounded(v).tolist() for k, v in vars(self.initial).items()}),
            "prior.json": _json(**vars(self.prior)),
            "truth.npz": npz(
                poses=_rounded(truth.target_poses_world),
                rates=_rounded(truth.target_rates_world),
                contours=np.round(contours, DECIMALS).astype(np.float32),
                limb_poses=truth.limb_poses.astype(np.int32),
                box=np.round(truth.box_target, DECIMALS),
                seen=np.packbits(seen, axis=1),
                **({} if truth.scored is None else {"scored": truth.scored}),
            ),
        }


def _rounded(values: Any) -> np.ndarray:
    # The sum turns -0.0, which has other bytes, into 0.0.
    return np.round(np.asarray(values, np.float64), DECIMALS + 2) + 0.0


def _json(**values: Any) -> bytes:
    return (json.dumps(values, indent=1) + "\n").encode()


def npz(**arrays: np.ndarray) -> bytes:
    """An uncompressed NPZ file; equal arrays give equal bytes."""
    return arrays_content({n: np.asarray(values, order="C") for n, values in arrays.items()})


def sha256(content: bytes) -> str:
    """In hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def sha256_of(file: Path) -> str:
    """The same of a file's content."""
    return sha256(read_bytes(file, GREATEST_ARRAYS))


class Data:
    """A folder of sequences: `files` (SHA-256 by path), the `names` of the sequences, the `id`."""

    def __init__(self, folder: Path):
        """UserError unless the folder has a manifest of this version of the benchmark."""
        self.folder, manifest = folder, folder / MANIFEST
        if not manifest.exists():
            raise UserError(f"{manifest}: is missing: write all sequences with stixel bench render")
        content, version = read_json(manifest), definitions()["version"]
        if content.get("benchmark") != version or not isinstance(content.get("files"), dict):
            raise UserError(f"{manifest}: not of benchmark {version}: run stixel bench render")
        self.files: dict[str, str] = content["files"]
        for path in self.files:
            name, _, file = path.partition("/")
            if file not in FILES or not name.replace("-", "").replace("_", "").isalnum():
                raise UserError(f"{manifest}: {path[:80]!r}: not a file of a sequence")
        self.names = list(dict.fromkeys(path.partition("/")[0] for path in self.files))
        self.id = sha256_of(manifest)

    def faults(self) -> list[str]:
        """One line for each file that is missing or has another SHA-256."""
        return [
            f"{path}: is missing or damaged: its SHA-256 is not that of {MANIFEST}"
            for path, expected in self.files.items()
            if not (self.folder / path).exists() or sha256_of(self.folder / path) != expected
        ]

    def read(self, name: str) -> SequenceData:
        """A sequence; UserError if a file is not valid."""
        folder = self.folder / name
        scans, truth = (read_arrays(folder / f"{file}.npz") for file in ("scans", "truth"))
        start, prior = (read_json(folder / f"{file}.json") for file in ("start", "prior"))
        try:
            times, sensor = scans["times"], scans["sensor_poses"]
            xx, xy, yy = scans["variances"].astype(np.float64).T
            covariances = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
            offsets, points = scans["offsets"].astype(np.int64), scans["points"].astype(np.float64)
            borders = scans["field_of_view"].tolist()
            view = FieldOfView(*borders) if borders else None
            contours, limbs = truth["contours"].astype(np.float64), truth["limb_poses"]
            motion = times, sensor, truth["poses"], truth["rates"]
            return SequenceData(
                Scans(times, sensor, offsets, points, covariances, view),
                InitialState(**{key: np.array(values) for key, values in start.items()}),
                PriorShape(**prior),
                Scenario(*motion, contours, limbs, scored=truth.get("scored")),
            )
        except (KeyError, TypeError, ValueError) as fault:
            raise UserError(f"{folder}: not a sequence: {fault}") from None
