"""The sequences of the benchmark: settings, sets, and their files, rendered, read and verified.

The bytes depend on the sequence alone: numbers are rounded, so that the last bits of another
processor do not count, and arrays are not compressed, as versions of zlib give other bytes. They
are rendered with the cached graph of a sweep, which resumes and uses any workers.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.border.files import GREATEST_ARRAYS, read_arrays, read_bytes, read_json, read_yaml
from stixel_cli.border.origins import TYPED, write_whole, written
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.overrides import read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.execute import execute
from stixel_cli.engine.progress import Progress
from stixel_cli.errors import MissingData, UserError, located
from stixel_cli.evaluation.contour_errors import even_points, in_frames, seen_points
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.results.folder import arrays_content, json_text
from stixel_cli.results.lineage import provenance
from stixel_cli.results.result import RunResult
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.report import data_folder
from stixel_cli.sweeps.design import compose_runs
from stixel_cli.sweeps.graphs import plan_runs
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState

FROZEN = "frozen"
"""The part that is ranked."""
FRESH_SEEDS, FIRST_FRESH_SEED, FRESH_SPAN = 10, 10_000, 10_000_000
"""Far from the seeds to tune on, 1000 to 1999, and from those of version 1.0."""


@dataclass(frozen=True)
class Sequence:
    """One sequence: the key of all files and rows is its `name`."""

    part: str
    sensor: str
    road_user: str
    case: str
    seed: int

    @property
    def name(self) -> str:
        """`SENSOR-ROAD_USER-CASE-SEED`."""
        return f"{self.sensor}-{self.road_user}-{self.case}-{self.seed}"

    @property
    def overrides(self) -> list[str]:
        """Of `stixel run`; the seed of the shape is that of the sequence."""
        case = definitions()["parts"][self.part]["cases"][self.case]
        own = {k: v[self.road_user] if isinstance(v, dict) else v for k, v in case.items()}
        settings = {"road_user": self.road_user, "seed": self.seed}
        settings |= {"road_user.shape_seed": self.seed, **definitions()["sensors"][self.sensor]}
        given = {key: v for key, v in (settings | own).items() if v is not None}
        return [override_text(key, self._filled(value)) for key, value in given.items()]

    def _filled(self, value: Any) -> Any:
        """A text of the definitions with its places filled in; * is the seed's place in it."""
        if not isinstance(value, str) or "{" not in value:
            return value
        if value == "{seed}":
            return self.seed
        data = data_folder("the user's recordings") if "{data}" in value else ""
        text = value.format(bench=bench_folder(), data=data, **vars(self))
        before, star, after = text.partition("*")
        if not star:
            return text
        found = sorted(Path(before).parent.glob(f"{Path(before).name}*{after}"))
        if len(found) <= self.seed:
            raise MissingData(f"{self.name}: {text}: has {len(found)} files")
        return str(found[self.seed])


def bench_folder() -> Path:
    """`pipelines/bench`: the definitions, the schema of packs, the rows."""
    return shipped_folder("pipelines") / "bench"


@cache
def definitions() -> dict[str, Any]:
    """The content of `sequences.yaml` there."""
    return read_yaml(bench_folder() / "sequences.yaml")


def sequences(part: str, seeds: Iterable[int] = ()) -> list[Sequence]:
    """The sequences of a part; with `seeds`, these of all its sensors and cases."""
    if part not in (parts := definitions()["parts"]):
        raise UserError(f"{part[:80]!r}: is not a part: must be one of {', '.join(parts)}")
    content, seeds = parts[part], list(seeds)
    return [
        Sequence(part, sensor, road_user, case, seed)
        for road_user in content.get("road_users", definitions()["road_users"])
        for case in content["cases"]
        for sensor, own in content["seeds"].items()
        for seed in seeds or (own[road_user] if isinstance(own, dict) else own)
    ]


def whole_set(mini: bool = False) -> list[Sequence]:
    """Version 1.0: its parts; or the mini set, the part of it to develop on."""
    if mini:
        return sequences(FROZEN, definitions()["mini_seeds"])
    return [one for part in definitions()["whole"] for one in sequences(part)]


def fresh_set(pack: str) -> list[Sequence]:
    """Sequences on ten seeds that the SHA-256 of a pack draws, in hexadecimal: one case a seed."""
    cases, found = list(definitions()["parts"][FROZEN]["cases"]), []
    for i in range(FRESH_SEEDS):
        number = int(hashlib.sha256(f"{pack} {i}".encode()).hexdigest()[:16], 16)
        drawn = sequences(FROZEN, [FIRST_FRESH_SEED + number % FRESH_SPAN])
        found += [one for one in drawn if one.case == cases[i % len(cases)]]
    return found


def named(name: str) -> Sequence:
    """The sequence of a name, of any seed; UserError if its sensor, class or case is unknown."""
    seed = name.rpartition("-")[2]
    if seed.isdecimal() and len(seed) < 10:
        every = (one for part in definitions()["parts"] for one in sequences(part, [int(seed)]))
        for one in (one for one in every if one.name == name):
            return one
    raise UserError(f"{name[:80]!r}: not the name of a sequence, such as stixels-car-turn-0")


def planned(chosen: Iterable[Sequence], further: Mapping[str, Any]) -> list[RunResult]:
    """The experiments of sequences, composed, in their order; `further` settings, as typed."""
    more = read_overrides((override_text(key, value) for key, value in further.items()), TYPED)
    each = [[*read_overrides(one.overrides, TYPED), *more] for one in chosen]
    return compose_runs(each, ["seed"], Composer())


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
                **({} if scans.heights is None else {"heights": scans.heights.astype(np.float32)}),
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
            raise UserError(
                f"--data: {manifest}: is missing: name the folder of the sequences, or write those "
                "of the mini set with stixel bench render --mini"
            )
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
        with located(f"{folder}: not a sequence", UserError, (KeyError, TypeError, ValueError)):
            times, sensor = scans["times"], scans["sensor_poses"]
            xx, xy, yy = scans["variances"].astype(np.float64).T
            covariances = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
            offsets, points = scans["offsets"].astype(np.int64), scans["points"].astype(np.float64)
            borders = scans["field_of_view"].tolist()
            view = FieldOfView(*borders) if borders else None
            heights = scans["heights"].astype(np.float64) if "heights" in scans else None
            contours, limbs = truth["contours"].astype(np.float64), truth["limb_poses"]
            motion = times, sensor, truth["poses"], truth["rates"]
            return SequenceData(
                Scans(times, sensor, offsets, points, covariances, view, heights=heights),
                InitialState(**{key: np.array(values) for key, values in start.items()}),
                PriorShape(**prior),
                Scenario(*motion, contours, limbs, scored=truth.get("scored")),
            )


NODES = ("scenario", "scans", "start")
BATCH = 6
"""Sequences that are computed together: the images of more would fill the cache."""


def render(
    chosen: list[Sequence], folder: Path, workers: int | None, note: Callable[[str], None]
) -> None:
    """Write sequences into a folder, and last their manifest; `note` gets a line for each batch.

    What the cache has is not computed again. The manifest's own SHA-256 is the id, so it has
    nothing that differs between two renderings.
    """
    runs = planned(chosen, {} if workers is None else {"executor.workers": workers})
    digests: dict[str, str] = {}
    with written(folder):
        (folder / MANIFEST).unlink(missing_ok=True)
        for first in range(0, len(chosen), BATCH):
            batch = slice(first, first + BATCH)
            plan = plan_runs(runs[batch], nodes=NODES)
            own, store = plan.runs, plan.store
            targets = [key for run in own for key in run.graph.expand(NODES)]
            with Lease(store.folder, targets):
                execute(plan.graph, targets, store, plan.executor, Progress(visible=True))
                for sequence, run in zip(chosen[batch], own, strict=True):
                    truth, scans, start = map(store.load, run.graph.expand(NODES))
                    prior = run.composition.configuration.prior
                    for name, content in SequenceData(scans, start, prior, truth).files().items():
                        write_whole(folder / sequence.name / name, content)
                        digests[f"{sequence.name}/{name}"] = sha256(content)
            note(f"{first + len(own)} of {len(chosen)} sequences")
        content = {"benchmark": definitions()["version"], "files": dict(sorted(digests.items()))}
        write_whole(folder / RENDERED, json_text(provenance()))
        write_whole(folder / MANIFEST, json.dumps(content, indent=1) + "\n")
